"""Reference renderer: float64, the rules of the INRIA rasterizer. What "correct" means in this project.

Per 16x16 tile, near to far, Gaussians whose circle of 3 standard deviations (long axis, rounded up to pixels) has a bounding
square that touches the tile. At pixel p with d = p - mean: E = (a dx^2 + c dy^2) / 2 + b dx dy, alpha = min(0.99, o exp(-E)).
A pair with E < 0 or alpha < 1/255 is skipped. The first Gaussian that would take the transmittance below 1e-4 is not blended
and finishes the pixel. docs/reference/reference_renderer.md says how this was checked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numba
import numpy as np

from ..params import ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN
from ..scene.camera import Camera
from .binning import bin_boxes, circle_boxes
from .projection import Projected

# Pixels this little outside the ellipse alpha = 1/255 are still evaluated, so that rounding never decides.
_MARGIN = 1e-9


@numba.njit(cache=True)
def _pixels(middle, half, first, last):
    """First and last pixel of first..last within middle +- half (none: the first is past the last)."""
    low = min(max(np.ceil(middle - half - _MARGIN * half), first), last + 1.0)
    high = max(min(np.floor(middle + half + _MARGIN * half), last), first - 1.0)
    return int(low), int(high)


@numba.njit(parallel=True, cache=True)
def _blend(mean, conic, cov, reach, opacity, rgb, start, entry, tiles_x, image, transmittance):
    """reach: E at which alpha falls to 1/255. image (H, W, 3) starts at 0, transmittance (H, W) at 1."""
    height, width = transmittance.shape
    for t in numba.prange(len(start) - 1):
        left = t % tiles_x * TILE
        top = t // tiles_x * TILE
        right = min(left + TILE, width) - 1
        bottom = min(top + TILE, height) - 1
        live = (right - left + 1) * (bottom - top + 1)
        done = np.zeros((TILE, TILE), np.bool_)
        for e in range(start[t], start[t + 1]):
            if live == 0:
                break
            i = entry[e]
            limit = 2.0 * reach[i]
            if not limit >= 0.0:
                continue
            limit = limit * (1.0 + _MARGIN) + _MARGIN
            mx = mean[i, 0]
            my = mean[i, 1]
            a = conic[i, 0]
            b = conic[i, 1]
            c = conic[i, 2]
            half = np.sqrt(limit * cov[i, 2])
            y0, y1 = _pixels(my, half, top, bottom)
            for y in range(y0, y1 + 1):
                dy = y - my
                # Along a row E is a parabola with its minimum at mx - b dy / a, dy^2 / (2 cov_yy) there.
                rest = max(limit - dy * dy / cov[i, 2], 0.0)
                half = np.sqrt(rest / a)
                x0, x1 = _pixels(mx - b * dy / a, half, left, right)
                for x in range(x0, x1 + 1):
                    if done[y - top, x - left]:
                        continue
                    dx = x - mx
                    energy = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
                    if energy < 0.0:
                        continue
                    alpha = min(ALPHA_MAX, opacity[i] * np.exp(-energy))
                    if alpha < ALPHA_MIN:
                        continue
                    before = transmittance[y, x]
                    after = before * (1.0 - alpha)
                    if after < TRANSMITTANCE_MIN:
                        done[y - top, x - left] = True
                        live -= 1
                        continue
                    weight = alpha * before
                    for k in range(3):
                        image[y, x, k] += weight * rgb[i, k]
                    transmittance[y, x] = after


def render_with_transmittance(
    projected: Projected, camera: Camera, background: Sequence[float] = (0.0, 0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Picture float64 (height, width, 3), neither clamped nor quantised, and the transmittance float64 (height, width) left."""
    tiles_x = -(-camera.width // TILE)
    tiles_y = -(-camera.height // TILE)
    start, entry = bin_boxes(circle_boxes(projected.mean, projected.circle, tiles_x, tiles_y), tiles_x, tiles_y)
    image = np.zeros((camera.height, camera.width, 3))
    transmittance = np.ones((camera.height, camera.width))
    reach = np.log(projected.opacity / ALPHA_MIN)
    _blend(
        projected.mean, projected.conic, projected.cov2d, reach, projected.opacity, projected.rgb,
        start, entry, tiles_x, image, transmittance,
    )
    image += transmittance[:, :, None] * np.asarray(background, np.float64)
    return image, transmittance


def render_reference(projected: Projected, camera: Camera, background: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Picture float64 (height, width, 3), neither clamped nor quantised; background is an RGB colour."""
    return render_with_transmittance(projected, camera, background)[0]


def expected_depth(projected: Projected, camera: Camera) -> np.ndarray:
    """float64 (height, width): camera-space z of the Gaussians at a pixel, each by its share of the picture, sum of w z over sum of w; NaN where none is."""
    values = np.zeros((projected.n_visible, 3))
    values[:, 0], values[:, 1] = projected.depth, 1.0
    sums = render_reference(replace(projected, rgb=values), camera)
    with np.errstate(invalid="ignore"):
        return np.where(sums[..., 1] > 0.0, sums[..., 0] / sums[..., 1], np.nan)
