"""`make docs PART=scale`: how a frame grows with the scene and with the picture, by the models held to the RTL, in docs/results/scaling.md."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

from flicker.chip.dram import DramConfig
from flicker.chip.whole import WholeFrame, first_half, whole_frame
from flicker.front.view import View, load_view
from flicker.golden.chip import whole_pairs
from flicker.golden.front.frame import run_front
from flicker.golden.lanes.lists import front_lists
from flicker.markdown import table
from flicker.params import RenderConfig
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.pipeline import packed_scene
from flicker.report.figures import Figure
from flicker.scene.grow import grown, with_degree
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS, RealView

from .common import SIZE, Say, folder_of_scenes, save_charts

FOLDERS = ("flowers", "playbot")
TIMES = (1, 2, 4, 8)
DEGREES = (0, 1, 2, 3)
SIZES = ((320, 178), (640, 360), SIZE, (1920, 1080))
CONFIG = RenderConfig(stage="lanes")
PEAK_SHARE = 0.8  # of the memory's peak rate, in the bound


@dataclass(frozen=True, eq=False)
class Point:
    """A frame. gaussians: of the scene; records, entries: of the picture; longest: list; alone: cycles of the rendering stage with all records at hand."""

    name: str
    gaussians: int
    size: tuple[int, int]
    degree: int
    records: int
    entries: int
    longest: int
    alone: int
    frame: WholeFrame

    @property
    def bound(self) -> float:
        """Of the rendering half: the stage alone, or its bytes at `PEAK_SHARE` of the peak rate."""
        moved = sum(stream.moved_bytes for stream in self.frame.back.traffic)
        return max(self.alone, moved / (PEAK_SHARE * DramConfig().bytes_per_second / 1e9))


def point(name: str, view: View) -> Point:
    dram = DramConfig()
    front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
    first, tables = first_half(front, CONFIG, dram)
    frame = whole_frame(first, tables, CONFIG, dram)
    alone = simulate_lanes(lane_work(whole_pairs(front_lists(front))), CONFIG.with_(in_width=CONFIG.delivered), leave=True).cycles
    return Point(
        name, len(view.scene), (view.camera.width, view.camera.height), view.scene.sh_degree, len(front.number), len(front.entry_tile),
        int(np.diff(tables.start).max()), alone, frame,
    )


def _views(real: RealView) -> Iterator[tuple[str, View]]:
    """Larger scenes, other degrees of harmonics, larger pictures."""
    view = load_view(real.path(folder_of_scenes()), real.number, SIZE)
    for times in TIMES:
        yield "scene", View(view.camera, grown(view.scene, times), name=f"{real.folder} x {times}")
    for degree in DEGREES:
        yield "degree", View(view.camera, with_degree(view.scene, degree), name=real.folder)
    for size in SIZES:
        yield "picture", View(view.camera.resized(*size), view.scene, name=real.folder)


def _row(p: Point) -> tuple[str, ...]:
    front, back = p.frame.front, p.frame.back
    moved = sum(stream.moved_bytes for stream in back.traffic)
    return (
        p.name, f"{p.gaussians:,}", str(p.degree), f"{p.size[0]}x{p.size[1]}", f"{p.entries:,}", f"{p.longest:,}",
        f"{front.cycles / 1e6:.2f}", f"{front.cycles / p.gaussians:.2f}", "memory" if front.dram > front.units else "units",
        f"{p.alone / 1e6:.2f}", f"{back.cycles / 1e6:.2f}", f"{back.cycles / p.entries:.2f}", f"{back.cycles / p.bound:.2f}",
        f"{sum(front.bytes.values()) / 1e6:.1f} + {moved / 1e6:.1f}", f"{p.frame.interval / 1e6:.2f}, {p.frame.bottleneck}",
    )


HEAD = [
    "scene", "Gaussians", "SH", "picture", "entries", "longest list", "front end, M", "a Gaussian", "of it the longer", "stage alone, M", "rendering, M",
    "an entry", "over the bound", "MB", "interval, M",
]


def _chart(points: list[Point]) -> Figure:
    fig, axes = plt.subplots(figsize=(7.0, 4.2))
    rows = []
    for folder, colour in zip(FOLDERS, ("#1b6ca8", "#c0504d")):
        own = sorted((p for p in points if p.name.startswith(folder)), key=lambda p: p.gaussians)
        x = [p.gaussians / 1e6 for p in own]
        for label, values, style in (
            ("front end", [p.frame.front.cycles for p in own], "--o"), ("rendering", [p.frame.back.cycles for p in own], "-s"),
            ("rendering, bound", [p.bound for p in own], ":"),
        ):
            axes.plot(x, [v / 1e6 for v in values], style, color=colour, label=f"{folder}, {label}", markersize=4)
            rows += [[p.name, p.gaussians, label, round(v)] for p, v in zip(own, values)]
    axes.set_xscale("log", base=2)
    axes.set_yscale("log", base=2)
    axes.set_xlabel("Gaussians, millions")
    axes.set_ylabel("cycles, millions")
    axes.legend(fontsize=7, frameon=False)
    title = f"Cycles by the size of the scene at {SIZE[0]}x{SIZE[1]}"
    return Figure("scaling", title, "", "", ["scene", "gaussians", "what", "cycles"], rows, fig)


def tables(say: Say) -> dict[str, str]:
    found: dict[str, list[Point]] = {"scene": [], "degree": [], "picture": []}
    for real in REAL_VIEWS:
        if real.folder not in FOLDERS:
            continue
        for what, view in _views(real):
            say(f"{what}: {view.name}, {len(view.scene):,} Gaussians, {view.camera.width}x{view.camera.height}")
            found[what].append(point(view.name or real.folder, view))
    say(save_charts([_chart(found["scene"])]))
    return {what: table(HEAD, [_row(p) for p in points]) for what, points in found.items()}
