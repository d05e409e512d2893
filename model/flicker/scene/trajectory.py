"""Camera paths of given cameras: one after the other, or as keyframes that splines join."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from ..errors import FlickerError
from .pinhole import Camera

_SAME = 1e-6  # relative difference of numbers of a lens that is none


def check_path(cameras: Sequence[Camera], where: str, what: str = "camera") -> None:
    """FlickerError, naming `where` they come from, the camera and the field, unless these cameras can be a path: two at least, of one size and one lens, and
    with times that rise where there are times."""
    if len(cameras) < 2:
        raise FlickerError(f"{where}: {'one' if cameras else 'no'} {what}: a path needs two at least, or a motion (--pan, --orbit, --dolly, --walk, --shake)")
    first = cameras[0]
    for n, camera in enumerate(cameras[1:], 1):
        for key in ("width", "height"):
            a, b = getattr(first, key), getattr(camera, key)
            if a != b:
                raise FlickerError(f"{where}: {what} {n}: {key}: {b} pixels, {a} before: a path has one size, which --size gives")
        for key in ("fx", "fy", "cx", "cy"):
            a, b = getattr(first, key), getattr(camera, key)
            if abs(a - b) > _SAME * max(abs(a), abs(b), 1.0):
                raise FlickerError(f"{where}: {what} {n}: {key}: {b:.9g} pixels, {a:.9g} before: a path has one lens")
        before = cameras[n - 1].timestamp
        if (before is None) != (camera.timestamp is None):
            raise FlickerError(f"{where}: {what} {n if camera.timestamp is None else n - 1}: timestamp: is missing, others have one")
        if before is not None and camera.timestamp is not None and camera.timestamp <= before:
            raise FlickerError(f"{where}: {what} {n}: timestamp: {camera.timestamp:.9g} s is not after {before:.9g} s, that of the one before")


def times_of(cameras: Sequence[Camera]) -> np.ndarray | None:
    """float64 (N,), seconds from the first camera; None where they have no times."""
    if any(c.timestamp is None for c in cameras):
        return None
    times = np.array([c.timestamp for c in cameras], np.float64)
    return times - times[0]


def joined(keyframes: Sequence[Camera], frames: int) -> list[Camera]:
    """Cameras of a path through keyframes, two at least: at their times, else evenly in time; the first frame is the first keyframe, the last one the last.

    Positions go along natural cubic splines, rotations along quaternion splines with continuous angular rate and acceleration (`scipy`'s
    `RotationSpline`: rotation vectors that are cubic in time between keyframes). The lens is the first one's: `check_path` first.
    """
    if frames < 1:
        raise FlickerError(f"frames: {frames}: one at least")
    times = times_of(keyframes)
    if times is None:
        times = np.arange(len(keyframes), dtype=np.float64)
    at = np.linspace(times[0], times[-1], frames)
    places = CubicSpline(times, np.array([c.position for c in keyframes]), bc_type="natural")(at)
    turns = RotationSpline(times, Rotation.from_matrix(np.array([c.rotation for c in keyframes])))(at).as_matrix()
    return [
        replace(keyframes[0], position=p, rotation=r, name=f"frame_{n}", img_name=None, timestamp=None) for n, (p, r) in enumerate(zip(places, turns))
    ]
