"""A view: a camera in a scene, with what everything downstream shares, made on first use."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..errors import FlickerError
from ..params import Coords, Form, SortOrder
from ..scene import Scene
from ..scene.camera import Camera, select_view
from ..scene.photos import BLACK, load_photo
from ..scene.sources import DEMO, Source, open_scene
from .lists import DERIVED, subtile_lists
from .projection import Projected, project
from .records import SubtileLists
from .reference import render_reference

__all__ = ["DEMO", "View", "load_view", "view_of"]
T = TypeVar("T")


class View:
    """A view.

    scene: of the view; None where only its projection is given. projected: splats near to far. name, number: of the scene and its camera, for
    tables. coords: where means are rounded to FP16. origin: position of the picture's first pixel on the screen, when the picture is a window of a larger one;
    matters for absolute coordinates only. background: RGB in [0, 1] that every picture of the view is drawn over. photo: float64 (H, W, 3) in [0, 1], what a
    camera saw of it; None where nobody knows. cameras_from: where the camera comes from, for people. order: what every engine sorts the view's splats by.
    """

    def __init__(
        self, camera: Camera, scene: Scene | None = None, projected: Projected | None = None, *, name: str = "", number: int = 0,
        coords: Coords = Coords.LOCAL, origin: tuple[int, int] = (0, 0), background: tuple[float, float, float] = BLACK, photo: np.ndarray | None = None,
        cameras_from: str = "", order: SortOrder = SortOrder.DEPTH,
    ) -> None:
        if scene is None and projected is None:
            raise ValueError("a view needs a scene or its projection")
        if photo is not None and photo.shape != (camera.height, camera.width, 3):
            raise ValueError(f"a photograph of shape {photo.shape} is not of a camera of {camera.width}x{camera.height}")
        self.camera, self._scene, self.name, self.number, self.coords, self.origin = camera, scene, name, number, coords, origin
        self.background, self.photo, self.cameras_from, self.order = background, photo, cameras_from, order
        if projected is not None:
            self.projected = projected
        self._kept: dict = {}

    @property
    def scene(self) -> Scene:
        """The scene. ValueError where only the projection is given."""
        if self._scene is None:
            raise ValueError("this view is only a projection")
        return self._scene

    @cached_property
    def projected(self) -> Projected:
        """Splats of the scene, near to far, in float64."""
        return project(self.scene, self.camera, self.order)

    @cached_property
    def reference(self) -> np.ndarray:
        """float64 (H, W, 3): the picture that everything is compared with."""
        return render_reference(self.projected, self.camera, self.background)

    def lists(self, form: Form, kind: str = "subtile") -> SubtileLists:
        """Lists of a kind (`front.lists.LISTS`) with records of a form."""
        return self.keep(("lists", form, kind), lambda: self._make_lists(form, kind))

    def _make_lists(self, form: Form, kind: str) -> SubtileLists:
        if kind == "subtile":
            return subtile_lists(self.projected, self.camera, form, self.coords, self.origin)
        if self.coords == Coords.ABSOLUTE:
            raise FlickerError(f"lists '{kind}': absolute coordinates are there for sub-tile lists only")
        return DERIVED[kind](self.lists(form), self.projected, self.camera)

    def keep(self, key: object, make: Callable[[], T]) -> T:
        """What was made for this key, made now if it was not; `drop` forgets it."""
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    def drop(self) -> None:
        """Forget lists and what was kept beside them."""
        self._kept.clear()


def load_view(
    scene: str | Path | Scene, number: int = 0, size: tuple[int, int] | None = None, cameras: str | Path | None = None, up: str | None = None,
    background: tuple[float, float, float] = BLACK, photo: str | Path | None = None, stored: bool = False,
    order: SortOrder = SortOrder.DEPTH,
) -> View:
    """The view of a scene from its camera `number`. size: (width, height); the vertical field of view and the shape of the pixels stay
    (`Camera.resized`); None: as the camera has it.

    scene, cameras, up: as in `open_scene`. background: RGB in [0, 1]. photo: picture file of what that camera saw (`scene.photos`); stored: of its pixels as
    they are stored, as of COLMAP. order: as of `View`.
    FlickerError, naming file and field, for what cannot be read.
    """
    return view_of(open_scene(scene, cameras, up), number, size, background, photo, stored, order)


def view_of(
    source: Source, number: int = 0, size: tuple[int, int] | None = None, background: tuple[float, float, float] = BLACK, photo: str | Path | None = None,
    stored: bool = False, order: SortOrder = SortOrder.DEPTH,
) -> View:
    """`load_view` of a scene that is open."""
    camera = select_view(source.cameras, number)
    if size is not None:
        camera = camera.resized(*size)
    seen = None if photo is None else load_photo(Path(photo), (camera.width, camera.height), background, stored)
    return View(camera, source.scene, name=source.name, number=number, background=background, photo=seen, cameras_from=source.cameras_from, order=order)
