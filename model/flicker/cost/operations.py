"""Hardware operations of a mask generator, by kind and format, so that area and energy can be computed from synthesised parts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from ..params import FIXED_FRAC_BITS, FIXED_INT_BITS, CatMode, Form, Precision, RenderConfig


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


def ctu_operations(config: RenderConfig) -> Operations:
    """Of a CTU: two PRTUs, one pixel rectangle of four leaders each per cycle."""
    if config.cat == CatMode.OFF:
        return Operations()
    fmt = "FP16" if config.precision == Precision.FP16 else "E4M3"
    difference = {
        Precision.FP8: "E4M3", Precision.FIXED: f"fixed {FIXED_INT_BITS + FIXED_FRAC_BITS + 2}",
    }.get(config.precision, "FP16")
    if config.form == Form.CONIC:  # per rectangle: xx, yy, sx, sy twice each, xy, t four times, h and E four times
        operations = [Operation(Op.MUL, fmt, 2 * 12), Operation(Op.MUL, fmt, 2 * 4, sqr=True), Operation(Op.ADD, fmt, 2 * 8)]
    else:  # per rectangle: p, q, v and vv twice each, u four times, uu four times, E four times
        operations = [Operation(Op.MUL, fmt, 2 * 6), Operation(Op.MUL, fmt, 2 * 6, sqr=True), Operation(Op.ADD, fmt, 2 * 8)]
    operations += [Operation(Op.ADD, difference, 2 * 4), Operation(Op.CMP, fmt, 2 * 4), Operation(Op.LOG, fmt, 1)]
    if config.precision == Precision.FIXED:
        operations.append(Operation(Op.SHIFT, f"FP16 -> q{FIXED_INT_BITS}.{FIXED_FRAC_BITS}", 2 * 2, note="means"))
    if config.precision in (Precision.MIXED, Precision.FIXED):
        operations.append(Operation(Op.SHIFT, "FP16 -> E4M3", 2 * 7, note="conversion"))
    elif config.precision == Precision.FP8:
        operations.append(Operation(Op.SHIFT, "FP16 -> E4M3", 2 * 5, note="conversion"))
    return Operations(tuple(operations))
