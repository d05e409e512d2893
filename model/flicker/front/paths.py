"""The camera path that somebody asks for: given cameras, keyframes, or a motion that begins at one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import FlickerError
from ..scene import motion
from ..scene.camera import Camera, select_view
from ..scene.sources import Source
from ..scene.trajectory import check_path, joined, times_of
from .ahead import common_up, distance_ahead
from .projection import project

AHEAD_M = 3.0  # from the first camera to what it looks at, where nobody says


@dataclass(frozen=True)
class Asked:
    """A path. kind: None: the cameras one after the other; `keyframes`, or a motion: `pan`, `orbit`, `dolly`, `walk`, `shake`. amount: pixels a frame of a
    pan, degrees of an orbit. view: camera that a motion begins at. size: (width, height); None: as the cameras have it. frames: None: all cameras, a second
    from keyframe to keyframe (or what their times say), a second of a motion. speed: m/s; ahead: metres to what the first camera looks at, which gives a
    scene its scale."""

    kind: str | None = None
    amount: float = 0.0
    view: int = 0
    size: tuple[int, int] | None = None
    frames: int | None = None
    fps: float = 90.0
    speed: float = motion.WALKING
    ahead: float = AHEAD_M
    seed: int = 1


def given_cameras(cameras: Sequence[Camera], cameras_from: str, asked: Asked) -> list[Camera]:
    """The cameras at the size of a path. FlickerError, naming where they come from, camera and field, where they should be a path and are none, or lack the
    one that a motion begins at."""
    given = [camera if asked.size is None else camera.resized(*asked.size) for camera in cameras]
    if asked.kind not in (None, "keyframes"):
        select_view(given, asked.view)
        return given
    check_path(given, cameras_from)
    if asked.kind is None and asked.frames is not None and asked.frames > len(given):
        raise FlickerError(f"{cameras_from}: {len(given)} cameras, not {asked.frames}, each a frame; as keyframes they make any number")
    return given


def path_of(source: Source, asked: Asked) -> tuple[list[Camera], str]:
    """The cameras of a path in a scene, one of a frame, and what it is, for people. FlickerError, naming file, camera and field, for cameras that are no
    path."""
    given = given_cameras(source.cameras, source.cameras_from, asked)
    if asked.kind in (None, "keyframes"):
        if asked.kind is None:
            return given[: asked.frames], f"cameras of {source.cameras_from}"
        times = times_of(given)
        seconds = len(given) - 1 if times is None else float(times[-1])
        return joined(given, asked.frames or round(seconds * asked.fps) + 1), f"{len(given)} keyframes of {source.cameras_from}"
    start, count = select_view(given, asked.view), asked.frames or max(round(asked.fps), 2)
    said = f"from camera {asked.view} of {source.cameras_from}"
    if asked.kind == "pan":
        return motion.panned(start, asked.amount, count), f"pan of {asked.amount:g} pixels a frame {said}"
    distance, upward = distance_ahead(start, project(source.scene, start)), common_up(source.cameras)
    unit = distance / asked.ahead
    if asked.kind == "orbit":
        centre = start.position + distance * start.rotation[:, 2]
        return motion.orbited(start, centre, upward, asked.amount, count), f"orbit of {asked.amount:g} degrees {said}"
    if asked.kind == "dolly":
        return motion.dollied(start, asked.speed * unit, asked.fps, count), f"dolly at {asked.speed:g} m/s {said}"
    if asked.kind == "walk":
        return motion.walked(start, upward, unit, asked.fps, count, asked.speed), f"walk at {asked.speed:g} m/s {said}"
    if asked.kind == "shake":
        return motion.shaken(start, unit, asked.fps, count, asked.seed), f"shake (seed {asked.seed}) {said}"
    raise ValueError(f"no path of kind {asked.kind}")
