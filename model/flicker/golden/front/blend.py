"""Records blended in float64: what the front end alone does to the picture."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from ...params import ALPHA_MAX, ALPHA_MIN, SUBTILE, TRANSMITTANCE_MIN, Form
from .record import Splats
from .setup import MEAN_FRACTION


@numba.njit
def alpha_at(shape, factored, opacity, dx, dy):
    """Alpha of a splat at a distance from its mean, 0 where it is below ALPHA_MIN or its weight no number of use."""
    if factored:
        energy = (shape[0] * dx + shape[1] * dy) ** 2 + (shape[2] * dy) ** 2
        weight = np.exp2(-energy)
    else:
        energy = (shape[0] * dx + shape[1] * dy) * dx + shape[2] * dy * dy
        weight = np.exp(-energy)
    if not energy >= 0.0:
        return 0.0
    alpha = min(ALPHA_MAX, opacity * weight)
    return 0.0 if alpha < ALPHA_MIN else alpha


@numba.njit(parallel=True, cache=True)
def _blend(mean, shape, factored, opacity, rgb, start, entry, cols, image, transmittance):
    height, width = transmittance.shape
    for s in numba.prange(len(start) - 1):
        left, top = s % cols * SUBTILE, s // cols * SUBTILE
        right, bottom = min(left + SUBTILE, width), min(top + SUBTILE, height)
        live = (right - left) * (bottom - top)
        done = np.zeros((SUBTILE, SUBTILE), np.bool_)
        for e in range(start[s], start[s + 1]):
            if live == 0:
                break
            i = entry[e]
            for y in range(top, bottom):
                dy = y - mean[i, 1]
                for x in range(left, right):
                    if done[y - top, x - left]:
                        continue
                    dx = x - mean[i, 0]
                    alpha = alpha_at(shape[i], factored, opacity[i], dx, dy)
                    if alpha == 0.0:
                        continue
                    before = transmittance[y, x]
                    after = before * (1.0 - alpha)
                    if after < TRANSMITTANCE_MIN:
                        done[y - top, x - left] = True
                        live -= 1
                        continue
                    for k in range(3):
                        image[y, x, k] += alpha * before * rgb[i, k]
                    transmittance[y, x] = after


def blend_records(
    splats: Splats, form: Form, start: np.ndarray, entry: np.ndarray, width: int, height: int, background: Sequence[float] = (0.0, 0.0, 0.0),
) -> np.ndarray:
    """Picture float64 (height, width, 3), unquantised, by the rules of the reference (`flicker.front.reference`) with lists of 8x8 sub-tiles."""
    image, transmittance = np.zeros((height, width, 3)), np.ones((height, width))
    mean = splats.mean / (1 << MEAN_FRACTION)
    _blend(mean, splats.shape, form == Form.FACTORED, splats.opacity, splats.rgb, start, entry, -(-width // SUBTILE), image, transmittance)
    return image + transmittance[:, :, None] * np.asarray(background, np.float64)
