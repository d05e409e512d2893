"""`transforms.json` of NeRF, nerfstudio and instant-ngp: frames with a lens and a pose.

A frame's own values come before those of the whole file. Poses are camera to world with x right, y up, z back (OpenGL); the principal point counts from the
picture's corner.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import FlickerError, FlickerWarning, one_line, say
from .fields import numbers, read_json, renamed, timestamp_of
from .image import picture_size
from .lens import COEFFICIENTS, foreign_note, said_fault
from .photos import SUFFIXES
from .pinhole import Camera

NUMBERS = ("w", "h", "cx", "cy", "fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "x_fov", "y_fov", "fisheye_crop_radius", *COEFFICIENTS)
SPLITS = ("train_filenames", "val_filenames", "test_filenames")  # nerfstudio's lists of pictures
SIZE = (800, 800)  # of NeRF's synthetic scenes, whose files name none
FROM_OPENGL = np.array([1.0, -1.0, -1.0])  # signs of the columns right, up, back to make them right, down, forward
_NAMES = {"width": "w", "height": "h", "fx": "fl_x", "fy": "fl_y", "position": "transform_matrix", "rotation": "transform_matrix"}
_PICTURES = ("images", "input", "photos")  # folders in which a photograph is looked for by its name alone


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame. where: for messages. data: its values, those of the whole file where it has none of its own. number: of `NUMBERS`, None where not given.
    folder: of the file. name: path of its picture as the file has it; None: not given."""

    where: str
    data: dict[str, Any]
    number: dict[str, float | None]
    folder: Path
    name: str | None

    @cached_property
    def picture(self) -> Path | None:
        """Its picture, named with or without suffix; None where there is none."""
        if self.name is None:
            return None
        path = self.folder / self.name
        places = [path] if path.suffix.lower() in SUFFIXES else []
        return next((p for p in (*places, *(path.with_name(path.name + suffix) for suffix in SUFFIXES)) if p.is_file()), None) if path.name else None

    @property
    def fault(self) -> str | None:
        """Why its lens is no pinhole, as `field: reason`; None: it is one."""
        return said_fault(self.data)

    def focal(self, w: float, h: float) -> tuple[float, float]:
        """Focal lengths (x, y) in pixels of a picture of w x h pixels; where one is not given, it is the other. As instant-ngp has it, x_fov and y_fov, fields
        of view in degrees, come before fl_x and fl_y, and these before camera_angle_x and camera_angle_y, in radians."""

        def one(axis: str, side: float) -> float | None:
            degrees, length, angle = (self.number[key] for key in (f"{axis}_fov", f"fl_{axis}", f"camera_angle_{axis}"))
            if degrees is not None:
                angle, length = math.radians(degrees), None
            return length or (None if angle is None else side / 2 / math.tan(angle / 2))

        fx, fy = one("x", w), one("y", h)
        if self.number["fl_x"] and not self.number["fl_y"] and self.number["y_fov"] is None:
            fy = fx  # an angle of the other axis is of less worth than a focal length
        known = fx or fy
        assert known is not None
        return fx or known, fy or known

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Position float64 (3,) and rotation float64 (3, 3), camera to world, columns right, down, forward. FlickerError."""
        matrix = self.data.get("transform_matrix")
        if matrix is None:
            raise FlickerError("transform_matrix: is missing")
        rows = len(matrix) if isinstance(matrix, list) else 0
        return pose_of(numbers(matrix, "transform_matrix", (3, 4) if rows == 3 else (4, 4)), "transform_matrix")


def pose_of(matrix: np.ndarray, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and rotation (3, 3), camera to world, columns right, down, forward, of a matrix (3, 4) or (4, 4) with columns right, up, back, position.
    FlickerError, naming `key`, for a last row that is none, as of a matrix written column by column."""
    if len(matrix) == 4 and np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-6:
        raise FlickerError(f"{key}: its last row is {' '.join(f'{v:g}' for v in matrix[3])}, not 0 0 0 1")
    return np.array(matrix[:3, 3]), matrix[:3, :3] * FROM_OPENGL


def frames_of(path: Path, data: Any) -> list[Frame]:
    """The frames of a file that holds `data`. FlickerError, naming file, frame and field."""
    frames = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(frames, list):
        raise FlickerError(f"{path}: frames: not a list")
    found = []
    for n, frame in enumerate(frames):
        where = f"{path}: frames[{n}]"
        if not isinstance(frame, dict):
            raise FlickerError(f"{where}: not an object")
        both = {key: value for key, value in data.items() if key != "frames"} | frame
        try:
            number = {key: None if both.get(key) is None else float(numbers(both[key], key, ())) for key in NUMBERS}
        except FlickerError as error:
            raise FlickerError(f"{where}: {error}") from None
        for key in ("w", "h", "fl_x", "fl_y", "fisheye_crop_radius"):
            if (value := number[key]) is not None and value <= 0:
                raise FlickerError(f"{where}: {key}: {value:g} is not positive")
        for key in ("camera_angle_x", "camera_angle_y"):
            if (value := number[key]) is not None and not 0 < value < math.pi:
                raise FlickerError(f"{where}: {key}: {value:g} is not between 0 and pi")
        for key in ("x_fov", "y_fov"):
            if (value := number[key]) is not None and not 0 < value < 180:
                raise FlickerError(f"{where}: {key}: {value:g} is not between 0 and 180 degrees")
        if all(number[key] is None for key in ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "x_fov", "y_fov")):
            raise FlickerError(f"{where}: neither fl_x nor camera_angle_x")
        name = both.get("file_path")
        if name is not None and not isinstance(name, str):
            raise FlickerError(f"{where}: file_path: not a text")
        found.append(Frame(where, both, number, path.parent, None if name is None else name.replace("\\", "/")))  # a path of Windows is one, too
    for note in dict.fromkeys(note for frame in found if (note := foreign_note(frame.data)) is not None):
        say(path, note)
    return found


def read_frames(path: Path) -> list[Frame]:
    """The frames of a file."""
    return frames_of(path, read_json(path))


def splits_of(path: Path, data: dict[str, Any], frames: Sequence[Frame]) -> dict[str, list[int]]:
    """Numbers of the frames in each of `SPLITS` that the file has, in the order of the frames. A picture is named as its frame names it, or without its suffix.
    FlickerError, naming file and field, for one that no frame has."""
    exact: dict[PurePosixPath, list[int]] = {}
    bare: dict[PurePosixPath, list[int]] = {}
    for n, frame in enumerate(frames):
        if frame.name:
            place = PurePosixPath(frame.name)
            exact.setdefault(place, []).append(n)
            bare.setdefault(place.with_suffix("") if place.suffix.lower() in SUFFIXES else place, []).append(n)
    found = {}
    for key in SPLITS:
        names = data.get(key)
        if names is None:
            continue
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise FlickerError(f"{path}: {key}: not a list of texts")
        chosen: set[int] = set()
        for k, name in enumerate(names):
            place = PurePosixPath(name.replace("\\", "/"))
            there = exact.get(place) or bare.get(place.with_suffix("") if place.suffix.lower() in SUFFIXES else place)
            if not there:
                raise FlickerError(f"{path}: {key}[{k}]: '{one_line(name)}' is the file_path of no frame")
            chosen.update(there)
        found[key] = sorted(chosen)
    return found


def photo_name(name: str) -> str:
    """The name by which `scene.photos` finds the picture of a frame: its path, without the folder where pictures are looked for anyway."""
    parts = [part for part in PurePosixPath(name.replace("\\", "/")).parts if part != "."]
    return "/".join(parts[1:] if len(parts) > 1 and parts[0] in _PICTURES else parts)


def cameras_of(path: Path, data: Any) -> list[Camera]:
    """The frames as cameras, in the order of the file. FlickerError, naming file, frame and field, also for a lens that is no pinhole.

    Sizes that the file does not name are those of the pictures, or of the first one that is there; without any, `SIZE` where only an angle of view is given.
    A FlickerWarning says so.
    """
    frames = frames_of(path, data)
    sizes = _Sizes(path, frames)
    found = []
    for n, frame in enumerate(frames):
        try:
            if frame.fault is not None:
                raise FlickerError(frame.fault)
            w, h = sizes.of(frame)
            position, rotation = frame.pose()
            fx, fy = frame.focal(w, h)
            cx, cy = (None if (value := frame.number[key]) is None else value - 0.5 for key in ("cx", "cy"))
            name = photo_name(frame.name) if frame.name else None
            found.append(Camera(
                w, h, fx, fy, position, rotation, PurePosixPath(name).stem if name else str(n), name or None, cx=cx, cy=cy,  # type: ignore[arg-type]
                timestamp=timestamp_of(frame.data),
            ))
        except FlickerError as error:
            raise FlickerError(f"{frame.where}: {renamed(error, _NAMES)}") from None
    sizes.told()
    return found


class _Sizes:
    """Sizes of the frames' pictures, and where they come from."""

    def __init__(self, path: Path, frames: list[Frame]) -> None:
        self.path, self.frames = path, frames
        self.own = self.borrowed = self.assumed = 0  # frames whose size is that of their picture, of another one's, `SIZE`

    @cached_property
    def first(self) -> Path | None:
        """The first picture that is there."""
        return next((frame.picture for frame in self.frames if frame.picture is not None), None)

    def of(self, frame: Frame) -> tuple[int, int]:
        """Width and height in pixels. FlickerError where nothing says them."""
        w, h = frame.number["w"], frame.number["h"]
        if w is not None and h is not None:
            return w, h  # type: ignore[return-value]  # the camera checks that they are whole
        if w is not None or h is not None:
            raise FlickerError(f"{'h' if h is None else 'w'}: is missing")
        picture = frame.picture or self.first
        if picture is not None:
            if frame.picture is not None:
                self.own += 1
            else:
                self.borrowed += 1
            return picture_size(picture)
        if any(frame.number[key] is not None for key in ("fl_x", "fl_y", "cx", "cy")):
            raise FlickerError("w, h: are missing, and no picture is there that would tell")
        self.assumed += 1
        return SIZE

    def told(self) -> None:
        """Say which sizes the file does not name."""
        for count, source in (
            (self.own, "those of its pictures"), (self.borrowed, f"that of {one_line(self.first)}"),
            (self.assumed, f"taken as {SIZE[0]}x{SIZE[1]}, no picture is there"),
        ):
            if count:
                said = FlickerWarning(f"{self.path}: names no size (w, h) of {count} of {len(self.frames)} frames: {source}")
                warnings.warn(said, stacklevel=4)
