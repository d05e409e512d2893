"""Row intervals in the unit disc: the pixel mask of a whole 8x8 sub-tile from fixed-point arithmetic.

In the factored form a splat contributes where u^2 + v^2 <= rho^2, with u = l0 dx + l1 dy and v = l2 dy. Divided by rho(o) this is the unit
disc, whatever the splat's size, shape and opacity, so a uniform absolute error d enlarges every splat's area by the same 2 d or so: fixed
point is the right number system, and few bits do. In a row v is constant, so the pixels of a row are those with
-r - s <= (i - 3.5) a <= r - s, r = sqrt(1 - v^2) from a table of one argument. Steps (docs/reference/mask_bounds.md has the widths and the proof):

    k = 1 / rho(o) from a table                          a, b, c = k (l0, l1, l2)
    X = 3.5 - mean_x, Y = 3.5 - mean_y                   P = a X, Q = b Y, z = c Y
    w = P + Q                                            v_j = z + (j - 3.5) c
    M = 2^-9 (|P| + |Q| + 2.25 (a + |b|)) + constant     s_j = w + (j - 3.5) b
    r_j = table(|v_j|) + M                               pixel (i, j): -r_j <= s_j + (i - 3.5) a <= r_j

M covers the roundings of the VRU and of this unit: no pixel whose alpha test would pass in the VRU is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numba
import numpy as np

from ...arithmetic.numbers import NEAREST, quantise
from ...arithmetic.thresholds import radii, thresholds
from ...cost.operations import Op, Operation, Operations
from ...errors import FlickerError
from ...front.records import SubtileLists
from ...front.view import View
from ...golden.masked import load_splat
from ...params import Form
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.channels import Channels
from ..stages.lanes import Lanes
from ..stages.pixels import PixelChannels

SIGNIFICAND = 13  # bits of a, b, c, X, Y with the hidden bit
EXTRA = 3  # fraction bits of sums beyond those of a comparison
K_BITS = 9  # fraction bits of k
THRESHOLD_BITS = 6  # mantissa bits of the threshold that address the table of k
THRESHOLD_MIN = 0.5  # smaller thresholds count as this
SHAPE_MAX = 1.625  # shape numbers; dilation by 0.3 px^2 keeps them below 1.55
_SUM_MAX = 4096.0  # |P| + |Q| beyond which every pixel of the rows in reach is visited


@dataclass(frozen=True)
class RowFormat:
    """fraction: bits of v, s and r behind the point. address: of these, bits of |v| that address the root table."""

    fraction: int = 8
    address: int = 8

    @property
    def name(self) -> str:
        return f"f{self.fraction}a{self.address}"

    def __post_init__(self) -> None:
        if not 4 <= self.fraction <= 12 or not 3 <= self.address <= self.fraction:
            raise FlickerError(f"rows: fraction must be 4 to 12 and address 3 to fraction, not {self.fraction} and {self.address}")


@cache
def inverse_radius() -> np.ndarray:
    """float64 (65536,): k of every FP16 opacity, at most 1 / rho(o), a multiple of 2^-K_BITS; 0 where no pair can pass."""
    t = thresholds(Form.FACTORED)
    low = np.maximum(t, THRESHOLD_MIN)
    unit = 2.0 ** (np.floor(np.log2(low)) - THRESHOLD_BITS)
    high = np.ceil(low / unit) * unit  # what the table's address stands for
    rho = np.sqrt(high) * (1 + 3.1 * 2.0**-11) + 2.0**-11
    k = np.floor(2.0**K_BITS / rho) / 2.0**K_BITS
    assert (k * radii(Form.FACTORED) <= 1).all()
    return np.where(t > 0, k, 0.0)


def errors(fmt: RowFormat) -> tuple[float, float]:
    """Bounds on the errors of v_j and of s_j + (i - 3.5) a, in units of 2^-fraction, M's dynamic part not counted."""
    unit = 2.0**-EXTRA / 2  # half a unit of the sums
    step = 3.5 * unit + 0.5  # (j - 3.5) c, then the rounding to `fraction` bits
    c_max = SHAPE_MAX / np.sqrt(THRESHOLD_MIN)
    v = unit + step + 2.0 ** (fmt.fraction - SIGNIFICAND) * (2.02 + 3.5 * c_max)
    u = 2 * unit + 2 * step + 2.0**-10
    return v, u


@cache
def root_table(fmt: RowFormat) -> np.ndarray:
    """int64: by |v| in units of 2^-address, r + the constant part of M in units of 2^-fraction, rounded up; ends where |v| > 1."""
    dv, du = errors(fmt)
    one = 1 << fmt.fraction
    table: list[int] = []
    while True:
        low = (len(table) << (fmt.fraction - fmt.address)) - dv  # smallest |v| that has this address
        if low > one:
            return np.array(table, np.int64)
        table.append(int(np.ceil(np.sqrt(one * one - max(low, 0.0) ** 2) + du)))


@numba.njit(forceinline=True)
def _significand(x):
    return quantise(x, SIGNIFICAND - 1, -1000, 1e300, NEAREST)


@numba.njit(parallel=True, cache=True)
def _rows(gauss, inverse, start, entry, mean, fraction, drop, root, mask, visit):
    unit = 2.0 ** (fraction + EXTRA)
    half = 1 << (EXTRA - 1)
    far = np.int64(64) << (fraction + EXTRA)
    for s in numba.prange(len(start) - 1):
        f = np.empty(9, np.float32)
        step = np.empty(8, np.int64)
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            k = inverse[gauss[i, 5]]
            for m in range(4):
                visit[n, m] = 0
            mask[n] = 0
            if k == 0.0:
                continue
            load_splat(n, i, gauss, mean, f)
            l0, l1, l2 = np.float64(f[2]), np.float64(f[3]), np.float64(f[4])
            a = _significand(k * l0)
            b = _significand(k * l1)
            c = _significand(k * l2)
            x = _significand(3.5 - np.float64(f[0]))
            y = _significand(3.5 - np.float64(f[1]))
            total = abs(a * x) + abs(b * y)
            if not (0.0 <= l0 <= SHAPE_MAX and abs(l1) <= SHAPE_MAX and 0.0 <= l2 <= SHAPE_MAX and total < _SUM_MAX and abs(c * y) < 1e9):
                for m in range(4):
                    visit[n, m] = 0xFFFF
                mask[n] = 15
                continue
            w = np.int64(np.rint(a * x * unit)) + np.int64(np.rint(b * y * unit))
            w = min(max(w, -far), far)
            z = np.int64(np.rint(c * y * unit))
            z = min(max(z, -far), far)
            ai = np.int64(np.rint(a * unit))
            bi = np.int64(np.rint(b * unit))
            ci = np.int64(np.rint(c * unit))
            # |P| + |Q| + 2.25 (a + |b|) in halves, rounded up, times 2^-9 in units of 2^-fraction, rounded up.
            dynamic = np.ceil(2.0 * (total + 2.25 * (a + abs(b))))
            margin = np.int64(np.ceil(dynamic * 2.0 ** (fraction - 10)))
            for q in range(8):
                step[q] = ((2 * q - 7) * ai + 2 * half) >> (EXTRA + 1)
            for j in range(8):
                v = abs((2 * z + (2 * j - 7) * ci + 2 * half) >> (EXTRA + 1)) >> drop
                if v >= len(root):
                    continue
                r = root[v] + margin
                centre = (2 * w + (2 * j - 7) * bi + 2 * half) >> (EXTRA + 1)
                bits = 0
                for q in range(8):
                    bits |= int(-r <= centre + step[q] <= r) << q
                base = (j // 4) * 2
                visit[n, base] |= (bits & 15) << (4 * (j % 4))
                visit[n, base + 1] |= (bits >> 4) << (4 * (j % 4))
            for m in range(4):
                mask[n] |= int(visit[n, m] != 0) << m


def row_masks(lists: SubtileLists, fmt: RowFormat) -> tuple[np.ndarray, np.ndarray]:
    """(mask uint8 (E,), visit uint16 (E, 4)) of the row intervals."""
    n = len(lists.entry)
    mask, visit = np.empty(n, np.uint8), np.empty((n, 4), np.uint16)
    _rows(
        lists.gauss, inverse_radius(), lists.start, lists.entry, lists.mean, fmt.fraction, fmt.fraction - fmt.address, root_table(fmt), mask, visit,
    )
    return mask, visit


def row_operations(fmt: RowFormat) -> Operations:
    """One element per cycle: eight rows in parallel."""
    f = fmt.fraction
    sums = f"fixed {7 + f + EXTRA}"
    row = f"fixed {3 + f}"
    return Operations((
        Operation(Op.LOG, "FP16", 1),
        Operation(Op.TABLE, f"{2 + THRESHOLD_BITS} -> {K_BITS + 1}", 1, note="k"),
        Operation(Op.ADD, f"float {SIGNIFICAND}", 2, note="X, Y: constant minus FP16"),
        Operation(Op.MUL, f"int {K_BITS + 1}x11", 3, note="a, b, c, exponents added"),
        Operation(Op.MUL, f"int {SIGNIFICAND}x{SIGNIFICAND}", 3, note="P, Q, z"),
        Operation(Op.SHIFT, f"{2 * SIGNIFICAND} -> {7 + f + EXTRA}", 3, note="P, Q, z to fixed point"),
        Operation(Op.SHIFT, f"{SIGNIFICAND} -> {2 + f + EXTRA}", 3, note="a, b, c to fixed point"),
        Operation(Op.ADD, sums, 1, note="w"),
        Operation(Op.ADD, "fixed 14", 3, note="M, in halves"),
        # (j - 3.5) c and the like: odd multiples 1, 3, 5, 7 of the half; 3, 5 and 7 by one addition each, for a, b and c.
        Operation(Op.ADD, f"fixed {3 + f + EXTRA}", 9, note="multiples of a, b, c"),
        Operation(Op.ADD, sums, 16, note="v_j, s_j with rounding"),
        Operation(Op.TABLE, f"{fmt.address} -> {f + 1}", 8, note="root"),
        Operation(Op.ADD, row, 8 * 3, note="r + M, and the two ends"),
        Operation(Op.CMP, row, 8 * 16, note="ends with the eight columns"),
    ))


@dataclass(frozen=True)
class Rows(MaskGenerator):
    """One element a cycle; eight rows count as eight evaluations. pixels: 64 pixel masks, else mini-tile masks."""

    fmt: RowFormat
    pixels: bool = True

    @property
    def exact(self) -> bool:
        return True

    @property
    def precision(self) -> str:
        return f"fixed {self.fmt.name}"

    @property
    def operations(self) -> Operations:
        return row_operations(self.fmt)

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        mask, visit = row_masks(lists, self.fmt)
        n = len(mask)
        return Masks(mask, np.ones(n, np.uint8), np.full(n, 8, np.uint16), visit if self.pixels else None)


# The first is the recommended one.
FORMATS = tuple(RowFormat(f, a) for f, a in ((8, 8), (6, 6), (7, 5), (7, 7), (8, 6), (9, 7), (10, 10)))
ACCUMULATORS = (10, 12, 14, 16, 20)
ACCUMULATOR = 14  # the recommended one
_LISTS = {"subtile": "", "reach": ", lists by the box of the reach", "ellipse": ", lists by the ellipse"}


def configurations() -> Iterator[Configuration]:
    """Formats, lists and masks on channels whose VRUs visit single pixels; accumulators; lanes."""
    form = Form.FACTORED
    for fmt in FORMATS:
        for pixels in (True, False):
            for kind, title in _LISTS.items():
                if kind != "subtile" and fmt is not FORMATS[0]:
                    continue
                words = ["rows"] + ["minitile"] * (not pixels) + [fmt.name] * (fmt is not FORMATS[0]) + [kind] * (kind != "subtile")
                formats = "" if fmt is FORMATS[0] else f", {fmt.fraction} fraction bits, {fmt.address}-bit root table"
                channels = PixelChannels(form) if pixels else Channels(form)
                yield Configuration(
                    "-".join(words), f"row intervals, {'pixel' if pixels else 'mini-tile'} masks{formats}{title}", "rows", Rows(fmt, pixels), channels,
                    lists=kind,
                )
    rows = Rows(FORMATS[0])
    stage: RenderingStage
    ellipse = "row intervals, pixel masks, lists by the ellipse"
    yield Configuration("rows-ellipse-64", f"{ellipse}, FIFO depth 64", "rows", rows, PixelChannels(form, fifo_depth=64), lists="ellipse")
    yield Configuration(
        "rows-ellipse-stop", f"{ellipse}, finished sub-tiles are left at once", "rows", rows, PixelChannels(form), lists="ellipse", stop=True,
    )
    for bits in ACCUMULATORS:
        title = f"row intervals, pixel masks, lists by the ellipse, colour accumulators of {bits} fraction bits"
        yield Configuration(f"rows-ellipse-acc{bits}", title, "rows", rows, PixelChannels(form, accumulator=bits), lists="ellipse")
    for name, title, stage in (
        ("lanes", "row intervals, independent lanes, fixed-point accumulators", Lanes(window=2, accumulator=ACCUMULATOR)),
        ("lanes-deep", "lanes, FIFO depth 40, two elements a cycle", Lanes(fifo_depth=40, window=3, width=2, accumulator=ACCUMULATOR)),
        ("lanes-64", "64 lanes, FIFO depth 4", Lanes(lanes=64, fifo_depth=4, window=2, accumulator=ACCUMULATOR)),
        ("lanes-fp16", "lanes, FP16 accumulators and their loop", Lanes(window=2, loop=4)),
        ("lanes-fp16-window-1", "lanes, FP16 accumulators, next pixel from the oldest entry only", Lanes(window=1, loop=4)),
        ("lanes-fifo-40", "lanes, FIFO depth 40", Lanes(fifo_depth=40, window=2, accumulator=ACCUMULATOR)),
        ("lanes-fifo-40-window-3", "lanes, FIFO depth 40, next pixel from three entries", Lanes(fifo_depth=40, window=3, accumulator=ACCUMULATOR)),
        *(
            (f"lanes-acc{bits}", f"lanes, accumulators of {bits} fraction bits", Lanes(window=2, accumulator=bits))
            for bits in ACCUMULATORS if bits != ACCUMULATOR
        ),
    ):
        yield Configuration(name, title, "rows", rows, stage, lists="ellipse")
