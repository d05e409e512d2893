"""Blending of a picture and its derivatives, tile by tile, with the rules of `front.reference`.

A tile is drawn by one thread, entries in the order of its list, and writes nothing that another tile writes: the results have the same bits whatever the
number of threads. Indices are unsigned: signed ones may count from the end, which costs a test at every access. What a thread does stands in a function of its
own, which halves the time to compile. `visit` is the one place where pixels are chosen and transmittance is counted down: whoever walks a list calls it.
"""

from __future__ import annotations

import numba
import numpy as np

from ..front.binning import span
from ..front.projection import RADIUS, XX, XY, YY, A, B, C, X, Y, tile_range
from ..params import ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN

# Columns of a splat's row. E = HALF_A dx^2 + MIXED dx dy + HALF_C dy^2 is at most LIMIT / 2 where alpha >= 1/255: rows within HALF_HEIGHT of the mean, and in
# a row dy away sqrt((LIMIT - dy^2 PER_YY) PER_A) around the mean + SLOPE dy.
MX, MY, HALF_A, MIXED, HALF_C, OPACITY, LIMIT, HALF_HEIGHT, PER_YY, PER_A, SLOPE, RED, GREEN, BLUE = range(14)
COLUMNS = 14
# Sums over pixels, of an entry: G = dL/dE, then G times dx, dy, dx^2, dx dy, dy^2; the colour's derivative.
G, G_X, G_Y, G_XX, G_XY, G_YY, D_RED, D_GREEN, D_BLUE = range(9)
SUMS = 9
MARGIN = 1e-3  # pixels and parts of LIMIT by which more is visited than alpha >= 1/255 needs: rounding never decides
COLOUR_MAX = 1e4  # a Gaussian with more is taken for a broken one
_NONE, _ONE, _TWO, _FOUR, _FIFTEEN = np.uint64(0), np.uint64(1), np.uint64(2), np.uint64(4), np.uint64(15)  # signed ones would make floats of unsigned indices
_FAST = {"contract", "nsz", "arcp"}  # nothing that would change what is not finite, or the order of sums


@numba.njit(cache=True)
def _make_row(k, index, table, opacity, rgb, width, height, rows, box, bad):
    tiles_x = (width + TILE - 1) // TILE
    tiles_y = (height + TILE - 1) // TILE
    i = index[k]
    x, y, xx, yy = table[i, X], table[i, Y], table[i, XX], table[i, YY]
    a, b, c = table[i, A], table[i, B], table[i, C]
    limit = 2.0 * np.log(opacity[i] / ALPHA_MIN)
    colour = max(abs(rgb[k, 0]), abs(rgb[k, 1]), abs(rgb[k, 2])) + rgb[k, 0] + rgb[k, 1] + rgb[k, 2]
    box[k] = 0
    bad[k] = not np.isfinite(x + y + table[i, XY] + 1.0 / xx + 1.0 / yy + 1.0 / a + b + c + opacity[i]) or not colour <= 4 * COLOUR_MAX
    if bad[k] or not limit >= 0.0:
        rows[k] = 0.0
        return
    limit += MARGIN * limit + MARGIN
    half_x, half_y = np.sqrt(limit * xx) + MARGIN, np.sqrt(limit * yy) + MARGIN
    circle = tile_range(x, table[i, RADIUS], tiles_x)
    ellipse = span(x - half_x, min(x + half_x, width - 1.0), TILE, tiles_x)
    box[k, 0], box[k, 1] = max(circle[0], ellipse[0]), min(circle[1], ellipse[1])
    circle = tile_range(y, table[i, RADIUS], tiles_y)
    ellipse = span(y - half_y, min(y + half_y, height - 1.0), TILE, tiles_y)
    box[k, 2], box[k, 3] = max(circle[0], ellipse[0]), min(circle[1], ellipse[1])
    rows[k, MX] = x
    rows[k, MY] = y
    rows[k, HALF_A] = 0.5 * a
    rows[k, MIXED] = b
    rows[k, HALF_C] = 0.5 * c
    rows[k, OPACITY] = opacity[i]
    rows[k, LIMIT] = limit
    rows[k, HALF_HEIGHT] = half_y
    rows[k, PER_YY] = 1.0 / yy
    rows[k, PER_A] = 1.0 / a
    rows[k, SLOPE] = -b / a
    rows[k, RED] = rgb[k, 0]
    rows[k, GREEN] = rgb[k, 1]
    rows[k, BLUE] = rgb[k, 2]


@numba.njit(parallel=True, cache=True)
def make_rows(index, table, opacity, rgb, width, height, rows, box, bad):
    """Rows and boxes of the Gaussians `index`: tiles that the reference lists them in and that a pixel of alpha >= 1/255 can be in.

    table: of `front.projection.geometry`. opacity: float64 (N,). rgb: float64 (M, 3). box: int32 (M, 4), columns, then rows, first and one past last. bad: bool
    (M,), something is not finite; such a Gaussian is in no tile.
    """
    for k in numba.prange(len(index)):
        _make_row(np.int64(k), index, table, opacity, rgb, width, height, rows, box, bad)


@numba.njit(fastmath=_FAST, cache=True)
def visit(rows, i, visited, left, top, right, bottom, remains, place, alpha, before):
    """Pixels of a tile that Gaussian i is blended in: how many, and how many it finishes. This is where the rules of blending stand.

    visited: uint64, bit 4 row + column of the 4x4 pixels of the tile in which it may be. left, top: the tile's first pixel. right, bottom: its last column and
    line within the picture, from there. remains: float64 (16, 16), transmittance, negative once the pixel is finished; brought up to date. The k-th blended
    pixel is at place[k] = 16 line + column (uint8), where the Gaussian has alpha[k] behind a transmittance of before[k] (float64, 256 of each).
    """
    mx, my = rows[i, MX] - left, rows[i, MY] - top
    half = rows[i, HALF_HEIGHT]
    low, high = max(np.ceil(my - half), 0.0), min(np.floor(my + half), bottom)
    blended, finished = _NONE, 0
    if high < low:
        return blended, finished
    half_a, mixed, half_c, limit = rows[i, HALF_A], rows[i, MIXED], rows[i, HALF_C], rows[i, LIMIT]
    opacity, per_yy, per_a, slope = rows[i, OPACITY], rows[i, PER_YY], rows[i, PER_A], rows[i, SLOPE]
    for y in range(np.uint64(np.int64(low)), np.uint64(np.int64(high) + 1)):
        dy = np.float64(y) - my
        half = np.sqrt(max(limit - dy * dy * per_yy, 0.0) * per_a) + MARGIN
        middle = mx + slope * dy
        low_x, high_x = max(np.ceil(middle - half), 0.0), min(np.floor(middle + half), right)
        if high_x < low_x:
            continue
        along, constant_part = mixed * dy, half_c * dy * dy
        for x in range(np.uint64(np.int64(low_x)), np.uint64(np.int64(high_x) + 1)):
            transmittance = remains[y, x]
            if transmittance < 0.0:
                continue
            dx = np.float64(x) - mx
            energy = (half_a * dx + along) * dx + constant_part
            if energy < 0.0:
                continue
            opaque = min(ALPHA_MAX, opacity * np.exp(-energy))
            if opaque < ALPHA_MIN or not (visited >> ((y >> _TWO << _TWO) + (x >> _TWO))) & _ONE:
                continue
            after = transmittance * (1.0 - opaque)
            if after < TRANSMITTANCE_MIN:
                remains[y, x] = -transmittance
                finished += 1
                continue
            remains[y, x] = after
            place[blended] = (y << _FOUR) + x
            alpha[blended] = opaque
            before[blended] = transmittance
            blended += _ONE
    return blended, finished


@numba.njit(fastmath=_FAST, cache=True)
def _blend_tile(t, rows, start, entry, mask, tiles_x, background, image, transmittance, used):
    height, width = transmittance.shape
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    remains = np.ones((TILE, TILE))
    colour = np.zeros((TILE * TILE, 3))
    place, alpha, before = np.empty(TILE * TILE, np.uint8), np.empty(TILE * TILE), np.empty(TILE * TILE)
    live = columns * lines
    for e in range(start[t], start[t + 1]):
        if live == 0:
            break
        i = np.uint64(entry[e])
        count, finished = visit(rows, i, np.uint64(mask[e]), left, top, columns - 1.0, lines - 1.0, remains, place, alpha, before)
        live -= finished
        used[e] = count or finished
        red, green, blue = rows[i, RED], rows[i, GREEN], rows[i, BLUE]
        for k in range(count):
            at, weight = np.uint64(place[k]), alpha[k] * before[k]
            colour[at, 0] += weight * red
            colour[at, 1] += weight * green
            colour[at, 2] += weight * blue
    for y in range(lines):
        for x in range(columns):
            remaining = abs(remains[y, x])
            transmittance[top + y, left + x] = remaining
            for k in range(3):
                image[top + y, left + x, k] = colour[y * TILE + x, k] + remaining * background[k]


@numba.njit(parallel=True, cache=True)
def blend(rows, start, entry, mask, tiles_x, background, image, transmittance, used):
    """image (H, W, 3) over the background, transmittance (H, W) left; used: bool (E,), the entry was blended in a pixel or finished one.

    mask: uint16 (E,), 4x4 pixels of the tile in which an entry may be blended, bit 4 row + column.
    """
    for t in numba.prange(len(start) - 1):
        _blend_tile(np.int64(t), rows, start, entry, mask, tiles_x, background, image, transmittance, used)


@numba.njit(fastmath=_FAST, cache=True)
def _blend_back_tile(t, rows, start, entry, mask, tiles_x, image, used, slope_of_image, sums):
    """Walks the list as `_blend_tile` does. A pixel's state: the transmittance, and `rest`, what is yet to come of the picture's product with its slope."""
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    remains = np.ones((TILE, TILE))
    pixel = np.zeros((TILE * TILE, 4))  # slope of the three channels, rest
    place, alpha, before = np.empty(TILE * TILE, np.uint8), np.empty(TILE * TILE), np.empty(TILE * TILE)
    for y in range(lines):
        for x in range(columns):
            at = y * TILE + x
            for k in range(3):
                pixel[at, k] = slope_of_image[top + y, left + x, k]
                pixel[at, 3] += slope_of_image[top + y, left + x, k] * image[top + y, left + x, k]
    for e in range(start[t], start[t + 1]):
        if not used[e]:
            continue
        i = np.uint64(entry[e])
        count, _ = visit(rows, i, np.uint64(mask[e]), left, top, columns - 1.0, lines - 1.0, remains, place, alpha, before)
        mx, my = rows[i, MX] - left, rows[i, MY] - top
        red, green, blue = rows[i, RED], rows[i, GREEN], rows[i, BLUE]
        g, g_x, g_y, g_xx, g_xy, g_yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        d_red, d_green, d_blue = 0.0, 0.0, 0.0
        for k in range(count):
            at = np.uint64(place[k])
            s_red, s_green, s_blue = pixel[at, 0], pixel[at, 1], pixel[at, 2]
            weight = alpha[k] * before[k]
            d_red += weight * s_red
            d_green += weight * s_green
            d_blue += weight * s_blue
            own = s_red * red + s_green * green + s_blue * blue
            rest = pixel[at, 3] - weight * own
            pixel[at, 3] = rest
            if alpha[k] < ALPHA_MAX:
                dx, dy = np.float64(at & _FIFTEEN) - mx, np.float64(at >> _FOUR) - my
                slope = alpha[k] * (rest / (1.0 - alpha[k]) - before[k] * own)
                g += slope
                g_x += slope * dx
                g_y += slope * dy
                g_xx += slope * dx * dx
                g_xy += slope * dx * dy
                g_yy += slope * dy * dy
        sums[e, G] = g
        sums[e, G_X] = g_x
        sums[e, G_Y] = g_y
        sums[e, G_XX] = g_xx
        sums[e, G_XY] = g_xy
        sums[e, G_YY] = g_yy
        sums[e, D_RED] = d_red
        sums[e, D_GREEN] = d_green
        sums[e, D_BLUE] = d_blue


@numba.njit(parallel=True, cache=True)
def blend_back(rows, start, entry, mask, tiles_x, image, used, slope_of_image, sums):
    """sums (E, 9) of every used entry; the others' are not written. slope_of_image: (H, W, 3), dL/d image."""
    for t in numba.prange(len(start) - 1):
        _blend_back_tile(np.int64(t), rows, start, entry, mask, tiles_x, image, used, slope_of_image, sums)


@numba.njit(cache=True)
def gather(entry, used, sums, total):
    """Add the sums of the entries to those of their Gaussians, float64 (M, 9), in the order of the lists."""
    for e in range(len(entry)):
        if used[e]:
            i = np.uint64(entry[e])
            for k in range(SUMS):
                total[i, k] += sums[e, k]
