"""What is minimised: (1 - lambda) L1 + lambda (1 - SSIM) (Kerbl et al. 2023), with its derivative in the picture."""

from __future__ import annotations

import numba
import numpy as np

RADIUS = 5  # of the Gaussian window of 11x11, sigma 1.5; outside of the picture everything is 0
_WINDOW = np.exp(-np.arange(-RADIUS, RADIUS + 1.0) ** 2 / (2 * 1.5**2))
_WINDOW /= _WINDOW.sum()
_C1, _C2 = 0.01**2, 0.03**2


@numba.njit(fastmath={"contract", "nsz"}, cache=True)
def _along(line, padded, window, out):
    """Window sums of a line of pixels with three channels, (3 W,). padded: scratch, (3 (W + 10),), 0 at both ends."""
    n, edge = len(line), 3 * RADIUS
    padded[edge : edge + n] = line
    for j in range(n):
        out[j] = window[0] * padded[j]
    for k in range(1, 2 * RADIUS + 1):
        for j in range(n):
            out[j] += window[k] * padded[j + 3 * k]


@numba.njit(fastmath={"contract", "nsz"}, cache=True)
def _across(lines, y, window, out):
    """Window sums down the columns of lines (H, L) at line y."""
    out[:] = window[RADIUS] * lines[y]
    for k in range(2 * RADIUS + 1):
        row = y + k - RADIUS
        if k != RADIUS and 0 <= row < len(lines):
            for j in range(len(out)):
                out[j] += window[k] * lines[row, j]


@numba.njit(parallel=True, fastmath={"contract", "nsz"}, cache=True)
def _ssim(x, y, window, c, scratch, slope, line_sum):
    """Sum of SSIM of each line, float64 (H,), and the derivative of their sum in x. x, y, slope: (H, 3 W). c: 0, 1, C1, C2. scratch: (8, H, 3 W)."""
    height, length = x.shape
    zero, one, c1, c2 = c[0], c[1], c[2], c[3]
    two = one + one
    for v in numba.prange(height):
        padded = np.full(length + 6 * RADIUS, zero)
        _along(x[v], padded, window, scratch[0, v])
        _along(y[v], padded, window, scratch[1, v])
        _along(x[v] * x[v], padded, window, scratch[2, v])
        _along(y[v] * y[v], padded, window, scratch[3, v])
        _along(x[v] * y[v], padded, window, scratch[4, v])
    for v in numba.prange(height):
        moments = np.empty((5, length), x.dtype)
        for m in range(5):
            _across(scratch[m], v, window, moments[m])
        total = 0.0
        for j in range(length):
            mx, my = moments[0, j], moments[1, j]
            a1, b1 = two * mx * my + c1, mx * mx + my * my + c1
            a2 = two * (moments[4, j] - mx * my) + c2
            b2 = moments[2, j] - mx * mx + moments[3, j] - my * my + c2
            per = one / (b1 * b2)
            s = a1 * a2 * per
            d_xy, d_xx = two * a1 * per, -s / b2
            scratch[5, v, j] = two * (my * a2 * per - s * mx / b1) - d_xy * my - two * d_xx * mx
            scratch[6, v, j] = d_xx
            scratch[7, v, j] = d_xy
            total += np.float64(s)
        line_sum[v] = total
    for v in numba.prange(height):
        padded = np.full(length + 6 * RADIUS, zero)
        for m in range(3):
            _along(scratch[5 + m, v], padded, window, scratch[m, v])
    for v in numba.prange(height):
        moments = np.empty((3, length), x.dtype)
        for m in range(3):
            _across(scratch[m], v, window, moments[m])
        for j in range(length):
            slope[v, j] = moments[0, j] + two * x[v, j] * moments[1, j] + y[v, j] * moments[2, j]


def loss_and_slope(image: np.ndarray, photo: np.ndarray, weight: float = 0.2) -> tuple[float, np.ndarray]:
    """The loss and its derivative in the picture; both pictures (H, W, 3) in one number format. weight: lambda."""
    height, width, _ = image.shape
    kind = image.dtype.type
    slope, lines = np.empty((height, 3 * width), kind), np.empty(height)
    x, y = image.reshape(height, -1), np.ascontiguousarray(photo).reshape(height, -1)
    _ssim(x, y, _WINDOW.astype(kind), np.array([0.0, 1.0, _C1, _C2], kind), np.empty((8, height, 3 * width), kind), slope, lines)
    difference = x - y
    loss = (1.0 - weight) * float(np.abs(difference).mean(dtype=np.float64)) + weight * (1.0 - float(lines.sum()) / x.size)
    slope *= kind(-weight / x.size)
    slope += np.sign(difference) * kind((1.0 - weight) / x.size)
    return loss, slope.reshape(image.shape)
