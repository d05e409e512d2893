"""Reduction of a scene to a budget (docs/reference/budget.md).

    clean, broken = sound(scene, cameras)
    reducer = Reducer(clean, fitted, held, Options(Goal(Kind.KEEP, 0.4)))
    reducer.run()
    small = reducer.scene()

Near-equal neighbours may become one. Rounds of scores, removal and tuning come nearer to the goal; then SH coefficients that say little go, colours are
refitted by least squares and everything is tuned until the held-out views gain no more. A reducer's state is its arrays, a random generator and a few numbers:
`save` writes them, `restore` continues to the same bits.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FlickerError, one_line
from ..fit.adam import Adam
from ..fit.engines import engine
from ..fit.least import LeastSize
from ..fit.parameters import SH, Parameters
from ..fit.render import Draw, render
from ..fit.start import extent_of
from ..fit.through import through
from ..progress import Steps, undivided
from ..scene.camera import Camera, cameras_text
from ..scene.clusters import reorder
from ..scene.gaussians import Scene
from ..scene.packed import PackedFormat
from .degrees import cut, cuts, losses
from .goal import FrameCost, Goal, Kind, chip_cost, price
from .merge import merge
from .refit import ITERATIONS, refit
from .score import Score, scores
from .tune import Rates, quality, tune_step

MEASURE_EVERY = 100  # steps of the last tuning
PATIENCE = 4  # measurements without gain in its second half that end it
LEAST_GAIN = 0.01  # dB
SAVE_EVERY = 100
CHIP_VIEWS = 2  # held-out views that a frame's cost is the mean of
_SHRINK, _LEAST_SHRINK = 0.85, 0.97  # of the Gaussians, a round towards dB; the search ends where rounds of the second fail
_AIM = 0.995  # of a goal of cycles or bytes: what removal aims at, since tuning moves it a little
_OVER = 0.98  # of what an estimate allows, where the model found more than the goal
_MOST_ROUNDS = 40
_REFIT_SHARES = (0.25, 0.5, 1.0)  # of the step of least squares that are tried
TUNE_BELOW = 48.0  # dB: nearer pictures are not tuned between rounds, nor is there anything to win
_FULL_RATE = 38.0  # dB at which rates are those of `Rates`; nearer pictures need smaller steps, in proportion to their error


class Phase(str, Enum):
    """Steps of a reduction in their order; as rows and checkpoints name them."""

    MERGE = "merge"
    REMOVE = "remove"
    TUNE = "tune"
    DEGREES = "degrees"
    REFIT = "refit"
    LAST = "last"
    DONE = "done"


@dataclass(frozen=True)
class Options:
    """rounds: removals on the way to a known goal. steps: of tuning after each. last: of the tuning at the end, at most. degrees: SH coefficients go as long as
    they are estimated to add at most this share to the squared error. form: of the packed scene whose frames are counted. through: name of the configuration
    through whose contribution test the small scene is drawn; None: as the reference draws it. least: standard deviation in pixels that no Gaussian falls below
    (`fit.least`), before the first removal. refit: steps of conjugate gradients of the least squares of colours; 0: none. merge: what pairs of near-equal
    neighbours may lose as one Gaussian (`merge`), before the first removal; 0: none is merged. engine: of `fit.engines`, what draws the views that are tuned;
    all else is numba's."""

    goal: Goal
    by: Score = Score.CHANGE
    rounds: int = 4
    steps: int = 150
    last: int = 1500
    degrees: float = 0.02
    seed: int = 1
    frame: tuple[int, int] = (1280, 720)
    form: PackedFormat = PackedFormat.CHUNK
    through: str | None = None
    least: float = 0.0
    refit: int = ITERATIONS
    merge: float = 0.0
    engine: str = "numba"


@dataclass(frozen=True)
class Row:
    """What a step gave. decibels: mean PSNR on the held-out views after it. coefficients: of SH a channel, mean. cost: of a frame, where the goal is one."""

    step: str
    gaussians: int
    coefficients: float
    decibels: float
    cost: FrameCost | None = None


def sound(scene: Scene, cameras: Sequence[Camera], steps: Steps | None = None) -> tuple[Scene, list[np.ndarray], int]:
    """The scene without Gaussians that have a number that is not finite, in itself or in a view; its pictures, float32 (H, W, 3) over black, of all cameras;
    how many were left out. FlickerError where nothing is left."""
    parameters = Parameters.of(scene)
    good = parameters.finite()
    while True:
        kept = np.flatnonzero(good)
        if not len(kept):
            raise FlickerError(f"{scene.path or 'scene'}: no Gaussian whose numbers are finite in every view")
        here, pictures = parameters.like(parameters.values[kept]), []
        with (steps or Steps()).bar("pictures of the full scene") as report:
            for k, camera in enumerate(cameras):
                report(k, len(cameras))
                frame = render(here, camera)
                good[kept[frame.index[frame.bad]]] = False
                pictures.append(frame.image.astype(np.float32))
        if good[kept].all():
            break
    taken = reorder(scene, kept)
    return taken, pictures, len(scene) - len(kept)


class Reducer:
    """State of a reduction.

    parameters: of the Gaussians that are left; coefficients: int64 (N,), how many SH coefficients a channel each has. removed: Gaussians taken out because a
    number of theirs, or of their derivatives, was not finite. rows: what each step gave.
    """

    def __init__(self, scene: Scene, fitted: Sequence[Camera], held: Sequence[Camera], pictures: Sequence[np.ndarray], options: Options) -> None:
        """scene, pictures: of `sound`, pictures of the fitted cameras, then of the held-out ones."""
        self.options, self.fitted, self.held = options, list(fitted), list(held)
        self.wanted, self.wanted_held = list(pictures[: len(fitted)]), list(pictures[len(fitted) :])
        self.parameters = Parameters.of(scene)
        self.full = len(self.parameters)
        self.coefficients = np.full(self.full, self.parameters.sh.shape[1], np.int64)
        self.moments = Adam.of(self.parameters.values)
        self.extent = extent_of(self.fitted)
        self.machine = None if options.through is None else through(options.through)
        self._draw: Draw = partial(render, through=self.machine, precision=np.float32)
        self._tuned: Draw = partial(self._draw, engine=engine(options.engine, self.machine is not None))
        self._least = LeastSize(options.least, self.fitted)
        self.rng = np.random.default_rng(options.seed)
        self.order = np.zeros(0, np.int64)  # fitted cameras that come next
        self.phase, self.step, self.round, self.removed = Phase.MERGE, 0, 0, 0
        self.ratio = _SHRINK
        self.level = 0.0  # dB of the picture that steps are sized for
        self.rows: list[Row] = []
        self.best: tuple[np.ndarray, np.ndarray, float, int] | None = None  # values, coefficients, dB, removed of the best so far, which is returned to
        self.stale = 0
        self.good = self.parameters.values.copy(), self.coefficients.copy(), float("inf")  # the smallest scene that reaches dB, likewise
        content = self.parameters.values.tobytes() + b"antialiased" * self.parameters.antialiased
        self._digest = hashlib.blake2b(content, digest_size=16).hexdigest()
        self._steps, self._told = Steps(), lambda row: None

    # -- what things are now ----------------------------------------------------------------------------------------------------------

    def scene(self) -> Scene:
        """With no more SH coefficients than any Gaussian has."""
        values = self.parameters.values[:, : SH + 3 * int(self.coefficients.max(initial=1))]
        return self.parameters.like(values).scene()

    def frame_cost(self, lanes: bool = False) -> FrameCost:
        """Of frames of some held-out views, at the chip's size."""
        cameras = self.held[:: max(1, len(self.held) // CHIP_VIEWS)][:CHIP_VIEWS]
        return chip_cost(self.scene(), [camera.resized(*self.options.frame) for camera in cameras], self.options.form, self._steps, lanes=lanes)

    def measure(self) -> float:
        """Mean PSNR of the held-out views in dB, pictures of `fit.render`."""
        return quality(self.parameters, self.held, self.wanted_held, self._draw)

    def _told_row(self, step: str, decibels: float, cost: FrameCost | None = None) -> None:
        self.rows.append(Row(step, len(self.parameters), float(self.coefficients.mean()), decibels, cost))
        self._told(self.rows[-1])

    # -- steps ------------------------------------------------------------------------------------------------------------------------

    def _select(self, keep: np.ndarray) -> None:
        if not len(keep):
            raise FlickerError(f"budget: no Gaussian is left after {self.round} rounds")
        self.parameters = self.parameters.like(self.parameters.values[keep])
        self.coefficients = self.coefficients[keep]
        self.moments.select(keep, 0)

    def _keep_best(self, decibels: float) -> None:
        self.best = self.parameters.values.copy(), self.coefficients.copy(), decibels, self.removed

    def _return_to_best(self) -> None:
        assert self.best is not None
        values, coefficients, _, self.removed = self.best
        self.parameters, self.coefficients = self.parameters.like(values.copy()), coefficients.copy()
        self.moments = Adam.of(values)

    def _merge(self) -> None:
        """What the full scene is and costs; sizes are held, near-equal neighbours become one."""
        self._told_row("full scene", float("inf") if self.machine is None else self.measure(), self.frame_cost(lanes=True))
        self._least.hold(self.parameters.values)
        self.good = self.parameters.values.copy(), *self.good[1:]
        self.phase = Phase.REMOVE
        if self.options.merge:
            values = merge(self.parameters.values, self.options.merge, self._steps)
            self.parameters, self.moments = self.parameters.like(values), Adam.of(values)
            self.coefficients = self.coefficients[: len(values)]  # all have as many
            decibels = self.measure()
            if self.options.goal.kind is Kind.DB and decibels >= self.options.goal.value:
                self.good = values.copy(), self.coefficients.copy(), decibels
            self._told_row("merging", decibels, self.frame_cost(lanes=True))

    def _remove(self) -> None:
        """A round: those of the lowest score go, as many as bring the scene nearer to the goal."""
        goal, n = self.options.goal, len(self.parameters)
        self.round += 1
        if goal.kind is Kind.KEEP:
            known = self.round / self.options.rounds
            share = max(1, round(self.full * goal.value**known)) / n
        elif goal.kind is Kind.DB:
            share = self.ratio
        else:
            cost = self.rows[-1].cost
            assert cost is not None
            now, left = cost.of(goal.kind), max(1, self.options.rounds + 1 - self.round)
            fixed = cost.fixed(goal.kind)
            target = now * (_AIM * goal.value / now) ** (1.0 / left)
            if target <= fixed:
                raise FlickerError(f"--{goal.kind.value}: {goal.value:g}: the picture alone takes {fixed:.4g}")
            share = (target - fixed) / (now - fixed) * (_OVER if self.round > self.options.rounds else 1.0)
        if share < 1.0:
            self._cut(share)
        decibels = self.measure()
        self._told_row(f"{self.round}: removal", decibels)
        self._keep_best(decibels)
        self.phase, self.step = Phase.TUNE, 0 if decibels < max(TUNE_BELOW, goal.value if goal.kind is Kind.DB else 0.0) else self.options.steps

    def _cut(self, share: float) -> None:
        """Leave a share of the sum of prices, those of the highest score by price; of a budget of bytes, SH coefficients go at the same price of error."""
        found = scores(self.parameters, self.fitted, self._steps, self._draw)
        scale = self.options.frame[0] * self.options.frame[1] / (self.fitted[0].width * self.fitted[0].height)
        cost = price(found, self.options.goal.kind, scale, self.coefficients)
        score = found.by(self.options.by) / cost
        if self.options.goal.kind is Kind.MBYTES and self.options.by is Score.CHANGE and self.coefficients.max() > 1:
            self._cut_both(share, score, cost, found.frames / found.views)
            return
        order = np.argsort(-score, kind="stable")
        kept = np.searchsorted(np.cumsum(cost[order]), share * cost.sum() * (1 + 1e-12), side="right")
        self._select(np.sort(order[: max(1, kept)]))

    def _cut_both(self, share: float, score: np.ndarray, cost: np.ndarray, seen: np.ndarray) -> None:
        """Gaussians and SH coefficients of clusters under one threshold of error by byte."""
        lost = losses(self.parameters, self.fitted, self._steps, self._draw)
        found = cuts(self.parameters, self.coefficients, lost, seen)
        order = np.argsort(np.concatenate([score, found.error / found.bytes]), kind="stable")
        total = np.cumsum(np.concatenate([cost, found.bytes])[order])
        gone = order[: np.searchsorted(total, (1.0 - share) * cost.sum())]
        keep = np.ones(len(score), np.bool_)
        keep[gone[gone < len(score)]] = False
        cut(self.parameters, self.coefficients, lost, found, gone[gone >= len(score)] - len(score))
        self._select(np.flatnonzero(keep))

    def _tune(self, rates: Rates, done: float) -> None:
        """One view."""
        if not len(self.order):
            self.order = self.rng.permutation(len(self.fitted))
        view, self.order = int(self.order[0]), self.order[1:]
        factor = min(1.0, 10 ** ((_FULL_RATE - self.level) / 20)) if self.level else 1.0
        rate = rates.at(done, self.extent, self.parameters.values.shape[1]) * np.float32(factor)
        decibels, broken = tune_step(self.parameters, self.moments, self.fitted[view], self.wanted[view], rate, self.coefficients, self._least, self._tuned)
        self.level = decibels if not self.level else 0.98 * self.level + 0.02 * decibels
        self.step += 1
        if len(broken):
            self.removed += len(broken)
            self._select(np.setdiff1d(np.arange(len(self.parameters)), broken))

    def _better(self) -> float:
        """Return to what was before the tuning, if that was better; dB of what is kept."""
        assert self.best is not None
        decibels = self.measure()
        if decibels <= self.best[2]:
            self._return_to_best()
        return max(decibels, self.best[2])

    def _end_round(self) -> None:
        """After the tuning of a round: the next one, or the end of removal."""
        goal = self.options.goal
        decibels = self._better()
        cost = self.frame_cost(lanes=True)
        self._told_row(f"{self.round}: tuning", decibels, cost)
        if goal.kind is Kind.DB:
            if decibels >= goal.value:
                self.good = self.parameters.values.copy(), self.coefficients.copy(), decibels
                over = len(self.parameters) * self.ratio < 1
            else:
                self.parameters, self.coefficients = self.parameters.like(self.good[0].copy()), self.good[1].copy()
                self.moments = Adam.of(self.parameters.values)
                over = self.ratio >= _LEAST_SHRINK
                self.ratio = float(np.sqrt(self.ratio))
        elif goal.kind is Kind.KEEP:
            over = self.round >= self.options.rounds
        else:
            over = cost.of(goal.kind) <= _AIM * goal.value
        if self.round >= _MOST_ROUNDS and not over:
            raise FlickerError(f"--{goal.kind.value}: {goal.value:g}: not reached in {_MOST_ROUNDS} rounds")
        self.phase, self.step = Phase.DEGREES if over else Phase.REMOVE, 0

    def _drop_degrees(self) -> None:
        """SH coefficients that say nothing, cluster by cluster."""
        self.phase = Phase.REFIT
        if self.options.degrees <= 0 or self.coefficients.max() == 1:
            return
        error = sum(float(((np.clip(self._draw(self.parameters, c).image, 0, 1) - np.clip(w, 0, 1)) ** 2).sum()) for c, w in zip(self.fitted, self.wanted))
        lost = losses(self.parameters, self.fitted, self._steps, self._draw)
        found, before = cuts(self.parameters, self.coefficients, lost, np.ones(len(self.parameters))), (self.parameters.values.copy(), self.coefficients.copy())
        order = np.argsort(found.error / found.bytes, kind="stable")
        cut(self.parameters, self.coefficients, lost, found, order[: np.searchsorted(np.cumsum(found.error[order]), self.options.degrees * error)])
        decibels = self.measure()
        if self.options.goal.kind is Kind.DB and decibels < self.options.goal.value:
            self.parameters, self.coefficients, decibels = self.parameters.like(before[0]), before[1], self.good[2]
        self._told_row("SH coefficients", decibels)

    def _refit(self) -> None:
        """The held-out views say how far to go towards the least squares of the fitted ones."""
        self._keep_best(self.measure())
        self.phase, self.step, self.stale = Phase.LAST, 0, 0
        if not self.options.refit:
            return
        assert self.best is not None
        before = self.parameters.values
        found = refit(
            self.parameters, self.fitted, self.wanted, self.coefficients, iterations=self.options.refit, steps=self._steps, draw=self._draw,
        )
        for share in _REFIT_SHARES:
            self.parameters = self.parameters.like(before + np.float32(share) * (found.values - before))
            decibels = self.measure()
            if decibels > self.best[2]:
                self._keep_best(decibels)
        self._return_to_best()
        self._told_row("least squares", self.best[2])

    def _last(self) -> None:
        """One step of the last tuning; the held-out views say when to stop, and what is kept."""
        if self.step < self.options.last:
            self._tune(Rates(), self.step / self.options.last)
        over = self.step >= self.options.last
        if over or self.step % MEASURE_EVERY == 0:
            decibels = self.measure()
            assert self.best is not None
            gained = decibels - self.best[2]
            long = self.step < self.options.last / 2  # steps that may lose what shorter ones then win
            self.stale = 0 if gained > LEAST_GAIN or long else self.stale + 1
            if gained > 0:
                self._keep_best(decibels)
            if over or self.stale >= PATIENCE:
                self._return_to_best()
                cost, goal = self.frame_cost(lanes=True), self.options.goal
                self._told_row(f"tuning, {self.step} steps", self.best[2], cost)
                self.phase, self.step = (Phase.REMOVE, 0) if goal.of_chip and cost.of(goal.kind) > goal.value else (Phase.DONE, self.step)

    def advance(self) -> None:
        """One step."""
        if self.phase is Phase.MERGE:
            self._merge()
        elif self.phase is Phase.REMOVE:
            self._remove()
        elif self.phase is Phase.TUNE:
            if self.step < self.options.steps:
                self._tune(Rates(), self.step / self.options.steps)
            if self.step >= self.options.steps:
                self._end_round()
        elif self.phase is Phase.DEGREES:
            self._drop_degrees()
        elif self.phase is Phase.REFIT:
            self._refit()
        elif self.phase is Phase.LAST:
            self._last()

    def run(self, steps: Steps | None = None, told: Callable[[Row], None] | None = None, keep: Callable[[], None] | None = None) -> None:
        """All that is left. told(row): after each step of the table; keep(): every so many steps, and at Ctrl-C between two steps of tuning."""
        self._steps, self._told = steps or Steps(), told or (lambda row: None)
        keep = keep or (lambda: None)
        while self.phase is not Phase.DONE:
            if self.phase in (Phase.TUNE, Phase.LAST):
                self._run_tuning(keep)
            else:
                self.advance()
                keep()
        keep()

    def _run_tuning(self, keep: Callable[[], None]) -> None:
        phase, most = self.phase, self.options.steps if self.phase is Phase.TUNE else self.options.last
        whole = True
        try:
            with self._steps.bar("tuning") as report:
                while self.phase is phase:
                    with undivided():
                        whole = False
                        self.advance()
                        whole = True
                    report(self.step, most)
                    if self.step % SAVE_EVERY == 0:
                        keep()
        except KeyboardInterrupt:
            if whole:
                keep()
            raise

    # -- state ------------------------------------------------------------------------------------------------------------------------

    def _identity(self) -> dict[str, Any]:
        """What a checkpoint must agree on."""
        views = hashlib.blake2b(cameras_text([*self.fitted, *self.held]).encode(), digest_size=16).hexdigest()
        return json.loads(json.dumps(asdict(self.options))) | {"scene": self._digest, "views": views}

    def save(self, path: Path) -> None:
        """Write the state. Raises OSError."""
        numbers = {
            "identity": self._identity(), "rng": self.rng.bit_generator.state, "phase": self.phase.value, "step": self.step, "round": self.round,
            "removed": self.removed, "ratio": self.ratio, "level": self.level, "stale": self.stale, "adam": self.moments.steps,
            "rows": [asdict(row) for row in self.rows], "best": None if self.best is None else self.best[2:],
            "good": self.good[2],
        }
        arrays = {"good_values": self.good[0], "good_coefficients": self.good[1]} if self.options.goal.kind is Kind.DB else {}
        if self.best is not None:
            arrays |= {"best_values": self.best[0], "best_coefficients": self.best[1]}
        with path.open("wb") as file:
            np.savez(
                file, numbers=np.array(json.dumps(numbers)), values=self.parameters.values, coefficients=self.coefficients, m=self.moments.first,
                v=self.moments.second, order=self.order, **arrays,  # type: ignore[arg-type]
            )

    def restore(self, path: Path) -> None:
        """Continue from a state that `save` wrote. FlickerError for that of another reduction, or a damaged file."""
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            numbers = json.loads(str(arrays.pop("numbers")))
            for key, ours in self._identity().items():
                theirs = numbers["identity"][key]
                if theirs != ours:
                    raise FlickerError(f"{path}: is of another {key.rstrip('s')}" if key in ("scene", "views") else f"{path}: has {key} {theirs}, not {ours}")
            self.parameters, self.coefficients = self.parameters.like(arrays["values"]), arrays["coefficients"]
            self.moments = Adam(arrays["m"], arrays["v"], numbers["adam"])
            self.order, self.phase = arrays["order"], Phase(numbers["phase"])
            self.step, self.round, self.removed, self.ratio = numbers["step"], numbers["round"], numbers["removed"], numbers["ratio"]
            self.level, self.stale = numbers["level"], numbers["stale"]
            self.rows = [Row(**{**row, "cost": None if row["cost"] is None else FrameCost(**row["cost"])}) for row in numbers["rows"]]
            self.best = None if numbers["best"] is None else (arrays["best_values"], arrays["best_coefficients"], *numbers["best"])
            if "good_values" in arrays:
                self.good = arrays["good_values"], arrays["good_coefficients"], numbers["good"]
            self.rng.bit_generator.state = numbers["rng"]
        except FlickerError:
            raise
        except OSError as error:
            raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)})") from None
        except Exception as error:  # numpy raises anything at all for a damaged file
            raise FlickerError(f"{path}: not a checkpoint ({one_line(error)})") from None
