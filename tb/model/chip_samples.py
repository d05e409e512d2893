"""Cameras and the view of the chip model's tests."""

from __future__ import annotations

import numpy as np
from flicker_tb.runner import seed
from scene_samples import random_scene

from flicker.chip.frame import Prepared, prepare
from flicker.front.view import View
from flicker.scene.camera import Camera
from flicker.scene.files import Scene


def camera(width: int = 96, height: int = 72, distance: float = 3.0, focal: float = 80.0) -> Camera:
    """Looking along +z at the origin."""
    return Camera(width, height, focal, focal, np.array([0.0, 0.0, -distance]), np.eye(3))


def turned_camera(rng: np.random.Generator, width: int, height: int) -> Camera:
    """Any direction, near or inside the unit cube."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 2] *= np.sign(np.linalg.det(q))
    return Camera(width, height, *rng.uniform(20, 200, 2), rng.uniform(-2, 2, 3), q)


def prepared_view() -> Prepared:
    """A view of 2,000 random Gaussians, a few of them twice (equal depths), a few large or opaque."""
    scene = random_scene(seed(), 2000, 1)
    scene.scales[:20] *= 6
    scene.scales[20:90], scene.opacities[20:90] = 0.3, 0.99
    twice = np.r_[np.arange(2000), np.arange(100)]
    scene = Scene(scene.means[twice], scene.scales[twice], scene.quats[twice], scene.opacities[twice], scene.sh[twice])
    return prepare(View(camera(), scene))
