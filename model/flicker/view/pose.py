"""Where a browser's camera stands, and the project's camera that sees the same."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..front.projection import Projected
from ..scene.camera import Camera


@dataclass(frozen=True)
class Pose:
    """Camera to world as the browser has it: axes right, down, forward. wxyz: unit quaternion. fov: radians, from the picture's upper to its lower edge."""

    wxyz: tuple[float, ...]
    position: tuple[float, ...]
    fov: float

    @classmethod
    def of(cls, camera: Camera) -> Pose:
        wxyz = Rotation.from_matrix(camera.rotation).as_quat(scalar_first=True)
        return cls(tuple(map(float, wxyz)), tuple(map(float, camera.position)), 2 * math.atan(camera.height / (2 * camera.fy)))

    def camera(self, like: Camera) -> Camera:
        """The camera with the size, the shape of the pixels and the principal point of another: a browser knows of none of these."""
        fy = like.height / (2 * math.tan(self.fov / 2))
        rotation = Rotation.from_quat(self.wxyz, scalar_first=True).as_matrix()
        return Camera(like.width, like.height, fy * like.fx / like.fy, fy, np.array(self.position), rotation, "browser", cx=like.cx, cy=like.cy)


def close(a: Camera, b: Camera) -> bool:
    """Equal but for what a browser's numbers lose."""
    far = 1e-4 * (1.0 + float(np.abs(a.position).max()))
    return (
        (a.width, a.height) == (b.width, b.height) and abs(a.fy - b.fy) < 1e-4 * a.fy and abs(a.fx - b.fx) < 1e-4 * a.fx
        and abs(a.cx - b.cx) < 1e-3 and abs(a.cy - b.cy) < 1e-3
        and float(np.abs(a.position - b.position).max()) < far and float(np.abs(a.rotation - b.rotation).max()) < 1e-4
    )


def common_up(cameras: Sequence[Camera]) -> np.ndarray:
    """float64 (3,): the direction in the world that cameras hold upright, their mean; the first one's own where they cancel."""
    mean = -np.mean([c.rotation[:, 1] for c in cameras], axis=0)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-3 else -cameras[0].rotation[:, 1]


def upright(camera: Camera, up: np.ndarray) -> np.ndarray:
    """float64 (3,): the direction nearest to `up` under which a camera that looks where this one does has its rotation, roll included."""
    right, own = camera.rotation[:, 0], -camera.rotation[:, 1]
    flat = up - (up @ right) * right
    return flat / np.linalg.norm(flat) if flat @ own > 0.05 else own


def target(camera: Camera, projected: Projected) -> np.ndarray:
    """float64 (3,): the point ahead that is orbited, as far as the middle one of the Gaussians about the principal point."""
    size = np.array([camera.width, camera.height])
    middle = (np.abs(projected.mean - (camera.cx, camera.cy)) < size / 4).all(axis=1) & (projected.opacity > 0.5)
    depth = projected.depth[middle] if middle.any() else projected.depth
    return camera.position + camera.rotation[:, 2] * (float(np.median(depth)) if len(depth) else 1.0)
