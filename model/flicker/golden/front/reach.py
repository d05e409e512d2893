"""Where a splat reaches: the pixel box of its ellipse alpha = 1/255 cut by 3 standard deviations, and the tiles and sub-tiles in it.

A band is a row of sub-tiles: up to 8 rows of pixels. The ellipse being convex, the part of it between the first and the last pixel row of a band
lies over one interval
of x, and a sub-tile of the band is entered exactly when a pixel column of it lies in that interval. Its right end is the ellipse's rightmost point if that lies
between these rows, else on the nearer of them; the left end likewise. At distance dy from the mean: x = kappa dy +- i0 sqrt(log2 o' - (l2 dy)^2), o' = 255 o.

"box" lists take the box of 3 standard deviations alone, as the paper does.
"""

from __future__ import annotations

from collections import namedtuple

import numba
import numpy as np

from ...arithmetic.ff import ff_add, ff_from_fixed, ff_mul, ff_sqrt, ff_sub, ff_to_fixed_round, pick
from ...params import SUBTILE, TILE
from .setup import MEAN_FRACTION, FrontFormats, rounded
from .splat import MEAN_INTEGER, SHAPE_SCALE, pixels

SIGMAS = 3.0
_BAND = SUBTILE - 1


def reach_tables(formats: FrontFormats) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """By opacity code 0 to 255, ff numbers of the shape format: log2(code); sqrt(2 ln code), standard deviations to alpha = 1/255; the same, at most
    3. And 1 / K.

    Entry 0 is that of 1; such splats are never listed.
    """
    code = np.maximum(np.arange(256), 1)
    sigmas = np.sqrt(2.0 * np.log(code))
    inverse = rounded(1.0 / SHAPE_SCALE, formats.shape)
    return rounded(np.log2(code), formats.shape), rounded(sigmas, formats.shape), rounded(np.minimum(sigmas, SIGMAS), formats.shape), float(inverse)


# What does not depend on the opacity. i0, kappa: as above. lean: of the ellipse's rightmost point from the mean, in rows for each standard deviation.
Steady = namedtuple("Steady", "i0 kappa lean")
# x0, x1, y0, y1: first and last pixel column and row; none where the first is past the last. limit: log2 o'. right: rows from the mean to the
# rightmost point, 1/128.
Reach = namedtuple("Reach", "x0 x1 y0 y1 i0 kappa limit right")


@numba.njit
def steady_one(p, inverse, S):
    """p: Projection. inverse: 1 / K."""
    i0 = ff_mul(ff_mul(ff_mul(p.det, p.rdet, S), p.ryy, S), inverse, S)
    return Steady(i0, ff_mul(p.xy, ff_mul(p.ryy, p.ryy, S), S), ff_mul(p.xy, p.rxx, S))


@numba.njit
def reach_one(x, y, sx, sy, steady, code, box, width, height, logs, sigmas, cut, S, fraction=MEAN_FRACTION):
    """Bounds of a splat. x, y: mean in 1/128 pixel. sx, sy: ff, standard deviations. code: 255 times the opacity."""
    far, bits = pick(box, SIGMAS, cut[code]), fraction + MEAN_INTEGER
    x0, x1 = pixels(x, ff_to_fixed_round(ff_mul(far, sx, S), fraction, bits), width, fraction)
    y0, y1 = pixels(y, ff_to_fixed_round(ff_mul(far, sy, S), fraction, bits), height, fraction)
    right = ff_to_fixed_round(ff_mul(sigmas[code], steady.lean, S), fraction, bits)
    return Reach(x0, x1, y0, y1, steady.i0, steady.kappa, logs[code], right)


@numba.njit
def half_chord(dy, l2, i0, kappa, limit, S, fraction=MEAN_FRACTION):
    """Where the ellipse is dy (1/128 pixel) below the mean: its middle and half its width there, ff."""
    d = ff_from_fixed(dy, fraction, S)
    v = ff_mul(l2, d, S)
    return ff_mul(kappa, d, S), ff_mul(i0, ff_sqrt(ff_sub(limit, ff_mul(v, v, S), S), S), S)


@numba.njit
def band_columns(band, box, x, y, l2, r, S, fraction=MEAN_FRACTION):
    """First and last pixel column that the splat enters in a band with rows of its own, rows 8 band to 8 band + 7; the first is past the last where
    there is none. r: Reach."""
    low, high = (max(band * SUBTILE, r.y0) << fraction) - y, (min(band * SUBTILE + _BAND, r.y1) << fraction) - y
    middle, half = half_chord(min(max(r.right, low), high), l2, r.i0, r.kappa, r.limit, S, fraction)
    right = x + ff_to_fixed_round(ff_add(middle, half, S), fraction, fraction + MEAN_INTEGER)
    middle, half = half_chord(min(max(-r.right, low), high), l2, r.i0, r.kappa, r.limit, S, fraction)
    left = x + ff_to_fixed_round(ff_sub(middle, half, S), fraction, fraction + MEAN_INTEGER)
    one = 1 << fraction
    return pick(box, r.x0, max((left + one - 1) >> fraction, r.x0)), pick(box, r.x1, min(right >> fraction, r.x1))


@numba.njit
def band_subtiles(band, box, x, y, l2, r, S, fraction=MEAN_FRACTION):
    """First and last sub-tile column that is entered in a band; the first is past the last where there is none."""
    if max(band * SUBTILE, r.y0) > min(band * SUBTILE + _BAND, r.y1):
        return 1, 0
    a, b = band_columns(band, box, x, y, l2, r, S, fraction)
    if a > b:
        return 1, 0
    return a // SUBTILE, b // SUBTILE


@numba.njit
def tiles_of(box, x, y, l2, r, cols, S, start, tile, mask, fraction=MEAN_FRACTION):
    """Write the entries of a splat, tile row by tile row, from place `start` of tile and mask (no writing where they are empty); their number.

    mask: bit 2 (row of sub-tiles) + column.
    """
    n = 0
    for row in range(r.y0 // TILE, r.y1 // TILE + 1):
        a0, a1 = band_subtiles(2 * row, box, x, y, l2, r, S, fraction)
        b0, b1 = band_subtiles(2 * row + 1, box, x, y, l2, r, S, fraction)
        if a0 > a1:
            low, high = b0, b1
        elif b0 > b1:
            low, high = a0, a1
        else:
            low, high = min(a0, b0), max(a1, b1)
        for col in range(low // 2, high // 2 + 1):
            bits = 0
            for k in range(2):
                s = 2 * col + k
                bits |= (1 << k) if a0 <= s <= a1 else 0
                bits |= (4 << k) if b0 <= s <= b1 else 0
            if bits:
                if tile.size:
                    tile[start + n] = row * cols + col
                    mask[start + n] = bits
                n += 1
    return n
