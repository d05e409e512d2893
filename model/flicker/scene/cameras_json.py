"""`cameras.json` of the INRIA code: a list of objects with img_name, width, height, position, rotation, fx, fy; here also cx, cy, timestamp.

`position` is the camera's centre in the world, `rotation` camera to world, rows of a matrix with columns right, down, forward. `cx`, `cy`: the principal
point in pixels from the picture's corner, as COLMAP counts; without them the middle. `timestamp`: seconds, of cameras of a path.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import FlickerError, say
from .fields import numbers, timestamp_of
from .lens import foreign_note, said_fault
from .pinhole import Camera

_KEYS = ("width", "height", "fx", "fy", "position", "rotation")


def cameras_of(path: Path, entries: list[Any]) -> list[Camera]:
    """The cameras, in the order of the file. FlickerError, naming file, camera and field; FlickerWarning for names of lenses that are not known."""
    cameras = []
    for i, entry in enumerate(entries):
        where = f"{path}: camera {i}"
        if not isinstance(entry, dict):
            raise FlickerError(f"{where}: not an object")
        for key in _KEYS:
            if key not in entry:
                raise FlickerError(f"{where}: '{key}' is missing")
        img_name = None if entry.get("img_name") is None else str(entry["img_name"])
        try:
            if (fault := said_fault(entry)) is not None:
                raise FlickerError(fault)
            centre: dict[str, Any] = {key: float(numbers(entry[key], key, ())) - 0.5 for key in ("cx", "cy") if entry.get(key) is not None}
            own = {key: entry[key] for key in _KEYS} | {"timestamp": timestamp_of(entry)}
            cameras.append(Camera(**own, name=img_name or str(i), img_name=img_name, **centre))
        except FlickerError as error:
            raise FlickerError(f"{where}: {error}") from None
    for note in dict.fromkeys(note for entry in entries if (note := foreign_note(entry)) is not None):
        say(path, note)
    return cameras


def cameras_text(cameras: Sequence[Camera]) -> str:
    """The text of the file; cx, cy of cameras whose principal point is not the middle, timestamp of those that have one. A camera without photograph goes by
    its name."""
    return json.dumps([
        {"id": k, "img_name": c.img_name or c.name, "width": c.width, "height": c.height, "position": c.position.tolist(),
         "rotation": c.rotation.tolist(), "fx": c.fx, "fy": c.fy,
         **({} if c.centred else {"cx": c.cx + 0.5, "cy": c.cy + 0.5}), **({} if c.timestamp is None else {"timestamp": c.timestamp})}
        for k, c in enumerate(cameras)
    ], indent=1) + "\n"
