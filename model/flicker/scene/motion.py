"""Cameras of motions that are made: a pan, an orbit, a dolly, a walk, a head that shakes. Every path begins at the camera it is made of, with its lens and
size.

Scenes have no scale. unit: what a metre is in the scene's units; the command line takes it from the distance of what the first camera looks at.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from .pinhole import Camera

WALKING = 1.4  # m/s, a comfortable pace of adults
STEPS_HZ = 2.0  # steps a second at that pace; a stride is two
BOB_M, SWAY_M = 0.025, 0.02  # of the head: vertically, once a step; sideways, once a stride (half of peak to peak)
FIXATION_M = 1.0  # the head turns against bob and sway about a point so far ahead

# A head that shakes: the spectral density of each velocity is flat up to the corner and falls as the fourth power of the frequency beyond.
SHAKE_HZ = (0.2, 12.0)  # lowest and highest frequency
CORNER_HZ = 2.6
TURN_RMS = (10.0, 10.0, 5.0)  # degrees a second: pitch, yaw, roll
SHIFT_RMS = (0.05, 0.05, 0.05)  # m/s: right, down, forward
_SINES = 96  # of each degree of freedom


def _along(camera: Camera, positions: np.ndarray, rotations: np.ndarray) -> list[Camera]:
    """Cameras with other poses: float64 (N, 3), (N, 3, 3)."""
    return [replace(camera, position=p, rotation=r, name=f"frame_{n}", img_name=None) for n, (p, r) in enumerate(zip(positions, rotations))]


def panned(camera: Camera, pixels: float, frames: int) -> list[Camera]:
    """Turned on the spot about its own vertical axis, to the right for positive `pixels`: the middle of the picture moves by so many pixels a frame."""
    turns = Rotation.from_rotvec(np.outer(np.arange(frames) * math.atan(pixels / camera.fx), [0.0, 1.0, 0.0])).as_matrix()
    return _along(camera, np.repeat(camera.position[None], frames, 0), camera.rotation @ turns)


def orbited(camera: Camera, centre: np.ndarray, up: np.ndarray, degrees: float, frames: int) -> list[Camera]:
    """About an axis up (3,) through `centre` (3,), to the right for positive `degrees`, which are those of all frames: at 360 the last frame is the first one's
    neighbour, so that the path can be shown in a loop."""
    angles = np.radians(degrees) * np.arange(frames) / frames
    turns = Rotation.from_rotvec(np.outer(angles, np.asarray(up) / np.linalg.norm(up))).as_matrix()
    return _along(camera, centre + turns @ (camera.position - centre), turns @ camera.rotation)


def dollied(camera: Camera, speed: float, fps: float, frames: int) -> list[Camera]:
    """Forward along its axis. speed: units of the scene a second."""
    return _along(camera, camera.position + np.outer(np.arange(frames) / fps * speed, camera.rotation[:, 2]), np.repeat(camera.rotation[None], frames, 0))


def walked(camera: Camera, up: np.ndarray, unit: float, fps: float, frames: int, speed: float = WALKING) -> list[Camera]:
    """Forward on level ground at `speed` metres a second, with the head of a walker: it bobs once a step and sways once a stride, and turns against both
    about a point `FIXATION_M` ahead, as Hirasaki, Moore, Raphan, Cohen: "Effects of walking velocity on vertical head and body movements during locomotion",
    Exp Brain Res 127 (1999) find it. Pitch has twice the frequency of yaw (Grossman, Leigh, Abel, Lanska, Thurston: "Frequency and velocity of rotational
    head perturbations during locomotion", Exp Brain Res 70 (1988)). Sizes of bob and sway, `BOB_M` and `SWAY_M`, are round numbers of this project.
    """
    up = np.asarray(up, np.float64) / np.linalg.norm(up)
    right, ahead = camera.rotation[:, 0], camera.rotation[:, 2]
    level = ahead - (ahead @ up) * up
    if np.linalg.norm(level) < 1e-3:  # a camera that looks straight up or down walks to its upper edge
        level = -camera.rotation[:, 1] - (-camera.rotation[:, 1] @ up) * up
    level /= np.linalg.norm(level)
    seconds = np.arange(frames) / fps
    bob = BOB_M * (1.0 - np.cos(2 * math.pi * STEPS_HZ * seconds))  # from the lowest place, when both feet are down
    sway = SWAY_M * np.sin(math.pi * STEPS_HZ * seconds)
    places = np.outer(speed * seconds, level) + np.outer(bob, up) + np.outer(sway, right)
    # Right is x and down y of the camera: to look down is a negative turn about x, to the left a negative one about y.
    turns = Rotation.from_rotvec(np.stack([-np.arctan(bob / FIXATION_M), -np.arctan(sway / FIXATION_M), np.zeros(frames)], axis=1)).as_matrix()
    return _along(camera, camera.position + unit * places, camera.rotation @ turns)


def _sines(rng: np.random.Generator, rms: float, seconds: np.ndarray) -> np.ndarray:
    """An angle or a place whose velocity has the spectrum above and this root mean square: 0 at 0 s. A sum of sines, so the same at any rate of frames."""
    edges = np.geomspace(*SHAKE_HZ, _SINES + 1)
    frequency = rng.uniform(edges[:-1], edges[1:])
    power = np.diff(edges) / (1.0 + (frequency / CORNER_HZ) ** 4)
    amplitude = rms * np.sqrt(2.0 * power / power.sum()) / (2 * math.pi * frequency)
    phase = rng.uniform(0.0, 2 * math.pi, _SINES)
    return (np.sin(2 * math.pi * np.outer(seconds, frequency) + phase) - np.sin(phase)) @ amplitude


def shaken(camera: Camera, unit: float, fps: float, frames: int, seed: int = 1, strength: float = 1.0) -> list[Camera]:
    """A head that is never still, six degrees of freedom. strength: times the root mean squares `TURN_RMS` and `SHIFT_RMS` of its velocities.

    Corner of the spectrum: vigorous voluntary rotations of the head do not exceed 2.6 Hz in the median (Grossman, Leigh, Abel, Lanska, Thurston: "Frequency and
    velocity of rotational head perturbations during locomotion", Exp Brain Res 70 (1988)), whose subjects turn their heads by less than 90 degrees a second in
    walking. Form and size are choices of this project. Same seed, same head, whatever the rate of frames.
    """
    rng, seconds = np.random.default_rng(seed), np.arange(frames) / fps
    angles, places = (np.stack([strength * _sines(rng, rms, seconds) for rms in each], axis=1) for each in (TURN_RMS, SHIFT_RMS))
    turns = Rotation.from_rotvec(np.radians(angles)).as_matrix()
    return _along(camera, camera.position + unit * places @ camera.rotation.T, camera.rotation @ turns)


def speeds(cameras: Sequence[Camera], fps: float) -> tuple[float, float]:
    """Largest speeds of a path: units of the scene a second, degrees a second; 0 of a single camera."""
    if len(cameras) < 2:
        return 0.0, 0.0
    places = np.array([c.position for c in cameras])
    turns = Rotation.from_matrix(np.array([c.rotation for c in cameras]))
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).max() * fps), float(np.degrees((turns[:-1].inv() * turns[1:]).magnitude().max()) * fps)
