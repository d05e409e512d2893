"""What a camera looks at: the point that is orbited, the direction that is up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..scene.camera import Camera
from .projection import Projected


def common_up(cameras: Sequence[Camera]) -> np.ndarray:
    """float64 (3,): the direction in the world that cameras hold upright, their mean; the first one's own where they cancel."""
    mean = -np.mean([c.rotation[:, 1] for c in cameras], axis=0)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-3 else -cameras[0].rotation[:, 1]


def distance_ahead(camera: Camera, projected: Projected) -> float:
    """Depth of the middle one of the Gaussians about the principal point; 1 where nothing is."""
    size = np.array([camera.width, camera.height])
    middle = (np.abs(projected.mean - (camera.cx, camera.cy)) < size / 4).all(axis=1) & (projected.opacity > 0.5)
    depth = projected.depth[middle] if middle.any() else projected.depth
    return float(np.median(depth)) if len(depth) else 1.0


def target(camera: Camera, projected: Projected) -> np.ndarray:
    """float64 (3,): the point ahead that is orbited, `distance_ahead` away."""
    return camera.position + camera.rotation[:, 2] * distance_ahead(camera, projected)
