"""One Gaussian, from the numbers in the image to its splat: projection, covariance, shape, bounds. Every intermediate value has a name.

Source: as `flicker.front.projection` (Kerbl et al. 2023, Sec. 4). Differences that save hardware, none of which changes the result in exact
arithmetic: focal lengths
are in the rows of the view (`FrameSetup.row_x`), scales are divided by the depth, the determinant is that of the Gram matrix (a sum of squares of the cross
product, so that nothing cancels), and the shape comes from two reciprocal square roots:

    l2 = K / sqrt(yy)    l0 = K yy / sqrt(yy det)    l1 = -K xy / sqrt(yy det)    K^2 = log2(e) / 2

so that (conic) / 2 log2(e) = L L^T with u = l0 dx + l1 dy, v = l2 dy. Sums of three are ((a + b) + c). The conic form (`conic_one`) takes the inverse of
the covariance as it is: its determinant is the square of a reciprocal square root.

Of an antialiased scene an opacity is multiplied by sqrt(gram) / sqrt(det), the determinants before and after dilation, sqrt(gram) being gram / sqrt(gram).
"""

from __future__ import annotations

import math
from collections import namedtuple

import numba
import numpy as np

from ...arithmetic.ff import ff_add, ff_from_int, ff_ldexp, ff_mul, ff_neg, ff_recip, ff_round, ff_rsqrt, ff_sqrt, ff_sub, ff_to_fixed_round, pick
from ...front.projection import DILATION, NEAR
from ...params import SPIKY_AXIS_RATIO
from .setup import MEAN_FRACTION, FrontFormats, rounded

SHAPE_SCALE = math.sqrt(0.5 * math.log2(math.e))
LARGEST_REST = 1023 * 1023 * 2  # what three rotation codes 2 code - 1023 leave for the square of the largest: (1023 sqrt(2))^2
MEAN_INTEGER = 23  # of a mean in pixels, with its sign, saturated: 2^22 on either side of the middle
MEAN_BITS = MEAN_INTEGER + MEAN_FRACTION
_TRACE_FACTOR = (SPIKY_AXIS_RATIO**2 + 1.0) ** 2 / SPIKY_AXIS_RATIO**2  # trace^2 / det where the axis ratio is that of the threshold


def constants(formats: FrontFormats) -> np.ndarray:
    """float64: constants of `project_one`, as ff numbers of their formats."""
    shape = rounded([SHAPE_SCALE, DILATION, DILATION**2, _TRACE_FACTOR], formats.shape)
    return np.concatenate([rounded([NEAR], formats.position), shape])


@numba.njit
def _sum3(a, b, c, M):
    return ff_add(ff_add(a, b, M), c, M)


@numba.njit
def _dot3(a0, a1, a2, b0, b1, b2, M):
    return _sum3(ff_mul(a0, b0, M), ff_mul(a1, b1, M), ff_mul(a2, b2, M), M)


@numba.njit
def largest_component(a, b, c, M):
    """ff: the component that a chunk's rotation leaves out, in units of sqrt(2) / 2046, from the three integers 2 code - 1023."""
    return ff_sqrt(ff_from_int(max(LARGEST_REST - (a * a + b * b + c * c), 0), M), M)


@numba.njit
def place_largest(number, most, a, b, d):
    """w, x, y, z of a chunk's rotation: the largest is component `number`, the others follow in order."""
    w = pick(number < 1, most, a)
    x = pick(number < 1, a, pick(number < 2, most, b))
    y = pick(number < 2, b, pick(number < 3, most, d))
    return w, x, y, pick(number < 3, d, most)


# d: mean less the camera's position, world axes. square: of the distance, from d alone. t: d in camera axes. x, y: mean on the screen in 1/128 pixel.
# ax, ay: clamped slopes. u, v: rows of the Jacobian times the view. r: rotation, row by row. s: scales over depth. gu, gv: rows of J W R S. cross: of the two.
# scale: of an opacity's number, which makes its code. xx, xy, yy: covariance, dilated. radius_x, radius_y: 3 standard deviations in 1/128 pixel.
# rxx, ryy, rdet: reciprocal square roots. far: the mean on the screen is saturated.
Projection = namedtuple(
    "Projection",
    "d0 d1 d2 square t0 t1 t2 iz tx ty x y ax ay u0 u1 u2 v0 v1 v2 norm n r00 r01 r02 r10 r11 r12 r20 r21 r22 s0 s1 s2 gu0 gu1 gu2 gv0 gv1 gv2 "
    "cross0 cross1 cross2 xx xy yy det trace spiky rxx ryy rdet scale m l0 l1 l2 sx sy radius_x radius_y near far",
)


@numba.njit
def project_one(
    d0c, stepc, q, s, w, x, y, z, view, focal, row_x, row_x_z, row_y, row_y_z, least, limit, middle, share, antialiased, const, P, S, fraction=MEAN_FRACTION,
):
    """Projection of a Gaussian. d0c: (3,) of the cluster, ff (P bits), stepc: (3,); q: (3,) ff numbers of the mean; s: (3,) ff (S bits); w to z:
    quaternion, any length. middle: principal point. share: `scale` where nothing is antialiased. fraction: of means and radii, 1/128 pixel where it is 7.

    Without `near` (nearer than 0.2) the other values mean nothing.
    """
    d0 = ff_add(d0c[0], ff_mul(stepc[0], q[0], P), P)
    d1 = ff_add(d0c[1], ff_mul(stepc[1], q[1], P), P)
    d2 = ff_add(d0c[2], ff_mul(stepc[2], q[2], P), P)
    square = _dot3(d0, d1, d2, d0, d1, d2, P)
    t0 = _dot3(view[0, 0], view[0, 1], view[0, 2], d0, d1, d2, P)
    t1 = _dot3(view[1, 0], view[1, 1], view[1, 2], d0, d1, d2, P)
    t2 = _dot3(view[2, 0], view[2, 1], view[2, 2], d0, d1, d2, P)
    near = t2 <= const[0]
    iz = ff_recip(t2, P)
    tx = ff_mul(t0, iz, P)
    ty = ff_mul(t1, iz, P)
    bits = fraction + MEAN_INTEGER
    top = (1 << (bits - 1)) - 1
    off_x = ff_to_fixed_round(ff_mul(focal[0], tx, P), fraction, bits)
    off_y = ff_to_fixed_round(ff_mul(focal[1], ty, P), fraction, bits)
    far = (off_x >= top) | (off_x < -top) | (off_y >= top) | (off_y < -top)
    screen_x, screen_y = off_x + middle[0], off_y + middle[1]
    ax = min(max(ff_round(tx, S), least[0]), limit[0])
    ay = min(max(ff_round(ty, S), least[1]), limit[1])
    u0 = ff_sub(row_x[0], ff_mul(ax, row_x_z[0], S), S)
    u1 = ff_sub(row_x[1], ff_mul(ax, row_x_z[1], S), S)
    u2 = ff_sub(row_x[2], ff_mul(ax, row_x_z[2], S), S)
    v0 = ff_sub(row_y[0], ff_mul(ay, row_y_z[0], S), S)
    v1 = ff_sub(row_y[1], ff_mul(ay, row_y_z[1], S), S)
    v2 = ff_sub(row_y[2], ff_mul(ay, row_y_z[2], S), S)
    norm = ff_add(ff_add(ff_mul(w, w, S), ff_mul(x, x, S), S), ff_add(ff_mul(y, y, S), ff_mul(z, z, S), S), S)
    n = ff_round(2.0 * ff_recip(norm, S), S)
    nx, ny, nz = ff_mul(n, x, S), ff_mul(n, y, S), ff_mul(n, z, S)
    wx, wy, wz = ff_mul(w, nx, S), ff_mul(w, ny, S), ff_mul(w, nz, S)
    qxx, qxy, qxz = ff_mul(x, nx, S), ff_mul(x, ny, S), ff_mul(x, nz, S)
    qyy, qyz, qzz = ff_mul(y, ny, S), ff_mul(y, nz, S), ff_mul(z, nz, S)
    r00, r01, r02 = ff_sub(1.0, ff_add(qyy, qzz, S), S), ff_sub(qxy, wz, S), ff_add(qxz, wy, S)
    r10, r11, r12 = ff_add(qxy, wz, S), ff_sub(1.0, ff_add(qxx, qzz, S), S), ff_sub(qyz, wx, S)
    r20, r21, r22 = ff_sub(qxz, wy, S), ff_add(qyz, wx, S), ff_sub(1.0, ff_add(qxx, qyy, S), S)
    over = ff_round(iz, S)
    s0, s1, s2 = ff_mul(s[0], over, S), ff_mul(s[1], over, S), ff_mul(s[2], over, S)
    gu0 = ff_mul(_dot3(u0, u1, u2, r00, r10, r20, S), s0, S)
    gu1 = ff_mul(_dot3(u0, u1, u2, r01, r11, r21, S), s1, S)
    gu2 = ff_mul(_dot3(u0, u1, u2, r02, r12, r22, S), s2, S)
    gv0 = ff_mul(_dot3(v0, v1, v2, r00, r10, r20, S), s0, S)
    gv1 = ff_mul(_dot3(v0, v1, v2, r01, r11, r21, S), s1, S)
    gv2 = ff_mul(_dot3(v0, v1, v2, r02, r12, r22, S), s2, S)
    xx = _dot3(gu0, gu1, gu2, gu0, gu1, gu2, S)
    yy = _dot3(gv0, gv1, gv2, gv0, gv1, gv2, S)
    xy = _dot3(gu0, gu1, gu2, gv0, gv1, gv2, S)
    cross0 = ff_sub(ff_mul(gu1, gv2, S), ff_mul(gu2, gv1, S), S)
    cross1 = ff_sub(ff_mul(gu2, gv0, S), ff_mul(gu0, gv2, S), S)
    cross2 = ff_sub(ff_mul(gu0, gv1, S), ff_mul(gu1, gv0, S), S)
    gram = _dot3(cross0, cross1, cross2, cross0, cross1, cross2, S)
    det = ff_add(gram, ff_add(ff_mul(const[2], ff_add(xx, yy, S), S), const[3], S), S)
    xx = ff_add(xx, const[2], S)
    yy = ff_add(yy, const[2], S)
    trace = ff_add(xx, yy, S)
    spiky = ff_mul(trace, trace, S) >= ff_mul(det, const[4], S)
    rxx, ryy, rdet = ff_rsqrt(xx, S), ff_rsqrt(yy, S), ff_rsqrt(det, S)
    scale = pick(antialiased, ff_mul(ff_mul(ff_mul(share, gram, S), ff_rsqrt(gram, S), S), rdet, S), share)
    m = ff_mul(const[1], ff_mul(ryy, rdet, S), S)
    l2 = ff_mul(const[1], ryy, S)
    l0 = ff_mul(yy, m, S)
    l1 = ff_neg(ff_mul(xy, m, S))
    sx, sy = ff_mul(xx, rxx, S), ff_mul(yy, ryy, S)
    radius_x = ff_to_fixed_round(ff_mul(3.0, sx, S), fraction, bits)
    radius_y = ff_to_fixed_round(ff_mul(3.0, sy, S), fraction, bits)
    return Projection(
        d0, d1, d2, square, t0, t1, t2, iz, tx, ty, screen_x, screen_y, ax, ay, u0, u1, u2, v0, v1, v2, norm, n, r00, r01, r02, r10, r11, r12, r20, r21,
        r22, s0, s1, s2, gu0, gu1, gu2, gv0, gv1, gv2, cross0, cross1, cross2, xx, xy, yy, det, trace, spiky, rxx, ryy, rdet, scale, m, l0, l1, l2, sx, sy,
        radius_x, radius_y, near, far,
    )


@numba.njit
def conic_one(p, S):
    """a / 2, b, c / 2 of the conic form, ff. p: Projection.

    The dilation bounds them: a, c and the magnitude of b are at most 1 / DILATION, far below FP16's largest number.
    """
    over = ff_mul(p.rdet, p.rdet, S)
    return ff_ldexp(ff_mul(p.yy, over, S), -1, S), ff_neg(ff_mul(p.xy, over, S)), ff_ldexp(ff_mul(p.xx, over, S), -1, S)


@numba.njit
def pixels(centre, reach, size, fraction=MEAN_FRACTION):
    """First and last pixel centre of 0..size - 1 within centre +- reach, both in 1/128 pixel; the first is past the last where there is none."""
    first = (centre + ~reach >> fraction) + 1  # rounded up: ~reach is -reach - 1
    last = (centre + reach) >> fraction
    return max(first, 0), min(last, size - 1)
