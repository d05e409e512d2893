"""Output folders of trainers: `point_cloud/iteration_N/point_cloud.ply` of the INRIA code and those that follow it, `cameras.json` at their top."""

from __future__ import annotations

import re
from pathlib import Path

_CLOUDS = "point_cloud"
_ITERATION = re.compile(r"iteration_(\d+)")


def trained_scene(folder: str | Path) -> Path | None:
    """The scene of the highest iteration in a trainer's folder, in its `point_cloud` or in one `iteration_N`; None: it is none of these.

    Of an iteration that is `point_cloud.ply`, else its only PLY.
    """
    folder = Path(folder)
    clouds = folder if folder.name == _CLOUDS else folder / _CLOUDS
    if _ITERATION.fullmatch(folder.resolve().name):
        iterations = [folder]
    elif clouds.is_dir():
        iterations = [place for place in clouds.iterdir() if _ITERATION.fullmatch(place.name)]
    else:
        return None
    for place in sorted(iterations, key=_number, reverse=True):
        found = sorted(place.glob("*.ply"))
        main = place / f"{_CLOUDS}.ply"
        if main in found or len(found) == 1:
            return main if main in found else found[0]
    return None


def _number(iteration: Path) -> int:
    match = _ITERATION.fullmatch(iteration.resolve().name)
    return int(match[1]) if match else -1


def model_folder(scene: str | Path) -> Path | None:
    """The top of the trainer's folder that a scene file lies in; None: it lies in none."""
    place = Path(scene).absolute().parent
    return place.parent.parent if _ITERATION.fullmatch(place.name) and place.parent.name == _CLOUDS else None
