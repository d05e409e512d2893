"""Runs the report: checks, measurements, figures, page."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..cost.area import SYNTHESIS
from ..scene.camera import Camera
from ..errors import FlickerError
from ..explore.stability.run import Point, Stability, run_stability
from ..explore.stability.write import check_folder
from .claims import Verdict, all_verdicts, read_areas
from .collect import Cache, Target, check_configurations, code_digest, collect, file_digest, known_configurations, parse_target
from .figures import own_figures, paper_figures, stability_table
from .page import page

__all__ = ["Job", "Written", "check", "known_configurations", "write_report"]

SUMMARY = ("scene", "view", "config", "cycles", "psnr_db", "ssim", "flip", "area_ge", "energy_uj", "model_only")


@dataclass(frozen=True)
class Job:
    """A checked request."""

    targets: tuple[Target, ...]
    configurations: tuple[str, ...]
    size: tuple[int, int]
    folder: Path


@dataclass(frozen=True)
class Written:
    """What a report consists of."""

    page: Path
    summary: Path
    verdicts: tuple[Verdict, ...]


def check(scenes: Sequence[str], folder: Path, size: tuple[int, int], configurations: Sequence[str] | None = None) -> Job:
    """All that can be wrong is found here, before any work; FlickerError. Without scenes the demo scene is taken."""
    targets = [parse_target(text) for text in scenes]
    for i, target in enumerate(targets):
        if any(t.title == target.title for t in targets[:i]):
            raise FlickerError(f"{target.path}: scene {target.title} is there twice")
    names = check_configurations(list(known_configurations()) if configurations is None else configurations)
    Camera(size[0], size[1], 1.0, 1.0, (0, 0, 0), ((1, 0, 0), (0, 1, 0), (0, 0, 1)))  # raises for a size out of range
    for part in (folder, folder / "cache", folder / "figures"):
        check_folder(part)
    for name in ("index.html", "summary.csv"):
        if (folder / name).is_dir():
            raise FlickerError(f"{folder / name}: is a folder")
    return Job(tuple(targets), tuple(names), size, folder)


def _demo(folder: Path, cache: Cache) -> Target:
    """The demo scene in a folder; made when it is not there as its makers in this state left it."""
    from ..scene import demo as demo_scene

    makers = sorted(Path(demo_scene.__file__).parent.glob("*.py"))
    key = cache.key("demo scene", *(file_digest(path) for path in makers))
    files = folder / "demo" / "demo.ply", folder / "demo" / "cameras.json"
    stored = cache.load(key)
    if stored is None or any(not f.exists() or file_digest(f) != stored[0][f.name] for f in files):
        demo_scene.write_demo(folder / "demo")
        cache.store(key, {f.name: file_digest(f) for f in files}, {})
    return Target(files[0])


def _stability(cache: Cache, seed: int) -> Stability:
    """The quick suite, from the cache where it is there."""
    key = cache.key(code_digest(), "stability", str(seed))
    stored = cache.load(key)
    if stored is None:
        result = run_stability(quick=True, seed=seed)
        cache.store(key, {"points": [p.__dict__ for p in result.points]}, {})
        return result
    return Stability(tuple(Point(**p) for p in stored[0]["points"]), seed)


def write_report(job: Job, seed: int = 1, progress: Callable[[int, int, str], None] = lambda done, total, text: None) -> Written:
    """Measure, draw, write. What is measured stays in the folder's cache, also after an interruption."""
    cache = Cache(job.folder / "cache")
    progress(0, 1, "scenes")
    targets = job.targets or (_demo(job.folder, cache),)
    views = collect(targets, job.configurations, job.size, job.folder / "cache", progress)
    progress(1, 1, "stability suite")
    stability = _stability(cache, seed)
    progress(1, 1, "figures")
    areas = read_areas(SYNTHESIS)
    verdicts = all_verdicts(views, areas)
    paper = paper_figures(views, areas)
    chart, heats = own_figures(views)
    table = stability_table(stability)
    for figure in (*paper, chart, *heats, table):
        figure.write(job.folder / "figures")
    about = {
        "views": ", ".join(v.target.title for v in views), "size": f"{job.size[0]}x{job.size[1]}", "configurations": str(len(job.configurations)),
        "accuracy": "PSNR, SSIM and FLIP (67 pixels per degree) of unquantised pictures against the float64 reference",
        "code": code_digest()[:16], "areas": "build/synth/area.csv" if areas else "the table of the package (make synth has not run)",
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
