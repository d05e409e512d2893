"""Clusters ("big Gaussians"): groups of neighbouring Gaussians, culled against the view frustum before their members are
read.

Source of the idea: paper, Sec. IV-A, after Jo et al. How clusters are made is our choice: the scene is put into
Morton order of the means and cut into runs of equal size, which PlayCanvas' writer does too; a cluster is then a
contiguous piece of memory. `flicker.chip.cull` drops those that cannot be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import FlickerError
from .gaussians import Scene
from .memory import CHUNK

_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Clusters:
    """C clusters of a scene in Morton order.

    size: Gaussians a cluster (the last may have fewer). start: int64 (C + 1,). low, high: float32 (C, 3), box of the means.
    centre: float32 (C, 3), radius: float32 (C,): sphere around the means. sigma: float32 (C,), largest standard deviation.
    """

    size: int
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    sigma: np.ndarray

    def __len__(self) -> int:
        return len(self.sigma)

    def members(self, keep: np.ndarray) -> np.ndarray:
        """Numbers of the Gaussians in the kept clusters (bool (C,)), ascending."""
        return np.flatnonzero(np.repeat(keep, np.diff(self.start)))


def morton_order(means: np.ndarray) -> np.ndarray:
    """int64 (N,): order of the Gaussians along a Morton curve, 21 bits an axis; equal codes keep their order."""
    means = np.asarray(means, np.float64)
    low = means.min(axis=0)
    extent = np.maximum(means.max(axis=0) - low, np.finfo(np.float64).tiny)
    cell = np.minimum((means - low) / extent * 2.0**21, 2.0**21 - 1).astype(np.uint64)
    code = np.zeros(len(means), np.uint64)
    for axis in range(3):
        x = cell[:, axis]
        for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3),
                            (2, 0x1249249249249249)):
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return np.argsort(code, kind="stable")


def reorder(scene: Scene, order: np.ndarray) -> Scene:
    """The scene with its Gaussians in another order."""
    return replace(scene, means=scene.means[order], scales=scene.scales[order], quats=scene.quats[order],
                   opacities=scene.opacities[order], sh=scene.sh[order])


def build_clusters(scene: Scene, size: int = CHUNK) -> tuple[Scene, Clusters]:
    """The scene in Morton order and its clusters."""
    if size < 1:
        raise FlickerError(f"clusters: size must be at least 1, not {size}")
    scene = reorder(scene, morton_order(scene.means))
    start = np.append(np.arange(0, len(scene), size), len(scene))
    low = np.minimum.reduceat(scene.means, start[:-1])
    high = np.maximum.reduceat(scene.means, start[:-1])
    sigma = np.maximum.reduceat(scene.scales.max(axis=1), start[:-1])
    centre = ((low.astype(np.float64) + high) / 2).astype(np.float32)
    away = scene.means.astype(np.float64) - np.repeat(centre, np.diff(start), axis=0)
    reach = np.maximum.reduceat(np.sqrt((away**2).sum(axis=1)), start[:-1])
    radius = np.nextafter((reach * (1 + _ROUNDING)).astype(np.float32), np.float32(np.inf))
    return scene, Clusters(size, start, low, high, centre, radius, sigma)
