"""Masks for nothing, without a superfluous bit: bounds, no designs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...front.records import SubtileLists
from ...front.view import View
from ...golden.masked import render_masked
from ...params import Form
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.channels import Channels
from ..stages.lanes import Lanes
from ..stages.pixels import PixelChannels


@dataclass(frozen=True)
class Oracle(MaskGenerator):
    """What contributes, found by running the VRUs on everything."""

    form: Form
    pixels: bool = True
    free = True

    @property
    def exact(self) -> bool:
        return True

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        n = len(lists.entry)
        _, contributing, _ = render_masked(lists, order, np.full(n, 15, np.uint8), None)
        mask = ((contributing != 0) << np.arange(4)).sum(axis=1).astype(np.uint8)
        return Masks(mask, np.zeros(n, np.uint8), np.zeros(n, np.uint16), contributing if self.pixels else None)


def configurations() -> Iterator[Configuration]:
    """Mini-tile and pixel masks in both forms, and on lanes."""
    for form in Form:
        end, what = ("", "") if form == Form.FACTORED else ("-conic", ", conic")
        yield Configuration("oracle-minitile" + end, f"free exact mini-tile masks{what}", "oracle", Oracle(form, pixels=False), Channels(form))
        yield Configuration("oracle" + end, f"free exact pixel masks{what}", "oracle", Oracle(form), PixelChannels(form))
    yield Configuration(
        "oracle-lanes", "free exact pixel masks, stage as in lanes-deep", "oracle", Oracle(Form.FACTORED), Lanes(fifo_depth=40, window=3, width=2),
    )
