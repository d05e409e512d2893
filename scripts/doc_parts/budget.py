"""`make docs PART=budget`: real scenes to budgets, step by step, in docs/results/budget.md. Half an hour; goes on where it was interrupted (build/budget)."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from flicker.budget.curve import Curve
from flicker.budget.goal import FrameCost, Goal, Kind
from flicker.budget.reduce import Options, Phase, Reducer, Row, sound
from flicker.budget.score import Score, scores
from flicker.budget.tune import quality
from flicker.budget.views import cameras_of, reference_psnr
from flicker.errors import FlickerError
from flicker.fit.parameters import Parameters
from flicker.markdown import table
from flicker.report.figures import budget_curves
from flicker.scene import Scene, load_scene
from flicker.scene.camera import Camera
from flicker.scene.real import REAL_VIEWS
from flicker.toolchain import BUILD

from .common import SIZE, SIZE_TEXT, Say, folder_of_scenes, save_charts

FOLDER = BUILD / "budget"
COUNT = 48  # cameras: 40 to fit, 8 held out
SHARES = (0.65, 0.5, 0.35, 0.25)  # of removal alone
JOBS: tuple[tuple[str, Options], ...] = (
    ("guitar", Options(Goal(Kind.KEEP, 0.25), rounds=3, steps=100, last=400)),
    ("playbot", Options(Goal(Kind.KEEP, 0.45), rounds=3, steps=80, last=200)),
    ("flowers", Options(Goal(Kind.KEEP, 0.5), rounds=3, steps=50, last=100)),
)


@dataclass(frozen=True)
class Result:
    """rows: what each step gave. decibels, large: of the finished scene on the held-out views, by the reference renderer, as fitted to and at `SIZE`. shown:
    share of the pixels of the held-out views in which the full scene is seen. alone: dB on the held-out views by removal alone in one go, by score and share.
    minutes: of processor time."""

    gaussians: int
    rows: list[Row]
    decibels: list[float]
    large: list[float]
    shown: float
    alone: dict[str, dict[str, float]]
    minutes: float


def _keep(reducer: Reducer, state: Path, clock: Path, used: float) -> None:
    temporary = state.with_name(f".{state.name}")
    reducer.save(temporary)
    temporary.replace(state)
    clock.write_text(json.dumps({"seconds": used}))


def _alone(clean: Scene, fitted: list[Camera], held: list[Camera], wanted: list[np.ndarray]) -> dict[str, dict[str, float]]:
    parameters = Parameters.of(clean)
    found = scores(parameters, fitted)

    def left(score: Score, share: float) -> Parameters:
        order = np.argsort(-found.by(score), kind="stable")
        return Parameters(parameters.values[np.sort(order[: round(share * len(parameters))])])

    return {score.value: {f"{share:g}": quality(left(score, share), held, wanted) for share in SHARES} for score in Score}


def _run(name: str, options: Options, say: Say) -> Result:
    FOLDER.mkdir(parents=True, exist_ok=True)
    view = next(view for view in REAL_VIEWS if view.folder == name)
    title = f"{name} {COUNT} {options.goal.kind.value} {options.goal.value:g}"
    state, clock = (FOLDER / f"{title.replace(' ', '_')}.{suffix}" for suffix in ("npz", "json"))
    asked = json.loads(json.dumps(asdict(options)))
    if clock.exists() and (told := json.loads(clock.read_text())).get("options") == asked:
        return Result(**told["result"] | {"rows": [Row(**row | {"cost": row["cost"] and FrameCost(**row["cost"])}) for row in told["result"]["rows"]]})
    say(f"{title}: views")
    began, before = time.process_time(), 0.0
    scene = load_scene(view.path(folder_of_scenes()))
    fitted, held = cameras_of(scene, count=COUNT, seed=options.seed)
    clean, pictures, _ = sound(scene, [*fitted, *held])
    reducer = Reducer(clean, fitted, held, pictures, options)
    if state.exists() and clock.exists():
        try:
            reducer.restore(state)
            before, began = json.loads(clock.read_text())["seconds"], time.process_time()
        except FlickerError as error:
            say(f"{error}: begins anew")
    if reducer.phase is not Phase.DONE:
        reducer.run(told=lambda row: say(f"{title}: {row.step}: {row.gaussians:,} Gaussians, {row.decibels:.2f} dB"),
                    keep=lambda: _keep(reducer, state, clock, before + time.process_time() - began))
    say(f"{title}: reference pictures")
    small = reducer.scene()
    result = Result(
        len(scene), reducer.rows, reference_psnr(clean, small, held), reference_psnr(clean, small, [camera.resized(*SIZE) for camera in held]),
        float(np.mean([picture.max(axis=2) > 0 for picture in pictures[len(fitted) :]])), _alone(clean, fitted, held, pictures[len(fitted) :]),
        json.loads(clock.read_text())["seconds"] / 60,
    )
    clock.write_text(json.dumps({"options": asked, "result": asdict(result)}))
    return result


@cache
def _results(say: Say) -> tuple[tuple[str, Options, Result], ...]:
    return tuple((name, options, _run(name, options, say)) for name, options in JOBS)


def draw(say: Say) -> str:
    """The chart of the budgets by share."""
    curves = [Curve.of(name, result.gaussians, result.rows) for name, options, result in _results(say) if options.goal.kind is Kind.KEEP]
    figure = budget_curves(curves)
    return save_charts([figure])


def _decibel(value: float) -> str:
    return "equal" if value > 150 else f"{value:.2f}"


def tables(say: Say) -> dict[str, str]:
    steps, ends = [], []
    for name, options, result in _results(say):
        for row in result.rows:
            cost = row.cost
            steps.append((
                name, row.step, f"{row.gaussians:,}", f"{row.gaussians / result.gaussians:.1%}", f"{row.coefficients:.2f}", _decibel(row.decibels),
                f"{cost.cycles:,.0f}" if cost else "", f"{cost.lane_cycles:,.0f}" if cost and cost.lane_cycles else "",
                f"{cost.bytes / 1e6:.2f}" if cost else "", f"{cost.image_bytes / 1e6:.2f}" if cost else "",
            ))
        command = f"--count {COUNT} --{options.goal.kind.value} {options.goal.value:g} --rounds {options.rounds} --steps {options.steps} --last {options.last}"
        ends.append((name, f"`{command}`", f"{result.rows[-1].gaussians / result.gaussians:.1%}", f"{np.mean(result.decibels):.2f}",
                     f"{min(result.decibels):.2f}", f"{np.mean(result.large):.2f}", f"{result.shown:.0%}", f"{result.minutes:.0f}"))
    heads = ["scene", "options", "kept", "held-out, dB", "worst view", f"at {SIZE_TEXT}", "pixels that show the scene", "processor time, min"]
    return {
        "alone": table(["scene", "score", *(f"{share:.0%}" for share in SHARES)], [
            (name, score, *(f"{by[f'{share:g}']:.2f}" for share in SHARES)) for name, _, result in _results(say) for score, by in result.alone.items()
        ], numbers=True),
        "results": table(heads, ends, numbers=True),
        "steps": table(
            ["scene", "after", "Gaussians", "kept", "SH coefficients", "held-out, dB", "cycles, channels", "cycles, lanes alone", "MB a frame", "MB packed"],
            steps, numbers=True,
        ),
    }
