"""Reading of tile lists, bit for bit: what `flk_list_reader` gives for a tile, and the bytes it reads for it (docs/reference/list_reader.md).

A list is read from its newest chunk to its oldest, the lines of a chunk in ascending order; each line is an element with its entries as they lie there.
The last element is marked; an empty list is one element without entries. A list that breaks the layout ends before the line with the fault.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .lists import (
    CHUNK_LINES,
    COUNT_BITS,
    HEADER_AT,
    LINE_BYTES,
    LINE_ENTRIES,
    LINK_BITS,
    POINTERS_PER_LINE,
    SHORT_ENTRIES,
    TAIL_AT,
    WRITERS,
    line_entries,
    pointer_place,
)

CHUNK_BYTES = CHUNK_LINES * LINE_BYTES


class Line(NamedTuple):
    """An element: the line's bits without its header, how many entries it has, last of its list."""

    entries: int
    used: int
    last: bool

    def unpacked(self) -> list[int]:
        """Its entries in the order of reading."""
        return line_entries(self.entries, self.used) if self.used else []


@dataclass(frozen=True)
class ReadTile:
    """lines: elements. requests: first line and number of lines of each read of the lists' memory, in order; with a fault, those up to it. fault: the list, or
    the memory, has one."""

    lines: tuple[Line, ...]
    requests: tuple[tuple[int, int], ...]
    fault: bool


def pointer_line(x: int, y: int, cols: int) -> int:
    """Line of the pointer table that has a tile's pointer."""
    return int(pointer_place(x + cols * y, cols)) // POINTERS_PER_LINE


def read_tile(
    memory: np.ndarray, pointers: np.ndarray, cols: int, x: int, y: int, chunks: int,
    fails: Callable[[int], bool] = lambda line: False, pointer_fails: Callable[[int], bool] = lambda line: False,
) -> ReadTile:
    """The list of the tile in column x, row y.

    memory: uint64 (lines, 8), pointers: uint32, as in `ListImage`; chunks: of each writer. fails, pointer_fails: whether the memory answers a line of the
    lists, of the pointer table, with an error. Faults are all that `read_lists` refuses, but a chunk that belongs to two lists; instead a chain has to go to
    lower numbers, as writers make it, so that it ends.
    """
    nothing = Line(0, 0, True)
    pointer = int(pointers[int(pointer_place(x + cols * y, cols))])
    chunk, used = pointer & (1 << LINK_BITS) - 1, pointer >> LINK_BITS
    if pointer_fails(pointer_line(x, y, cols)):
        return ReadTile((nothing,), (), True)
    if pointer == 0:
        return ReadTile((nothing,), (), False)
    fault = not 1 <= used <= CHUNK_LINES or chunk >= chunks
    writer = x & 1 | (y & 1) << 1
    lines: list[Line] = []
    requests: list[tuple[int, int]] = []
    more = not fault
    while more:
        first = (chunk * WRITERS + writer) * CHUNK_LINES
        requests.append((first, used))
        more = False
        for k in range(used):
            word = int.from_bytes(memory[first + k].tobytes(), "little")
            header = word >> HEADER_AT
            count, link = header & (1 << COUNT_BITS) - 1, header >> COUNT_BITS & (1 << LINK_BITS) - 1
            linked, rest = header >> COUNT_BITS + LINK_BITS & 1, header >> COUNT_BITS + LINK_BITS + 1
            wrong = rest != 0 or (linked and link >= chunk if k == 0 else link or linked)
            wrong = wrong or (count <= LINE_ENTRIES and word >> TAIL_AT & (1 << HEADER_AT - TAIL_AT) - 1 != 0)
            if fails(first + k) or not 1 <= count <= SHORT_ENTRIES or wrong:
                fault, more = True, False
                break
            lines.append(Line(word & (1 << HEADER_AT) - 1, count, False))
            if k == 0 and linked:
                more, following = True, link
        if more:
            chunk, used = following, CHUNK_LINES
    if not lines:
        return ReadTile((nothing,), tuple(requests), fault)
    return ReadTile((*lines[:-1], lines[-1]._replace(last=True)), tuple(requests), fault)
