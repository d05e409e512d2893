"""`make docs PART=scale_hardware`: frames with long lists and of grown scenes in the verilated chip with 32 lanes, in docs/results/scaling.md.

An error: a frame buffer that differs from the golden model's; cycles of a frame or bytes that are more than 10 % off.
"""

from __future__ import annotations

from collections.abc import Iterator

from flicker.chip.dram import DramConfig
from flicker.front.view import View, load_view
from flicker.golden.front.frame import ListKind
from flicker.markdown import table
from flicker.scene.grow import grown
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS

from .chip_hardware import measure
from .common import SIZE, Say, folder_of_scenes
from .scale import CONFIG, point

# Folder, times, size: small pictures have the longest lists.
VIEWS = (("flowers", 1, (320, 178)), ("playbot", 1, (320, 178)), ("playbot", 1, (640, 360)), ("flowers", 1, SIZE), ("flowers", 2, SIZE))
CHUNKS = 64_000  # of a list writer: enough for all of them


def _views() -> Iterator[tuple[str, View]]:
    for folder, times, size in VIEWS:
        real = next(view for view in REAL_VIEWS if view.folder == folder)
        view = load_view(real.path(folder_of_scenes()), real.number, SIZE)
        name = f"{folder} x {times}, {size[0]}x{size[1]}"
        yield name, View(view.camera.resized(*size), view.scene if times == 1 else grown(view.scene, times), name=name)


def tables(say: Say) -> dict[str, str]:
    rows, spent = [], []
    for name, view in _views():
        model = point(name, view)
        found = measure(say, name, view, CONFIG, PackedFormat.CHUNK, ListKind.ELLIPSE, CHUNKS, DramConfig())
        front, back = found.halves
        rows.append((
            name, f"{model.longest:,}", f"{front:,}", f"{found.off[0]:+.1%}", f"{back:,}", f"{found.off[1]:+.1%}", f"{back / model.bound:.2f}",
            f"{found.interval:,}", f"{found.off[3]:+.1%}", f"{sum(found.moved.values()) / 1e6:.1f}", found.model.bottleneck,
        ))
        spent.append((name, *(f"{share:.1%}" for share in found.spent.values())))
    return {"": table(
        ["view", "longest list", "front end, cycles", "model off by", "rendering, cycles", "model off by", "over the bound", "interval back to back",
         "model off by", "MB", "what the model says it waits for"], rows,
    ), "spent": table(["view", "data", "nothing waits", "turns between reads and writes", "refresh of all banks", "rows"], spent, numbers=True)}
