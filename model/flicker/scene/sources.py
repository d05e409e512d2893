"""A scene as a user names it, with its cameras: a file, a folder, a trainer's output folder, or `demo`, the project's own scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import FlickerError
from . import sog
from .camera import Camera, cameras_said, find_cameras, load_cameras
from .files import load_scene, scene_name
from .folders import trained_scene
from .gaussians import Scene

DEMO = "demo"  # the project's own scene, by this name instead of a file


@dataclass(frozen=True, eq=False)
class Source:
    """A scene and its cameras. name: of the scene, for tables. file: what was read, `demo`, or nothing for a scene that is in no file. cameras_from: where the
    cameras come from, for people."""

    scene: Scene
    cameras: list[Camera]
    name: str
    file: str
    cameras_from: str


def scene_path(scene: str | Path) -> str | Path:
    """The scene of the highest iteration in a trainer's output folder, such as `point_cloud/iteration_30000/point_cloud.ply`; everything else as it is."""
    path = Path(scene)
    if str(scene) == DEMO or not path.is_dir() or (path / sog.META).is_file():
        return scene
    return trained_scene(path) or scene


def read_scene(scene: str | Path) -> Scene:
    """The Gaussians of a scene as a user names it. FlickerError as of `load_scene`."""
    if str(scene) == DEMO:
        from .demo import generate

        return generate()
    return load_scene(scene_path(scene))


def open_scene(scene: str | Path | Scene, cameras: str | Path | None = None, up: str | None = None) -> Source:
    """A scene with its cameras. cameras: a file or folder for `load_cameras`; None: those of the demo scene, else as `find_cameras` finds them. up: as there.

    FlickerError, naming file and field, for what cannot be read.
    """
    if isinstance(scene, Scene):
        name, file = ("", "") if scene.path is None else (scene_name(scene.path), str(scene.path))
        return Source(scene, find_cameras(scene, cameras, up), name, file, cameras_said(scene.path, cameras, up))
    if str(scene) == DEMO:
        from .demo import demo_cameras

        if up is not None:
            raise FlickerError(f"up: {up}: only orbit cameras can be turned, and the demo scene has its own")
        own = cameras is None
        found = demo_cameras() if own else load_cameras(cameras)  # type: ignore[arg-type]
        return Source(read_scene(scene), found, DEMO, DEMO, "the demo scene's own" if own else cameras_said(None, cameras))
    path = scene_path(scene)
    loaded = load_scene(path)
    return Source(loaded, find_cameras(loaded, cameras, up), scene_name(path), str(path), cameras_said(path, cameras, up))
