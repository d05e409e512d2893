"""`make docs PART=chip_hardware`: frames of the verilated chip beside the chip model's halves, in docs/results/chip.md.

With SLOW=1 flowers at 1280x720 too, with both kinds of refresh. An error: a frame buffer that differs from the golden model's; cycles of a
frame that are more than 10 % off.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from flicker.chip.dram import DramConfig, Refresh
from flicker.chip.tile_lists import TileLists
from flicker.chip.whole import WholeFrame, first_half, whole_frame
from flicker.chip_counters import FRONT, RENDERING
from flicker.errors import FlickerError
from flicker.front.view import DEMO, View, load_view
from flicker.golden.chip import render_chip
from flicker.golden.front.frame import ListKind, run_front
from flicker.golden.front.record import RecordKind
from flicker.golden.lanes.lists import front_lists
from flicker.markdown import table
from flicker.params import FAITHFUL, RenderConfig
from flicker.pipeline import packed_scene
from flicker.scene.camera import Camera
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS
from flicker.sim.chip import ChipFrame, ChipSession, build
from flicker.sim.half import MemoryOptions
from flicker.sim.row import RowFrame, back_to_back

from .common import Say, folder_of_scenes

SIZE = (640, 360)
VIEWS = ("guitar", "stpeter")
LIMIT = 0.1
CHUNKS = 8000  # of a list writer: enough for these views
FLOWERS_CHUNKS = 24_000  # of that view whole
# By name: the configuration, what the scene is packed in, and its lists (`flicker render`'s defaults, and with --faithful).
BUILDS = {
    "default": (RenderConfig(), PackedFormat.CHUNK, ListKind.ELLIPSE),
    "faithful": (FAITHFUL, PackedFormat.FP16, ListKind.BOX),
}
PURPOSES = ("table", "headers", "geometry", "colour", "records", "lists", "pointers", "frame")


def four_frames(chip: ChipSession, camera: Camera, chunks: int = CHUNKS, lists: ListKind = ListKind.ELLIPSE) -> list[RowFrame]:
    """Of one view, back to back: while the last but one is rendered the front end works on the last, as in a longer row of frames. chunks: of a list writer."""
    return list(back_to_back(chip, [camera] * 4, chunks=chunks, lists=lists))


def _places() -> list[tuple[str, str | Path, int, tuple[int, int] | None, int, str, Refresh]]:
    """Title, scene, view, size, chunks of a list writer, build, the memory's refresh."""
    at = [(f"{DEMO} 0", DEMO, 0), *((v.title, v.path(folder_of_scenes()), v.number) for v in REAL_VIEWS if v.folder in VIEWS)]
    flowers = next(v for v in REAL_VIEWS if v.folder == "flowers")
    whole = (f"{flowers.title}, 1280x720", flowers.path(folder_of_scenes()), flowers.number, None, FLOWERS_CHUNKS, "default")
    return [
        *((*place, SIZE, CHUNKS, name, Refresh.ALL_BANKS) for name, place in product(BUILDS, at)),
        *((*whole, refresh) for refresh in (Refresh.ALL_BANKS, Refresh.PER_BANK) if os.environ.get("SLOW") == "1"),
    ]


@dataclass(frozen=True, eq=False)
class Measured:
    """A view in the verilated chip and in the model. alone, done: a frame alone and four back to back; simulated: cycles of the first, seconds: of the
    processor; moved: bytes of the DRAM by purpose. spent: shares of its clocks between the second frame and the third, by what they went to."""

    model: WholeFrame
    lists: TileLists
    alone: ChipFrame
    done: list[ChipFrame]
    moved: dict[str, int]
    simulated: int
    seconds: float
    spent: dict[str, float]

    @property
    def halves(self) -> tuple[int, int]:
        """Cycles of the front end and of the rendering half of the frame alone."""
        stamps = self.alone.stamps
        return stamps["front_done"] - stamps["taken"], stamps["rendering_done"] - stamps["rendering_start"]

    @property
    def cycles(self) -> int:
        """Of the frame alone."""
        return self.alone.stamps["rendering_done"] - self.alone.stamps["taken"]

    @property
    def interval(self) -> int:
        """Cycles from frame to frame, as in a longer row: from the second to the third."""
        return self.done[2].stamps["rendering_done"] - self.done[1].stamps["rendering_done"]

    @property
    def off(self) -> list[float]:
        """By how much the model is off: front end, rendering, frame, interval."""
        model = (self.model.front.cycles, self.model.back.cycles, self.model.latency, self.model.interval)
        return [ours / rtl - 1 for ours, rtl in zip(model, (*self.halves, self.cycles, self.interval))]


def measure(
    say: Say, title: str, view: View, config: RenderConfig, format_: PackedFormat, lists: ListKind, chunks: int, dram: DramConfig,
) -> Measured:
    """Raises FlickerError where a picture differs from the golden model's or the model's cycles of a frame or its bytes are more than `LIMIT` off."""
    camera = view.camera
    say(f"{title}: building the simulator")
    build(config)
    packed = packed_scene(view, format_)
    front = run_front(packed, camera, lists, RecordKind.of(config.form))
    golden = render_chip(front_lists(front) if config.by_lanes else front.subtile_lists(), config)
    first, lists_there = first_half(front, config, dram)
    # Which lines of records are read again depends on timing, and whether a list that is read again is left before that.
    loose = {"records"} | ({"lists"} if lists_there.run_lines.any() else set())
    model = whole_frame(first, lists_there, config, dram)
    say(f"{title}: alone")
    with ChipSession(packed, config, memory=MemoryOptions(dram.timing)) as chip:
        begin = time.process_time()
        alone = chip.render(camera, lists=lists)
        seconds = time.process_time() - begin
        simulated = chip.usage().live["cycles"]
    assert alone.usage is not None
    moved = {name: sum(both) for name, both in alone.usage.traffic.items()}
    for purpose, due in model.bytes.items():
        if abs(due / moved[purpose] - 1) > (LIMIT if purpose in loose else 0.0):
            raise FlickerError(f"{title}: {purpose}: the chip moves {moved[purpose]:,} bytes, the chip model {due:,}")
    say(f"{title}: four frames back to back")
    with ChipSession(packed, config, memory=MemoryOptions(dram.timing)) as chip:
        row = four_frames(chip, camera, chunks, lists)
    done, spent = [frame.frame for frame in row], row[2].spent
    for frame in (alone, *done):
        if frame.error or not np.array_equal(frame.buffer, golden.buffer):
            raise FlickerError(f"{title}: the picture differs from the golden model's")
    found = Measured(model, lists_there, alone, done, moved, simulated, seconds, {name: clocks / sum(spent.values()) for name, clocks in spent.items()})
    if abs(found.off[2]) > LIMIT:
        raise FlickerError(f"{title}: the chip model's cycles are {found.off[2]:+.1%} off")
    return found


def tables(say: Say) -> dict[str, str]:
    rows, traffic = [], []
    waits: dict[str, list[str]] = {}
    for place, path, number, size, chunks, name, refresh in _places():
        config, format_, lists = BUILDS[name]
        title = f"{place}, {name}" + ("" if refresh == Refresh.ALL_BANKS else f", refresh {refresh}")
        found = measure(say, title, load_view(path, number, size), config, format_, lists, chunks, DramConfig(refresh=refresh))
        alone, halves, off, moved = found.alone, found.halves, found.off, found.moved
        rows.append((
            title, f"{halves[0]:,}", f"{off[0]:+.1%}", f"{halves[1]:,}", f"{off[1]:+.1%}", f"{found.cycles:,}", f"{off[2]:+.1%}", f"{found.interval:,}",
            f"{off[3]:+.1%}", f"{found.interval / max(halves):.2f}", found.model.bottleneck, f"{found.simulated / found.seconds:,.0f}",
        ))
        waits[title] = [
            f"{int(values[counter.name]) / (half * counter.units):.1%}"
            for counters, values, half in ((FRONT, alone.front, halves[0]), (RENDERING, alone.rendering, halves[1])) for counter in counters if counter.stall
        ]
        lines = found.model.bytes["records"] / moved["records"] - 1
        traffic.append((title, *(f"{moved[name] / 1e6:.2f}" for name in PURPOSES), f"{sum(moved.values()) / 1e6:.2f}", f"{lines:+.1%}"))
    return {
        "cycles": table(
            ["view", "front end, cycles", "model off by", "rendering, cycles", "model off by", "frame, cycles", "model off by", "interval back to back",
             "model off by", "of the slower half alone", "what the model says it waits for", "simulated cycles a second of processor time"], rows,
        ),
        "waits": table(["what waits", *waits], list(zip([counter.stall for counter in (*FRONT, *RENDERING) if counter.stall], *waits.values()))),
        "traffic": table(["view, MB of the DRAM", *PURPOSES, "all", "records' model off by"], traffic),
    }
