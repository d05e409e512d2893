"""Runs the report: checks, measurements, figures, page."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..budget.curve import Curve
from ..cost.area import TABLE, parts
from ..cost.stamp import stamp_of
from ..errors import FlickerError
from ..explore.configurations import group, matching
from ..explore.digest import code_digest, key
from ..explore.points import SceneFile, Target
from ..explore.stability.run import Point, Stability, run_stability
from ..explore.store import DEFAULT, Store
from ..front.view import DEMO
from ..output import check_folder, write_csv, write_records, write_text
from ..scene.camera import Camera
from ..scene.photos import BLACK
from .claims import Verdict, all_verdicts
from .collect import collect
from .figures import budget_curves, own_figures, paper_figures, stability_table
from .moving import FRAMES, GROUP, assumptions, collect_moving, moving_figure, moving_pictures
from .named import named, view_numbers
from .page import InMotion, page

SUMMARY = ("scene", "view", "config", "cycles", "psnr_db", "ssim", "flip", "photo_psnr_db", "photo_ssim", "area_ge", "energy_uj", "model_only")


@dataclass(frozen=True)
class Job:
    """A checked request. store: folder of results, shared with sweeps. curves: of `flicker budget`. moving: configurations of the section on stability over
    time; frames: of each of its motions, 0: no such section."""

    targets: tuple[Target, ...]
    configurations: tuple[str, ...]
    folder: Path
    store: Path
    curves: tuple[Curve, ...] = ()
    moving: tuple[str, ...] = ()
    frames: int = 0


@dataclass(frozen=True)
class Written:
    """What a report consists of."""

    page: Path
    summary: Path
    verdicts: tuple[Verdict, ...]


def parse_targets(text: str, size: tuple[int, int] | None, photos: str | None = None, background: tuple[float, float, float] = BLACK) -> list[Target]:
    """`FILE` (its view 0), or `demo`, `FILE:VIEW`, `FILE:FIRST-LAST` or `FILE:all`; FlickerError when there is no such file, view or photograph."""
    path, of = named(text)
    scene = SceneFile(str(path), photos=photos, background=background)
    numbers = view_numbers(of, scene.views())
    if not numbers:
        raise FlickerError(f"{path}: views {of}: there are none")
    try:
        return [scene.target(number, size) for number in numbers]
    except FlickerError as error:
        raise FlickerError(f"{path}: {error}" if str(error).startswith("view ") else str(error)) from None


def check(
    scenes: Sequence[str], folder: Path, size: tuple[int, int] | None = None, configurations: Sequence[str] | None = None, store: Path = DEFAULT,
    photos: str | None = None, background: tuple[float, float, float] = BLACK, budgets: Sequence[Path] = (),
    frames: int = FRAMES,
) -> Job:
    """All that can be wrong is found here, before any work; FlickerError. Without scenes the demo scene is taken.

    size: None: every camera's own where there is a photograph, else `explore.points.SIZE`. photos, background: as in `SceneFile`. budgets: files of
    `flicker budget --json`. frames: of each motion in the section on stability over time; 0: without it. It has the configurations that are named, else the
    group `GROUP`.
    """
    if frames < 0 or frames == 1:
        raise FlickerError(f"--frames {frames}: a change takes two frames; 0: no section on stability over time")
    if size is not None:
        Camera(size[0], size[1], 1.0, 1.0, np.zeros(3), np.eye(3))  # raises for a size out of range
    targets = [target for text in scenes for target in parse_targets(text, size, photos, background)]
    targets = targets or [SceneFile(DEMO, photos=photos, background=background).target(0, size)]
    for i, target in enumerate(targets):
        if any(t.title == target.title for t in targets[:i]):
            raise FlickerError(f"{target.scene.path}: scene {target.title} is there twice")
    try:
        names = group("report") if configurations is None else matching(configurations)
    except FlickerError as error:
        raise FlickerError(f"--configs: {error}") from None
    for part in (folder, folder / "figures"):
        check_folder(part)
    Store(store)
    for name in ("index.html", "summary.csv"):
        if (folder / name).is_dir():
            raise FlickerError(f"{folder / name}: is a folder")
    moving = group(GROUP) if configurations is None else names
    return Job(tuple(targets), tuple(names), folder, store, tuple(map(Curve.load, budgets)), tuple(moving) if frames else (), frames)


def _stability(store: Store, seed: int) -> Stability:
    """The quick suite, from the store where it is there."""
    name = key(code_digest(), "stability", seed)
    stored = store.load(name)
    if stored is None:
        result = run_stability(quick=True, seed=seed)
        store.put(name, {"points": [p.__dict__ for p in result.points]})
        return result
    return Stability(tuple(Point(**p) for p in stored["points"]), seed)


def _in_motion(job: Job, store: Store, progress: Callable[[int, int, str], None]) -> InMotion | None:
    """The section on stability over time, its files written; None: none is wanted."""
    if not job.frames:
        return None
    moving = collect_moving(job.targets, job.moving, job.frames, store, progress)
    section = InMotion(moving, moving_figure(moving), [picture for each in moving for picture in moving_pictures(each)], assumptions(moving, job.frames))
    section.figure.write(job.folder / "figures")
    for picture in section.pictures:
        picture.write(job.folder / "figures")
    return section


def write_report(job: Job, seed: int = 1, progress: Callable[[int, int, str], None] = lambda done, total, text: None) -> Written:
    """Measure, draw, write. What is measured stays in the store, also after an interruption."""
    store = Store(job.store)
    views = collect(job.targets, job.configurations, store, progress)
    motion = _in_motion(job, store, progress)
    progress(1, 1, "stability suite")
    stability = _stability(store, seed)
    progress(1, 1, "figures")
    areas = {key: part.ge for key, part in parts().items()}
    verdicts = all_verdicts(views, areas)
    paper = paper_figures(views, areas)
    charts, heats = own_figures(views)
    budgets = [budget_curves(job.curves)] if job.curves else []
    table = stability_table(stability)
    for figure in (*paper, *charts, *heats, *budgets, table):
        figure.write(job.folder / "figures")
    about = {
        "views": ", ".join(v.target.title for v in views), "size": ", ".join(dict.fromkeys(f"{w}x{h}" for w, h in (t.size for t in job.targets))),
        "photographs": f"of {sum(t.photo is not None for t in job.targets)} of {len(views)} views, averaged to the picture's size",
        "cameras": "; ".join(dict.fromkeys(f"{t.scene.name}: {t.scene.cameras_from}" for t in job.targets)),
        "background": ", ".join(dict.fromkeys(" ".join(f"{c:g}" for c in t.scene.background) for t in job.targets)), "configurations": str(len(job.configurations)),
        "accuracy": "PSNR, SSIM and FLIP (67 pixels per degree) of unquantised pictures against the float64 reference",
        "code": code_digest()[:16], "areas": f"{TABLE.name}, of RTL {stamp_of(TABLE.read_text())}",
    }
    text = page(views, verdicts, paper, charts, heats, budgets, (stability, table), about, motion)
    rows = [view.rows[name] for view in views for name in view.rows]
    index, summary = job.folder / "index.html", job.folder / "summary.csv"
    write_records(summary, SUMMARY, rows)  # stages differ in the parts that their energy has
    write_csv(job.folder / "verdicts.csv", [
        ["figure", "claim", "paper", "here", "verdict"], *([v.figure, v.claim, v.paper, json.dumps(v.ours), v.verdict] for v in verdicts),
    ])
    write_text(index, text)
    return Written(index, summary, tuple(verdicts))
