"""What the commands share: reading of options, checks of results before any work, progress on the terminal."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.table import Table

from ..errors import FlickerError
from ..output import json_text
from ..output import write_atomically as write_atomically
from ..progress import Steps
from .tables import Terminal

console = Terminal()


class RichSteps(Steps):
    """Progress of a run on the terminal (`progress.Steps`)."""

    @contextmanager
    def step(self, text: str) -> Iterator[None]:
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        with Progress(SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn(), console=console, transient=True,
                      disable=not console.is_terminal) as p:
            p.add_task(text, total=None)
            yield

    @contextmanager
    def bar(self, text: str):
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        with Progress(TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.percentage:>3.0f}%"), TimeElapsedColumn(),
                      console=console, transient=True, disable=not console.is_terminal) as p:
            task = p.add_task(text, total=None)
            yield lambda done, total: p.update(task, completed=done, total=total)


def say(found: object, as_json: bool, quiet: bool, shown: Callable[[], Table]) -> None:
    """Print what a command has found: as JSON, not at all, or as `shown` makes it."""
    if as_json:
        console.file.write(json_text(found).rstrip("\n") + "\n")
    elif not quiet:
        console.print(shown())


def say_source(scene: object, cameras_from: str) -> None:
    """Which scene and cameras are used."""
    console.print(f"{scene}: cameras: {cameras_from}", highlight=False, soft_wrap=True)


class Within(Steps):
    """Progress of one of several runs: shares go to the bar of all. report: takes a number from 0 to 1."""

    def __init__(self, report: Callable[[float], None]) -> None:
        self.report = report

    @contextmanager
    def bar(self, text: str):
        yield lambda done, total: self.report(done / max(total, 1))


def parse_size(text: str | None) -> tuple[int, int] | None:
    """`WxH` to two integers; the camera checks the range."""
    if text is None:
        return None
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.strip().isdecimal() for p in parts):
        raise FlickerError(f"--size: expected WxH such as 1280x720, not '{text}'")
    return int(parts[0]), int(parts[1])


CAMERAS_HELP = (
    "cameras.json (INRIA), transforms.json, camera_path.json, or a folder of COLMAP's (default: cameras.json that goes with the scene, else an orbit)"
)
SIZE_HELP = "WxH; the vertical field of view stays, and the shape of the pixels: sideways the picture is cropped or extended"
BACKGROUND_HELP = "black, white or r,g,b from 0 to 1: behind the scene"
ORDER_HELP = "what splats are sorted by: depth along the camera's axis, or distance to the camera, which stays while it turns on the spot"


def parse_view(text: str) -> int | None:
    """The number of a camera; None: `all`."""
    if text == "all":
        return None
    try:
        return int(text)
    except ValueError:
        raise FlickerError(f"--view: expected the number of a camera or all, not '{text}'") from None


def background_of(text: str) -> tuple[float, float, float]:
    """RGB of `--background`."""
    from ..scene.photos import parse_background

    try:
        return parse_background(text)
    except FlickerError as error:
        raise FlickerError(f"--{error}") from None


def writable_folder(folder: Path, option: str) -> None:
    """Fail before any work when nothing could be written into a folder, which need not be there yet."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError:
        raise FlickerError(f"{option}: {folder}: not a folder") from None
    except OSError as error:
        raise FlickerError(f"{option}: {folder}: cannot be written ({error.strerror})") from None
    finally:
        for place in missing:  # what was made to find out
            with suppress(OSError):
                place.rmdir()


def writable(path: Path | None, option: str) -> None:
    """Fail before any work when a result could not be written."""
    if path is None:
        return
    if path.is_dir():
        raise FlickerError(f"{option}: {path} is a folder")
    if not path.parent.is_dir():
        raise FlickerError(f"{option}: {path.parent}: no such folder")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise FlickerError(f"{option}: {path}: not writable")


def check_apart(out: Path, option: str, scene: Path | None) -> None:
    """Fail before any work where a result would take the place of the scene that it is made of."""
    if scene is not None and scene.exists() and out.exists() and out.samefile(scene):
        raise FlickerError(f"{option}: {out} is the scene itself: name another file")


def check_scene(scene: str | Path) -> None:
    """Fail before a second of imports where there is no such scene, or nothing that is one."""
    from ..scene.files import scene_kind
    from ..scene.sources import DEMO, scene_path

    if str(scene) != DEMO:
        scene_kind(scene_path(scene))


def check_there(*paths: Path | None) -> None:
    """Fail before a second of imports where a file or folder is not there."""
    for path in paths:
        try:
            if path is not None:
                path.stat()
        except OSError as error:
            raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
