"""Which clusters a camera may see: five half-spaces against the box or sphere of each cluster's means.

The cull is conservative with respect to `projection.project`: it never drops a Gaussian whose circle touches the
picture. With camera-space mean (X, Y, z), z > NEAR, standard deviations <= s and the Jacobian's clamped slopes a, b
(|a| <= lim_x, |b| <= lim_y) the long axis of the undilated footprint is at most s f sqrt(1 + a^2 + b^2) / z =: s F /
z with f = max(fx, fy), and the circle's radius at most 3 s F / z + 3 sqrt(DILATION + sqrt(0.1)) + 1 =: 3 s F / z + m
(dilation, the rasterizer's floor under its discriminant, rounding up). The clamped slopes lie in `slope_range`. The left border is therefore reached only if
fx X + (c_x + m) z + 3 s F > 0, a half-space; likewise the others and z > NEAR. A cluster is dropped when the largest
value of a left-hand side over its box or sphere of means, with its largest s, is not positive.
"""

from __future__ import annotations

import numpy as np

from ..errors import FlickerError
from ..front.projection import DILATION, NEAR, slope_range
from ..params import TILE
from ..scene.camera import Camera
from ..scene.clusters import Clusters

_RADIUS_MARGIN = 3.0 * np.sqrt(DILATION + np.sqrt(0.1)) + 1.0
_ROUNDING = 1e-9


def planes(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-spaces of the cull: normal (5, 3) in world axes, offset (5,), factor of the standard deviation (5,).

    A Gaussian can be visible only if normal . mean + offset + factor * sigma > 0 for all five.
    """
    lim_x, lim_y = np.abs(slope_range(camera)).max(axis=1)
    reach = 3.0 * max(camera.fx, camera.fy) * np.sqrt(1.0 + lim_x**2 + lim_y**2)
    m = _RADIUS_MARGIN
    normals = [(0.0, 0.0, 1.0)]
    for axis, (f, n, middle) in enumerate(((camera.fx, camera.width, camera.cx), (camera.fy, camera.height, camera.cy))):
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
