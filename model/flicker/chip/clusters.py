"""Clusters ("big Gaussians"): groups of neighbouring Gaussians, culled against the view frustum before their members are
read.

Source of the idea: paper, Sec. IV-A, after Jo et al. How clusters are made is our choice: the scene is put into
Morton order of the means and cut into runs of equal size, which PlayCanvas' writer does too; a cluster is then a
contiguous piece of memory.

The cull is conservative with respect to `projection.project`: it never drops a Gaussian whose circle touches the
picture. With camera-space mean (X, Y, z), z > NEAR, standard deviations <= s and the Jacobian's clamped slopes a, b
(|a| <= lim_x, |b| <= lim_y) the long axis of the undilated footprint is at most s f sqrt(1 + a^2 + b^2) / z =: s F /
z with f = max(fx, fy), and the circle's radius at most 3 s F / z + 3 sqrt(DILATION + sqrt(0.1)) + 1 =: 3 s F / z + m
(dilation, the rasterizer's floor under its discriminant, rounding up). The left border is therefore reached only if
fx X + (c_x + m) z + 3 s F > 0, a half-space; likewise the others and z > NEAR. A cluster is dropped when the largest
value of a left-hand side over its box or sphere of means, with its largest s, is not positive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import FlickerError
from ..front.projection import _CLAMP, DILATION, NEAR
from ..params import TILE
from ..scene.camera import Camera
from ..scene.files import Scene
from .constants import CLUSTER_SIZE

_RADIUS_MARGIN = 3.0 * np.sqrt(DILATION + np.sqrt(0.1)) + 1.0
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


def build_clusters(scene: Scene, size: int = CLUSTER_SIZE) -> tuple[Scene, Clusters]:
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


def planes(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-spaces of the cull: normal (5, 3) in world axes, offset (5,), factor of the standard deviation (5,).

    A Gaussian can be visible only if normal . mean + offset + factor * sigma > 0 for all five.
    """
    lim_x, lim_y = (_CLAMP * 0.5 * n / f for n, f in ((camera.width, camera.fx), (camera.height, camera.fy)))
    reach = 3.0 * max(camera.fx, camera.fy) * np.sqrt(1.0 + lim_x**2 + lim_y**2)
    m = _RADIUS_MARGIN
    normals = [(0.0, 0.0, 1.0)]
    for axis, (f, n) in enumerate(((camera.fx, camera.width), (camera.fy, camera.height))):
        middle = 0.5 * (n - 1)
        beyond = TILE * -(-n // TILE)  # the rasterizer's tiles may reach beyond the picture
        for sign, depth in ((1.0, middle + m), (-1.0, beyond - middle + m)):
            normal = [0.0, 0.0, depth]
            normal[axis] = sign * f
            normals.append(tuple(normal))
    world = np.array(normals) @ camera.rotation.T
    offset = -world @ camera.position
    offset[0] -= NEAR
    return world, offset, np.array([0.0, reach, reach, reach, reach])


def cull(clusters: Clusters, camera: Camera, shape: str = "box") -> np.ndarray:
    """bool (C,): clusters that may hold a visible Gaussian. shape: "box" or "sphere", the bound of the means."""
    normal, offset, factor = planes(camera)
    if shape == "box":
        low, high = clusters.low.astype(np.float64), clusters.high.astype(np.float64)
        middle, half = (low + high) / 2, (high - low) / 2
        most = middle @ normal.T + half @ np.abs(normal).T
    elif shape == "sphere":
        most = clusters.centre.astype(np.float64) @ normal.T + np.outer(clusters.radius, np.linalg.norm(normal, axis=1))
    else:
        raise FlickerError(f"clusters: shape must be box or sphere, not {shape}")
    most += offset + np.outer(clusters.sigma, factor)
    scale = np.abs(clusters.centre) @ np.abs(normal).T + np.abs(offset)
    return (most > -_ROUNDING * scale).all(axis=1)
