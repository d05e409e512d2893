"""What lies in memory for the rendering half: tile lists in the order in which they are read, and the bursts of the DRAM that a frame takes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..front.records import SubtileLists
from ..golden.chip import whole_pairs
from ..golden.frame_buffer import PAIR, PixelFormat
from ..golden.front.frame import FrontFrame
from ..golden.front.memory import FrontImage
from ..golden.list_reader import read_tile
from ..golden.lists import CHUNK_LINES, ENTRY_BITS, POINTERS_PER_LINE, pointer_place
from ..golden.sorting import CAPACITY, sort_list
from ..params import CORES, TILE
from ..sim.preprocessing import Regions
from .constants import LINE_BYTES
from .dram import READ, WRITE, Stream

BEAT = 64
RECORD_LINE = 32


def tile_lists(frame: FrontFrame, cols: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sorted lists of the walk's tiles, `cols` in a row: start int64 (T + 1,), record numbers and masks of the entries."""
    picture = -(-frame.camera.width // TILE)
    tile = frame.entry_tile // picture * cols + frame.entry_tile % picture
    number = frame.number[frame.entry_splat]
    order = np.lexsort((number, frame.key[frame.entry_splat], tile))
    rows = -(-frame.camera.height // TILE)
    start = np.concatenate([[0], np.cumsum(np.bincount(tile, minlength=cols * rows))])
    return start.astype(np.int64), number[order].astype(np.int64), frame.entry_mask[order].astype(np.int64)


@dataclass(frozen=True, eq=False)
class TileLists:
    """What lies in memory for the rendering half, whatever renders: lists of the walk's T tiles, `cols` in a row, in whole pairs.

    start (T + 1,), record, mask: sorted entries. lines (T,): of each list; of list t, chunks chunk_start[t] to chunk_start[t + 1] have chunk_entries entries,
    and readings reading_start[t] and on take reading_size entries after reading_cuts cuts. addresses: lines of all lists, in the order of the walk.
    """

    frame: FrontFrame
    lists: SubtileLists
    cols: int
    rows: int
    start: np.ndarray
    record: np.ndarray
    mask: np.ndarray
    lines: np.ndarray
    addresses: np.ndarray
    chunk_start: np.ndarray
    chunk_entries: np.ndarray
    reading_start: np.ndarray
    reading_size: np.ndarray
    reading_cuts: np.ndarray
    regions: Regions

    @staticmethod
    def of(frame: FrontFrame, image: FrontImage) -> TileLists:
        cols, rows = -(-frame.camera.width // PAIR) * (PAIR // TILE), -(-frame.camera.height // TILE)
        start, record, mask = tile_lists(frame, cols)
        tables = image.lists
        chunks: list[int] = []
        addresses: list[np.ndarray] = []
        chunk_start, lines = [0], np.zeros(rows * cols, np.int64)
        reading_start, sizes, cuts = [0], [], []
        for t in range(rows * cols):
            length = int(start[t + 1] - start[t])
            if length:
                read = read_tile(tables.memory, tables.pointers, tables.cols, t % cols, t // cols, tables.chunks)
                lines[t] = len(read.lines)
                addresses += [first + np.arange(count) for first, count in read.requests]
                used = [line.used for line in read.lines]
                first = (len(used) - 1) % CHUNK_LINES + 1  # the newest chunk comes first and is the one that is not full
                chunks += [sum(used[:first])] + [sum(used[at : at + CHUNK_LINES]) for at in range(first, len(used), CHUNK_LINES)]
                if length > CAPACITY:
                    entries = [line.entries >> ENTRY_BITS * k & (1 << ENTRY_BITS) - 1 for line in read.lines for k in range(line.used)]
                    found = sort_list(np.array(entries, np.uint64)).readings
                    sizes += [len(r.gathered) for r in found]
                    cuts += [len(r.limits) for r in found]
                else:
                    sizes.append(length)
                    cuts.append(0)
            else:
                sizes.append(0)
                cuts.append(0)
            chunk_start.append(len(chunks))
            reading_start.append(len(sizes))
        return TileLists(
            frame, whole_pairs(frame.subtile_lists()), cols, rows, start, record, mask, lines,
            np.concatenate([np.zeros(0, np.int64), *addresses]), np.array(chunk_start), np.array(chunks, np.int64), np.array(reading_start), np.array(sizes),
            np.array(cuts), Regions.of(frame.packed, frame.camera, tables.chunks, frame.kind),
        )

    def by_tile(self, values: np.ndarray) -> np.ndarray:
        """Of sub-tiles, to (T, 4, ...)."""
        parts = values.reshape(self.rows, 2, self.cols, 2, *values.shape[1:])
        return np.ascontiguousarray(np.moveaxis(parts, 2, 1).reshape(self.rows * self.cols, CORES, *values.shape[1:]))

    def traffic(self, readings: np.ndarray, missed: np.ndarray, format_: PixelFormat, stride: int) -> list[Stream]:
        """Bursts by purpose. readings (T,): of each list; missed: lines of records that are read, in order."""
        ends = np.cumsum(self.lines)
        first = np.repeat(ends - self.lines, readings)
        count = np.repeat(self.lines, readings)
        line = self.addresses[np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())]
        cols = self.cols // 2
        wide = PAIR * format_.bytes
        pairs = np.repeat(np.arange(self.rows) * TILE, cols)[:, None] + np.arange(TILE)  # rows of pixels
        base = self.regions.pointers + self.regions.pointer_bytes
        place = base + pairs * stride + np.tile(np.arange(cols), self.rows)[:, None] * wide
        picture = -(-self.frame.camera.width // TILE)
        t = np.arange(self.rows * self.cols)
        pointer = np.asarray(pointer_place(np.minimum(t % self.cols, picture - 1) + picture * (t // self.cols), picture)) // POINTERS_PER_LINE
        step = BEAT // LINE_BYTES
        pointers = ((self.regions.pointers // LINE_BYTES + step * pointer)[:, None] + np.arange(step)).ravel()
        return [
            Stream("pointers", pointers, np.full(len(pointers), READ, np.int8), BEAT * len(t)),
            Stream.ranges("lists", self.regions.lists + BEAT * line, np.full(len(line), BEAT), READ),
            Stream.ranges("records", self.regions.records + RECORD_LINE * missed, np.full(len(missed), RECORD_LINE), READ),
            Stream.ranges("frame", place.ravel(), np.full(place.size, wide), WRITE),
        ]
