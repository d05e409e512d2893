"""Exact-rectangle test: the smallest weight E over the 4x4 pixels of a mini-tile, against the threshold.

E is convex, so over a rectangle that does not hold the mean its minimum lies on the edge facing the mean: on the nearest vertical
edge where the mean is beside the rectangle, on the nearest horizontal edge where it is above or below, and on one of the two where
both hold. On an edge the minimum is at the line's optimum clamped to the edge; the slopes of the optimum come from preprocessing.

`bound` makes it safe: margins that cover every rounding of test and VRU, so that no pixel that the VRU would blend is lost. The
proof, and where the constants come from, is in docs/reference/mask_bounds.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np

from ...arithmetic.fp import FP16_R, sub
from ...arithmetic.numbers import DOWN, FORMATS, NEAREST, UP, Numbers, numbers, quantise
from ...arithmetic.thresholds import EPSILON, radii, thresholds
from ...cost.operations import Op, Operation, Operations
from ...front.projection import Projected
from ...front.records import SubtileLists
from ...front.view import View
from ...golden.masked import load_splat
from ...params import Form
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.channels import Channels


def margins(form: Form, system: Numbers) -> tuple[float, float]:
    """(kappa, absolute) of the margin M = kappa S + absolute (D + 4) (docs/reference/mask_bounds.md, exact rectangle).

    factored: S = |l0 dx| + (|l1| + |l2|) |dy|, D = |dx| + |dy|. conic: S = |s0| dx^2 + |s2| dy^2 + |s1 dx dy|, D = dx^2 + dy^2 + |dx dy|. Both at the
    farthest corner of the mini-tile. kappa is rounded up to a sum of two powers of two.
    """
    h = 1 + 2.0 ** -(system.man + 1)  # of one rounding to the format
    e = 1 + EPSILON  # of one rounding to FP16
    point = (h**3 * e**2 - 1) + (h * e - 1)  # where the edge is evaluated
    if form == Form.FACTORED:
        kappa = point + (h**3 - 1) * h * e + 2.1 * EPSILON
    else:
        kappa = 2 * point + point**2 + (h**5 * e - 1) * h**2 * e**2 + 7.1 * EPSILON + system.tiny
    return _two_powers(kappa), 4 * system.tiny


def _two_powers(x: float) -> float:
    """The smallest sum of two powers of two (or one) that is at least x."""
    first = 2.0 ** np.floor(np.log2(x))
    rest = x - first
    return first if rest <= 0 else first + 2.0 ** np.ceil(np.log2(rest))


@numba.njit(forceinline=True)
def _edge(l0, l1, l2, dx, dy, conic, man, emin, top):
    """(u, v, E) in the factored form, (h, t, E) in the conic form, each operation rounded to nearest."""
    if conic:
        xx = quantise(dx * dx, man, emin, top, NEAREST)
        yy = quantise(dy * dy, man, emin, top, NEAREST)
        sx = quantise(xx * l0, man, emin, top, NEAREST)
        sy = quantise(yy * l2, man, emin, top, NEAREST)
        xy = quantise(dx * dy, man, emin, top, NEAREST)
        t = quantise(xy * l1, man, emin, top, NEAREST)
        h = quantise(sx + sy, man, emin, top, NEAREST)
        return h, t, quantise(h + t, man, emin, top, NEAREST)
    p = quantise(l0 * dx, man, emin, top, NEAREST)
    q = quantise(l1 * dy, man, emin, top, NEAREST)
    u = quantise(p + q, man, emin, top, NEAREST)
    v = quantise(l2 * dy, man, emin, top, NEAREST)
    uu = quantise(u * u, man, emin, top, NEAREST)
    vv = quantise(v * v, man, emin, top, NEAREST)
    return u, v, quantise(uu + vv, man, emin, top, NEAREST)


@numba.njit(forceinline=True)
def _margin(l0, l1, l2, fx, fy, conic, kappa, absolute, man, emin, top):
    """Upper bound M on all errors, in the format, rounded up. l0, l1, l2, fx, fy: magnitudes, rounded up; infinite if anything overflows."""
    if conic:
        xx = quantise(fx * fx, man, emin, top, UP)
        yy = quantise(fy * fy, man, emin, top, UP)
        xy = quantise(fx * fy, man, emin, top, UP)
        if not (xx < np.inf and yy < np.inf and xy < np.inf):
            return np.inf
        s = quantise(quantise(xx * l0, man, emin, top, UP) + quantise(yy * l2, man, emin, top, UP), man, emin, top, UP)
        s = quantise(s + quantise(xy * l1, man, emin, top, UP), man, emin, top, UP)
        d = xx + yy + xy
    else:
        row = quantise(quantise(l1 + l2, man, emin, top, UP) * fy, man, emin, top, UP)
        s = quantise(quantise(l0 * fx, man, emin, top, UP) + row, man, emin, top, UP)
        d = fx + fy
    return quantise(kappa * s + absolute * (d + 4.0), man, emin, top, UP)


@numba.njit(parallel=True, cache=True)
def _exact(gauss, slopes, limit, start, entry, mean, conic, bound, scaled, system, kappa, absolute, mask, evaluations):
    man, emin, top, tiny = system
    for s in numba.prange(len(start) - 1):
        f = np.empty(9, np.float32)
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            load_splat(n, i, gauss, mean, f)
            threshold = limit[gauss[i, 5]]
            if not threshold > 0.0:  # no opacity that could pass
                mask[n] = 0
                evaluations[n] = 0
                continue
            scale = 1.0
            if scaled:  # an exponent per Gaussian that brings its largest shape number to [1/4, 1/2)
                largest = max(abs(np.float64(f[2])), max(abs(np.float64(f[3])), abs(np.float64(f[4]))))
                if largest > 0.0:
                    scale = 2.0 ** -(np.floor(np.log2(largest)) + 2.0)
            l0 = quantise(f[2] * scale, man, emin, top, NEAREST)
            l1 = quantise(f[3] * scale, man, emin, top, NEAREST)
            l2 = quantise(f[4] * scale, man, emin, top, NEAREST)
            v_slope = quantise(slopes[i, 0], man, emin, top, NEAREST)
            h_slope = quantise(slopes[i, 1], man, emin, top, NEAREST)
            t = quantise(threshold * (scale if conic else scale * scale), man, emin, top, UP)
            u0 = quantise(abs(f[2]) * scale, man, emin, top, UP)
            u1 = quantise(abs(f[3]) * scale, man, emin, top, UP)
            u2 = quantise(abs(f[4]) * scale, man, emin, top, UP)
            # The proof takes shape numbers up to 2; no projection makes larger ones. A value beyond the format proves nothing.
            unsafe = bound and not (max(u0, max(u1, u2)) <= 2.0 and max(abs(slopes[i, 0]), abs(slopes[i, 1])) < min(top, 65000.0))
            send = 0
            count = 0
            for m in range(4):
                x0 = (m % 2) * 4
                y0 = (m // 2) * 4
                wx0 = np.float64(sub(np.float32(x0), f[0], FP16_R))
                wx3 = np.float64(sub(np.float32(x0 + 3), f[0], FP16_R))
                wy0 = np.float64(sub(np.float32(y0), f[1], FP16_R))
                wy3 = np.float64(sub(np.float32(y0 + 3), f[1], FP16_R))
                left, right, above, below = wx0 > 0, wx3 < 0, wy0 > 0, wy3 < 0
                if not (left or right or above or below):
                    send |= 1 << m
                    continue
                dx0 = quantise(wx0, man, emin, top, NEAREST)
                dx3 = quantise(wx3, man, emin, top, NEAREST)
                dy0 = quantise(wy0, man, emin, top, NEAREST)
                dy3 = quantise(wy3, man, emin, top, NEAREST)
                margin = 0.0
                if bound:
                    fx = quantise(max(abs(wx0), abs(wx3)), man, emin, top, UP)
                    fy = quantise(max(abs(wy0), abs(wy3)), man, emin, top, UP)
                    if not unsafe and fx < np.inf and fy < np.inf:
                        margin = _margin(u0, u1, u2, fx, fy, conic, kappa, absolute, man, emin, top)
                    if unsafe or not (fx < np.inf and fy < np.inf and margin < np.inf):
                        send |= 1 << m
                        continue
                passes = False
                for edge in range(2):
                    if edge == 0:
                        if not (left or right):
                            continue
                        dx = dx0 if left else dx3
                        dy = quantise(-v_slope * dx, man, emin, top, NEAREST)
                        dy = min(max(dy, dy0), dy3)
                    else:
                        if not (above or below):
                            continue
                        dy = dy0 if above else dy3
                        dx = quantise(-h_slope * dy, man, emin, top, NEAREST)
                        dx = min(max(dx, dx0), dx3)
                    count += 1
                    u, v, e = _edge(l0, l1, l2, dx, dy, conic, man, emin, top)
                    if not bound:
                        passes |= t > e
                    elif conic:
                        passes |= t >= quantise(e - margin, man, emin, top, DOWN)
                    else:
                        u = max(quantise(abs(u) - margin, man, emin, top, DOWN), 0.0)
                        v = max(quantise(abs(v) - margin, man, emin, top, DOWN), 0.0)
                        e = quantise(u * u, man, emin, top, DOWN) + quantise(v * v, man, emin, top, DOWN)
                        passes |= t >= quantise(e, man, emin, top, DOWN)
                send |= int(passes) << m
            mask[n] = send
            evaluations[n] = count


def edge_slopes(projected: Projected) -> np.ndarray:
    """float64 (N, 2), FP16 values: b / c and b / a of each splat, with which the optimum on a vertical edge is dy = -(b / c) dx.

    From the exact conic, as preprocessing has it.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slopes = projected.conic[:, 1:2] / projected.conic[:, 2::-2]
        return np.clip(slopes, -65504, 65504).astype(np.float16).astype(np.float64)


def exact_masks(
    lists: SubtileLists, slopes: np.ndarray, system: Numbers, bound: bool, scaled: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """(mask uint8 (E,), evaluations uint16 (E,)) of the exact-rectangle test in a number system."""
    conic = lists.form == Form.CONIC
    kappa, absolute = margins(lists.form, system)
    limit = thresholds(lists.form)
    if bound and not conic:
        limit = radii(lists.form) ** 2
    n = len(lists.entry)
    mask, evaluations = np.empty(n, np.uint8), np.empty(n, np.uint16)
    _exact(
        lists.gauss, slopes, limit, lists.start, lists.entry, lists.mean, conic, bound, scaled, system, kappa, absolute, mask, evaluations,
    )
    return mask, evaluations


def exact_operations(form: Form, fmt: str, bound: bool, scaled: bool) -> Operations:
    """One element per cycle. Mini-tiles of a column share their vertical edge, those of a row their horizontal one."""
    width = {"fp16": 16, "e5m6": 12, "e4m4": 9, "e5m3": 9, "q8.8": 17, "q8.4": 13}.get(fmt, 8)
    fmt = fmt.upper()
    operations = [
        Operation(Op.ADD, "FP16", 8, note="differences"), Operation(Op.CMP, fmt, 16, note="clamps"), Operation(Op.CMP, fmt, 8), Operation(Op.LOG, fmt, 1),
    ]
    if form == Form.FACTORED:
        # Column: p, optimum. Row: q, v, vv, optimum. Mini-tile: q, v, vv, uu (vertical), p, uu (horizontal).
        operations += [Operation(Op.MUL, fmt, 2 * 2 + 2 * 3 + 4 * 3), Operation(Op.MUL, fmt, 2 + 4 * 3, sqr=True), Operation(Op.ADD, fmt, 16)]
        if bound:
            operations += [Operation(Op.MUL, fmt, 4, note="margin"), Operation(Op.ADD, fmt, 1 + 4 + 4 + 16, note="margin")]
    else:
        # Column: xx, sx, optimum. Row: yy, sy, optimum. Mini-tile, twice: square and product of the free side, xy, t.
        operations += [Operation(Op.MUL, fmt, 2 * 2 + 2 * 2 + 4 * 2 * 3), Operation(Op.MUL, fmt, 2 + 2 + 4 * 2, sqr=True), Operation(Op.ADD, fmt, 16)]
        if bound:
            operations += [
                Operation(Op.MUL, fmt, 2 + 2 + 4 * 2, note="margin"), Operation(Op.MUL, fmt, 4, sqr=True, note="margin"),
                Operation(Op.ADD, fmt, 8 + 4 + 8, note="margin"),
            ]
    if fmt != "FP16":
        operations.append(Operation(Op.SHIFT, f"FP16 -> {fmt}", 8 + 3, note="conversion"))
    if scaled:
        operations.append(Operation(Op.SHIFT, fmt, 4, note="exponent per Gaussian"))
    return Operations(tuple(operations), record_bits=2 * width, preprocessing=(Operation(Op.MUL, "FP16", 2, note="slopes b / a, b / c from the reciprocals"),))


@dataclass(frozen=True)
class ExactRectangle(MaskGenerator):
    """One element a cycle. number_format: of `arithmetic.numbers.FORMATS`. bound: with the proved margin. scaled: an exponent per Gaussian."""

    form: Form
    number_format: str
    bound: bool = False
    scaled: bool = False

    @property
    def exact(self) -> bool:
        return self.bound

    @property
    def precision(self) -> str:
        return self.number_format

    @property
    def operations(self) -> Operations:
        return exact_operations(self.form, self.number_format, self.bound, self.scaled)

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        slopes = view.keep("edge slopes", lambda: edge_slopes(view.projected))
        mask, evaluations = exact_masks(lists, slopes, numbers(self.number_format), self.bound, self.scaled)
        return Masks(mask, np.ones(len(mask), np.uint8), evaluations)


def configurations() -> Iterator[Configuration]:
    """The recommended one first, then every format, scaled, with bound, in both forms."""
    yield Configuration(
        "exact", "exact rectangle per mini-tile, FP16 bound", "exact", ExactRectangle(Form.FACTORED, "fp16", bound=True), Channels(Form.FACTORED),
    )
    for form in (Form.FACTORED, Form.CONIC):
        for fmt in FORMATS:
            fixed_point = fmt.startswith("q")
            for bound in (False,) if fixed_point else (False, True):
                for scaled in (False,) if fmt == "fp16" or fixed_point else (False, True):
                    words = ["conic"] * (form == Form.CONIC) + ["scaled"] * scaled + ["bound"] * bound
                    yield Configuration(
                        "-".join(["exact", fmt, *words]), ", ".join(["exact rectangle per mini-tile", fmt.upper(), *words]), "exact",
                        ExactRectangle(form, fmt, bound, scaled), Channels(form),
                    )
