"""How many Gaussians there are and where: growth by the gradient of their place on the screen (Kerbl et al. 2023, Sec. 5.2).

A Gaussian whose mean gradient is large is cloned where it is small, split in two where it is large; nearly transparent ones are removed. How many may be there
grows evenly up to the largest number, and those of the largest gradients go first.
"""

from __future__ import annotations

import numpy as np

from ..scene.clusters import morton_order
from .parameters import LOGIT, MEAN, QUAT, SCALE, Parameters

EVERY = 100  # iterations
LEAST_GRADIENT = 2e-5  # in halves of the picture's width and height
LEAST_OPACITY = 0.005
SMALL = 0.01  # of the scene's extent: cloned, not split
SHRINK = 1.6  # of the standard deviations of the halves


def _rotations(quats: np.ndarray) -> np.ndarray:
    """(N, 3, 3) of quaternions (N, 4) of any length."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    return np.stack([
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ], axis=1).reshape(-1, 3, 3)


def refine(parameters: Parameters, score: np.ndarray, extent: float, most: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """What stays and what comes: numbers of the Gaussians that stay, and new rows (n, P).

    score: float64 (N,), mean gradient of each on the screen. most: how many there may be.
    """
    values = parameters.values
    stays = values[:, LOGIT] > np.log(LEAST_OPACITY / (1.0 - LEAST_OPACITY))
    wanting = np.flatnonzero(stays & (score > LEAST_GRADIENT))
    wanting = wanting[np.argsort(-score[wanting], kind="stable")][: max(0, most - int(stays.sum()))]
    large = np.exp(values[wanting, SCALE:QUAT]).max(axis=1) > SMALL * extent
    clones, parts = values[wanting[~large]], np.repeat(values[wanting[large]], 2, axis=0)
    offset = np.exp(parts[:, SCALE:QUAT].astype(np.float64)) * rng.normal(size=(len(parts), 3))
    parts[:, MEAN:SCALE] += (_rotations(parts[:, QUAT:LOGIT].astype(np.float64)) * offset[:, None, :]).sum(axis=2)
    parts[:, SCALE:QUAT] -= np.float32(np.log(SHRINK))
    stays[wanting[large]] = False
    return np.flatnonzero(stays), np.concatenate([clones, parts])


def in_order(parameters: Parameters) -> np.ndarray:
    """int64 (N,): along a Morton curve, so that neighbours in the picture are neighbours in memory."""
    return morton_order(parameters.means)
