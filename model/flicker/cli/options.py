"""What the commands share: reading of options, checks of results before any work, progress on the terminal."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import FlickerError
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


def parse_size(text: str | None) -> tuple[int, int] | None:
    """`WxH` to two integers; the camera checks the range."""
    if text is None:
        return None
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.strip().isdigit() for p in parts):
        raise FlickerError(f"--size: expected WxH such as 1280x720, not '{text}'")
    return int(parts[0]), int(parts[1])


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


def check_scene(scene: str | Path) -> None:
    """Fail before a second of imports where there is no such scene, or nothing that is one."""
    if str(scene) != "demo":
        from ..scene.files import scene_kind

        scene_kind(scene)


def check_there(*paths: Path | None) -> None:
    """Fail before a second of imports where a file or folder is not there."""
    for path in paths:
        try:
            if path is not None:
                path.stat()
        except OSError as error:
            raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
