"""Projected splats to hardware records and sub-tile lists.

The projection runs in float64; what reaches the hardware is rounded to FP16 here, once. A splat meets a sub-tile when its
3-sigma box (per axis, after dilation) contains a pixel centre of it. Lists keep the near-to-far order of the projection.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np

from ..arithmetic.fp import FP16_R, fp16_bits, fp16_from_f64, sub
from ..params import SUBTILE, TILE, Coords, Form, RenderConfig
from .binning import bin_boxes, pairs, pixel_boxes

LOG2E = 1.4426950408889634
MAX_FP16 = 65504.0


@dataclass
class Bins:
    """Lists of one frame without records; fields as in `SubtileLists`."""

    width: int
    height: int
    start: np.ndarray
    entry: np.ndarray
    cols: int
    rows: int
    tile_pairs: int


@dataclass
class SubtileLists:
    """Records of one frame.

    gauss: uint16 (N, 9) in the order of `feature_t` (mean_x first; its two means are unused here).
    spiky: bool (N,).
    start: int64 (S + 1,), entries of sub-tile s are start[s]:start[s + 1].
    entry: int32 (E,), splat of each entry; mean: uint16 (E, 2), its mean relative to the sub-tile.
    cols, rows: sub-tile grid; sub-tile s is column s % cols, row s // cols.
    adjusted: values that did not fit FP16, by reason (clamped to the largest finite number; reported, not silent).
    """

    width: int
    height: int
    form: Form
    gauss: np.ndarray
    spiky: np.ndarray
    start: np.ndarray
    entry: np.ndarray
    mean: np.ndarray
    cols: int
    rows: int
    tile_pairs: int
    adjusted: dict[str, int] = field(default_factory=dict)

    def features(self, e: int) -> np.ndarray:
        """uint16 (9,): the feature record of entry e."""
        f = self.gauss[self.entry[e]].copy()
        f[0:2] = self.mean[e]
        return f


@numba.njit(parallel=True, cache=True)
def _round_splats(conic, cov, opacity, rgb, factored, gauss, clamped):
    for i in numba.prange(conic.shape[0]):
        a = conic[i, 0]
        b = conic[i, 1]
        c = conic[i, 2]
        if factored:
            k = 0.5 * LOG2E
            l0 = np.sqrt(a * k)
            l1 = b * k / l0
            l2 = np.sqrt(k / cov[i, 2])  # c' - l1^2 = det / a = 1 / cov_yy, without the cancellation
            s = (l0, l1, l2)
        else:
            s = (0.5 * a, b, 0.5 * c)
        row = gauss[i]
        n = 0
        for j in range(3):
            v = s[j]
            if not abs(v) <= MAX_FP16:
                v = np.copysign(MAX_FP16, v)
                n += 1
            row[2 + j] = fp16_bits(fp16_from_f64(v))
        row[5] = fp16_bits(fp16_from_f64(opacity[i]))
        for j in range(3):
            v = rgb[i, 2 - j]
            if not v <= MAX_FP16:
                v = MAX_FP16
                n += 1
            row[6 + j] = fp16_bits(fp16_from_f64(v))
        clamped[i] = n


@numba.njit(parallel=True, cache=True)
def local_means(mean, start, entry, cols, absolute, out):
    """Fill out (E, 2) with FP16 bits of each entry's mean, relative to its sub-tile; absolute: rounded in screen coordinates first."""
    for s in numba.prange(start.shape[0] - 1):
        ox = (s % cols) * SUBTILE
        oy = (s // cols) * SUBTILE
        for e in range(start[s], start[s + 1]):
            i = entry[e]
            if absolute:
                x = sub(fp16_from_f64(mean[i, 0]), np.float32(ox), FP16_R)
                y = sub(fp16_from_f64(mean[i, 1]), np.float32(oy), FP16_R)
            else:
                x = fp16_from_f64(min(max(mean[i, 0] - ox, -MAX_FP16), MAX_FP16))
                y = fp16_from_f64(min(max(mean[i, 1] - oy, -MAX_FP16), MAX_FP16))
            out[e, 0] = fp16_bits(x)
            out[e, 1] = fp16_bits(y)


def bin_splats(projected, camera) -> Bins:
    """Sub-tile lists of the projected splats."""
    cols = -(-camera.width // SUBTILE)
    rows = -(-camera.height // SUBTILE)
    size = camera.width, camera.height
    start, entry = bin_boxes(pixel_boxes(projected.mean, projected.radii, SUBTILE, cols, rows, *size), cols, rows)
    tile_pairs = pairs(pixel_boxes(projected.mean, projected.radii, TILE, -(-camera.width // TILE), -(-camera.height // TILE), *size))
    return Bins(*size, start, entry, cols, rows, tile_pairs)


def build_lists(projected, camera, config: RenderConfig) -> SubtileLists:
    """Round the projected splats to records and bin them into sub-tile lists."""
    n = len(projected.depth)
    gauss = np.zeros((n, 9), np.uint16)
    clamped = np.zeros(n, np.int32)
    _round_splats(projected.conic, projected.cov2d, projected.opacity, projected.rgb, config.form == Form.FACTORED, gauss, clamped)
    bins = bin_splats(projected, camera)
    mean = np.empty((len(bins.entry), 2), np.uint16)
    local_means(projected.mean, bins.start, bins.entry, bins.cols, config.coords == Coords.ABSOLUTE, mean)
    adjusted = {"value beyond FP16 clamped": int((clamped > 0).sum())} if clamped.any() else {}
    return SubtileLists(
        bins.width, bins.height, config.form, gauss, np.asarray(projected.spiky, bool), bins.start, bins.entry, mean,
        bins.cols, bins.rows, bins.tile_pairs, adjusted,
    )
