"""Scenes, their views, and the points of sweeps and reports: one configuration on one view."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..front.view import DEMO, View, load_view
from ..scene.camera import camera_count, cameras_beside
from ..scene.files import scene_digest, scene_name, scene_title
from .configurations import get_configuration
from .digest import code_digest, file_digest, key


@dataclass(frozen=True)
class SceneFile:
    """A scene and its cameras. path: a file, a folder, or `demo`. cameras: a file; None: what `find_cameras` finds. up: of the orbit."""

    path: str
    cameras: str | None = None
    up: str | None = None

    @property
    def file(self) -> str:
        """Name of file or folder."""
        return self.path if self.path == DEMO else scene_title(self.path)

    @property
    def name(self) -> str:
        """The same without its suffixes."""
        return self.path if self.path == DEMO else scene_name(self.path)

    def views(self) -> int:
        """Number of cameras."""
        if self.path == DEMO:
            from ..scene.demo import demo_cameras

            return len(demo_cameras())
        return camera_count(self.path, self.cameras, self.up)

    @cached_property
    def digest(self) -> str:
        """Of the contents of scene and cameras; the demo scene is code."""
        if self.path == DEMO:
            return ""
        cameras = Path(self.cameras) if self.cameras is not None else cameras_beside(self.path)
        return "-".join((scene_digest(self.path)[:16], file_digest(cameras) if cameras else "orbit", self.up or ""))


@dataclass(frozen=True)
class Target:
    """One view of a scene at a size."""

    scene: SceneFile
    view: int
    size: tuple[int, int]

    @property
    def title(self) -> str:
        return f"{self.scene.name} {self.view}"

    def load(self) -> View:
        return load_view(self.scene.path, self.view, self.size, self.scene.cameras, self.scene.up)

    def key(self, *parts: object) -> str:
        """Name of a result of this view: of contents, not of places."""
        return key(code_digest(), self.scene.file, self.scene.digest, self.view, *self.size, *parts)


@dataclass(frozen=True)
class Point:
    """One configuration on one view."""

    target: Target
    configuration: str

    @cached_property
    def key(self) -> str:
        """Name of the point's result."""
        return self.target.key(repr(get_configuration(self.configuration)))
