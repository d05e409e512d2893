"""Scenes, their views, and the points of sweeps and reports: one configuration on one view."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..front.view import DEMO, View, load_view
from ..scene.camera import ORBIT_VIEWS, load_cameras
from .configurations import get_configuration
from .digest import code_digest, file_digest, key

SUFFIXES = (".ply", ".spz", ".sog", ".splat")


@dataclass(frozen=True)
class SceneFile:
    """A scene and its cameras. path: a file, or `demo`. cameras: a file; None: `cameras.json` beside the scene, else an orbit."""

    path: str
    cameras: str | None = None

    @property
    def file(self) -> str:
        """File name."""
        return Path(self.path).name

    @property
    def name(self) -> str:
        """File name without its suffixes."""
        return self.file.split(".")[0]

    @property
    def cameras_file(self) -> Path | None:
        """The file that the cameras come from; None: there is none."""
        used = Path(self.cameras) if self.cameras is not None else Path(self.path).parent / "cameras.json"
        return used if self.path != DEMO and used.exists() else None

    def views(self) -> int:
        """Number of cameras."""
        if self.path == DEMO:
            from ..scene.demo import demo_cameras

            return len(demo_cameras())
        return ORBIT_VIEWS if self.cameras_file is None else len(load_cameras(self.cameras_file))

    @cached_property
    def digest(self) -> str:
        """Of the contents of scene and cameras; the demo scene is code."""
        if self.path == DEMO:
            return ""
        digest = file_digest(Path(self.path))
        return digest if self.cameras_file is None else f"{digest}-{file_digest(self.cameras_file)}"


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
        return load_view(self.scene.path, self.view, self.size, self.scene.cameras)

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
