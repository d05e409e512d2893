"""Optimisation of a scene on photographs (docs/reference/fit.md).

    trainer = Trainer(load_dataset(path, 400), Options(iterations=4000))
    trainer.run()
    scene = trainer.scene()

A trainer's state is its arrays, a random generator and a count: `save` writes them, `restore` continues to the same bits.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FlickerError, one_line
from ..explore.machine import run
from ..front.projection import project
from ..front.reference import render_reference
from ..front.view import View
from ..progress import Steps, undivided
from ..scene.gaussians import Scene
from ..scene.metrics import psnr, ssim
from ..scene.photos import BLACK
from . import density
from .adam import Adam
from .dataset import Dataset
from .engines import engine
from .least import LeastSize
from .loss import log_error_slope, loss_and_slope
from .parameters import LOGIT, QUAT, SCALE, SH, Parameters
from .render import backward, render
from .start import extent_of, start
from .through import through

MEASURE_EVERY = 500  # iterations
SAVE_EVERY = 500
MEASURED = 24  # test photographs that are looked at on the way; in the end all are
# Learning rates of the INRIA code, which makes 30,000 iterations: of means in extents of the scene, first and last.
_MEAN_RATES = (1.6e-4, 1.6e-6)
_SCALE_RATE, _QUAT_RATE, _LOGIT_RATE, _SH_RATE, _SH_REST = 5e-3, 1e-3, 5e-2, 2.5e-3, 1 / 20
# A fit from nothing makes fewer and takes longer steps, but in opacity: of means by the square root of how many fewer, at most _LONGEST; of the others _OTHERS
# times as much longer, of higher harmonics _OTHERS times again.
_ITERATIONS, _LONGEST, _OTHERS = 30_000, 4.0, 2.0
_EXPOSURE_RATES = (1e-2, 1e-3)
_LAST_RATE = 0.1  # of all rates but the means', which fall evenly over the last third
# Of a checkpoint's identity, what cannot be shown: how it is called where it is another one.
_DIGESTS = {"scene": "another scene", "photographs": "other photographs", "pixels": "photographs or masks of other contents", "cameras": "other cameras"}
_DEGREE_EVERY = 1000  # iterations until the next SH degree, or an eighth of all


@dataclass(frozen=True)
class Options:
    """gaussians: at most so many. degree: of the SH. background: RGB in [0, 1]. exposure: each photograph has an affine colour of its own.

    tune: of a scene that is there: none of its Gaussians is split or removed, and the learning rates are those of a fit from its share `begin` on.
    through: name of the configuration whose masks the pictures are drawn with; None: all pixels are visited. least: standard deviation in pixels that no
    Gaussian falls below (`LeastSize`). squared: share of the iterations, the last ones, in which the squared error is minimised (`log_error_slope`), with
    moments that begin anew; None: half of a fit from nothing, none of one that tunes. longer: factor of the steps of means, others follow
    (docs/reference/fit.md); None:
    by the number of iterations, or the INRIA code's own steps where a scene is tuned. engine: of `engines`, what draws the photographs' views; PSNR is numba's.
    """

    iterations: int = 4000
    gaussians: int = 100_000
    degree: int = 2
    seed: int = 1
    background: tuple[float, float, float] = BLACK
    exposure: bool = False
    tune: bool = False
    through: str | None = None
    least: float = 0.0
    begin: float = 2 / 3
    squared: float | None = None
    longer: float | None = None
    engine: str = "numba"

    @property
    def first_squared(self) -> int:
        """The first iteration that minimises the squared error."""
        share = self.squared if self.squared is not None else 0.0 if self.tune else 0.5
        return round((1.0 - share) * self.iterations)


@dataclass(frozen=True)
class Quality:
    """Mean over the test photographs. psnr in dB; compensated: after an affine colour fit of each picture to its photograph. machine: psnr of the picture
    that the configuration `Options.through` draws, bit for bit; NaN without one."""

    psnr: float
    ssim: float
    compensated: float
    machine: float


def _where(counted: np.ndarray | None, image: np.ndarray, photo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of both pictures (H, W, 3) that count, (N, 3); both as they are where all do."""
    return (image, photo) if counted is None else (image[counted], photo[counted])


def _masked(
    measure: Callable[[np.ndarray, np.ndarray], tuple[float, np.ndarray]], image: np.ndarray, photo: np.ndarray, counted: np.ndarray | None,
) -> tuple[float, np.ndarray]:
    """A loss and its slope, of pictures that are black where pixels do not count; the photograph is so already."""
    if counted is None:
        return measure(image, photo)
    loss, slope = measure(image * counted[..., None], photo)
    return loss, slope * counted[..., None]


def affine_fit(image: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """The picture (..., 3) with the affine change of colour that brings it nearest to the photograph, least squares."""
    columns = np.concatenate([image, np.ones((*image.shape[:-1], 1))], axis=-1).reshape(-1, 4).astype(np.float64)
    change = np.linalg.lstsq(columns, photo.reshape(-1, 3).astype(np.float64), rcond=None)[0]
    return (columns @ change).reshape(image.shape)


class Trainer:
    """State of a fit. parameters, moments: of the Gaussians. exposures: float32 (photographs, 12), rows of an affine colour (3, 4).

    iteration: how many are done. removed: Gaussians that were taken out because a number of theirs, or of their derivatives, was not finite.
    """

    def __init__(self, dataset: Dataset, options: Options, parameters: Parameters | None = None) -> None:
        """parameters: to begin with; None: `start` makes them."""
        self.dataset, self.options = dataset, options
        self.machine = None if options.through is None else through(options.through)
        self._engine = engine(options.engine, self.machine is not None)
        self.rng = np.random.default_rng(options.seed)
        self._photos = [shot.load(options.background) for shot in dataset.fitted]
        self._test_photos = [shot.load(options.background) for shot in dataset.tests]
        self._counted, self._test_counted = [shot.counted() for shot in dataset.fitted], [shot.counted() for shot in dataset.tests]
        for photo, counted in zip(self._photos, self._counted):
            if counted is not None:
                photo[~counted] = 0.0
        if all(counted is not None and not counted.any() for counted in self._counted):
            raise FlickerError("masks: no pixel of the photographs to fit to counts: those count that are white in a mask")
        if parameters is None:
            begun = start(dataset, self._photos, options.gaussians, options.degree, self.rng, self._counted)
        else:
            begun = parameters.like(parameters.values.copy())
        self.parameters = begun
        self.first = len(self.parameters)
        self._began = None if parameters is None else hashlib.sha256(parameters.values.tobytes() + b"antialiased" * parameters.antialiased).hexdigest()
        self.moments = Adam.of(self.parameters.values)
        self.exposures = np.tile(np.eye(3, 4, dtype=np.float32).ravel(), (len(dataset.fitted), 1))
        self.exposure_moments = Adam.of(self.exposures)
        self.iteration, self.removed = 0, 0
        self.order = np.zeros(0, np.int64)  # photographs that come next
        self.score, self.seen = np.zeros(self.first), np.zeros(self.first)
        self.extent = extent_of([shot.camera for shot in dataset.fitted])
        self._least = LeastSize(options.least, [shot.camera for shot in dataset.fitted])
        self._least.hold(self.parameters.values)

    # -- one step ---------------------------------------------------------------------------------------------------------------------

    def rates(self) -> np.ndarray:
        """float32 (P,): learning rates of this iteration."""
        done = self.iteration / self.options.iterations
        longer, others, rest = self.options.longer, 1.0, _SH_REST
        if longer is None and not self.options.tune:
            longer = min(_LONGEST, max(1.0, (_ITERATIONS / self.options.iterations) ** 0.5))
        if longer is None:
            longer = 1.0
        else:
            others, rest = _OTHERS * longer, _OTHERS * rest
        if self.options.tune:
            done = self.options.begin + (1.0 - self.options.begin) * done
        falling = _LAST_RATE ** max(0.0, 3.0 * done - 2.0)
        rates = np.empty(self.parameters.values.shape[1])
        first, last = _MEAN_RATES
        rates[:SCALE] = self.extent * longer * first * (last / first) ** done
        rates[SCALE:QUAT], rates[QUAT:LOGIT], rates[LOGIT] = _SCALE_RATE * others * falling, _QUAT_RATE * others * falling, _LOGIT_RATE * falling
        rates[SH:] = _SH_RATE * others * rest * falling
        rates[SH : SH + 3] = _SH_RATE * others * falling
        return rates.astype(np.float32)

    @property
    def degree(self) -> int:
        """SH degree that is trained now."""
        if self.options.tune:
            return self.parameters.degree
        return min(self.options.degree, self.iteration // max(1, min(_DEGREE_EVERY, self.options.iterations // 8)))

    def step(self) -> float:
        """One photograph; the loss."""
        if not len(self.order):
            self.order = self.rng.permutation(len(self._photos))
        view, self.order = int(self.order[0]), self.order[1:]
        camera, photo = self.dataset.fitted[view].camera, self._photos[view]
        frame = render(self.parameters, camera, self.options.background, self.machine, np.float32, self._engine)
        if self.iteration == self.options.first_squared:
            self.moments = Adam.of(self.parameters.values)
        measure = loss_and_slope if self.iteration < self.options.first_squared else log_error_slope
        counted = self._counted[view]
        if self.options.exposure:
            change = self.exposures[view].reshape(3, 4)
            loss, slope = _masked(measure, np.ascontiguousarray(frame.image @ change[:, :3].T + change[:, 3]), photo, counted)
            by_colour = np.einsum("hwi,hwj->ij", slope, frame.image, dtype=np.float64)
            gradient = np.concatenate([by_colour, slope.sum(axis=(0, 1), dtype=np.float64)[:, None]], axis=1).astype(np.float32)
            slope = slope @ change[:, :3]
            fast, slow = _EXPOSURE_RATES
            rate = np.full(12, fast * (slow / fast) ** (self.iteration / self.options.iterations), np.float32)
            self.exposure_moments.step(self.exposures, np.array([view]), gradient.reshape(1, 12), rate)
        else:
            loss, slope = _masked(measure, frame.image, photo, counted)
        found = backward(frame, slope, (self.degree + 1) ** 2)
        refused = self.moments.step(self.parameters.values, found.index, found.values, self.rates())
        self._least.hold(self.parameters.values, found.index)
        self.score[found.index] += np.hypot(found.screen[:, 0] * camera.width / 2, found.screen[:, 1] * camera.height / 2)
        self.seen[found.index] += 1
        self.iteration += 1
        broken = np.union1d(found.index[refused], frame.index[frame.bad])
        if len(broken):
            self.removed += len(broken)
            self._select(np.setdiff1d(np.arange(len(self.parameters)), broken))
        self._grow()
        return loss

    def _select(self, keep: np.ndarray, new: np.ndarray | None = None) -> None:
        """Keep the Gaussians `keep`, in that order, and put new rows behind them."""
        values = self.parameters.values
        new = values[:0] if new is None else new
        if not len(keep) + len(new):
            raise FlickerError(f"fit: no Gaussian is left after {self.iteration} iterations")
        self.parameters = self.parameters.like(np.concatenate([values[keep], new]))
        self.moments.select(keep, len(new))
        self.score, self.seen = (np.concatenate([old[keep], np.zeros(len(new))]) for old in (self.score, self.seen))

    def _grow(self) -> None:
        """Clone, split and remove, from a twentieth to the half of the iterations."""
        total = self.options.iterations
        begin, end = total // 20, total // 2
        if self.options.tune or self.iteration % density.EVERY or not begin <= self.iteration <= end:
            return
        good = self.parameters.finite()  # what no view shows is found here
        if not good.all():
            self.removed += int((~good).sum())
            self._select(np.flatnonzero(good))
        share = min(1.0, (self.iteration - begin + density.EVERY) / (0.7 * (end - begin) + 1))
        most = int(self.first + share * max(0, self.options.gaussians - self.first))
        keep, new = density.refine(self.parameters, self.score / np.maximum(self.seen, 1), self.extent, most, self.rng)
        self._least.hold(new)
        self._select(keep, new)
        self._select(density.in_order(self.parameters))
        self.score[:], self.seen[:] = 0, 0

    # -- whole runs -------------------------------------------------------------------------------------------------------------------

    def run(
        self, steps: Steps | None = None, told: Callable[[int, int, float], None] | None = None, keep: Callable[[], None] | None = None,
    ) -> None:
        """All iterations that are left. told(iteration, Gaussians, PSNR of the test photographs), keep(): every so many, and keep() at Ctrl-C."""
        whole = True
        try:
            with (steps or Steps()).bar("fitting") as report:
                while self.iteration < self.options.iterations:
                    with undivided():
                        whole = False
                        self.step()
                        whole = True
                    report(self.iteration, self.options.iterations)
                    if told and (self.iteration % MEASURE_EVERY == 0 or self.iteration == self.options.iterations):
                        told(self.iteration, len(self.parameters), self.measure())
                    if keep and self.iteration % SAVE_EVERY == 0:
                        keep()
        except KeyboardInterrupt:
            if keep and whole:
                keep()
            raise

    def scene(self) -> Scene:
        """The scene of the present parameters, activated."""
        return self.parameters.scene()

    def measure(self) -> float:
        """Mean PSNR in dB of the test photographs, of `MEASURED` of them where there are more; pictures of `render`, with exposure after an affine fit."""
        found = []
        every = -(-len(self._test_photos) // MEASURED)
        for shot, photo, counted in list(zip(self.dataset.tests, self._test_photos, self._test_counted))[::every]:
            image, photo = _where(counted, render(self.parameters, shot.camera, self.options.background, self.machine).image, photo)
            found.append(psnr(affine_fit(image, photo) if self.options.exposure else image, photo) if photo.size else np.nan)
        return float(np.nanmean(found)) if not np.isnan(found).all() else float("nan")

    def quality(self, scene: Scene) -> Quality:
        """A scene against the test photographs by the reference renderer."""
        rows = []
        for shot, photo, counted in zip(self.dataset.tests, self._test_photos, self._test_counted):
            if counted is not None and not counted.any():
                continue
            image = render_reference(project(scene, shot.camera), shot.camera, self.options.background)
            same = ssim(image, photo, counted) if min(photo.shape[:2]) >= 11 else float("nan")
            drawn = float("nan")
            if self.machine is not None:
                drawn = psnr(*_where(counted, run(self.machine, View(shot.camera, scene, background=self.options.background)).image, photo))
            image, photo = _where(counted, image, photo)
            rows.append((psnr(image, photo), same, psnr(affine_fit(image, photo), photo), drawn))
        return Quality(*map(float, np.mean(rows, axis=0))) if rows else Quality(*[float("nan")] * 4)

    @property
    def masked(self) -> float:
        """Share of the photographs' pixels that do not count."""
        every = [(shot.camera.width * shot.camera.height, counted) for shot, counted in zip(self.dataset.shots, self._counted + self._test_counted)]
        return sum(0 if counted is None else int((~counted).sum()) for _, counted in every) / sum(size for size, _ in every)

    @property
    def hidden(self) -> int:
        """Photographs of which no pixel counts."""
        return sum(counted is not None and not counted.any() for counted in self._counted + self._test_counted)

    # -- state ------------------------------------------------------------------------------------------------------------------------

    def _identity(self) -> dict[str, Any]:
        """What a checkpoint must agree on."""
        return asdict(self.options) | {
            "scene": self._began,
            "background": list(self.options.background),
            "photographs": [[str(s.camera.img_name), s.camera.width, s.camera.height] for s in (*self.dataset.fitted, *self.dataset.tests)],
            "pixels": self._pixels, "cameras": self._cameras,
        }

    @cached_property
    def _pixels(self) -> str:
        """Digest of the photographs and their masks, as they are used."""
        digest = hashlib.blake2b(digest_size=16)
        for array in (*self._photos, *self._test_photos, *self._counted, *self._test_counted):
            digest.update(b"none" if array is None else np.ascontiguousarray(array).data)
        return digest.hexdigest()

    @cached_property
    def _cameras(self) -> str:
        """Digest of the photographs' poses and focal lengths, and of which are for testing."""
        cameras = [[shot.camera.fx, shot.camera.fy, shot.camera.position.tolist(), shot.camera.rotation.tolist()] for shot in self.dataset.shots]
        return hashlib.blake2b(json.dumps([len(self.dataset.fitted), cameras]).encode(), digest_size=16).hexdigest()

    def save(self, path: Path) -> None:
        """Write the state. Raises OSError."""
        numbers = {
            "identity": self._identity(), "rng": self.rng.bit_generator.state, "iteration": self.iteration, "removed": self.removed, "first": self.first,
            "steps": [self.moments.steps, self.exposure_moments.steps],
        }
        with path.open("wb") as file:
            np.savez(
                file, numbers=np.array(json.dumps(numbers)), values=self.parameters.values, m=self.moments.first, v=self.moments.second,
                exposures=self.exposures, exposure_m=self.exposure_moments.first, exposure_v=self.exposure_moments.second, order=self.order,
                score=self.score, seen=self.seen,
            )

    def restore(self, path: Path) -> None:
        """Continue from a state that `save` wrote. FlickerError for another fit's, or a damaged file."""
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            numbers = json.loads(str(arrays.pop("numbers")))
            theirs, ours = numbers["identity"], json.loads(json.dumps(self._identity()))
            for key in ours:
                if key in _DIGESTS and theirs.get(key) != ours[key]:
                    raise FlickerError(f"{path}: is of a fit with {_DIGESTS[key]}")
                if theirs[key] != ours[key]:
                    said = f"{key} {theirs[key]}, not {ours[key]}"
                    raise FlickerError(f"{path}: is of a fit with {said}")
            self.parameters = self.parameters.like(arrays["values"])
            self.moments = Adam(arrays["m"], arrays["v"], numbers["steps"][0])
            self.exposures = arrays["exposures"]
            self.exposure_moments = Adam(arrays["exposure_m"], arrays["exposure_v"], numbers["steps"][1])
            self.order, self.score, self.seen = arrays["order"], arrays["score"], arrays["seen"]
            self.iteration, self.removed, self.first = numbers["iteration"], numbers["removed"], numbers["first"]
            self.rng.bit_generator.state = numbers["rng"]
        except FlickerError:
            raise
        except OSError as error:
            raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)})") from None
        except Exception as error:  # numpy raises anything at all for a damaged file
            raise FlickerError(f"{path}: not a checkpoint ({one_line(error)})") from None
