"""Blending of a picture and its derivatives, tile by tile, with the rules of `front.reference`.

A tile is drawn by one thread, entries in the order of its list, and writes nothing that another tile writes: the results have the same bits whatever the
number of threads. Indices are unsigned: signed ones may count from the end, which costs a test at every access. What a thread does stands in a function of its
own, which halves the time to compile. `visit` is the one place where pixels are chosen and transmittance is counted down: whoever walks a list calls it, over
windows of LANES pixels of a line, and does all it has to do with a pixel in the same loop, without branches, which the compiler then vectorises. The format of
the rows, float32 or float64, is that of everything.
"""

from __future__ import annotations

import math

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
# Pixels and parts of LIMIT by which more is visited than alpha >= 1/255 needs, so that rounding never decides; in float32 as long as a splat's mean is within
# some 10,000 pixels of the tile.
MARGIN = 1e-3
COLOUR_MAX = 1e4  # a Gaussian with more is taken for a broken one
LANES = 8  # pixels of a line that are visited at once
PITCH = TILE + LANES  # of a tile's lines in its planes: what is visited beyond its end is no pixel
PLANE = TILE * PITCH
_ONE, _TWO, _FOUR, _TWELVE = np.uint64(1), np.uint64(2), np.uint64(4), np.uint64(12)  # signed ones would make floats of unsigned indices
_LANES, _PITCH = np.uint64(LANES), np.uint64(PITCH)
_OWN, _OWN_2, _OWN_3, _OWN_4 = (np.uint64(k * PLANE) for k in range(1, 5))  # planes behind the transmittance
_FAST = {"contract", "nsz", "arcp"}  # nothing that would change what is not finite, or the order of sums
_SUMS = _FAST | {"reassoc"}  # sums over lanes
_FAR = 6.0  # energy from which alpha is below 1/255 whatever the opacity
# exp(-x) = p(x)^16 with the Taylor polynomial p of exp(-x / 16): to 1e-11 up to _FAR.
_E0, _E1, _E2, _E3, _E4, _E5, _E6, _E7, _E8, _E9, _E10 = ((-1 / 16) ** k / math.factorial(k) for k in range(11))


@numba.njit(error_model="numpy", fastmath=_FAST, forceinline=True)
def _exp(x, real):
    """exp(-x) of x from 0 to _FAR, without a branch or a table, so that lanes are computed at once."""
    low = real(_E8) + x * (real(_E9) + x * real(_E10))
    low = real(_E4) + x * (real(_E5) + x * (real(_E6) + x * (real(_E7) + x * low)))
    low = real(_E0) + x * (real(_E1) + x * (real(_E2) + x * (real(_E3) + x * low)))
    square = low * low
    fourth = square * square
    eighth = fourth * fourth
    return eighth * eighth


@numba.njit(error_model="numpy", cache=True)
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


@numba.njit(error_model="numpy", parallel=True, cache=True)
def make_rows(index, table, opacity, rgb, width, height, rows, box, bad):
    """Rows and boxes of the Gaussians `index`: tiles that the reference lists them in and that a pixel of alpha >= 1/255 can be in.

    table: of `front.projection.geometry`. opacity: float64 (N,). rgb: float64 (M, 3). box: int32 (M, 4), columns, then rows, first and one past last. bad: bool
    (M,), something is not finite; such a Gaussian is in no tile.
    """
    for k in numba.prange(len(index)):
        _make_row(np.int64(k), index, table, opacity, rgb, width, height, rows, box, bad)


@numba.njit(error_model="numpy", fastmath=_FAST, forceinline=True)
def spans(row, left, top, right, bottom, first, last):
    """Lines of a tile from which to which a Gaussian is visited; from first[line], a multiple of four, to last[line] (int32 (16,)) in each of them.

    row: of the Gaussian. left, top: the tile's first pixel. right, bottom: its last column and line within the picture, from there.
    """
    real = row.dtype.type
    mx, my = row[MX] - real(left), row[MY] - real(top)
    limit, per_yy, per_a, slope = row[LIMIT], row[PER_YY], row[PER_A], row[SLOPE]
    nothing, end, margin = real(0.0), real(TILE), real(MARGIN)
    for y in range(TILE):
        dy = real(y) - my
        half = np.sqrt(max(limit - dy * dy * per_yy, nothing) * per_a) + margin
        middle = mx + slope * dy
        first[y] = np.int32(min(max(np.ceil(middle - half), nothing), end)) & -4
        last[y] = np.int32(max(min(np.floor(middle + half), real(right)), real(-1.0)))
    low, high = max(np.ceil(my - row[HALF_HEIGHT]), nothing), min(np.floor(my + row[HALF_HEIGHT]), real(bottom))
    return np.uint64(np.int64(min(low, end))), np.uint64(np.int64(max(high, real(-1.0))) + 1)


@numba.njit(error_model="numpy", fastmath=_FAST, forceinline=True)
def window(row, visited, left, top, y, x):
    """What LANES pixels of a tile, from column x of line y on, have in common for `visit`: (distance of the first from the mean in x, terms of E, opacity in
    the four nearer and the four farther pixels), and their place in a plane.

    visited: uint64, bit 4 row + column of the 4x4 pixels of the tile in which the Gaussian may be; x: a multiple of four.
    """
    real = row.dtype.type
    dx, dy = real(np.int64(x)) - (row[MX] - real(left)), real(np.int64(y)) - (row[MY] - real(top))
    tiny = visited >> ((y >> _TWO << _TWO) + (x >> _TWO))
    near = row[OPACITY] if tiny & _ONE else real(0.0)
    far = row[OPACITY] if tiny & _TWO and x < _TWELVE else real(0.0)
    return (dx, row[HALF_A], row[MIXED] * dy, row[HALF_C] * dy * dy, near, far), y * _PITCH + x


@numba.njit(error_model="numpy", fastmath=_FAST, forceinline=True)
def visit(k, common, state, at, real):
    """Blend a Gaussian in pixel k of a window at the place `at`: its distance from the mean in x; alpha, 0 where it is not blended; the transmittance before
    and after it, negative where the pixel was finished before or is none of the picture, and where it is finished now. The rules of blending stand here.

    state: of `new_tile`; its transmittance is brought up to date. real: its format.
    """
    dx, half_a, along, constant_part, near, far = common
    d = dx + real(np.int64(k))
    energy = (half_a * d + along) * d + constant_part
    opaque = min(real(ALPHA_MAX), (near if k < _FOUR else far) * _exp(min(energy, real(_FAR)), real))
    opaque = opaque if (opaque >= real(ALPHA_MIN)) & (energy >= real(0.0)) else real(0.0)
    before = state[at + k]
    after = before - before * opaque
    lives = after >= real(TRANSMITTANCE_MIN)
    after = after if lives else -abs(before)
    state[at + k] = after
    return d, opaque if lives else real(0.0), before, after


@numba.njit(error_model="numpy", forceinline=True)
def new_tile(planes, columns, lines, kind):
    """((1 + planes) PLANE,), of format `kind`: planes of a tile's pixels, the place of column x of line y at y PITCH + x of each. The first is the
    transmittance: 1 in the pixels of the picture, negative beyond them and in those that are finished; the others are 0. All in one array, so that the compiler
    sees that they do not overlap."""
    state = np.zeros((1 + planes) * PLANE, kind)
    for y in range(TILE):
        for x in range(PITCH):
            state[y * PITCH + x] = 1.0 if y < lines and x < columns else -1.0
    return state


@numba.njit(error_model="numpy", fastmath=_SUMS, forceinline=True)
def _paint(common, at, state, red, green, blue, real):
    """Blend a Gaussian in a window: in how many pixels it is blended, and how many it finishes; both as float numbers, as wide as the others."""
    blended, finished = real(0.0), real(0.0)
    for k in range(_LANES):
        _, opaque, before, after = visit(k, common, state, at, real)
        weight = opaque * before
        state[_OWN + at + k] += weight * red
        state[_OWN_2 + at + k] += weight * green
        state[_OWN_3 + at + k] += weight * blue
        blended += real(1.0) if opaque > real(0.0) else real(0.0)
        finished += real(1.0) if (before > real(0.0)) & (after < real(0.0)) else real(0.0)
    return blended, finished


@numba.njit(error_model="numpy", fastmath=_FAST, cache=True)
def _blend_tile(t, rows, start, entry, mask, tiles_x, background, image, transmittance, used):
    height, width = transmittance.shape
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    state = new_tile(3, columns, lines, rows.dtype)
    first, last = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    live = columns * lines
    real = rows.dtype.type
    for e in range(start[t], start[t + 1]):
        if live == 0:
            break
        row = rows[np.uint64(entry[e])]
        red, green, blue = row[RED], row[GREEN], row[BLUE]
        met = real(0.0)
        low, high = spans(row, left, top, columns - 1.0, lines - 1.0, first, last)
        for y in range(low, high):
            for x in range(first[y], last[y] + 1, LANES):
                common, at = window(row, np.uint64(mask[e]), left, top, y, np.uint64(x))
                blended, finished = _paint(common, at, state, red, green, blue, real)
                met += blended + finished
                live -= np.int64(finished)
        used[e] = met > 0
    for y in range(lines):
        for x in range(columns):
            at = y * PITCH + x
            remaining = abs(state[at])
            transmittance[top + y, left + x] = remaining
            for k in range(3):
                image[top + y, left + x, k] = state[(k + 1) * PLANE + at] + remaining * background[k]


@numba.njit(error_model="numpy", parallel=True, cache=True)
def blend(rows, start, entry, mask, tiles_x, background, image, transmittance, used):
    """image (H, W, 3) over the background, transmittance (H, W) left; used: bool (E,), the entry was blended in a pixel or finished one.

    mask: uint16 (E,), 4x4 pixels of the tile in which an entry may be blended, bit 4 row + column.
    """
    for t in numba.prange(len(start) - 1):
        _blend_tile(np.int64(t), rows, start, entry, mask, tiles_x, background, image, transmittance, used)


@numba.njit(error_model="numpy", fastmath=_SUMS, forceinline=True)
def _slopes(common, at, state, red, green, blue, real):
    """Brings `rest` up to date in a window; sums over its pixels: of G = dL/dE, of G dx, of G dx^2; the colour's derivative."""
    nothing = real(0.0)
    g, g_x, g_xx, d_red, d_green, d_blue = nothing, nothing, nothing, nothing, nothing, nothing
    for k in range(_LANES):
        dx, opaque, before, _ = visit(k, common, state, at, real)
        s_red, s_green, s_blue, rest = state[_OWN + at + k], state[_OWN_2 + at + k], state[_OWN_3 + at + k], state[_OWN_4 + at + k]
        weight = opaque * before
        own = s_red * red + s_green * green + s_blue * blue
        rest -= weight * own
        state[_OWN_4 + at + k] = rest
        slope = opaque * rest / (real(1.0) - opaque) - weight * own if opaque < real(ALPHA_MAX) else nothing
        g += slope
        g_x += slope * dx
        g_xx += slope * dx * dx
        d_red += weight * s_red
        d_green += weight * s_green
        d_blue += weight * s_blue
    return g, g_x, g_xx, d_red, d_green, d_blue


@numba.njit(error_model="numpy", fastmath=_FAST, cache=True)
def _blend_back_tile(t, rows, start, entry, mask, tiles_x, image, used, slope_of_image, sums):
    """Walks the list as `_blend_tile` does. A pixel's state: the transmittance, the slope of its three channels, and `rest`, what is yet to come of the
    picture's product with its slope."""
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    state = new_tile(4, columns, lines, rows.dtype)
    first, last = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    for y in range(lines):
        for x in range(columns):
            at = y * PITCH + x
            for k in range(3):
                slope = slope_of_image[top + y, left + x, k]
                state[(k + 1) * PLANE + at] = slope
                state[4 * PLANE + at] += slope * image[top + y, left + x, k]
    real = rows.dtype.type
    for e in range(start[t], start[t + 1]):
        if not used[e]:
            continue
        row = rows[np.uint64(entry[e])]
        my = np.float64(row[MY]) - top
        red, green, blue = row[RED], row[GREEN], row[BLUE]
        g, g_x, g_y, g_xx, g_xy, g_yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        d_red, d_green, d_blue = 0.0, 0.0, 0.0
        low, high = spans(row, left, top, columns - 1.0, lines - 1.0, first, last)
        for y in range(low, high):
            dy = np.float64(np.int64(y)) - my
            for x in range(first[y], last[y] + 1, LANES):
                common, at = window(row, np.uint64(mask[e]), left, top, y, np.uint64(x))
                some, some_x, some_xx, some_red, some_green, some_blue = _slopes(common, at, state, red, green, blue, real)
                g += some
                g_x += some_x
                g_y += some * dy
                g_xx += some_xx
                g_xy += some_x * dy
                g_yy += some * dy * dy
                d_red += some_red
                d_green += some_green
                d_blue += some_blue
        sums[e, G] = g
        sums[e, G_X] = g_x
        sums[e, G_Y] = g_y
        sums[e, G_XX] = g_xx
        sums[e, G_XY] = g_xy
        sums[e, G_YY] = g_yy
        sums[e, D_RED] = d_red
        sums[e, D_GREEN] = d_green
        sums[e, D_BLUE] = d_blue


@numba.njit(error_model="numpy", parallel=True, cache=True)
def blend_back(rows, start, entry, mask, tiles_x, image, used, slope_of_image, sums):
    """sums (E, 9) of every used entry; the others' are not written. slope_of_image: (H, W, 3), dL/d image."""
    for t in numba.prange(len(start) - 1):
        _blend_back_tile(np.int64(t), rows, start, entry, mask, tiles_x, image, used, slope_of_image, sums)


@numba.njit(error_model="numpy", cache=True)
def gather(entry, used, sums, total, seen):
    """Add the sums of the entries to those of their Gaussians, float64 (M, 9), in the order of the lists; seen: bool (M,), those with any."""
    for e in range(len(entry)):
        if used[e]:
            i = np.uint64(entry[e])
            seen[i] = True
            for k in range(SUMS):
                total[i, k] += sums[e, k]
