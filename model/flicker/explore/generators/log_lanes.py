"""Masks of the lanes in the log domain, from the lanes' own sums: `flk_splat_setup` and `flk_row_mask` (docs/reference/lanes.md has widths and proof)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...cost.area import part
from ...front.records import SubtileLists
from ...front.view import View
from ...golden.lanes.formats import FORMATS
from ...golden.lanes.lists import float_lists
from ...golden.lanes.render import lane_masks
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.log_lanes import LaneMasks, LogLanes


@dataclass(frozen=True)
class LogRows(MaskGenerator):
    """One element a cycle; eight rows count as eight evaluations. For the stage `LogLanes`, whose records it makes on the way."""

    pixels = True

    @property
    def exact(self) -> bool:
        """Of what the lanes would have blended (docs/reference/lanes.md), whose rounding is not that of the VRU."""
        return True

    @property
    def precision(self) -> str:
        return f"fixed {FORMATS.name}"

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        records = float_lists(view.projected, lists)
        bits, passes = lane_masks(records)
        visit = bits.view(np.uint16).reshape(-1, 4)
        mask = ((visit != 0) << np.arange(4)).sum(axis=1).astype(np.uint8)
        n = len(mask)
        return LaneMasks(mask, np.ones(n, np.uint8), np.full(n, 8, np.uint16), visit, None, records, passes)

    def rtl(self) -> dict | None:
        return {"stage": "lanes"}

    def area(self) -> float:
        return part("splat_setup", "default").ge + part("row_mask", "default").ge


def configurations() -> Iterator[Configuration]:
    """The default build, one that takes an element a cycle, more lanes, as many as fit the area of the GSCore-like build, and the default one behind lists that
    end as the reference's."""
    for name, title, stage in (
        ("log-lanes", "lanes in the log domain", LogLanes()),
        ("log-lanes-one", "lanes in the log domain, one element a cycle", LogLanes(in_width=1)),
        ("log-lanes-64", "64 lanes in the log domain", LogLanes(64)),
        ("log-lanes-128", "128 lanes in the log domain, one element a cycle, half the store", LogLanes(128, 1, 12, 8)),
    ):
        yield Configuration(name, title, "lanes", LogRows(), stage, lists="ellipse")
    yield Configuration("log-lanes-squares", "lanes in the log domain, lists that end as the reference's", "lanes", LogRows(), LogLanes(), lists="squares")
