"""From the derivatives of splats on the screen to those of a scene's parameters: the projection of `front.projection` backwards."""

from __future__ import annotations

import numba
import numpy as np

from ..front.projection import _C0, _C1, _C2, _C3, DILATION, FACTOR, XX, XY, YY, A, B, C
from .parameters import LOGIT, MEAN, QUAT, SCALE, SH
from .raster import D_RED, G_X, G_XX, G_XY, G_Y, G_YY, RED, G

_BLOCK = 256  # Gaussians that one call of a thread takes


@numba.njit(error_model="numpy", cache=True)
def _basis(x, y, z, count, out):
    """The first `count` real harmonics at a unit vector, as `front.projection.colours` sums them."""
    out[0] = _C0
    if count > 1:
        out[1], out[2], out[3] = -_C1 * y, _C1 * z, -_C1 * x
    xx, yy, zz = x * x, y * y, z * z
    if count > 4:
        out[4], out[5], out[6] = _C2[0] * x * y, _C2[1] * y * z, _C2[2] * (2.0 * zz - xx - yy)
        out[7], out[8] = _C2[3] * x * z, _C2[4] * (xx - yy)
    if count > 9:
        out[9], out[10], out[11] = _C3[0] * y * (3.0 * xx - yy), _C3[1] * x * y * z, _C3[2] * y * (4.0 * zz - xx - yy)
        out[12], out[13] = _C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy), _C3[4] * x * (4.0 * zz - xx - yy)
        out[14], out[15] = _C3[5] * z * (xx - yy), _C3[6] * x * (xx - 3.0 * yy)


@numba.njit(error_model="numpy", cache=True)
def _basis_slope(x, y, z, count, e):
    """Gradient in (x, y, z) of sum e_k basis_k."""
    dx = dy = dz = 0.0
    if count > 1:
        dx, dy, dz = -_C1 * e[3], -_C1 * e[1], _C1 * e[2]
    xx, yy, zz = x * x, y * y, z * z
    if count > 4:
        e4, e5, e6, e7, e8 = _C2[0] * e[4], _C2[1] * e[5], _C2[2] * e[6], _C2[3] * e[7], _C2[4] * e[8]
        dx += e4 * y - 2.0 * e6 * x + e7 * z + 2.0 * e8 * x
        dy += e4 * x + e5 * z - 2.0 * e6 * y - 2.0 * e8 * y
        dz += e5 * y + 4.0 * e6 * z + e7 * x
    if count > 9:
        e9, e10, e11, e12 = _C3[0] * e[9], _C3[1] * e[10], _C3[2] * e[11], _C3[3] * e[12]
        e13, e14, e15 = _C3[4] * e[13], _C3[5] * e[14], _C3[6] * e[15]
        dx += 6.0 * e9 * x * y + e10 * y * z - 2.0 * e11 * x * y - 6.0 * e12 * x * z
        dx += e13 * (4.0 * zz - 3.0 * xx - yy) + 2.0 * e14 * x * z + 3.0 * e15 * (xx - yy)
        dy += 3.0 * e9 * (xx - yy) + e10 * x * z + e11 * (4.0 * zz - xx - 3.0 * yy) - 6.0 * e12 * y * z
        dy += -2.0 * e13 * x * y - 2.0 * e14 * y * z - 6.0 * e15 * x * y
        dz += e10 * x * y + 8.0 * e11 * y * z + 3.0 * e12 * (2.0 * zz - xx - yy) + 8.0 * e13 * x * z + e14 * (xx - yy)
    return dx, dy, dz


@numba.njit(error_model="numpy", cache=True)
def _chain(n, values, index, place, table, rows, sums, view, position, fx, fy, slope, antialiased, coefficients, gradient, screen, basis, weight):
    k = np.uint64(place[n])
    i = np.uint64(index[k])
    gradient[n] = 0.0
    a, b, c = table[i, A], table[i, B], table[i, C]
    g_x, g_y = sums[k, G_X], sums[k, G_Y]
    mean_x, mean_y = -(a * g_x + b * g_y), -(b * g_x + c * g_y)
    screen[n, 0], screen[n, 1] = mean_x, mean_y

    # The conic is the inverse of the covariance: dL/dcov = -conic dL/dconic conic, all symmetric.
    q0, q1, q2 = 0.5 * sums[k, G_XX], 0.5 * sums[k, G_XY], 0.5 * sums[k, G_YY]
    left00, left01 = a * q0 + b * q1, a * q1 + b * q2
    left10, left11 = b * q0 + c * q1, b * q1 + c * q2
    cov00, cov01 = -(left00 * a + left01 * b), -(left00 * b + left01 * c)
    cov11 = -(left10 * b + left11 * c)
    if antialiased:
        # The opacity's factor is sqrt(det / dilated det): d log factor / dcov is half the difference of the inverses. What is drawn has a factor above 1/255.
        per_det = a / (table[i, FACTOR] ** 2 * table[i, YY])
        half = -0.5 * sums[k, G]
        cov00 += half * ((table[i, YY] - DILATION) * per_det - a)
        cov01 += half * (-table[i, XY] * per_det - b)
        cov11 += half * ((table[i, XX] - DILATION) * per_det - c)

    dx = values[i, MEAN] - position[0]
    dy = values[i, MEAN + 1] - position[1]
    dz = values[i, MEAN + 2] - position[2]
    z = view[2, 0] * dx + view[2, 1] * dy + view[2, 2] * dz
    tx = (view[0, 0] * dx + view[0, 1] * dy + view[0, 2] * dz) / z
    ty = (view[1, 0] * dx + view[1, 1] * dy + view[1, 2] * dz) / z
    held_x, held_y = min(max(tx, slope[0, 0]), slope[0, 1]), min(max(ty, slope[1, 0]), slope[1, 1])
    j00, j11, j02, j12 = fx / z, fy / z, -fx * held_x / z, -fy * held_y / z

    w = np.float64(values[i, QUAT])
    p = np.float64(values[i, QUAT + 1])
    q = np.float64(values[i, QUAT + 2])
    r = np.float64(values[i, QUAT + 3])
    norm = np.sqrt(w * w + p * p + q * q + r * r)
    w, p, q, r = w / norm, p / norm, q / norm, r / norm
    d00 = d11 = d02 = d12 = 0.0  # of the Jacobian
    dw = dp = dq = dr = 0.0
    for m in range(3):
        if m == 0:
            r0, r1, r2 = 1.0 - 2.0 * (q * q + r * r), 2.0 * (p * q + w * r), 2.0 * (p * r - w * q)
        elif m == 1:
            r0, r1, r2 = 2.0 * (p * q - w * r), 1.0 - 2.0 * (p * p + r * r), 2.0 * (q * r + w * p)
        else:
            r0, r1, r2 = 2.0 * (p * r + w * q), 2.0 * (q * r - w * p), 1.0 - 2.0 * (p * p + q * q)
        s = np.exp(np.float64(values[i, SCALE + m]))
        b0 = s * (view[0, 0] * r0 + view[0, 1] * r1 + view[0, 2] * r2)
        b1 = s * (view[1, 0] * r0 + view[1, 1] * r1 + view[1, 2] * r2)
        b2 = s * (view[2, 0] * r0 + view[2, 1] * r1 + view[2, 2] * r2)
        u, v = j00 * b0 + j02 * b2, j11 * b1 + j12 * b2
        # cov = V V^T with columns (u, v).
        du, dv = 2.0 * (cov00 * u + cov01 * v), 2.0 * (cov01 * u + cov11 * v)
        d00 += du * b0
        d02 += du * b2
        d11 += dv * b1
        d12 += dv * b2
        e0, e1, e2 = j00 * du, j11 * dv, j02 * du + j12 * dv
        gradient[n, SCALE + m] = e0 * b0 + e1 * b1 + e2 * b2
        c0 = s * (view[0, 0] * e0 + view[1, 0] * e1 + view[2, 0] * e2)
        c1 = s * (view[0, 1] * e0 + view[1, 1] * e1 + view[2, 1] * e2)
        c2 = s * (view[0, 2] * e0 + view[1, 2] * e1 + view[2, 2] * e2)
        if m == 0:
            dw += 2.0 * (r * c1 - q * c2)
            dp += 2.0 * (q * c1 + r * c2)
            dq += 2.0 * (-2.0 * q * c0 + p * c1 - w * c2)
            dr += 2.0 * (-2.0 * r * c0 + w * c1 + p * c2)
        elif m == 1:
            dw += 2.0 * (-r * c0 + p * c2)
            dp += 2.0 * (q * c0 - 2.0 * p * c1 + w * c2)
            dq += 2.0 * (p * c0 + r * c2)
            dr += 2.0 * (-w * c0 - 2.0 * r * c1 + q * c2)
        else:
            dw += 2.0 * (q * c0 - p * c1)
            dp += 2.0 * (r * c0 - w * c1 - 2.0 * p * c2)
            dq += 2.0 * (w * c0 + r * c1 - 2.0 * q * c2)
            dr += 2.0 * (p * c0 + q * c1)
    along = w * dw + p * dp + q * dq + r * dr
    gradient[n, QUAT] = (dw - along * w) / norm
    gradient[n, QUAT + 1] = (dp - along * p) / norm
    gradient[n, QUAT + 2] = (dq - along * q) / norm
    gradient[n, QUAT + 3] = (dr - along * r) / norm

    # Mean in the camera: by the place on the screen and by the Jacobian, whose tangents stand still where they are held.
    d_tx, d_ty = fx * mean_x, fy * mean_y
    if held_x == tx:
        d_tx -= fx / z * d02
    if held_y == ty:
        d_ty -= fy / z * d12
    t0, t1 = d_tx / z, d_ty / z
    t2 = -(d_tx * tx + d_ty * ty + j00 * d00 + j11 * d11 + j02 * d02 + j12 * d12) / z
    m0 = view[0, 0] * t0 + view[1, 0] * t1 + view[2, 0] * t2
    m1 = view[0, 1] * t0 + view[1, 1] * t1 + view[2, 1] * t2
    m2 = view[0, 2] * t0 + view[1, 2] * t1 + view[2, 2] * t2

    # Colour: coefficients, and the mean through the direction.
    distance = np.sqrt(dx * dx + dy * dy + dz * dz)
    ox, oy, oz = dx / distance, dy / distance, dz / distance
    count = (values.shape[1] - SH) // 3
    weight[:] = 0.0
    _basis(ox, oy, oz, count, basis)
    for channel in range(3):
        if rows[k, RED + channel] > 0.0:
            slope = sums[k, D_RED + channel]
            for m in range(count):
                column = SH + 3 * m + channel
                weight[m] += slope * values[i, column]
                if m < coefficients:
                    gradient[n, column] = slope * basis[m]
    sx, sy, sz = _basis_slope(ox, oy, oz, count, weight)
    radial = sx * ox + sy * oy + sz * oz
    gradient[n, MEAN] = m0 + (sx - radial * ox) / distance
    gradient[n, MEAN + 1] = m1 + (sy - radial * oy) / distance
    gradient[n, MEAN + 2] = m2 + (sz - radial * oz) / distance

    # alpha = o exp(-E): dL/do = -G / o, and do/dlogit = o (1 - o); a factor of o changes neither.
    gradient[n, LOGIT] = -sums[k, G] / (1.0 + np.exp(np.float64(values[i, LOGIT])))


@numba.njit(error_model="numpy", cache=True)
def _chain_block(block, values, index, place, table, rows, sums, view, position, fx, fy, slope, antialiased, coefficients, gradient, screen):
    basis, weight = np.zeros(16), np.zeros(16)
    for n in range(block * _BLOCK, min((block + 1) * _BLOCK, len(place))):
        _chain(n, values, index, place, table, rows, sums, view, position, fx, fy, slope, antialiased, coefficients, gradient, screen, basis, weight)


@numba.njit(error_model="numpy", parallel=True, cache=True)
def chain(values, index, place, table, rows, sums, view, position, fx, fy, slope, antialiased, coefficients, gradient, screen):
    """gradient: float32 (S, P), of the Gaussians index[place] in the columns of `values`; screen: float64 (S, 2), of their means in pixels.

    place: int64 (S,), into rows and sums. sums: float64 (M, 9), of `raster`. view: world to camera (3, 3). slope: of `slope_range`.
    antialiased: opacities have their factor. coefficients: how many SH coefficients are trained; the others' derivatives are 0.
    """
    for block in numba.prange((len(place) + _BLOCK - 1) // _BLOCK):
        _chain_block(np.int64(block), values, index, place, table, rows, sums, view, position, fx, fy, slope, antialiased, coefficients, gradient, screen)
