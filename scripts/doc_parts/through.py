"""`make docs PART=through`: speed against accuracy of every mode before and after fine-tuning through its contribution test, in docs/results/fit.md.

An hour on one core; what is tuned stays in build/photographs, and an interrupted run goes on from there. Delete the folder when the optimisation itself
has changed.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from flicker.explore.points import Point, SceneFile
from flicker.explore.store import Store
from flicker.fit.dataset import load_dataset
from flicker.fit.train import Options
from flicker.markdown import table
from flicker.report.figures import Move, moves
from flicker.scene.camera import cameras_text
from flicker.scene.files import load_scene

from .common import Say, folder_of_scenes, save_charts
from .photographs import FOLDER, SCENES, kept, row_of, trained

PHOTOGRAPHS = SCENES[0]  # lego
TUNED = Options(iterations=500, tune=True, begin=0.0, squared=0.5)
SMALL = 0.1  # dB: of what costs less no share is told
LARGE = 0.45  # pixels, of modes that look at few leaders of smooth Gaussians
# Machines, and the least size of Gaussians in pixels that they are tuned with.
MACHINES = (
    ("faithful", 0.0), ("flicker-dense-fixed-factored", 0.0), ("flicker-smooth-fixed-factored", 0.0), ("flicker-spiky-fixed-factored", LARGE),
    ("flicker-sparse-fixed-factored", LARGE),
)


@dataclass(frozen=True)
class Quality:
    """Means over the test photographs. machine, reference: PSNR in dB. cycles: of the rendering stage."""

    machine: float
    reference: float
    cycles: float


@cache
def _results() -> dict[tuple[str, str], Quality]:
    """By machine and scene: "before", "through" its test, "plain", as many iterations without a test."""
    source = folder_of_scenes() / PHOTOGRAPHS.name
    data, store = load_dataset(source, PHOTOGRAPHS.size), Store()
    options = hashlib.sha256(repr((PHOTOGRAPHS, TUNED, MACHINES)).encode()).hexdigest()[:12]
    folder = FOLDER / f"through-{options}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cameras.json").write_text(cameras_text([shot.camera for shot in data.tests]))
    fit = kept(folder / "before.ply", lambda: load_scene(source / "scene.ply"))
    found = {}
    for machine, least in MACHINES:
        jobs = {"plain": TUNED, "through": replace(TUNED, through=machine, least=least)}
        files = {"before": fit} | {
            name: kept(folder / f"{name if name == 'plain' else machine}.ply", lambda: trained(data, job, fit))
            for name, job in jobs.items()
        }
        for name, path in files.items():
            scene = SceneFile(str(path), photos=str(data.tests[0].path.parent))
            rows = [row_of(Point(scene.target(view), machine), store) for view in range(scene.views())]
            found[machine, name] = Quality(*(float(np.mean([r[key] for r in rows])) for key in ("photo_psnr_db", "reference_photo_psnr_db", "cycles")))
    return found


def draw(say: Say) -> str:
    """The chart: cycles against PSNR, an arrow for each machine."""
    say("tuning through every mode, an hour")
    found = _results()
    ends = {machine: [(found[machine, name].cycles, found[machine, name].machine) for name in ("before", "through")] for machine, _ in MACHINES}
    figure = moves(
        "through", "Fine-tuned through the contribution test", [Move(machine, *places) for machine, places in ends.items()],
        "PSNR against test photographs, dB",
    )
    return save_charts([figure])


def tables(say: Say) -> dict[str, str]:
    say("tuning through every mode, an hour")
    found = _results()
    rows = []
    for machine, least in MACHINES:
        before, plain, after = (found[machine, name] for name in ("before", "plain", "through"))
        cost = [q.reference - q.machine for q in (before, plain, after)]
        rows.append((
            f"`{machine}`", f"{least:g}", *(f"{q.machine:.2f} ({q.reference:.2f})" for q in (before, plain, after)),
            f"{(after.machine - before.machine) / cost[0]:.0%}" if cost[0] >= SMALL else "", " / ".join(f"{x:.2f}" for x in cost),
            f"{before.cycles:,.0f}", f"{after.cycles:,.0f}",
        ))
    return {"": table([
        "machine", "least size, pixels", "before, dB", f"{TUNED.iterations} iterations without its test", "with its test", "gain, of what the test missed",
        "the test costs, dB, before / without / with", "cycles before", "after",
    ], rows)}
