"""Scenes and views as the command line names them; light enough to be asked before anything else is imported."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import FlickerError
from ..scene.files import scene_kind
from ..scene.sources import DEMO, scene_path


def view_numbers(text: str, count: int) -> list[int] | None:
    """What stands behind the colon of a scene: `3`, `0-12` or `all` of `count`; None: it is no such thing."""
    first, dash, last = text.partition("-")
    if text == "all":
        return list(range(count))
    if not first.isdigit() or (dash and not last.isdigit()):
        return None
    return list(range(int(first), int(last if dash else first) + 1))


def named(text: str) -> tuple[Path, str]:
    """The file, and the text of its views, of `FILE` (its view 0) or `demo`, `FILE:VIEW`, `FILE:FIRST-LAST` or `FILE:all`; FlickerError when there is no such scene."""
    path, of = Path(text), "0"
    head, colon, tail = text.rpartition(":")
    if colon and not path.exists() and view_numbers(tail, 0) is not None:
        path, of = Path(head), tail
    if str(path) != DEMO:
        if not path.exists():
            raise FlickerError(f"{path}: no such scene")
        if not os.access(path, os.R_OK):
            raise FlickerError(f"{path}: not readable")
        path = Path(scene_path(path))
        scene_kind(path)
    return path, of
