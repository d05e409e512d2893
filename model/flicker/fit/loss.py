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


@numba.njit(error_model="numpy", fastmath={"contract", "nsz"}, cache=True)
def _blur_line(m, v, maps, window, out):
    height, length = maps.shape[1:]
    edge = 3 * RADIUS
    padded = np.zeros(length + 2 * edge, maps.dtype)  # window sums down the columns, 0 at both ends
    down, along = padded[edge : edge + length], out[m, v]
    for k in range(max(0, RADIUS - v), min(2 * RADIUS + 1, height + RADIUS - v)):
        line, weight = maps[m, v + k - RADIUS], window[k]
        for j in range(length):
            down[j] += weight * line[j]
    along[:] = 0
    for k in range(2 * RADIUS + 1):
        shifted, weight = padded[3 * k :], window[k]
        for j in range(length):
            along[j] += weight * shifted[j]


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _blur(maps, window, out):
    """Window sums of maps (n, H, 3 W), pixels with three channels."""
    for n in numba.prange(maps.shape[0] * maps.shape[1]):
        _blur_line(np.int64(n) // maps.shape[1], np.int64(n) % maps.shape[1], maps, window, out)


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _products(image, photo, out):
    """x, y, x^2, y^2, x y of two pictures (H, 3 W) of any formats, (5, H, 3 W)."""
    real = out.dtype.type
    for v in numba.prange(image.shape[0]):
        for j in range(image.shape[1]):
            x, y = real(image[v, j]), real(photo[v, j])
            out[0, v, j], out[1, v, j], out[2, v, j], out[3, v, j], out[4, v, j] = x, y, x * x, y * y, x * y


@numba.njit(error_model="numpy", fastmath={"contract", "nsz", "arcp"}, cache=True)
def _compare_line(moments, slopes):
    real = moments.dtype.type
    one, two, c1, c2 = real(1.0), real(2.0), real(_C1), real(_C2)
    x, y, xx, yy, xy = moments[0], moments[1], moments[2], moments[3], moments[4]
    by_x, by_xx, by_xy = slopes[0], slopes[1], slopes[2]
    total = 0.0
    for j in range(len(x)):
        mx, my = x[j], y[j]
        a1, b1 = two * mx * my + c1, mx * mx + my * my + c1
        a2 = two * (xy[j] - mx * my) + c2
        b2 = xx[j] - mx * mx + yy[j] - my * my + c2
        per = one / (b1 * b2)
        s = a1 * a2 * per
        d_xy, d_xx = two * a1 * per, -s * b1 * per
        by_x[j] = two * (my * a2 * per - s * b2 * per * mx) - d_xy * my - two * d_xx * mx
        by_xx[j] = d_xx
        by_xy[j] = d_xy
        total += np.float64(s)
    return total


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _compare(moments, slopes, totals):
    """totals: float64 (H,), sums of SSIM of lines; slopes: (3, H, 3 W), its derivatives in the moments E[x], E[x^2], E[x y]. moments: (5, H, 3 W) of x, y, x^2,
    y^2, x y."""
    for v in numba.prange(moments.shape[1]):
        totals[v] = _compare_line(moments[:, v], slopes[:, v])


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _slope(pictures, blurred, weight, slope, totals):
    """slope: (H, 3 W), of the loss in x but for the number of values; totals: float64 (H,), sums of absolute differences of lines."""
    real = pictures.dtype.type
    for v in numba.prange(pictures.shape[1]):
        x, y, total = pictures[0, v], pictures[1, v], 0.0
        for j in range(len(x)):
            difference = x[j] - y[j]
            total += np.float64(abs(difference))
            structure = blurred[0, v, j] + real(2.0) * x[j] * blurred[1, v, j] + y[j] * blurred[2, v, j]
            slope[v, j] = real(1.0 - weight) * np.sign(difference) - real(weight) * structure
        totals[v] = total


def loss_and_slope(image: np.ndarray, photo: np.ndarray, weight: float = 0.2) -> tuple[float, np.ndarray]:
    """The loss and its derivative in the picture; both pictures (H, W, 3). weight: lambda. Computed in the photograph's format, float32 or float64."""
    shape = image.shape[0], image.shape[1] * 3
    maps, moments, totals = np.empty((5, *shape), photo.dtype), np.empty((5, *shape), photo.dtype), np.empty((2, shape[0]))
    window = _WINDOW.astype(photo.dtype)
    _products(image.reshape(shape), photo.reshape(shape), maps)
    _blur(maps, window, moments)
    slopes, blurred = np.empty((2, 3, *shape), photo.dtype)
    _compare(moments, slopes, totals[0])
    _blur(slopes, window, blurred)
    slope = np.empty(shape, photo.dtype)
    _slope(maps, blurred, weight, slope, totals[1])
    similar, away = totals.sum(axis=1) / maps[0].size
    return (1.0 - weight) * float(away) + weight * (1.0 - float(similar)), (slope / photo.dtype.type(maps[0].size)).reshape(image.shape)


def log_error_slope(image: np.ndarray, wanted: np.ndarray) -> tuple[float, np.ndarray]:
    """Mean squared error of a picture (H, W, 3) to the wanted one, both clamped to [0, 1], and the derivative of its logarithm in the picture.

    A channel beyond [0, 1] on the side of a wanted value that is at that end has no slope.
    """
    target = np.clip(wanted, 0.0, 1.0)
    difference = np.clip(image, 0.0, 1.0) - target
    error = float(np.mean(difference**2))
    # Beyond the range the clamped difference still says which way to go.
    return error, difference * (2.0 / (difference.size * max(error, LEAST_ERROR)))
