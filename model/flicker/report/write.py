"""Runs the report: checks, measurements, figures, page."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..cost.area import TABLE, parts
from ..cost.stamp import stamp_of
from ..errors import FlickerError
from ..explore.configurations import group, matching
from ..explore.digest import code_digest, key
from ..explore.points import SceneFile, Target
from ..explore.stability.run import Point, Stability, run_stability
from ..explore.stability.write import check_folder
from ..explore.store import DEFAULT, Store
from ..front.view import DEMO
from ..scene.camera import Camera
from ..scene.files import scene_kind
from .claims import Verdict, all_verdicts
from .collect import collect
from .figures import own_figures, paper_figures, stability_table
from .page import page

SUMMARY = ("scene", "view", "config", "cycles", "psnr_db", "ssim", "flip", "area_ge", "energy_uj", "model_only")


@dataclass(frozen=True)
class Job:
    """A checked request. store: folder of results, shared with sweeps."""

    targets: tuple[Target, ...]
    configurations: tuple[str, ...]
    size: tuple[int, int]
    folder: Path
    store: Path


@dataclass(frozen=True)
class Written:
    """What a report consists of."""

    page: Path
    summary: Path
    verdicts: tuple[Verdict, ...]


def parse_target(text: str, size: tuple[int, int]) -> Target:
    """`FILE` or `FILE:VIEW`; FlickerError when there is no such file or view."""
    path, view = Path(text), 0
    head, colon, tail = text.rpartition(":")
    if colon and not path.exists() and tail.isdigit():
        path, view = Path(head), int(tail)
    if not path.exists():
        raise FlickerError(f"{path}: no such scene")
    if not os.access(path, os.R_OK):
        raise FlickerError(f"{path}: not readable")
    scene_kind(path)
    scene = SceneFile(str(path))
    if view >= (count := scene.views()):
        raise FlickerError(f"{path}: view {view}: there are {count} cameras, 0 to {count - 1}")
    return Target(scene, view, size)


def check(
    scenes: Sequence[str], folder: Path, size: tuple[int, int], configurations: Sequence[str] | None = None, store: Path = DEFAULT,
) -> Job:
    """All that can be wrong is found here, before any work; FlickerError. Without scenes the demo scene is taken."""
    targets = [parse_target(text, size) for text in scenes] or [Target(SceneFile(DEMO), 0, size)]
    for i, target in enumerate(targets):
        if any(t.title == target.title for t in targets[:i]):
            raise FlickerError(f"{target.scene.path}: scene {target.title} is there twice")
    try:
        names = group("report") if configurations is None else matching(configurations)
    except FlickerError as error:
        raise FlickerError(f"--configs: {error}") from None
    Camera(size[0], size[1], 1.0, 1.0, np.zeros(3), np.eye(3))  # raises for a size out of range
    for part in (folder, folder / "figures"):
        check_folder(part)
    Store(store)
    for name in ("index.html", "summary.csv"):
        if (folder / name).is_dir():
            raise FlickerError(f"{folder / name}: is a folder")
    return Job(tuple(targets), tuple(names), size, folder, store)


def _stability(store: Store, seed: int) -> Stability:
    """The quick suite, from the store where it is there."""
    name = key(code_digest(), "stability", seed)
    stored = store.load(name)
    if stored is None:
        result = run_stability(quick=True, seed=seed)
        store.put(name, {"points": [p.__dict__ for p in result.points]})
        return result
    return Stability(tuple(Point(**p) for p in stored["points"]), seed)


def write_report(job: Job, seed: int = 1, progress: Callable[[int, int, str], None] = lambda done, total, text: None) -> Written:
    """Measure, draw, write. What is measured stays in the store, also after an interruption."""
    store = Store(job.store)
    views = collect(job.targets, job.configurations, store, progress)
    progress(1, 1, "stability suite")
    stability = _stability(store, seed)
    progress(1, 1, "figures")
    areas = {key: part.ge for key, part in parts().items()}
    verdicts = all_verdicts(views, areas)
    paper = paper_figures(views, areas)
    chart, heats = own_figures(views)
    table = stability_table(stability)
    for figure in (*paper, chart, *heats, table):
        figure.write(job.folder / "figures")
    about = {
        "views": ", ".join(v.target.title for v in views), "size": f"{job.size[0]}x{job.size[1]}", "configurations": str(len(job.configurations)),
        "accuracy": "PSNR, SSIM and FLIP (67 pixels per degree) of unquantised pictures against the float64 reference",
        "code": code_digest()[:16], "areas": f"{TABLE.name}, of RTL {stamp_of(TABLE.read_text())}",
    }
    text = page(views, verdicts, paper, chart, heats, (stability, table), about)
    rows = [view.rows[name] for view in views for name in view.rows]
    columns = [*SUMMARY, *(key for key in rows[0] if key not in SUMMARY)]
    index, summary = job.folder / "index.html", job.folder / "summary.csv"
    try:
        with summary.open("w", newline="") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n", restval="")
            writer.writeheader()
            writer.writerows(rows)
        with (job.folder / "verdicts.csv").open("w", newline="") as file:
            lines = csv.writer(file, lineterminator="\n")
            lines.writerow(["figure", "claim", "paper", "here", "verdict"])
            lines.writerows([v.figure, v.claim, v.paper, json.dumps(v.ours), v.verdict] for v in verdicts)
        index.write_text(text)
    except OSError as error:
        raise FlickerError(f"{job.folder}: cannot be written ({error.strerror})") from None
    return Written(index, summary, tuple(verdicts))
