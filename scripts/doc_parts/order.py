"""`make docs PART=order`: what turning on the spot does to the order of splats, by depth and by distance, in docs/results/motion.md.

The demo scene and the real views at two speeds. Pops are those of the chip's front end (`flicker.front.pops`). A temporal PSNR against the reference of the
same order does not see them, since both pictures change their order; that of float64 by depth against float64 by distance does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from flicker import markdown
from flicker.chip.drawing import Drawing
from flicker.front.pops import Seen, pops
from flicker.front.view import DEMO, View
from flicker.motion.frames import seen_by
from flicker.params import RECOMMENDED, SortOrder
from flicker.pipeline import Engine, FrontOptions
from flicker.scene.motion import panned
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS
from flicker.scene.sources import Source, open_scene
from flicker.scene.temporal import Change, TemporalError, summarise

from .common import Say, folder_of_scenes, significant

SIZE, FRAMES, FPS = (480, 270), 6, 90.0
SPEEDS = (0.25, 4.0)  # pixels a frame
CHIP = Drawing(Engine.CHIP_GOLDEN, RECOMMENDED, options=FrontOptions(PackedFormat.CHUNK))


def _sources(say: Say) -> Iterator[tuple[str, Source, int]]:
    say(f"{DEMO} 0")
    yield f"{DEMO} 0", open_scene(DEMO), 0
    for view in REAL_VIEWS:
        say(view.title)
        yield view.title, open_scene(view.path(folder_of_scenes())), view.number


def _row(source: Source, number: int, speed: float) -> list[str]:
    """Cells of a view at a speed."""
    measures = {name: TemporalError() for name in ("depth", "distance", "orders")}
    changes: dict[str, list[Change]] = {name: [] for name in measures}
    before: dict[SortOrder, Seen] = {}
    pairs, share = dict.fromkeys(SortOrder, 0), dict.fromkeys(SortOrder, 0.0)
    for camera in panned(source.cameras[number].resized(*SIZE), speed, FRAMES):
        views = {order: View(camera, source.scene, order=order) for order in SortOrder}
        for order, view in views.items():
            changes[order.value].append(measures[order.value].add(CHIP.render(view).image, view.reference))
            seen = seen_by(view, CHIP)
            if order in before:
                found = pops(before[order], seen)
                pairs[order] += found.pops
                share[order] += found.popped
            before[order] = seen
        changes["orders"].append(measures["orders"].add(*(views[order].reference for order in SortOrder)))
    of = {name: summarise(found, FPS) for name, found in changes.items()}

    def both(name: str) -> str:
        summary = of[name]
        assert summary.temporal_psnr_db is not None
        return " / ".join("equal" if math.isinf(db) else f"{db:.1f}" for db in (summary.psnr_db, summary.temporal_psnr_db))

    counts = [f"{pairs[order] / (FRAMES - 1):,.0f}" for order in SortOrder]
    popped = 100 * share[SortOrder.DEPTH] / (FRAMES - 1)
    return [f"{speed:g}", *counts, significant(popped, 2), both("depth"), both("distance"), both("orders")]


def tables(say: Say) -> dict[str, str]:
    heads = [
        "view", "pixels a frame", "pops, depth", "pops, distance", "pixels with pops, depth, %", "chip by depth", "chip by distance",
        "float64 by depth against distance",
    ]
    rows = []
    for title, source, number in _sources(say):
        for speed in SPEEDS:
            say(f"{title}: {speed:g} pixels a frame")
            rows.append([title, *_row(source, number, speed)])
    return {"": markdown.table(heads, rows)}
