"""Scenes, their views, and the points of sweeps and reports: one configuration on one view."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

from ..errors import FlickerError
from ..front.paths import Asked, given_cameras, path_of
from ..front.view import DEMO, View, load_view
from ..params import SortOrder
from ..scene import Scene
from ..scene.camera import ORBIT_VIEWS, Camera, camera_files, cameras_beside, cameras_said, no_such_view, of_colmap, photos_root, stored_cameras
from ..scene.files import scene_digest, scene_name, scene_title
from ..scene.photos import BLACK, NONE, check_photo, photo_beside, photo_in
from ..scene.sources import open_scene
from .configurations import get_configuration
from .digest import code_digest, file_digest, key

SIZE = (1280, 720)  # of views without a photograph when none is asked for


@dataclass(frozen=True)
class SceneFile:
    """A scene, its cameras, its photographs. path: a file, a folder, or `demo`. cameras: a file or folder; None: what `find_cameras` finds. up: of the orbit.
    photos: a folder with the photograph of every camera; None: those found beside the cameras; `none`: none. background: RGB in [0, 1].
    order: what splats are sorted by."""

    path: str
    cameras: str | None = None
    up: str | None = None
    photos: str | None = None
    background: tuple[float, float, float] = BLACK
    order: SortOrder = SortOrder.DEPTH

    @property
    def file(self) -> str:
        """Name of file or folder."""
        return self.path if self.path == DEMO else scene_title(self.path)

    @property
    def name(self) -> str:
        """The same without its suffixes."""
        return self.path if self.path == DEMO else scene_name(self.path)

    @property
    def cameras_file(self) -> Path | None:
        """The file or folder that the cameras come from; None: there is none."""
        if self.cameras is not None:
            return Path(self.cameras)
        return None if self.path == DEMO else cameras_beside(self.path)

    @cached_property
    def stored(self) -> bool:
        """Whether the cameras are of pixels as they are stored, whatever EXIF says: COLMAP's."""
        return self.cameras_file is not None and of_colmap(self.cameras_file)

    @property
    def cameras_from(self) -> str:
        """Where the cameras come from, for people."""
        if self.path == DEMO:
            return "the demo scene's own" if self.cameras is None else cameras_said(None, self.cameras)
        return cameras_said(self.path, self.cameras, self.up)

    @cached_property
    def _cameras(self) -> list[Camera] | None:
        """The cameras; None: an orbit, which needs the scene."""
        if self.path == DEMO and self.cameras is None:
            from ..scene.demo import demo_cameras

            return demo_cameras()
        return stored_cameras(self.path, self.cameras, self.up)

    def views(self) -> int:
        """Number of cameras."""
        return ORBIT_VIEWS if self._cameras is None else len(self._cameras)

    def photo(self, view: int) -> Path | None:
        """The photograph of a view; None: there is none. FlickerError when one was asked for, or when two are found."""
        if self.photos == NONE:
            return None
        camera = None if self._cameras is None else self._cameras[view]
        if camera is None or camera.img_name is None or self.cameras_file is None:
            if self.photos is None:
                return None
            raise FlickerError(f"photos: {self.path}: view {view} has no 'img_name' in a cameras.json, by which its photograph would be found")
        if self.photos is not None:
            return photo_in(Path(self.photos), camera.img_name)
        return photo_beside(photos_root(self.cameras_file) / self.cameras_file.name, camera.img_name)

    def target(self, view: int, size: tuple[int, int] | None = None) -> Target:
        """A view of the scene, with its photograph checked. size: None: that of the camera where it has a photograph, else `SIZE`. FlickerError."""
        if view >= (count := self.views()):
            raise no_such_view(view, count)
        photo = self.photo(view)
        if photo is None or self._cameras is None:
            return Target(self, view, size or SIZE)
        size = size or (self._cameras[view].width, self._cameras[view].height)
        check_photo(photo, size, self.stored)
        return Target(self, view, size)

    def path_target(self, asked: Asked, size: tuple[int, int] | None = None, clock: float = 1.0) -> Target:
        """A path in the scene, its cameras checked as far as they are known without the scene. size: None: `SIZE`. FlickerError."""
        asked = replace(asked, size=size or SIZE)
        if self._cameras is not None:
            given_cameras(self._cameras, self.cameras_from, asked)
        elif asked.view >= (count := self.views()):
            raise no_such_view(asked.view, count)
        return Target(self, asked.view, size or SIZE, asked, clock)

    @cached_property
    def digest(self) -> str:
        """Of the contents of scene and cameras; the demo scene and its own cameras are code."""
        cameras = self.cameras_file
        digests = ["orbit"] if cameras is None else [file_digest(file) for file in camera_files(cameras)]
        if self.path == DEMO:
            return "" if cameras is None else "-".join(digests)
        return "-".join((scene_digest(self.path)[:16], *digests, self.up or ""))


@dataclass(frozen=True)
class Target:
    """One view of a scene at a size, or a path that begins there. clock: of the machine, GHz: a frame of a path is late that takes longer than it has."""

    scene: SceneFile
    view: int
    size: tuple[int, int]
    path: Asked | None = None
    clock: float = 1.0

    @property
    def title(self) -> str:
        return f"{self.scene.name} {self.number}"

    @property
    def number(self) -> str:
        """Number of the view, and what the path is."""
        return f"{self.view}, {self.path_title}" if self.path else str(self.view)

    @property
    def moved(self) -> dict[str, object]:
        """What a path is, in full; of a still nothing."""
        return {} if self.path is None else {"path": asdict(self.path), "clock_ghz": self.clock}

    @property
    def path_title(self) -> str | None:
        """What the path is, in few words; None: a still."""
        if self.path is None:
            return None
        words = [self.path.kind or "cameras in order", *([f"{self.path.amount:g}"] if self.path.kind in ("pan", "orbit") else [])]
        return " ".join(words)

    @cached_property
    def photo(self) -> Path | None:
        """Its photograph; a path has none."""
        return None if self.path else self.scene.photo(self.view)

    @cached_property
    def looks(self) -> str:
        """Background, order, content of the photograph: what results depend on beside scene, cameras, size."""
        by = "" if self.scene.order is SortOrder.DEPTH else f" {self.scene.order.value}"
        return f"{self.scene.background}{by} {'' if self.photo is None else file_digest(self.photo)}"

    def load(self) -> View:
        scene = self.scene
        return load_view(scene.path, self.view, self.size, scene.cameras, scene.up, scene.background, self.photo, scene.stored, scene.order)

    def cameras(self) -> tuple[Scene, list[Camera]]:
        """The scene and the cameras of the path. FlickerError for cameras that are none."""
        assert self.path is not None
        source = open_scene(self.scene.path, self.scene.cameras, self.scene.up)
        return source.scene, path_of(source, self.path)[0]

    def key(self, *parts: object) -> str:
        """Name of a result of this view: of contents, not of places."""
        return key(code_digest(), self.scene.file, self.scene.digest, self.view, *self.size, self.looks, *self.moved.values(), *parts)


@dataclass(frozen=True)
class Point:
    """One configuration on one view."""

    target: Target
    configuration: str

    @cached_property
    def key(self) -> str:
        """Name of the point's result."""
        return self.target.key(repr(get_configuration(self.configuration)))
