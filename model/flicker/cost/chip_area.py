"""Square millimetres of the chip by component, beside the paper's Table 2a: estimates from synthesised gates and memory (docs/reference/synthesis.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

Unit = tuple[str, str]  # unit and configuration, as in areas.csv

# 28 nm from gate equivalents: a NAND2 of about 0.5 um2 (9-track cells, 0.9 um x 0.56 um), no allowance for routing.
UM2_PER_GE = 0.5
# SRAM: a 6T bit cell of 0.127 um2, half of a macro being bit cells.
UM2_PER_BIT = 0.127 / 0.5

PREPROCESSING, SORTING, TEST, CORES, OTHERS = (
    "Preprocessing core x4", "Sorting unit x4", "Contribution test unit x4", "Rendering core x4", "Feature buffer and others (288 KB)",
)
PAPER_MM2 = {PREPROCESSING: 0.76, SORTING: 0.16, TEST: 0.09, CORES: 0.96, OTHERS: 1.50}

# By chip: the units that components are, four of each. Others are what else the whole chip (`top`) has.
CHIPS: dict[str, dict[str, Unit]] = {
    "faithful": {
        PREPROCESSING: ("preprocessing_core", "conic"), SORTING: ("list_sorter", "default"), TEST: ("ctu", "faithful"), CORES: ("rendering_core", "conic"),
    },
    "default": {
        PREPROCESSING: ("preprocessing_core", "default"), SORTING: ("list_sorter", "default"), TEST: ("ctu", "factored fixed"),
        CORES: ("rendering_core", "factored"),
    },
}


def components(chip: str, size: Callable[[Unit], tuple[float, int]]) -> dict[str, tuple[float, int]]:
    """GE and bits of SRAM by component of `PAPER_MM2`; in sum the whole chip. size: of a synthesised unit (`area.in_table`).
    """
    found = {name: (4 * ge, 4 * bits) for name, (ge, bits) in ((name, size(unit)) for name, unit in CHIPS[chip].items())}
    ge, bits = size(("top", chip))
    return found | {OTHERS: (ge - sum(part[0] for part in found.values()), bits - sum(part[1] for part in found.values()))}


def square_millimetres(ge: float, bits: int = 0) -> float:
    """Of logic and SRAM."""
    return (ge * UM2_PER_GE + bits * UM2_PER_BIT) / 1e6


def in_all(parts: Mapping[str, tuple[float, int]]) -> float:
    """Square millimetres of all components."""
    return sum(square_millimetres(*part) for part in parts.values())
