"""Row intervals: the pixels of a sub-tile in which a splat can pass the lane's test, from the lane's own u and v.

A pair passes where u^2 + v^2 < bound(o), an integer (`formats.tables`). The sums that u and v are made of are cut to `mask` fraction bits here, always
downwards, so that each row is an interval of small integers:

    s_j = floor(w + (j - 3.5) l1), y_j = floor(z + (j - 3.5) l2), c_i = floor((i - 3.5) l0)
    V_j = y_j or, of a negative one, -y_j - 1      radius_j at least isqrt(mask_bound - 1 - V_j^2), from a table
    pixel (i, j) is in the mask where -radius_j - 2 <= s_j + c_i <= radius_j

Floors are monotonic, so no pixel is left out that the lane blends, whatever roundings made u and v (docs/reference/lanes.md).
"""

from __future__ import annotations

from collections import namedtuple

import numba

from .setup import column_step, row_u, row_v

# s, y: cut sums of the row, unit 2^-mask. rest: mask_bound - 1 - V^2, unit 2^-2mask; negative: the row is empty. radius: unit 2^-mask; -1 in an empty row.
RowInterval = namedtuple("RowInterval", "s y rest radius")


@numba.njit
def root_up(rest, t):
    """At least isqrt(rest), rest >= 0: the leading bits, an even number of places up, address a table of roots that are rounded up."""
    places = 0
    while rest >> (2 * places + t.root_bits):
        places += 1
    return t.root[rest >> 2 * places] >> (t.root_shift - places)


@numba.njit
def row_interval(s, j, t):
    """Row j of a sub-tile. s: SplatSetup, t: LaneTables."""
    cut = t.guard + t.drop
    y = row_v(s, j, t) >> cut
    least = y if y >= 0 else -1 - y
    rest = t.mask_bound[s.opacity] - 1 - least * least
    return RowInterval(row_u(s, j, t) >> cut, y, rest, root_up(rest, t) if rest >= 0 else -1)


@numba.njit
def row_mask(s, t):
    """int64: bit 16 m + i is pixel i of mini-tile m."""
    mask = 0
    for j in range(8):
        row = row_interval(s, j, t)
        if row.radius < 0:
            continue
        base = (j // 4) * 32 + (j % 4) * 4
        for i in range(8):
            if -row.radius - 2 <= row.s + (column_step(s, i) >> (t.guard + t.drop)) <= row.radius:
                mask |= 1 << (base + (i // 4) * 16 + i % 4)
    return mask


@numba.njit(forceinline=True)
def place_of(bit):
    """(column, row) in the sub-tile of a mask's bit."""
    return (bit >> 4 & 1) * 4 + (bit & 3), (bit >> 5) * 4 + (bit >> 2 & 3)
