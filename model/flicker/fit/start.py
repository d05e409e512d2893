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
_BLOCK = 4096  # places whose colours are held at once


def extent_of(cameras: Sequence[Camera]) -> float:
    """Size of a scene: 1.1 times the distance of the farthest camera from their middle, as the INRIA code takes it."""
    positions = np.array([camera.position for camera in cameras])
    return 1.1 * float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max()) or 1.0


def _seen(places: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """bool (N,): places in the picture of a camera; lines and columns of those, int64."""
    x, y, z = ((places - camera.position) @ camera.rotation).T
    with np.errstate(all="ignore"):
        column, line = camera.fx * x / z + 0.5 * camera.width, camera.fy * y / z + 0.5 * camera.height
    seen = (z > NEAR) & (column >= 0) & (column < camera.width) & (line >= 0) & (line < camera.height)
    return seen, line[seen].astype(np.int64), column[seen].astype(np.int64)


def _candidates(
    cameras: Sequence[Camera], solid: Sequence[np.ndarray | None], low: np.ndarray, high: np.ndarray, count: int, rng: np.random.Generator,
) -> np.ndarray:
    """Of `count` random places in a box, those that at least half as many cameras see as see any, and that no photograph shows to be empty."""
    places = rng.uniform(low, high, (count, 3))
    views, empty = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    for camera, mask in zip(cameras, solid):
        seen, line, column = _seen(places, camera)
        views += seen
        if mask is not None:
            empty[np.flatnonzero(seen)[~mask[line, column]]] = True
    best = int(views.max(initial=0))
    if best < 2:
        raise FlickerError("cameras: no place is seen by two of them: the views do not overlap")
    return places[(views >= max(2, best // 2)) & ~empty]


def _random_places(cameras: Sequence[Camera], solid: Sequence[np.ndarray | None], count: int, rng: np.random.Generator) -> np.ndarray:
    """Places in the cube around the point that the cameras look at, as large as their distance from it, that many cameras see; where photographs have
    transparent parts, within the box and the hull of what they show.

    solid: bool (H, W) of each photograph, False where it is transparent; None: it is nowhere.
    """
    positions = np.array([camera.position for camera in cameras])
    forward = np.array([camera.rotation[:, 2] for camera in cameras])
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]
    middle = positions.mean(axis=0)
    # The point nearest to all axes; where these are nearly parallel, the one near the cameras.
    focus = middle + np.linalg.solve(across.sum(axis=0) + 1e-3 * len(cameras) * np.eye(3), (across @ (positions - middle)[:, :, None]).sum(axis=0)[:, 0])
    half = max(float(np.linalg.norm(positions - focus, axis=1).max()), NEAR)
    low, high = focus - half, focus + half
    found = _candidates(cameras, solid, low, high, _TRIES * count, rng)
    if any(mask is not None for mask in solid):
        everywhere = [None] * len(cameras)
        if len(found) < 4:
            return _candidates(cameras, everywhere, low, high, _TRIES * count, rng)[:count]
        margin = 0.5 * (found.max(axis=0) - found.min(axis=0)) / len(found) ** (1 / 3)
        low, high = np.maximum(low, found.min(axis=0) - margin), np.minimum(high, found.max(axis=0) + margin)
        found = max(found, _candidates(cameras, solid, low, high, _TRIES * count, rng), key=len)
    return found[:count]


def _colours_of(places: np.ndarray, cameras: Sequence[Camera], photos: Sequence[np.ndarray]) -> np.ndarray:
    """float64 (N, 3): median of what the photographs show at each place, grey where none does."""
    middle = np.full(places.shape, 0.5)
    for first in range(0, len(places), _BLOCK):
        block = places[first : first + _BLOCK]
        shown = np.full((len(cameras), len(block), 3), np.nan, np.float32)
        for row, camera, photo in zip(shown, cameras, photos):
            seen, line, column = _seen(block, camera)
            row[seen] = photo[line, column]
        some = ~np.isnan(shown[..., 0]).all(axis=0)
        middle[first : first + _BLOCK][some] = np.nanmedian(shown[:, some], axis=0)
    return middle


def start(dataset: Dataset, photos: Sequence[np.ndarray], gaussians: int, degree: int, rng: np.random.Generator) -> Parameters:
    """COLMAP's points, at most `gaussians` of them; else random places, in the colours of the photographs (H, W, 3). Round, as large as the distance to the
    nearest three others, faint."""
    cameras = [shot.camera for shot in dataset.fitted]
    if dataset.points is not None and dataset.colours is not None:
        chosen = np.sort(rng.permutation(len(dataset.points))[:gaussians])
        places, colours = dataset.points[chosen], dataset.colours[chosen]
    else:
        places = _random_places(cameras, [shot.solid() for shot in dataset.fitted], max(4, int(RANDOM * gaussians)), rng)
        colours = _colours_of(places, cameras, photos)
    distance = KDTree(places).query(places, k=min(4, len(places)))[0][:, 1:]
    size = np.clip(np.sqrt((distance**2).mean(axis=1)) if len(places) > 1 else np.ones(1), 1e-4 * extent_of(cameras), 0.1 * extent_of(cameras))
    values = np.zeros((len(places), SH + 3 * (degree + 1) ** 2), np.float32)
    values[:, MEAN:SCALE] = places
    values[:, SCALE:QUAT] = np.log(size)[:, None]
    values[:, QUAT] = 1.0
    values[:, LOGIT] = np.log(OPACITY / (1.0 - OPACITY))
    values[:, SH : SH + 3] = (colours - 0.5) / SH_C0
    return Parameters(values)
