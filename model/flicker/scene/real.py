"""The real scenes that tables, tests and benchmarks use: files in the folder that FLICKER_SCENES names (docs/reference/scenes.md), one view each."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

VARIABLE = "FLICKER_SCENES"


@dataclass(frozen=True)
class RealView:
    """folder, file: below the folder of real scenes. number: of the camera in its `cameras.json`."""

    folder: str
    file: str
    number: int

    @property
    def title(self) -> str:
        return f"{self.folder} {self.number}"

    def path(self, scenes: Path) -> Path:
        """The scene file."""
        return scenes / self.folder / self.file


REAL_VIEWS = (
    RealView("flowers", "flowers.compressed.ply", 0),
    RealView("playbot", "playbot.sog", 1),
    RealView("guitar", "guitar.ply", 1),
    RealView("stpeter", "st-peter.sog", 0),
)


def real_scenes() -> Path | None:
    """The folder of real scenes; None when FLICKER_SCENES does not name one."""
    folder = os.environ.get(VARIABLE)
    return Path(folder) if folder else None
