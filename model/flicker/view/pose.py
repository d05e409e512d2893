"""Where a browser's camera stands, and the project's camera that sees the same."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

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


def upright(camera: Camera, up: np.ndarray) -> np.ndarray:
    """float64 (3,): the direction nearest to `up` under which a camera that looks where this one does has its rotation, roll included."""
    right, own = camera.rotation[:, 0], -camera.rotation[:, 1]
    flat = up - (up @ right) * right
    return flat / np.linalg.norm(flat) if flat @ own > 0.05 else own
