"""Gaussians of a least size on the screen: a lower bound on their standard deviations, from the photograph that sees them largest.

A test that samples leader pixels (docs/reference/fit.md) misses Gaussians that fit between these; larger ones it finds. After the smoothing filter of
Mip-Splatting (Yu et al. 2024), which bounds sizes from below by a camera's sampling rate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from ..scene.camera import Camera
from .parameters import MEAN, QUAT, SCALE


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _hold(values, index, position, per_pixel, pixels):
    for k in numba.prange(len(index)):
        i = np.int64(index[k])
        least = np.inf
        for c in range(len(position)):
            square = 0.0
            for j in range(3):
                square += (np.float64(values[i, MEAN + j]) - position[c, j]) ** 2
            least = min(least, np.sqrt(square) * per_pixel[c])
        low = np.float32(np.log(max(least * pixels, 1e-30)))
        for j in range(SCALE, QUAT):
            if values[i, j] < low:  # what is not a number stays so
                values[i, j] = low


class LeastSize:
    """pixels: least standard deviation along each axis, in pixels of the camera in which a Gaussian at its distance is largest, before the 0.3 px^2 that every
    splat gets."""

    def __init__(self, pixels: float, cameras: Sequence[Camera]) -> None:
        self.pixels = pixels
        self._position = np.array([camera.position for camera in cameras], np.float64)
        self._per_pixel = np.array([1.0 / max(camera.fx, camera.fy) for camera in cameras])

    def hold(self, values: np.ndarray, index: np.ndarray | None = None) -> None:
        """Raise the sizes of the rows `index`, or of all, of parameters that are too small, in place."""
        if self.pixels > 0.0:
            _hold(values, np.arange(len(values)) if index is None else index, self._position, self._per_pixel, self.pixels)
