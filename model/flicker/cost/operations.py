"""Hardware operations of a mask generator, by kind and format, so that area and energy can be computed from synthesised parts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum


class Op(str, Enum):
    """Kinds of operation."""

    MUL = "mul"  # multiplication
    ADD = "add"  # addition or subtraction
    CMP = "cmp"  # comparison of magnitude
    TABLE = "table"  # look-up in a constant table; format = address bits -> data bits
    SHIFT = "shift"  # barrel shift, conversion between formats
    LOG = "log"  # log(255 o)


@dataclass(frozen=True)
class Operation:
    """`count` operations of one kind and format for every element; `sqr`: the multiplication is a square."""

    op: Op
    format: str
    count: int
    sqr: bool = False
    note: str = ""


@dataclass(frozen=True)
class Operations:
    """Operations per element of one mask generator at full rate (one element per `cycles` cycles).

    record_bits: bits the splat record needs beyond `flk_pkg::splat_t`. preprocessing: operations per Gaussian, not per element.
    """

    per_element: tuple[Operation, ...] = ()
    cycles: int = 1
    record_bits: int = 0
    preprocessing: tuple[Operation, ...] = ()

    def count(self, op: Op) -> int:
        """Operations of a kind per element."""
        return sum(o.count for o in self.per_element if o.op == op)

    def rows(self) -> Iterable[dict[str, str | int]]:
        """One dictionary per operation, for tables."""
        for place, operations in (("element", self.per_element), ("Gaussian", self.preprocessing)):
            for o in operations:
                yield {"per": place, "op": o.op.value, "format": o.format, "count": o.count, "square": o.sqr, "note": o.note}


NONE = Operations()
