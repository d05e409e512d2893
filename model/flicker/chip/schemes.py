"""Schemes that make the sorted sub-tile lists.

Input are the visible Gaussians in the order of memory (`collect`): depth key, box of sub-tiles, record number. Every
scheme ends with the same lists as `front.records.build_lists` (equal depths in the order of memory); what differs is
on the way there.

Grain, what one list stands for: a sub-tile; a tile, whose records are broadcast to the four cores with a 4-bit mask;
a group of 2x2 or 4x4 tiles, whose list is sorted once and filtered per tile by a bit mask (GS-TG). Method, how a list
comes to lie in DRAM:

- counting: a first pass counts the entries of each list, a second writes them where they belong. Entries of a list
  lie together, writes scatter.
- linked: one pass; a full chunk of 64 bytes goes to the next free place and carries the number of the chunk before
  it. Writes are one stream, reads follow the chain from the newest chunk back.
- global: all records are sorted by depth first, far to near, then linked: chains are read near to far and need no
  further sort.

A small write-combining buffer (sets x ways lines, least recently used) collects entries before they are written.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from ..errors import FlickerError
from . import constants as c


class Grain(IntEnum):
    """Sub-tiles along a side of the square that a list stands for."""

    SUBTILE = 1
    TILE = 2
    GROUP32 = 4
    GROUP64 = 8


class Method(str, Enum):
    """How lists are built."""

    COUNTING = "counting"
    LINKED = "linked"
    GLOBAL = "global"


@dataclass(frozen=True)
class Scheme:
    """A way to build and sort the lists. record_cache_bytes: 0 for none.

    key_bits: 32, the depth as it is, or fewer for fixed point between the nearest and the farthest depth of the frame; then the lists
    may differ in the order of entries that such keys cannot tell apart.
    """

    method: Method
    grain: Grain
    record_cache_bytes: int = c.RECORD_CACHE_BYTES
    combiner_sets: int = c.COMBINER_SETS
    combiner_ways: int = c.COMBINER_WAYS
    sort_capacity: int = c.SORT_CAPACITY
    key_bits: int = c.KEY_BITS

    def __post_init__(self) -> None:
        for name in ("combiner_sets", "combiner_ways"):
            if getattr(self, name) < 1:
                raise FlickerError(f"lists: {name} must be at least 1, not {getattr(self, name)}")
        if not 1 <= self.key_bits <= c.KEY_BITS:
            raise FlickerError(f"lists: key_bits must be 1 to {c.KEY_BITS}, not {self.key_bits}")
        if self.record_cache_bytes and self.record_cache_bytes < c.RECORD_BYTES * c.RECORD_CACHE_WAYS:
            raise FlickerError(f"lists: record_cache_bytes must be 0 or at least {c.RECORD_BYTES * c.RECORD_CACHE_WAYS}")

    @property
    def name(self) -> str:
        return f"{self.method.value}-{self.grain.name.lower()}"

    @property
    def mask_bits(self) -> int:
        return 0 if self.grain == Grain.SUBTILE else int(self.grain) ** 2

    @property
    def entry_bits(self) -> int:
        key = 0 if self.method is Method.GLOBAL else self.key_bits
        return key + c.ID_BITS + self.mask_bits

    @property
    def per_line(self) -> int:
        """Entries of a burst in the lists of the counting method."""
        return c.LINE_BYTES * 8 // self.entry_bits

    @property
    def per_chunk(self) -> int:
        """Entries of a linked chunk."""
        return (c.CHUNK_BYTES * 8 - c.CHUNK_LINK_BITS) // self.entry_bits


SCHEMES = {s.name: s for s in (
    Scheme(Method.COUNTING, Grain.SUBTILE),
    Scheme(Method.LINKED, Grain.SUBTILE),
    Scheme(Method.COUNTING, Grain.TILE),
    Scheme(Method.LINKED, Grain.TILE),
    Scheme(Method.GLOBAL, Grain.TILE),
    Scheme(Method.LINKED, Grain.GROUP32),
    Scheme(Method.LINKED, Grain.GROUP64),
)}
RECOMMENDED = "linked-tile"
