"""Cameras that a budget is fitted to, and cameras that are held out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from ..explore.machine import Configuration, run
from ..front.projection import project
from ..front.reference import render_reference
from ..front.view import View
from ..progress import Steps
from ..scene.camera import DEFAULT_UP, Camera, load_cameras, orbit_camera
from ..scene.gaussians import Scene
from ..scene.metrics import psnr

VIEWS = 144  # of an orbit: 120 to fit, 24 held out
HOLD_EVERY = 6  # cameras 0, 6, 12, ... are held out
LEAST_VIEWS = 3
SIZE = (480, 270)  # of an orbit's pictures
ELEVATIONS = (5.0, 45.0)  # degrees, of the orbits
NEARER = (1.0, 2.2)  # times nearer than the orbit of `flicker render`, which shows the scene whole
_G = 1.2207440846057596  # x^4 = x + 1


def orbits(scene: Scene, count: int, size: tuple[int, int], up: str | None, seed: int) -> list[Camera]:
    """Cameras around a scene at several distances and heights, evenly spread however many are taken: the additive recurrence R_3 of Roberts (2018), "The
    unreasonable effectiveness of quasirandom sequences", from a start that the seed gives, over azimuth, elevation and logarithm of the distance.

    size: (width, height) in pixels. up: as of `orbit_camera`. FlickerError for an unknown up or an impossible size.
    """
    steps = _G ** -np.arange(1.0, 4.0)
    places = (np.random.default_rng(seed).uniform(size=3) + np.arange(count)[:, None] * steps) % 1.0
    cameras = []
    for azimuth, height, depth in places.tolist():
        elevation = ELEVATIONS[0] + height * (ELEVATIONS[1] - ELEVATIONS[0])
        cameras.append(orbit_camera(scene, azimuth, 1, *size, up or DEFAULT_UP, elevation=elevation, nearer=NEARER[0] * (NEARER[1] / NEARER[0]) ** depth))
    return cameras


def cameras_of(
    scene: Scene, path: Path | None = None, count: int = VIEWS, size: tuple[int, int] | None = None, up: str | None = None, seed: int = 1,
) -> tuple[list[Camera], list[Camera]]:
    """Cameras to fit and cameras held out. path: a file or folder of cameras, all of which are taken; None: `orbits`, `count` of them.

    size: (width, height) of the pictures, as `Camera.resized` makes them. None: that of the cameras of the file, `SIZE` of an orbit. FlickerError names the
    file and the field.
    """
    if path is not None:
        if up is not None:
            raise FlickerError(f"up: {up}: only orbit cameras can be turned, but the cameras come from {path}")
        cameras = load_cameras(path)
        if size is not None:
            cameras = [camera.resized(*size) for camera in cameras]
        if len(cameras) < LEAST_VIEWS:
            raise FlickerError(f"{path}: {len(cameras)} cameras: at least {LEAST_VIEWS} are needed, of which some are held out")
    else:
        cameras = orbits(scene, count, size or SIZE, up, seed)
    held = cameras[::HOLD_EVERY]
    return [camera for k, camera in enumerate(cameras) if k % HOLD_EVERY], held


def machine_psnr(
    scene: Scene, cameras: Sequence[Camera], pictures: Sequence[np.ndarray], machine: Configuration, steps: Steps | None = None,
) -> list[float]:
    """dB of a scene as a machine draws it, bit-true, over black, against pictures (H, W, 3) of the cameras; of each camera."""
    found = []
    with (steps or Steps()).bar("pictures of the machine") as report:
        for k, (camera, picture) in enumerate(zip(cameras, pictures)):
            report(k, len(cameras))
            found.append(psnr(run(machine, View(camera, scene, background=(0.0, 0.0, 0.0))).image, picture))
    return found


def reference_psnr(full: Scene, small: Scene, cameras: Sequence[Camera], steps: Steps | None = None) -> list[float]:
    """dB of a scene against the full one, over black, both drawn by the reference renderer; of each camera."""
    found = []
    with (steps or Steps()).bar("reference pictures") as report:
        for k, camera in enumerate(cameras):
            report(k, len(cameras))
            found.append(psnr(*(render_reference(project(scene, camera), camera) for scene in (small, full))))
    return found
