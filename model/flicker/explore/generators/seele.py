"""SeeLe: the leader pixel of each 2x2 group."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np

from ...arithmetic.fp import FP16_R, mul, sub
from ...cost.operations import Op, Operation, Operations
from ...front.records import SubtileLists
from ...front.view import View
from ...golden.masked import load_splat
from ...golden.vru import ALPHA_MIN, CONIC, alpha_of
from ...golden.weight import conic_axis, conic_pixel, factored_pixel, factored_row
from ...params import Form
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.pixels import PixelChannels


@numba.njit(parallel=True, cache=True)
def _seele(gauss, start, entry, mean, form, mask, visit):
    for s in numba.prange(len(start) - 1):
        f = np.empty(9, np.float32)
        col = np.empty((2, 4), np.float32)
        row = np.empty((2, 4), np.float32)
        for n in range(start[s], start[s + 1]):
            load_splat(n, entry[n], gauss, mean, f)
            for k in range(4):
                dx = sub(np.float32(2 * k), f[0], FP16_R)
                dy = sub(np.float32(2 * k), f[1], FP16_R)
                if form == CONIC:
                    col[0, k] = dx
                    row[0, k] = dy
                    col[1, k] = conic_axis(dx, f[2], FP16_R)[1]
                    row[1, k] = conic_axis(dy, f[4], FP16_R)[1]
                else:
                    col[0, k] = mul(f[2], dx, FP16_R)
                    row[0, k], _, row[1, k] = factored_row(dy, f[3], f[4], FP16_R)
            send = 0
            for m in range(4):
                v = 0
                for g in range(4):
                    x = (m % 2) * 2 + g % 2
                    y = (m // 2) * 2 + g // 2
                    if form == CONIC:
                        e = conic_pixel(col[0, x], row[0, y], col[1, x], row[1, y], f[3], FP16_R)[3]
                    else:
                        e = factored_pixel(col[0, x], row[0, y], row[1, y], FP16_R)[2]
                    if e >= 0 and alpha_of(e, f[5], form != CONIC)[1] >= ALPHA_MIN:
                        v |= 0x33 << ((g // 2) * 8 + (g % 2) * 2)
                visit[n, m] = v
                send |= int(v != 0) << m
            mask[n] = send


def seele_masks(lists: SubtileLists) -> tuple[np.ndarray, np.ndarray]:
    """(mask, visit): a 2x2 group of pixels is visited when its leader, the top-left pixel, has alpha >= 1/255 (FP16, as the VRU)."""
    n = len(lists.entry)
    mask, visit = np.empty(n, np.uint8), np.empty((n, 4), np.uint16)
    _seele(lists.gauss, lists.start, lists.entry, lists.mean, int(lists.form), mask, visit)
    return mask, visit


def seele_operations(form: Form) -> Operations:
    """Sixteen leaders per element: four columns, four rows; alpha itself is compared, as in the renderer."""
    common = (Operation(Op.ADD, "FP16", 8), Operation(Op.TABLE, "FP16 exp", 16), Operation(Op.MUL, "FP16", 16, note="opacity"), Operation(Op.CMP, "FP16", 16))
    if form == Form.CONIC:
        own = (Operation(Op.MUL, "FP16", 8 + 32), Operation(Op.MUL, "FP16", 8, sqr=True), Operation(Op.ADD, "FP16", 32))
    else:
        own = (Operation(Op.MUL, "FP16", 4 + 8), Operation(Op.MUL, "FP16", 4 + 16, sqr=True), Operation(Op.ADD, "FP16", 32))
    return Operations(common + own, cycles=2)


@dataclass(frozen=True)
class Seele(MaskGenerator):
    """Sixteen leaders in two cycles."""

    form: Form
    pixels = True

    @property
    def precision(self) -> str:
        return "fp16"

    @property
    def operations(self) -> Operations:
        return seele_operations(self.form)

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        mask, visit = seele_masks(lists)
        n = len(mask)
        return Masks(mask, np.full(n, 2, np.uint8), np.full(n, 16, np.uint16), visit)


def configurations() -> Iterator[Configuration]:
    """In both forms."""
    for form in Form:
        end, what = ("", "") if form == Form.FACTORED else ("-conic", ", conic")
        yield Configuration("seele" + end, f"SeeLe: leader pixel of each 2x2 group{what}", "baseline", Seele(form), PixelChannels(form))
