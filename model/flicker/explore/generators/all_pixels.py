"""The weight of all 64 pixels in FP16 against the threshold, eight leaders a cycle as two PRTUs have."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...cost.operations import Op, Operation, Operations
from ...front.records import SubtileLists
from ...front.view import View
from ...golden.masked import pixel_tests
from ...params import Form
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.pixels import PixelChannels


@dataclass(frozen=True)
class AllPixels(MaskGenerator):
    """Eight columns, then one row a cycle."""

    form: Form
    pixels = True

    @property
    def exact(self) -> bool:
        return True

    @property
    def precision(self) -> str:
        return "fp16"

    @property
    def operations(self) -> Operations:
        if self.form == Form.FACTORED:
            own = (Operation(Op.MUL, "FP16", 8 + 16), Operation(Op.MUL, "FP16", 8 + 64, sqr=True), Operation(Op.ADD, "FP16", 128))
        else:
            own = (Operation(Op.MUL, "FP16", 16 + 128), Operation(Op.MUL, "FP16", 16, sqr=True), Operation(Op.ADD, "FP16", 128))
        return Operations((Operation(Op.LOG, "FP16", 1), Operation(Op.ADD, "FP16", 16, note="differences"), *own, Operation(Op.CMP, "FP16", 64)), cycles=8)

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        mask, visit = pixel_tests(lists)
        n = len(mask)
        return Masks(mask, np.full(n, 8, np.uint8), np.full(n, 64, np.uint16), visit)


def configurations() -> Iterator[Configuration]:
    """In both forms."""
    for form in Form:
        end = "" if form == Form.FACTORED else "-conic"
        yield Configuration(f"pixels{end}", f"all 64 pixels tested in FP16{end.replace('-', ', ')}", "rows", AllPixels(form), PixelChannels(form))
