"""What is minimised: (1 - lambda) L1 + lambda (1 - SSIM) (Kerbl et al. 2023), or the logarithm of the mean squared error, whose mean over views is, but for a
factor, the mean PSNR; each with its derivative in the picture."""

from __future__ import annotations

import numba
import numpy as np

RADIUS = 5  # of the Gaussian window of 11x11, sigma 1.5; outside of the picture everything is 0
_WINDOW = np.exp(-np.arange(-RADIUS, RADIUS + 1.0) ** 2 / (2 * 1.5**2))
_WINDOW /= _WINDOW.sum()
_C1, _C2 = 0.01**2, 0.03**2
LEAST_ERROR = 1e-10  # of a view, mean square: 100 dB; nearer ones are not pulled harder


@numba.njit(fastmath={"contract", "nsz"}, cache=True)
def _blur_line(m, v, maps, window, out):
    height, length = maps.shape[1:]
    edge = 3 * RADIUS
    padded = np.zeros(length + 2 * edge)  # window sums down the columns, 0 at both ends
    for k in range(max(0, RADIUS - v), min(2 * RADIUS + 1, height + RADIUS - v)):
        for j in range(length):
            padded[edge + j] += window[k] * maps[m, v + k - RADIUS, j]
    out[m, v] = 0.0
    for k in range(2 * RADIUS + 1):
        for j in range(length):
            out[m, v, j] += window[k] * padded[j + 3 * k]


@numba.njit(parallel=True, cache=True)
def _blur(maps, window, out):
    """Window sums of maps (n, H, 3 W), pixels with three channels."""
    for n in numba.prange(maps.shape[0] * maps.shape[1]):
        _blur_line(np.int64(n) // maps.shape[1], np.int64(n) % maps.shape[1], maps, window, out)


@numba.njit(fastmath={"contract", "nsz"}, cache=True)
def _compare(moments, slopes):
    """Sum of SSIM, and slopes (3, H, 3 W): its derivatives in the moments E[x], E[x^2], E[x y]. moments: (5, H, 3 W) of x, y, x^2, y^2, x y."""
    total = 0.0
    for v in range(moments.shape[1]):
        for j in range(moments.shape[2]):
            mx, my = moments[0, v, j], moments[1, v, j]
            a1, b1 = 2.0 * mx * my + _C1, mx * mx + my * my + _C1
            a2 = 2.0 * (moments[4, v, j] - mx * my) + _C2
            b2 = moments[2, v, j] - mx * mx + moments[3, v, j] - my * my + _C2
            per = 1.0 / (b1 * b2)
            s = a1 * a2 * per
            d_xy, d_xx = 2.0 * a1 * per, -s / b2
            slopes[0, v, j] = 2.0 * (my * a2 * per - s * mx / b1) - d_xy * my - 2.0 * d_xx * mx
            slopes[1, v, j] = d_xx
            slopes[2, v, j] = d_xy
            total += s
    return total


def loss_and_slope(image: np.ndarray, photo: np.ndarray, weight: float = 0.2) -> tuple[float, np.ndarray]:
    """The loss and its derivative in the picture; both pictures (H, W, 3). weight: lambda."""
    shape = image.shape[0], image.shape[1] * 3
    x, y = (picture.reshape(shape).astype(np.float64) for picture in (image, photo))
    moments = np.empty((5, *shape))
    _blur(np.stack([x, y, x * x, y * y, x * y]), _WINDOW, moments)
    slopes, blurred = np.empty((2, 3, *shape))
    total = float(_compare(moments, slopes))
    _blur(slopes, _WINDOW, blurred)
    difference = x - y
    loss = (1.0 - weight) * float(np.abs(difference).mean()) + weight * (1.0 - total / x.size)
    slope = (1.0 - weight) * np.sign(difference) - weight * (blurred[0] + 2.0 * x * blurred[1] + y * blurred[2])
    return loss, (slope / x.size).reshape(image.shape)


def log_error_slope(image: np.ndarray, wanted: np.ndarray) -> tuple[float, np.ndarray]:
    """Mean squared error of a picture (H, W, 3) to the wanted one, both clamped to [0, 1], and the derivative of its logarithm in the picture.

    A channel beyond [0, 1] on the side of a wanted value that is at that end has no slope.
    """
    target = np.clip(wanted, 0.0, 1.0)
    difference = np.clip(image, 0.0, 1.0) - target
    error = float(np.mean(difference**2))
    # Beyond the range the clamped difference still says which way to go.
    return error, difference * (2.0 / (difference.size * max(error, LEAST_ERROR)))
