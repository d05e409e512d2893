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
from ..golden.lists import CHUNK_LINES, POINTER_BYTES, WRITERS, pointer_place
from ..golden.long_lists import RUNS, sort_long
from ..golden.sorting import CAPACITY
from ..golden.walk import tile_walk
from ..params import CORES, TILE
from ..perf.long_lists import merge_cycles
from ..sim.preprocessing import Regions
from .constants import LINE_BYTES
from .dram import READ, WRITE, Stream

BEAT = 64
RECORD_LINE = 32


def tile_lists(frame: FrontFrame, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sorted lists of the walk's T tiles in columns x and rows y: start int64 (T + 1,), record numbers and masks of the entries."""
    picture = -(-frame.camera.width // TILE)
    place = np.empty((y.max() + 1, x.max() + 1), np.int64)
    place[y, x] = np.arange(len(x))
    tile = place[frame.entry_tile // picture, frame.entry_tile % picture]
    number = frame.number[frame.entry_splat]
    order = np.lexsort((number, frame.key[frame.entry_splat], tile))
    start = np.concatenate([[0], np.cumsum(np.bincount(tile, minlength=len(x)))])
    return start.astype(np.int64), number[order].astype(np.int64), frame.entry_mask[order].astype(np.int64)


@dataclass(frozen=True, eq=False)
class TileLists:
    """What lies in memory for the rendering half, whatever renders: lists of the walk's T tiles, in whole pairs, `cols` columns and `rows` rows of them.

    x, y (T,): column and row of each tile. start (T + 1,), record, mask: sorted entries. lines (T,): of each list; of list t, chunks chunk_start[t] to
    chunk_start[t + 1] have chunk_entries entries. A list that a sorting unit does not hold is written back as run_lines[t] lines of runs and comes in batches,
    batch_start[t] and on, of batch_size entries: batch_given: cycles from the first request for runs until all lines of a batch have been given, nothing else
    waiting; batch_lines: lines used up by then. Other lists have one batch, with zeros. addresses: lines of all lists, in the order of the walk. capacity:
    entries of the sorting unit; None: an ideal one, that reads lists once and takes no time.
    """

    frame: FrontFrame
    lists: SubtileLists
    cols: int
    rows: int
    x: np.ndarray
    y: np.ndarray
    start: np.ndarray
    record: np.ndarray
    mask: np.ndarray
    lines: np.ndarray
    addresses: np.ndarray
    chunk_start: np.ndarray
    chunk_entries: np.ndarray
    run_lines: np.ndarray
    batch_start: np.ndarray
    batch_size: np.ndarray
    batch_given: np.ndarray
    batch_lines: np.ndarray
    capacity: int | None
    merge_lines: int
    regions: Regions

    @staticmethod
    def of(frame: FrontFrame, image: FrontImage, capacity: int | None = CAPACITY, merge_lines: int = 2 * RUNS) -> TileLists:
        """capacity: of a sorting unit, entries; None: it is ideal. merge_lines: of the memory that runs are read into. Raises FlickerError for a list of more
        runs than fit."""
        cols, rows = -(-frame.camera.width // PAIR) * (PAIR // TILE), -(-frame.camera.height // TILE)
        x, y = tile_walk(cols // 2, rows)
        start, record, mask = tile_lists(frame, x, y)
        tables = image.lists
        chunks: list[int] = []
        addresses: list[np.ndarray] = []
        chunk_start, lines = [0], np.zeros(rows * cols, np.int64)
        run_lines = np.zeros(rows * cols, np.int64)
        batch_start, sizes, given, used_up = [0], [], [], []
        for t in range(rows * cols):
            length = int(start[t + 1] - start[t])
            if length:
                read = read_tile(tables.memory, tables.pointers, tables.cols, int(x[t]), int(y[t]), tables.chunks)
                lines[t] = len(read.lines)
                addresses += [first + np.arange(count) for first, count in read.requests]
                used = [line.used for line in read.lines]
                first = (len(used) - 1) % CHUNK_LINES + 1  # the newest chunk comes first and is the one that is not full
                chunks += [sum(used[:first])] + [sum(used[at : at + CHUNK_LINES]) for at in range(first, len(used), CHUNK_LINES)]
                if capacity is not None and length > capacity:
                    entries = [entry for line in read.lines for entry in line.unpacked()]
                    long = sort_long(np.array(entries, np.uint64), capacity, merge_lines // 2)
                    cycles = merge_cycles(long, merge_lines)
                    run_lines[t] = long.lines
                    sizes += [len(b.chunk) for b in long.batches]
                    given += (cycles.given - cycles.runs).tolist()
                    used_up += np.cumsum([sum(f.whole for f in b.fed) for b in long.batches]).tolist()
            if not run_lines[t]:
                sizes.append(length)
                given.append(0)
                used_up.append(0)
            chunk_start.append(len(chunks))
            batch_start.append(len(sizes))
        return TileLists(
            frame, whole_pairs(frame.subtile_lists()), cols, rows, x, y, start, record, mask, lines,
            np.concatenate([np.zeros(0, np.int64), *addresses]), np.array(chunk_start), np.array(chunks, np.int64), run_lines, np.array(batch_start),
            np.array(sizes), np.array(given), np.array(used_up), capacity, merge_lines, Regions.of(frame.packed, frame.camera, tables.chunks, frame.kind),
        )

    def by_tile(self, values: np.ndarray) -> np.ndarray:
        """Of sub-tiles, to (T, 4, ...)."""
        parts = np.moveaxis(values.reshape(self.rows, 2, self.cols, 2, *values.shape[1:]), 2, 1)
        return np.ascontiguousarray(parts[self.y, self.x].reshape(len(self.x), CORES, *values.shape[1:]))

    def runs_read(self, batches: np.ndarray) -> np.ndarray:
        """int64 (T,): lines of runs that are read. batches (T,): of each list that are given, one or none where it has no runs."""
        used = np.where(batches > 0, self.batch_lines[self.batch_start[:-1] + np.maximum(batches, 1) - 1], 0)
        return np.minimum(used + self.merge_lines, self.run_lines)

    def traffic(self, batches: np.ndarray, missed: np.ndarray, format_: PixelFormat, stride: int) -> list[Stream]:
        """Bursts by purpose. batches (T,): of each list; missed: lines of records that are read, in order."""
        runs = self.regions.lists + self.regions.chunks * WRITERS * CHUNK_LINES * BEAT
        wide = PAIR * format_.bytes
        base = self.regions.pointers + self.regions.pointer_bytes
        pixels = self.y[::2, None] * TILE + np.arange(TILE)  # rows of a pair's
        place = base + pixels * stride + self.x[::2, None] // 2 * wide
        picture = -(-self.frame.camera.width // TILE)
        pointer = np.asarray(pointer_place(np.minimum(self.x, picture - 1) + picture * self.y, picture))
        pointers = (self.regions.pointers + POINTER_BYTES * pointer) // LINE_BYTES
        return [
            Stream("pointers", pointers, np.full(len(pointers), READ, np.int8), LINE_BYTES * len(self.x)),
            Stream.ranges("lists", self.regions.lists + BEAT * self.addresses, np.full(len(self.addresses), BEAT), READ),
            *(Stream.ranges("lists", np.full(len(n), runs), BEAT * n, kind) for n, kind in ((self.run_lines, WRITE), (self.runs_read(batches), READ))),
            Stream.ranges("records", self.regions.records + RECORD_LINE * missed, np.full(len(missed), RECORD_LINE), READ),
            Stream.ranges("frame", place.ravel(), np.full(place.size, wide), WRITE),
        ]
