"""The Gaussians that a fit begins with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from ..errors import FlickerError
from ..front.projection import NEAR
from ..scene.camera import Camera
from ..scene.gaussians import SH_C0
from .dataset import Dataset
from .parameters import LOGIT, MEAN, QUAT, SCALE, SH, Parameters

OPACITY = 0.1
RANDOM = 0.3  # share of the largest number of Gaussians that random starts have
_TRIES = 16  # random places tried for each that is kept


def extent_of(cameras: Sequence[Camera]) -> float:
    """Size of a scene: 1.1 times the distance of the farthest camera from their middle, as the INRIA code takes it."""
    positions = np.array([camera.position for camera in cameras])
    return 1.1 * float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max()) or 1.0


def _random_places(cameras: Sequence[Camera], count: int, rng: np.random.Generator) -> np.ndarray:
    """Places in the cube around the point that the cameras look at, as large as their distance from it, that many cameras see."""
    positions = np.array([camera.position for camera in cameras])
    forward = np.array([camera.rotation[:, 2] for camera in cameras])
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]
    middle = positions.mean(axis=0)
    # The point nearest to all axes; where these are nearly parallel, the one near the cameras.
    focus = middle + np.linalg.solve(across.sum(axis=0) + 1e-3 * len(cameras) * np.eye(3), (across @ (positions - middle)[:, :, None]).sum(axis=0)[:, 0])
    half = max(float(np.linalg.norm(positions - focus, axis=1).max()), NEAR)
    places = focus + rng.uniform(-half, half, (_TRIES * count, 3))
    views = np.zeros(len(places), np.int64)
    for camera in cameras:
        x, y, z = ((places - camera.position) @ camera.rotation).T
        with np.errstate(all="ignore"):
            views += (z > NEAR) & (np.abs(camera.fx * x / z) < camera.width / 2) & (np.abs(camera.fy * y / z) < camera.height / 2)
    best = int(views.max(initial=0))
    if best < 2:
        raise FlickerError("cameras: no place is seen by two of them: the views do not overlap")
    return places[views >= max(2, best // 2)][:count]


def start(dataset: Dataset, gaussians: int, degree: int, rng: np.random.Generator) -> Parameters:
    """COLMAP's points, at most `gaussians` of them; else random places. Round, as large as the distance to the nearest three others, faint."""
    cameras = [shot.camera for shot in dataset.fitted]
    if dataset.points is not None and dataset.colours is not None:
        chosen = np.sort(rng.permutation(len(dataset.points))[:gaussians])
        places, colours = dataset.points[chosen], dataset.colours[chosen]
    else:
        places = _random_places(cameras, max(4, int(RANDOM * gaussians)), rng)
        colours = np.full(places.shape, 0.5)
    distance = KDTree(places).query(places, k=min(4, len(places)))[0][:, 1:]
    size = np.clip(np.sqrt((distance**2).mean(axis=1)) if len(places) > 1 else np.ones(1), 1e-4 * extent_of(cameras), 0.1 * extent_of(cameras))
    values = np.zeros((len(places), SH + 3 * (degree + 1) ** 2), np.float32)
    values[:, MEAN:SCALE] = places
    values[:, SCALE:QUAT] = np.log(size)[:, None]
    values[:, QUAT] = 1.0
    values[:, LOGIT] = np.log(OPACITY / (1.0 - OPACITY))
    values[:, SH : SH + 3] = (colours - 0.5) / SH_C0
    return Parameters(values)
