"""Cameras of the demo scene, and the turn from author coordinates to those of scene files."""

from __future__ import annotations

import numpy as np

from flicker.scene.camera import Camera
from flicker.scene.demo.splats import dot, unit

WIDTH, HEIGHT = 640, 360
HALF_WIDTH = 0.424  # tangent of half the horizontal field of view
# name, eye and target in author coordinates; the first is the hero shot
VIEWS = (
    ("hero", (0.30, -8.60, 4.30), (0.12, 0.0, 1.50)),
    ("left", (-3.70, -7.80, 3.60), (-0.05, 0.1, 1.36)),
    ("right", (3.90, -7.60, 4.70), (0.10, 0.1, 1.44)),
    ("close", (-0.20, -6.00, 3.20), (-0.62, 0.0, 1.62)),
)
EYES = np.array([eye for _, eye, _ in VIEWS])


def to_world(v: np.ndarray) -> np.ndarray:
    """Author vectors (..., 3) (z up) as scene vectors (x right, y down, z away, as COLMAP has them)."""
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], axis=-1)


def seen(p: np.ndarray, n: np.ndarray) -> np.ndarray:
    """True (N,) where a surface at p with normal n faces one of the demo cameras."""
    facing = np.zeros(len(p), bool)
    for eye in EYES:
        facing |= dot(n, unit(eye - p)) > -0.12
    return facing


def demo_cameras(width: int = WIDTH, height: int = HEIGHT) -> list[Camera]:
    """The four views, hero shot first, at `width` x `height` pixels (made for 16:9)."""
    cameras = []
    for name, eye, target in VIEWS:
        position = to_world(np.array(eye))
        forward = unit(to_world(np.array(target)) - position)
        right = unit(np.cross([0.0, 1.0, 0.0], forward))
        down = np.cross(forward, right)
        focal = WIDTH / 2 / HALF_WIDTH
        cameras.append(Camera(
            width=width, height=height, fx=focal * width / WIDTH, fy=focal * height / HEIGHT,
            position=position, rotation=np.stack([right, down, forward], axis=1), name=name,
        ))
    return cameras
