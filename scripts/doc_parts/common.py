"""What several parts need: the real views, and rows of configurations on them from the store that reports and sweeps share."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from pathlib import Path

from flicker.errors import FlickerError
from flicker.explore.configurations import CONFIGURATIONS
from flicker.explore.evaluate import evaluate
from flicker.explore.points import Point, SceneFile, Target
from flicker.explore.store import Store
from flicker.front.view import DEMO, View, load_view
from flicker.report.figures import Figure
from flicker.scene.real import REAL_VIEWS, VARIABLE, RealView, real_scenes
from flicker.toolchain import ROOT

IMAGES = ROOT / "docs" / "images"
SIZE = (1280, 720)
SIZE_TEXT = f"{SIZE[0]}x{SIZE[1]}"
Say = Callable[[str], None]  # shows what is being done
Rows = dict[str, dict[str, dict]]  # rows of `evaluate` by view and configuration


def save_charts(figures: Sequence[Figure]) -> str:
    """Charts of the report for the pages; the files that were written."""
    with tempfile.TemporaryDirectory() as folder:
        for figure in figures:
            figure.write(Path(folder))
            shutil.copy(Path(folder) / f"{figure.name}.png", IMAGES)
    return ", ".join(str((IMAGES / f"{figure.name}.png").relative_to(ROOT)) for figure in figures)


def scenes_missing() -> str | None:
    """Why the real views cannot be rendered; None where they can."""
    folder = real_scenes()
    if folder is None:
        return f"{VARIABLE} is not set; it names the folder of the real scenes (docs/reference/scenes.md)"
    missing = [view.path(folder) for view in REAL_VIEWS if not view.path(folder).is_file()]
    return f"{VARIABLE}: {missing[0]}: no such file" if missing else None


def folder_of_scenes() -> Path:
    """The folder of real scenes. Raises FlickerError where there is none."""
    if reason := scenes_missing():
        raise FlickerError(reason)
    folder = real_scenes()
    assert folder is not None
    return folder


def load(view: RealView) -> View:
    """A real view at the size of all tables."""
    return load_view(view.path(folder_of_scenes()), view.number, SIZE)


def titled_views(say: Say) -> Iterable[tuple[str, View]]:
    """The demo scene's first view and the real ones, by title, each loaded when its turn comes."""
    say(f"{DEMO} 0")
    yield f"{DEMO} 0", load_view(DEMO, 0, SIZE)
    for view in REAL_VIEWS:
        say(view.title)
        yield view.title, load(view)


def significant(value: float, digits: int) -> str:
    """A positive number to so many figures, without exponent."""
    places = digits - 1 - math.floor(math.log10(value)) if value > 0 else 0
    return f"{round(value, places):,.{max(places, 0)}f}"


class Measured:
    """Rows of one real view: from the store, else computed and kept there."""

    def __init__(self, view: RealView) -> None:
        self.target = Target(SceneFile(str(view.path(folder_of_scenes()))), view.number, SIZE)
        self.store = Store()

    @cached_property
    def view(self) -> View:
        return self.target.load()

    def rows(self, names: Sequence[str], say: Say) -> dict[str, dict]:
        """Rows of configurations by name, in their order."""
        found: dict[str, dict] = {}
        kind = None
        # Few lists in memory at a time; configurations of one picture one after the other.
        for name in sorted(names, key=lambda name: (CONFIGURATIONS[name].lists, CONFIGURATIONS[name].form, repr(CONFIGURATIONS[name].picture_key()))):
            key = Point(self.target, name).key
            row = self.store.load(key)
            if row is None:
                say(f"{self.target.title}: {name}")
                if "view" in self.__dict__ and kind != (kind := (CONFIGURATIONS[name].lists, CONFIGURATIONS[name].form)):
                    self.view.drop()
                self.store.put(key, evaluate(self.view, name).row)
                row = self.store.load(key)
                assert row is not None
            found[name] = row
        return {name: found[name] for name in names}


def measure(names: Sequence[str], say: Say, views: Sequence[RealView] = REAL_VIEWS) -> Rows:
    """Rows of configurations on real views, by title of the view and name."""
    return {view.title: Measured(view).rows(list(dict.fromkeys(names)), say) for view in views}
