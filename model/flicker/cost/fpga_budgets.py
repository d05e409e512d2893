"""Budgets of chips on UltraScale+, by unit and in all (fpga_budgets.toml)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from .fpga import Resources

BUDGETS = Path(__file__).with_suffix(".toml")
BUDGETED = 1_000  # LUTs, with memories, from which on a unit has a budget


def over_budget(chip: str, units: Mapping[str, tuple[int, Resources]], all_: Resources) -> list[str]:
    """What is above the budgets of a chip, or has none though it should: a line each. units: as of `Fpga.by_unit`. Of a chip without budgets: none."""
    most = tomllib.loads(BUDGETS.read_text()).get(chip)
    if most is None:
        return []
    lines = []
    for name, own in [("all", all_), *((module, own) for module, (_, own) in units.items())]:
        found = {"lut": own.lut + own.lutram, "dsp": own.dsp, "bram": own.bram}
        if name in most:
            lines += [f"{name}: {found[what]:,g} {what}, budget {limit:,g}" for what, limit in most[name].items() if found[what] > limit]
        elif found["lut"] >= BUDGETED:
            lines.append(f"{name}: {found['lut']:,} lut, no budget ({BUDGETS.name})")
    return lines
