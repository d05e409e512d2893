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
_FAR = 2.0  # pixels by which the farthest places move between the cameras that are farthest apart
_NEAR_FOCUS = 0.5  # of the distances to the cameras: a point that all look at is at least so far before them
_BLOCK = 4096  # places whose colours are held at once
# bool (H, W) of each photograph. solid: False where it is transparent, counted: False where it does not count; None: nowhere.
Masks = Sequence[np.ndarray | None]


def extent_of(cameras: Sequence[Camera]) -> float:
    """Size of a scene: 1.1 times the distance of the farthest camera from their middle, as the INRIA code takes it."""
    positions = np.array([camera.position for camera in cameras])
    return 1.1 * float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max()) or 1.0


def _seen(places: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """bool (N,): places in the picture of a camera; lines and columns of those, int64."""
    x, y, z = ((places - camera.position) @ camera.rotation).T
    with np.errstate(all="ignore"):
        column, line = camera.fx * x / z + camera.cx + 0.5, camera.fy * y / z + camera.cy + 0.5
    seen = (z > NEAR) & (column >= 0) & (column < camera.width) & (line >= 0) & (line < camera.height)
    return seen, line[seen].astype(np.int64), column[seen].astype(np.int64)


def _unmasked(seen: np.ndarray, line: np.ndarray, column: np.ndarray, counted: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `_seen` gives, without pixels that do not count."""
    if counted is None:
        return seen, line, column
    good, seen = counted[line, column], seen.copy()
    seen[seen] = good
    return seen, line[good], column[good]


def _candidates(cameras: Sequence[Camera], solid: Masks, counted: Masks, places: np.ndarray) -> np.ndarray:
    """Of random places those that at least half as many cameras see as see any, and that no photograph shows to be empty."""
    views, empty = np.zeros(len(places), np.int64), np.zeros(len(places), np.bool_)
    for camera, mask, counts in zip(cameras, solid, counted):
        seen, line, column = _unmasked(*_seen(places, camera), counts)
        views += seen
        if mask is not None:
            empty[np.flatnonzero(seen)[~mask[line, column]]] = True
    best = int(views.max(initial=0))
    if best < 2:
        raise FlickerError("cameras: no place is seen by two of them: the views do not overlap")
    return places[(views >= max(2, best // 2)) & ~empty]


def _focus(cameras: Sequence[Camera]) -> np.ndarray | None:
    """float64 (3,): the point that the cameras look at, nearest to all their axes; None: there is none, as of parallel axes, or of cameras that look
    outwards."""
    positions = np.array([camera.position for camera in cameras])
    forward = np.array([camera.rotation[:, 2] for camera in cameras])
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]
    middle = positions.mean(axis=0)
    # Where axes are nearly parallel, the point near the cameras.
    focus = middle + np.linalg.solve(across.sum(axis=0) + 1e-3 * len(cameras) * np.eye(3), (across @ (positions - middle)[:, :, None]).sum(axis=0)[:, 0])
    away = focus - positions
    return focus if np.median((away * forward).sum(axis=1)) > _NEAR_FOCUS * np.median(np.linalg.norm(away, axis=1)) else None


def _boxed(cameras: Sequence[Camera], focus: np.ndarray, solid: Masks, counted: Masks, count: int, rng: np.random.Generator) -> np.ndarray:
    """Places in the cube around the point that the cameras look at, as large as their distance from it, that many cameras see; where photographs have
    transparent parts, within the box and the hull of what they show."""
    half = max(max(float(np.linalg.norm(camera.position - focus)) for camera in cameras), NEAR)
    low, high = focus - half, focus + half

    def candidates(solid: Masks) -> np.ndarray:
        return _candidates(cameras, solid, counted, rng.uniform(low, high, (_TRIES * count, 3)))

    found = candidates(solid)
    if any(mask is not None for mask in solid):
        if len(found) < 4:
            return candidates([None] * len(cameras))[:count]
        margin = 0.5 * (found.max(axis=0) - found.min(axis=0)) / len(found) ** (1 / 3)
        low, high = np.maximum(low, found.min(axis=0) - margin), np.minimum(high, found.max(axis=0) + margin)
        found = max(found, candidates(solid), key=len)
    return found[:count]


def _swept(
    cameras: Sequence[Camera], photos: Sequence[np.ndarray], solid: Masks, counted: Masks, count: int, rng: np.random.Generator,
) -> np.ndarray:
    """Places along the rays of random pixels, each at that of `_TRIES` depths at which the cameras that see it agree best on its colour (a plane sweep).

    Depths are even in their inverse, that is in the pixels by which a place moves between two cameras: from where the nearest views meet to where the
    farthest two see it `_FAR` pixels apart.
    """
    positions = np.array([camera.position for camera in cameras])
    between = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    wide, near = between.max() or 1.0, between[between > 0].min(initial=between.max() or 1.0)
    focal, width = (float(np.median([getattr(camera, name) for camera in cameras])) for name in ("fx", "width"))
    first, last = 1.0 / max(near * focal / width, NEAR), _FAR / (wide * focal)
    if last >= first:
        raise FlickerError("cameras: no place is seen by two of them: the views do not overlap")
    number, depth = rng.integers(len(cameras), size=count), 1.0 / rng.uniform(last, first, (_TRIES, count))
    rays = np.empty((count, 3))
    for k, (camera, mask, counts) in enumerate(zip(cameras, solid, counted)):
        shown = np.ones((camera.height, camera.width), np.bool_)
        for part in (mask, counts):
            shown &= True if part is None else part
        of, pixels = np.flatnonzero(number == k), np.flatnonzero(shown if shown.any() else ~shown)
        line, column = np.divmod(rng.choice(pixels, len(of)), camera.width)
        jitter = rng.uniform(size=(2, len(of)))
        x, y = (column + jitter[0] - 0.5 * camera.width) / camera.fx, (line + jitter[1] - 0.5 * camera.height) / camera.fy
        rays[of] = np.stack([x, y, np.ones(len(of))], axis=1) @ camera.rotation.T
    found = positions[number] + depth[..., None] * rays
    best, least = np.zeros(count, np.int64), np.full(count, np.inf)
    for k, places in enumerate(found):
        total, squares, views = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
        for camera, photo, counts in zip(cameras, photos, counted):
            seen, line, column = _unmasked(*_seen(places, camera), counts)
            colour = photo[line, column].astype(np.float64)
            total[seen] += colour
            squares[seen] += colour**2
            views += seen
        with np.errstate(all="ignore"):
            spread = ((squares - total**2 / views[:, None]) / (views - 1.0)[:, None]).sum(axis=1)
        better = (views >= 2) & (spread < least)
        best[better], least[better] = k, spread[better]
    seen = np.flatnonzero(np.isfinite(least))
    if not len(seen):
        raise FlickerError("cameras: no place is seen by two of them: the views do not overlap")
    return found[best[seen], seen]


def _colours_of(places: np.ndarray, cameras: Sequence[Camera], photos: Sequence[np.ndarray], counted: Masks) -> np.ndarray:
    """float64 (N, 3): median of what the photographs show at each place, grey where none does."""
    middle = np.full(places.shape, 0.5)
    for first in range(0, len(places), _BLOCK):
        block = places[first : first + _BLOCK]
        shown = np.full((len(cameras), len(block), 3), np.nan, np.float32)
        for row, camera, photo, counts in zip(shown, cameras, photos, counted):
            seen, line, column = _unmasked(*_seen(block, camera), counts)
            row[seen] = photo[line, column]
        some = ~np.isnan(shown[..., 0]).all(axis=0)
        middle[first : first + _BLOCK][some] = np.nanmedian(shown[:, some], axis=0)
    return middle


def start(dataset: Dataset, photos: Sequence[np.ndarray], gaussians: int, degree: int, rng: np.random.Generator, counted: Masks | None = None) -> Parameters:
    """COLMAP's points, at most `gaussians` of them; else random places, in the colours of the photographs (H, W, 3). Round, as large as the distance to the
    nearest three others, faint. counted: of each photograph, bool (H, W), pixels that count; None: all."""
    cameras = [shot.camera for shot in dataset.fitted]
    if dataset.points is not None and dataset.colours is not None:
        chosen = np.sort(rng.permutation(len(dataset.points))[:gaussians])
        places, colours = dataset.points[chosen], dataset.colours[chosen]
    else:
        counts = counted or [None] * len(cameras)
        solid, count, focus = [shot.solid() for shot in dataset.fitted], max(4, int(RANDOM * gaussians)), _focus(cameras)
        places = _swept(cameras, photos, solid, counts, count, rng) if focus is None else _boxed(cameras, focus, solid, counts, count, rng)
        colours = _colours_of(places, cameras, photos, counts)
    distance = KDTree(places).query(places, k=min(4, len(places)))[0].reshape(len(places), -1)[:, 1:]
    size = np.clip(np.sqrt((distance**2).mean(axis=1)) if len(places) > 1 else np.ones(1), 1e-4 * extent_of(cameras), 0.1 * extent_of(cameras))
    values = np.zeros((len(places), SH + 3 * (degree + 1) ** 2), np.float32)
    values[:, MEAN:SCALE] = places
    values[:, SCALE:QUAT] = np.log(size)[:, None]
    values[:, QUAT] = 1.0
    values[:, LOGIT] = np.log(OPACITY / (1.0 - OPACITY))
    values[:, SH : SH + 3] = (colours - 0.5) / SH_C0
    return Parameters(values)
