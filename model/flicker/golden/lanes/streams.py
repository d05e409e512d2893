"""What the cores of the lanes take: sorted lists of records, each of the sub-tiles of one tile that a core has (rtl/flk_lane_stage.sv).

Sub-tile s of a tile, in column s % 2 and row s / 2, is of core s % cores: a core of four has one sub-tile of each tile, one of two has those of a column, the
only one has all. A record that several of them see is an element for each, one behind the other; one token ends the list of all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ...params import CORES
from ..render import Streamed, stream_order


@dataclass(frozen=True, eq=False)
class CoreStreams:
    """Lists of cores. Sub-tiles are numbered row by row in a grid of whole tiles; of four cores in the picture's own grid.

    cols, rows: of the grid. subtile: int64 (L, 4 / cores), sub-tiles of each list. order, core_start: lists core by core, start of each core's part.
    start: int64 (L + 1,) of each list in element. element, member: int64 (E,), which element of the sub-tiles' lists, and which sub-tile of the list it is for.
    """

    cols: int
    rows: int
    subtile: np.ndarray
    order: np.ndarray
    core_start: np.ndarray
    start: np.ndarray
    element: np.ndarray
    member: np.ndarray


def whole_tiles(cols: int, rows: int) -> tuple[int, int, np.ndarray]:
    """Columns and rows of the least grid of whole tiles, and the numbers that the sub-tiles of a grid have there, int64 (cols * rows,)."""
    across, down = cols + cols % 2, rows + rows % 2
    return across, down, (np.arange(rows)[:, None] * across + np.arange(cols)).ravel()


@numba.njit(cache=True)
def _merge(subtile, subtile_start, entry, start, element, member, place):
    """Lists of a tile's sub-tiles in one order that is in all of them: of the sub-tiles the lowest whose next record no other one sees later than its
    next, and where there is none, since they are not sorted by the same, the lowest. place: of scratch, (records, sub-tiles), all -1."""
    count = subtile.shape[1]
    at, end = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for l in range(len(subtile)):
        for m in range(count):
            at[m], end[m] = subtile_start[subtile[l, m]], subtile_start[subtile[l, m] + 1]
            for n in range(at[m], end[m]):
                place[entry[n], m] = n
        n_out = start[l]
        while n_out < start[l + 1]:
            chosen = -1
            for m in range(count):
                if at[m] == end[m]:
                    continue
                ready = True
                for o in range(count):
                    ready &= place[entry[at[m]], o] <= at[o]
                if ready or chosen < 0:
                    chosen = m
                if ready:
                    break
            record = entry[at[chosen]]
            for m in range(count):
                if at[m] < end[m] and entry[at[m]] == record:
                    element[n_out], member[n_out] = at[m], m
                    at[m] += 1
                    n_out += 1
        for m in range(count):
            for n in range(subtile_start[subtile[l, m]], end[m]):
                place[entry[n], m] = -1


def core_streams(lists: Streamed, entry: np.ndarray, cores: int = CORES, empty: bool = True) -> CoreStreams:
    """Streams of sub-tile lists, tiles row by row. entry: int (E,), record of each element. empty: with lists that are empty."""
    start = np.asarray(lists.start, np.int64)
    if cores == CORES:
        order, core_start = stream_order(lists, empty)
        return CoreStreams(
            lists.cols, lists.rows, np.arange(len(start) - 1)[:, None], order, core_start, start, np.arange(start[-1]), np.zeros(start[-1], np.int64),
        )
    cols, rows, number = whole_tiles(lists.cols, lists.rows)
    length = np.zeros(cols * rows, np.int64)
    length[number] = np.diff(start)
    grid = np.arange(cols * rows).reshape(rows, cols)
    parts = [np.stack([grid[s // 2 :: 2, s % 2 :: 2].ravel() for s in range(k, CORES, cores)], axis=1) for k in range(cores)]
    subtile = np.concatenate(parts)
    own = np.split(np.arange(len(subtile)), cores)
    sizes = length[subtile].sum(axis=1)
    if not empty:
        own = [part[sizes[part] > 0] for part in own]
    list_start = np.concatenate([[0], np.cumsum(sizes)])
    element, member = np.zeros((2, len(entry)), np.int64)
    place = np.full((int(np.max(entry, initial=-1)) + 1, subtile.shape[1]), -1, np.int64)
    _merge(subtile, np.concatenate([[0], np.cumsum(length)]), np.asarray(entry, np.int64), list_start, element, member, place)
    return CoreStreams(cols, rows, subtile, np.concatenate(own), np.cumsum([0] + [len(part) for part in own]), list_start, element, member)
