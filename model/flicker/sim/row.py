"""Frames through the verilated chip back to back, as a host runs them: two under way, each with memory of its own (docs/guide/programming.md).

    with ChipSession(packed, config) as chip:
        for done in back_to_back(chip, cameras):
            done.frame.buffer, done.interval, done.moved
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..chip_registers import ResultError
from ..errors import FlickerError
from ..golden.frame_buffer import PixelFormat
from ..golden.front.frame import ListKind
from ..params import SortOrder
from ..scene.camera import Camera
from .chip import LIMIT, OF_PLACE, ChipFrame, ChipSession, Place
from .driver import CStore
from .half import BEAT

POLL = 20  # cycles between polls of `flk_ready`
MORE = 4  # times as much list memory where it does not suffice
TAGS, CYCLES = 1 << 16, 1 << 32  # that there are: tags of frames, cycles in a stamp


class Opened(NamedTuple):
    """Bursts of the DRAM, rows that were opened for them, and clocks of `Counts.rows` that went to that."""

    bursts: int
    rows: int
    clocks: int


@dataclass(frozen=True, eq=False)
class RowFrame:
    """A frame of a row. number: in the row. moved: bytes of the DRAM, read and written, by purpose. interval: cycles since the frame before it ended; None of
    the first one. spent: clocks of the DRAM's channels since then, or since the row began, by what they went to (`Counts`). rows: of both frames under way in
    that time, by purpose."""

    number: int
    frame: ChipFrame
    moved: dict[str, int]
    interval: int | None
    spent: dict[str, int]
    rows: dict[str, Opened]


def _rows(chip: ChipSession) -> dict[str, np.ndarray]:
    """Until now, of the scene and of both places: bursts, rows opened, clocks of them."""
    found: dict[str, np.ndarray] = {}
    burst = chip.memory.timing.burst_bytes if chip.memory.timing else 1
    for number in (1, 2):
        for name, c in chip.purposes(number).items():
            if number == 1 or name in OF_PLACE:
                bursts = int(c.dram_read_bytes + c.dram_write_bytes) // burst
                found[name] = found.get(name, np.zeros(3, np.int64)) + np.array([bursts, c.rows_opened, c.row_clocks], np.int64)
    return found


class _Counted:
    """What the DRAM moves for the frames at two places. A place has one frame at a time, so its own traffic since the last look is that frame's; what the
    front end reads of the scene is counted by the chip, frame by frame."""

    def __init__(self, chip: ChipSession, places: Sequence[Place]) -> None:
        self.chip, self.table = chip, -(-len(chip.packed.sections()["table"]) // BEAT)
        self.before = {place.number: self._now(place) for place in places}

    def _now(self, place: Place) -> dict[str, int]:
        counts = self.chip.purposes(place.number)
        return {name: int(counts[name].dram_read_bytes + counts[name].dram_write_bytes) for name in OF_PLACE}

    def of(self, frame: ChipFrame, place: Place) -> dict[str, int]:
        before, now = self.before[place.number], self._now(place)
        self.before[place.number] = now
        beats = {"table": self.table} | {name: int(frame.front[f"{name.removesuffix('s')}_beats"]) for name in ("headers", "geometry", "colour")}
        if store := int(frame.front["store_beats"]) + int(frame.front["store_lines"]):
            beats["store"] = store
        return {name: BEAT * count for name, count in beats.items()} | {name: now[name] - before[name] for name in OF_PLACE}


def back_to_back(
    chip: ChipSession, cameras: Sequence[Camera], format_: PixelFormat = PixelFormat.RGB8, *, chunks: int | None = None,
    background: Sequence[int] = (0, 0, 0), lists: ListKind = ListKind.ELLIPSE, order: SortOrder = SortOrder.DEPTH, limit: int = LIMIT,
    store: CStore | None = None,
) -> Iterator[RowFrame]:
    """A frame for each camera, all of one size, each started as soon as the chip takes it: while one is rendered, the front end works on the next.

    The session has no other frames. chunks: of a list writer; None: as many as are expected. Where they do not suffice there are four times as many, and the
    row goes on with the frame before that one, which is not given again: every interval is one of a row. limit: cycles until the next frame ends.
    store: of `ChipSession.store`, colours that frames keep.
    FlickerError, naming the frame, for any other fault.
    """
    given, before, opened = 0, chip.dram_counts().spent, _rows(chip)
    while given < len(cameras):
        first = max(given - 1, 0)
        places = [chip.place(cameras[0], format_, chunks=chunks, number=1 + k) for k in range(2)]
        row = [
            chip.frame(camera, places[k % 2], format_, background=background, lists=lists, order=order, tag=(first + k) % TAGS, store=store)
            for k, camera in enumerate(cameras[first:])
        ]
        counted = _Counted(chip, places)
        ended: int | None = None  # the frame before, in this cycle
        chip.start(row[0])
        for k, (frame, number) in enumerate(zip(row, range(first, len(cameras)))):
            following = row[k + 1] if k + 1 < len(row) else None
            if following is not None:
                while chip.call("flk_ready", ctypes.byref(chip.device)) == "BUSY":
                    chip.step(POLL)
                chip.start(following, frame)
            done = chip.finish(frame, limit)
            if done.error >> ResultError.LIST_MEMORY & 1:
                chunks = MORE * places[0].region.chunks
                if following is not None:  # is under way beside it
                    chip.finish(following, limit)
                break
            if done.error:
                raise FlickerError(f"{chip.name}: frame {number}: {', '.join(done.errors)} (seed {chip.seed})")
            end, moved = done.stamps["rendering_done"], counted.of(done, places[k % 2])
            interval: int | None = None if ended is None else (end - ended) % CYCLES
            ended = end
            now = chip.dram_counts().spent
            spent, before = {name: value - before[name] for name, value in now.items()}, now
            rows_now = _rows(chip)
            rows, opened = {name: Opened(*map(int, value - opened[name])) for name, value in rows_now.items()}, rows_now
            if number == given:
                given += 1
                yield RowFrame(number, done, moved, interval, spent, rows)


def differs(image: np.ndarray, want: np.ndarray) -> str | None:
    """The first pixel in which two pictures in RGB8, float (H, W, 3) in [0, 1], differ, with both values; None: they are equal."""
    ours, theirs = (np.rint(picture * 255.0).astype(np.int64) for picture in (image, want))
    apart = np.argwhere((ours != theirs).any(axis=2))
    if not len(apart):
        return None
    y, x = (int(v) for v in apart[0])
    return f"pixel ({x}, {y}): {tuple(ours[y, x].tolist())}, golden {tuple(theirs[y, x].tolist())}; {len(apart)} pixels differ"
