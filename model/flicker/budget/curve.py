"""What a reduction gave at each size on the way: kept share, loss, bytes and cycles of a frame."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import FlickerError, one_line
from .goal import FrameCost
from .reduce import Row


@dataclass(frozen=True)
class Point:
    """kept: share of the Gaussians. decibels: mean PSNR on the held-out views. cost: of a frame."""

    kept: float
    decibels: float
    cost: FrameCost


@dataclass(frozen=True)
class Curve:
    """Points of a scene, in the order of the steps."""

    title: str
    points: tuple[Point, ...]

    @classmethod
    def of(cls, title: str, gaussians: int, rows: Sequence[Row]) -> Curve:
        """gaussians: of the full scene, whose row, equal pictures, is left out."""
        return cls(title, tuple(Point(row.gaussians / gaussians, row.decibels, row.cost) for row in rows if row.cost and math.isfinite(row.decibels)))

    @classmethod
    def load(cls, path: Path) -> Curve:
        """What `flicker budget --json` wrote. FlickerError names the file and what is wrong."""
        try:
            told = json.loads(path.read_text())
        except OSError as error:
            raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
        except ValueError as error:
            raise FlickerError(f"{path}: not JSON ({one_line(error)})") from None
        try:
            return cls.of(Path(str(told["scene"])).name.split(".")[0], int(told["gaussians"][0]), [_row(row) for row in told["steps"]])
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise FlickerError(f"{path}: not what flicker budget --json writes ({type(error).__name__}: {one_line(error)})") from None


def _row(row: dict[str, Any]) -> Row:
    decibels = math.inf if row["decibels"] is None else float(row["decibels"])
    return Row(str(row["step"]), int(row["gaussians"]), float(row["coefficients"]), decibels, None if row["cost"] is None else FrameCost(**row["cost"]))
