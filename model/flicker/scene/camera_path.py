"""`camera_path.json` of nerfstudio's viewer: a walk of rendered pictures of one size.

As nerfstudio renders it: `fov` is the vertical field of view in degrees, pixels are square, the principal point is the middle; `aspect` is that of the editor's
window and has no effect. Poses are camera to world with x right, y up, z back (OpenGL).
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

from ..errors import FlickerError, FlickerWarning
from .fields import numbers, renamed
from .pinhole import Camera
from .transforms import pose_of

KEY = "camera_path"
_NAMES = {"width": "render_width", "height": "render_height", "position": "camera_to_world", "rotation": "camera_to_world"}


def cameras_of(path: Path, data: dict[str, Any]) -> list[Camera]:
    """The cameras, in the order of the path. FlickerError, naming file, camera and field; FlickerWarning for a crop, which is not applied."""
    entries = data[KEY]
    if not isinstance(entries, list):
        raise FlickerError(f"{path}: {KEY}: not a list")
    size = []
    for key in ("render_width", "render_height"):
        if data.get(key) is None:
            raise FlickerError(f"{path}: {key}: is missing")
        size.append(data[key])
    if data.get("crop"):
        warnings.warn(FlickerWarning(f"{path}: crop: is not applied, the whole scene is drawn"), stacklevel=3)
    found = []
    for n, entry in enumerate(entries):
        where = f"{path}: {KEY}[{n}]"
        if not isinstance(entry, dict):
            raise FlickerError(f"{where}: not an object")
        try:
            found.append(_camera(data | entry, size, f"path_{n}"))
        except FlickerError as error:
            raise FlickerError(f"{where}: {renamed(error, _NAMES)}") from None
    return found


def _camera(entry: dict[str, Any], size: list[Any], name: str) -> Camera:
    kind = entry.get("camera_type") or "perspective"
    if str(kind).lower() != "perspective":
        raise FlickerError(f"camera_type: {kind} is no pinhole, and only pinholes are drawn")
    matrix = entry.get("camera_to_world")
    nested = isinstance(matrix, list) and len(matrix) == 4
    pose = numbers(matrix, "camera_to_world", (4, 4) if nested else (16,)).reshape(4, 4)
    fov = entry.get("fov") if entry.get("fov") is not None else entry.get("default_fov")
    if fov is None:
        raise FlickerError("fov: is missing")
    degrees = float(numbers(fov, "fov", ()))
    if not 0 < degrees < 180:
        raise FlickerError(f"fov: {degrees:g} is not between 0 and 180 degrees")
    focal = 0.5 * float(numbers(size[1], "render_height", ())) / math.tan(math.radians(degrees) / 2)
    return Camera(size[0], size[1], focal, focal, *pose_of(pose, "camera_to_world"), name)
