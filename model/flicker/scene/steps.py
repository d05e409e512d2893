"""How coarse the positions of a memory image are: their steps, in units of the scene and in pixels of its views."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import FlickerError, FlickerWarning
from .camera import Camera, find_cameras
from .gaussians import Scene
from .packed import POSITION_BITS, PackedFormat, PackedScene, means_and_scales, split
from .sources import DEMO

# Steps over the sizes of Gaussians on the screen (root mean square) from which on there is a warning (docs/reference/memory_image.md). Ordinary scenes have
# up to 0.1; what packing alone leaves of pictures is in docs/results/memory_formats.md.
COARSE = 0.25
VIEWS = 16  # cameras looked through, evenly from all
_NEAR = 0.2  # depth from which on Gaussians are drawn
_DILATION = 0.3  # square pixels that pictures add to every covariance


def position_steps(packed: PackedScene) -> np.ndarray:
    """float64 (N,): step of each Gaussian's position, the largest of three axes, in units of the scene. What is told is at most half a step away.

    In chunks an axis on which all codes of a cluster are its lowest or its highest is exact: its step is 0.
    """
    words = packed.geometry[packed.slot]
    if packed.format is not PackedFormat.CHUNK:
        return np.spacing(np.abs(words[:, :3].view(np.float16)).astype(np.float16)).astype(np.float64).max(axis=1)
    codes = split(words[:, 0], POSITION_BITS)
    inner = np.maximum.reduceat((codes > 0) & (codes < (1 << np.array(POSITION_BITS)) - 1), packed.start[:-1])
    return (packed.headers["position_step"].astype(np.float64) * inner).max(axis=1)[packed.cluster]


@dataclass(frozen=True)
class PositionSteps:
    """Steps of a scene's positions. mean, largest: of all Gaussians, units of the scene. views: cameras looked through. seen: Gaussians in their pictures, each
    counted once a camera. mean_px, largest_px: of these, pixels. relative: root mean square of these over their sizes, the middle one of the three standard
    deviations, with the dilation that pictures have; all three 0 where none is seen. format: of the image."""

    mean: float
    largest: float
    views: int
    seen: int
    mean_px: float
    largest_px: float
    relative: float
    format: PackedFormat

    @property
    def coarse(self) -> bool:
        """A loss to be seen: above `COARSE`."""
        return self.relative > COARSE

    def warning(self, brought: bool) -> str:
        """What is wrong and what would help, for people. brought: the clusters are the file's own."""
        helps = "; the other formats have finer steps" if self.format is PackedFormat.FP16 else "; --rechunk makes the clusters anew" if brought else ""
        return (
            f"positions are packed in steps of {self.relative:.2g} of the Gaussians' sizes on the screen (root mean square; "
            f"{self.mean_px:.2g} pixels in the mean, {self.largest_px:.2g} at most), above {COARSE:g}: a loss to be seen{helps}"
        )

    def as_dict(self) -> dict[str, float | int]:
        """For statistics."""
        return {"mean": self.mean, "largest": self.largest, "mean_px": self.mean_px, "largest_px": self.largest_px, "relative": self.relative}


def in_picture(means: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """bool (N,): which means (N, 3) are in the camera's picture at a depth that is drawn; and their depths, float64, in order."""
    x, y, z = ((means - camera.position) @ camera.rotation).T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inside = (z >= _NEAR) & (np.abs(camera.fx * x / z + camera.cx - 0.5 * (camera.width - 1)) <= 0.5 * camera.width)
        inside &= np.abs(camera.fy * y / z + camera.cy - 0.5 * (camera.height - 1)) <= 0.5 * camera.height
    return inside, z[inside]


def scene_views(scene: Scene, path: Path) -> list[Camera]:
    """At most `VIEWS` cameras of the scene at `path`, evenly from its own; with a warning those of an orbit, where it has none."""
    from .demo import demo_cameras

    try:
        cameras = demo_cameras() if str(path) == DEMO else find_cameras(scene)
    except FlickerError as error:
        warnings.warn(FlickerWarning(f"{error}; an orbit is measured"), stacklevel=2)
        cameras = find_cameras(replace(scene, path=None))
    return chosen_views(cameras)


def chosen_views(cameras: Sequence[Camera]) -> list[Camera]:
    """At most `VIEWS` cameras, evenly from all."""
    count = min(len(cameras), VIEWS)
    return [cameras[i * len(cameras) // count] for i in range(count)]


def measure_steps(packed: PackedScene, cameras: Sequence[Camera]) -> PositionSteps:
    """Steps of positions, seen through the cameras; a Gaussian is seen where `in_picture` says so."""
    steps, (means, scales) = position_steps(packed), means_and_scales(packed)
    middle = np.median(scales, axis=1)
    seen, total, squares, largest = 0, 0.0, 0.0, 0.0
    for camera in cameras:
        inside, depth = in_picture(means, camera)
        if not len(depth):
            continue
        focal = max(camera.fx, camera.fy)
        pixels = steps[inside] * focal / depth
        seen, total, largest = seen + len(pixels), total + float(pixels.sum()), max(largest, float(pixels.max()))
        squares += float((pixels**2 / ((middle[inside] * focal / depth) ** 2 + _DILATION)).sum())
    count = max(seen, 1)
    return PositionSteps(float(steps.mean()), float(steps.max()), len(cameras), seen, total / count, largest, math.sqrt(squares / count), packed.format)
