"""`make docs PART=budget`: real scenes to budgets, step by step, in docs/budget.md. Hours; goes on where it was interrupted (build/budget)."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from flicker.budget.curve import Curve
from flicker.budget.goal import Goal, Kind
from flicker.budget.reduce import Options, Phase, Reducer, Row, sound
from flicker.budget.views import cameras_of, reference_psnr
from flicker.errors import FlickerError
from flicker.markdown import table
from flicker.report.figures import budget_curves
from flicker.scene import load_scene
from flicker.scene.real import REAL_VIEWS
from flicker.toolchain import BUILD, ROOT

from .common import Say, folder_of_scenes

FOLDER = BUILD / "budget"
IMAGES = ROOT / "docs" / "images"
JOBS = (
    ("guitar", Options(Goal(Kind.KEEP, 0.25), rounds=3, steps=100, last=400)),
    ("playbot", Options(Goal(Kind.KEEP, 0.45), rounds=3, steps=80, last=200)),
    ("flowers", Options(Goal(Kind.KEEP, 0.5), rounds=3, steps=80, last=200)),
)


@dataclass(frozen=True)
class Result:
    """rows: what each step gave. decibels: of the finished scene on the held-out views, by the reference renderer. minutes: of processor time."""

    gaussians: int
    rows: list[Row]
    decibels: list[float]
    minutes: float


def _keep(reducer: Reducer, state: Path, clock: Path, used: float) -> None:
    temporary = state.with_name(f".{state.name}")
    reducer.save(temporary)
    temporary.replace(state)
    clock.write_text(json.dumps(used))


def _run(name: str, options: Options, say: Say) -> Result:
    FOLDER.mkdir(parents=True, exist_ok=True)
    view = next(view for view in REAL_VIEWS if view.folder == name)
    title = f"{name} {options.goal.kind.value} {options.goal.value:g}"
    state, clock = (FOLDER / f"{title.replace(' ', '_')}.{suffix}" for suffix in ("npz", "json"))
    say(f"{title}: views")
    began, before = time.process_time(), 0.0
    scene = load_scene(view.path(folder_of_scenes()))
    fitted, held = cameras_of(scene, seed=options.seed)
    clean, pictures, _ = sound(scene, [*fitted, *held])
    reducer = Reducer(clean, fitted, held, pictures, options)
    if state.exists() and clock.exists():
        try:
            reducer.restore(state)
            before, began = json.loads(clock.read_text()), time.process_time()
        except FlickerError as error:
            say(f"{error}: begins anew")
    if reducer.phase is not Phase.DONE:
        reducer.run(told=lambda row: say(f"{title}: {row.step}: {row.gaussians:,} Gaussians, {row.decibels:.2f} dB"),
                    keep=lambda: _keep(reducer, state, clock, before + time.process_time() - began))
    say(f"{title}: reference pictures")
    return Result(len(scene), reducer.rows, reference_psnr(clean, reducer.scene(), held), json.loads(clock.read_text()) / 60)


@cache
def _results(say: Say) -> tuple[tuple[str, Options, Result], ...]:
    return tuple((name, options, _run(name, options, say)) for name, options in JOBS)


def draw(say: Say) -> str:
    """The chart of the budgets by share."""
    curves = [Curve.of(name, result.gaussians, result.rows) for name, options, result in _results(say) if options.goal.kind is Kind.KEEP]
    figure = budget_curves(curves)
    with tempfile.TemporaryDirectory() as folder:
        figure.write(Path(folder))
        shutil.copy(Path(folder) / f"{figure.name}.png", IMAGES)
    return str((IMAGES / f"{figure.name}.png").relative_to(ROOT))


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
        mean = sum(result.decibels) / len(result.decibels)
        ends.append((name, f"`--{options.goal.kind.value} {options.goal.value:g} --rounds {options.rounds} --steps {options.steps} --last {options.last}`",
                     f"{result.rows[-1].gaussians / result.gaussians:.1%}", f"{mean:.2f}", f"{min(result.decibels):.2f}", f"{result.minutes:.0f}"))
    return {
        "results": table(["scene", "options", "kept", "held-out, dB", "worst view", "processor time, min"], ends, numbers=True),
        "steps": table(
            ["scene", "after", "Gaussians", "kept", "SH coefficients", "held-out, dB", "cycles, channels", "cycles, lanes alone", "MB a frame", "MB packed"],
            steps, numbers=True,
        ),
    }
