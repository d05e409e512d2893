"""Registers of the ff units (their latency) with which no path is longer than 60 FO4 (docs/reference/ff.md), by mantissa bits of the tables' groups."""

from __future__ import annotations

from .ff_tables import GROUPS

STAGES = {
    "flk_ff_add": {11: 2, 15: 3, 19: 3, 23: 3},
    "flk_ff_mul": {11: 2, 15: 3, 19: 3, 23: 4},
    "flk_ff_recip": {11: 2, 15: 2, 19: 3, 23: 4},
    "flk_ff_rsqrt": {11: 2, 15: 3, 19: 3, 23: 4},
    "flk_ff_sqrt": {11: 2, 15: 3, 19: 3, 23: 4},
    "flk_ff_exp2": {11: 2, 15: 2, 19: 3, 23: 4},
}


def stages(module: str, M: int) -> int:
    """Registers of a unit of M mantissa bits."""
    return STAGES[module][next(group for group in GROUPS if group >= M)]
