"""Keyframes that a browser records, as a path that `flicker path --cameras FILE --keyframes` joins by splines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..output import cannot_write, write_text
from ..scene.camera import Camera, cameras_text
from ..scene.trajectory import check_path

FILE = "path.json"


class Keyframes:
    """Cameras with their times, in the order in which they are recorded."""

    def __init__(self) -> None:
        self.cameras: list[Camera] = []

    def add(self, camera: Camera, seconds: float) -> None:
        """A keyframe, so many seconds after the one before; the first one is at 0."""
        at = 0.0 if not self.cameras else float(self.cameras[-1].timestamp or 0.0) + seconds
        self.cameras.append(replace(camera, name=f"keyframe_{len(self.cameras)}", img_name=None, timestamp=at))

    def remove(self) -> None:
        """The last one, if there is one."""
        if self.cameras:
            self.cameras.pop()

    def save(self, folder: Path) -> Path:
        """Write them as `path.json`, in the layout of `cameras.json` with times. FlickerError where they are no path, such as after a zoom that changed the
        lens."""
        path = folder / FILE
        check_path(self.cameras, path.name, "keyframe")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise cannot_write(folder, error) from None
        write_text(path, cameras_text(self.cameras))
        return path

    def __str__(self) -> str:
        if not self.cameras:
            return "no keyframe yet"
        return f"{len(self.cameras)} keyframe{'s' * (len(self.cameras) > 1)}, {self.cameras[-1].timestamp:.1f} s"
