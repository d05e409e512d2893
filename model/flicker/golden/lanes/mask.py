"""Row intervals: the pixels of a sub-tile in which a splat can pass the lane's test, from the lane's own u and v.

A pair passes where u^2 + v^2 < bound(o), an integer (`formats.tables`). With U = |u| and V = |v| cut to `mask` fraction bits that gives
U^2 + V^2 < mask_bound, so U <= isqrt(mask_bound - 1 - V^2): one number a row. The table of roots rounds it up. So no pixel is left out that the lane blends,
whatever roundings made u and v (docs/lanes.md).
"""

from __future__ import annotations

from collections import namedtuple

import numba

from .setup import u_of, v_of

# v: unit 2^-uv. rest: mask_bound - 1 - V^2, unit 2^-2mask; negative: the row is empty. radius: pixels have U <= radius, unit 2^-mask; -1 in an empty row.
RowInterval = namedtuple("RowInterval", "v rest radius")


@numba.njit
def root_up(rest, t):
    """At least isqrt(rest), rest >= 0: the table's root of the leading bits, an even number of places further left, and one."""
    places = 0
    while rest >> (2 * places + t.root_bits):
        places += 1
    return t.root[rest >> 2 * places] >> (t.root_shift - places)


@numba.njit
def row_interval(s, j, t):
    """Row j of a sub-tile. s: SplatSetup, t: LaneTables."""
    v = v_of(s, j, t)
    cut = abs(v) >> t.drop
    rest = t.mask_bound[s.opacity] - 1 - cut * cut
    return RowInterval(v, rest, root_up(rest, t) if rest >= 0 else -1)


@numba.njit
def row_mask(s, t):
    """int64: bit 16 m + i is pixel i of mini-tile m."""
    mask = 0
    for j in range(8):
        radius = row_interval(s, j, t).radius
        if radius < 0:
            continue
        base = (j // 4) * 32 + (j % 4) * 4
        for i in range(8):
            if abs(u_of(s, i, j, t)) >> t.drop <= radius:
                mask |= 1 << (base + (i // 4) * 16 + i % 4)
    return mask


@numba.njit(forceinline=True)
def place_of(bit):
    """(column, row) in the sub-tile of a mask's bit."""
    return (bit >> 4 & 1) * 4 + (bit & 3), (bit >> 5) * 4 + (bit >> 2 & 3)
