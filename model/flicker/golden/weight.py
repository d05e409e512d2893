"""The Gaussian weight E, in conic and in factored form (docs/reference/number_formats.md).

PRTU and VRU evaluate the same expressions: terms of a pixel column, terms of a pixel row, and what joins them. Written
once here, each operation rounded to the format `r` (constants of `fp.rounding`), in the order of the hardware:

| | conic (paper, Eq. 1 and Alg. 1) | factored |
|---|---|---|
| column | xx = dx dx, s = xx (a/2) | p = l0 dx |
| row | yy = dy dy, s = yy (c/2) | q = l1 dy, v = l2 dy, vv = v v |
| pixel | h = sx + sy, xy = dx dy, t = xy b, E = h + t | u = p + q, uu = u u, E = uu + vv |
"""

from __future__ import annotations

import numba

from ..arithmetic.fp import add, mul


@numba.njit(forceinline=True)
def conic_axis(d, s, r):
    """Column or row terms of the conic form: (d d, d d s)."""
    dd = mul(d, d, r)
    return dd, mul(dd, s, r)


@numba.njit(forceinline=True)
def conic_pixel(dx, dy, sx, sy, b, r):
    """Pixel terms of the conic form: (xy, t, h, E)."""
    xy = mul(dx, dy, r)
    t = mul(xy, b, r)
    h = add(sx, sy, r)
    return xy, t, h, add(h, t, r)


@numba.njit(forceinline=True)
def factored_row(dy, l1, l2, r):
    """Row terms of the factored form: (q, v, vv)."""
    q = mul(l1, dy, r)
    v = mul(l2, dy, r)
    return q, v, mul(v, v, r)


@numba.njit(forceinline=True)
def factored_pixel(p, q, vv, r):
    """Pixel terms of the factored form: (u, uu, E)."""
    u = add(p, q, r)
    uu = mul(u, u, r)
    return u, uu, add(uu, vv, r)
