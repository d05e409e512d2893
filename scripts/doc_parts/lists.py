"""`make docs PART=lists`: tables of docs/results/lists.md. The demo scene and the real ones, one view each."""

from __future__ import annotations

from functools import partial

import numpy as np

from flicker.chip.frame import prepare
from flicker.chip.line_formats import CHOSEN, FORMATS, PLAIN, fill
from flicker.chip.list_layout import WRITERS, Chain, Keyed, LayoutResult, ListLayout, Replace, evaluate_layout, key_entries, read_cycles, visits, write
from flicker.front.binning import pairs, pixel_boxes
from flicker.front.view import View, load_view
from flicker.golden.front.frame import run_front
from flicker.markdown import table
from flicker.params import TILE
from flicker.pipeline import FrontOptions, packed_for_picture
from flicker.scene.real import REAL_VIEWS

from .common import Say, folder_of_scenes, load, titled_views

_table = partial(table, numbers=True)
_POINTS = ((100, 16), (200, 16))
FLIGHT_OF = "flowers"
_FLIGHTS = (4, 8, 16, 32, 64)
_LATENCIES = (100, 200)
_CHUNKS = (1, 2, 4, 8, 16)

LAYOUTS = (
    ("recommended: 512-byte chunks, newest first", ListLayout()),
    *((f"chunks of {64 * n} bytes", ListLayout(lines=n)) for n in _CHUNKS if n != ListLayout().lines),
    ("chunks growing from 64 to 1,024 bytes, four pools", ListLayout(lines=16, chain=Chain.GROWING, mixed=False)),
    ("forward chain, next chunk reserved", ListLayout(chain=Chain.FORWARD)),
    ("directory, chunks of 64 bytes, four pools", ListLayout(lines=1, chain=Chain.DIRECTORY, mixed=False)),
    ("directory, four pools", ListLayout(chain=Chain.DIRECTORY, mixed=False)),
    ("four pools one after the other", ListLayout(mixed=False)),
    ("lists together, lengths known (bound)", ListLayout(chain=Chain.STREAM, mixed=False)),
    ("two bins by key range", ListLayout(bins=2)),
    ("two bins by quantiles", ListLayout(bins=2, quantiles=True)),
    ("four bins by key range", ListLayout(bins=4)),
    ("four bins by quantiles", ListLayout(bins=4, quantiles=True)),
    ("four bins by quantiles, combiner x 4", ListLayout(bins=4, quantiles=True, ways=16)),
    ("combiner: least recently used", ListLayout(replace=Replace.LRU)),
    ("combiner: fullest goes", ListLayout(replace=Replace.FULLEST)),
    ("combiner: 256 x 1 lines a writer", ListLayout(sets_x=16, sets_y=16, ways=1)),
    ("combiner: 128 x 2", ListLayout(sets_x=16, ways=2)),
    ("combiner: 64 x 2", ListLayout(ways=2)),
    ("combiner: 64 x 8", ListLayout(ways=8)),
    ("combiner: 16 x 4", ListLayout(sets_x=4, sets_y=4)),
)


def _entry_row(title: str, view: View, keyed: Keyed) -> tuple[str, ...]:
    camera, e = view.camera, keyed.entries
    boxes = pairs(pixel_boxes(view.projected.mean, view.projected.radii, TILE, e.cols, e.rows, camera.width, camera.height))
    count = np.bincount(e.tile, minlength=e.cols * e.rows)
    x, y = e.tile % e.cols, e.tile // e.cols
    writers = np.bincount(x % 2 + y % 2 * 2, minlength=WRITERS)
    return (title, f"{boxes:,}", f"{len(e):,}", f"{np.bitwise_count(e.mask).sum():,}", f"{count.mean():.0f}", f"{count.max():,}",
            f"{keyed.needed.sum() / len(e):.0%}",
            f"{writers.max() * WRITERS / len(e) - 1:.1%}")


def _layout_row(title: str, label: str, r: LayoutResult) -> tuple[str, ...]:
    return (title, label, f"{r.fill:.2f}", f"{r.written / 1e6:.2f}", f"{r.pool / 1e6:.2f}", f"{r.write_cycles:,}", f"{r.efficiency:.0%}", f"{r.read / 1e6:.2f}",
            f"{r.skipped / 1e6:.2f}", *(f"{r.once_cycles[p]:,}" for p in _POINTS), f"{r.combiner / 1024:.0f}", f"{r.pointers / 1024:.0f}")


def _flight_rows(keyed: Keyed) -> list[tuple[str, ...]]:
    rows = []
    for lines in _CHUNKS:
        written = write(keyed, ListLayout(lines=lines))
        walk = visits(keyed, written, 1, False)
        for latency in _LATENCIES:
            rows.append((str(64 * lines), str(latency), *(f"{read_cycles(written, walk, latency, n):,}" for n in _FLIGHTS)))
    return rows


SMALL = (320, 178)  # where lists are long


def _format_rows(say: Say) -> list[tuple[str, ...]]:
    """Formats of lines, by the lists that the golden front end leaves."""
    frames = []
    for view in REAL_VIEWS:
        loaded = load(view)
        frames.append((view.title, run_front(packed_for_picture(loaded, FrontOptions())[0], loaded.camera)))
    small = load_view(REAL_VIEWS[0].path(folder_of_scenes()), REAL_VIEWS[0].number, SMALL)
    frames.append((f"{REAL_VIEWS[0].title}, {SMALL[0]}x{SMALL[1]}", run_front(packed_for_picture(small, FrontOptions())[0], small.camera)))
    rows = []
    for title, frame in frames:
        say(f"{title}: formats of lines")
        plain = fill(frame, PLAIN)
        for format_ in FORMATS:
            found = fill(frame, format_)
            name = f"**{format_.name}**" if format_ == CHOSEN else format_.name
            runs = f"{found.run_lines / plain.run_lines:.0%}" if plain.run_lines else "-"
            share = f"{found.lines / plain.lines:.1%}"
            rows.append((title, name, f"{format_.bits}", f"{found.entries / found.lines:.2f}", f"{found.written / 1e6:.2f}", share, runs))
    return rows


def tables(say: Say) -> dict[str, str]:
    """Of every view."""
    entries, layouts, flights = [], [], []
    formats = _format_rows(say)
    for title, view in titled_views(say):
        prepared = prepare(view)
        keyed = key_entries(prepared)
        entries.append(_entry_row(title, prepared.view, keyed))
        for label, layout in LAYOUTS:
            say(f"{title}: {label}")
            layouts.append(_layout_row(title, label, evaluate_layout(keyed, layout, _POINTS, early=False)))
        if title.startswith(FLIGHT_OF):
            flights = _flight_rows(keyed)
    return {
        "entries": _table(("view", "by boxes", "exact", "sub-tiles in masks", "mean list", "longest list", "needed", "busiest writer above mean"), entries),
        "layouts": _table(("view", "layout", "entries a line", "written MB", "pool MB", "write cycles", "efficiency", "read MB, early stop", "never read MB",
                           *(f"read, latency {lat}" for lat, _ in _POINTS), "combiner KB", "pointers KB"), layouts),
        "formats": _table(("view", "format", "bits a line", "entries a line", "written MB", "of the lines of nine", "of lines of runs"), formats),
        "flight": _table(("chunk bytes", "latency", *(f"{n} lists in flight" for n in _FLIGHTS)), flights),
    }
