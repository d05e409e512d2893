"""The pinhole camera.

World and camera axes follow COLMAP and the INRIA code: camera x right, y down, z forward. Pixel centres lie on integers, so the middle of a picture
is ((width - 1) / 2, (height - 1) / 2); files count from the picture's corner, half a pixel before the first centre.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import FlickerError
from .fields import numbers

MAX_SIZE = 16384


@dataclass(frozen=True, eq=False)
class Camera:
    """A view.

    width, height: pixels, 1 to 16384. fx, fy: focal lengths in pixels.
    position: float64 (3,), camera centre in the world.
    rotation: float64 (3, 3), camera to world, columns right, down, forward.
    name: for people. img_name: name of its photograph; None: it has none.
    cx, cy: principal point in pixels, pixel centres on integers; None: the middle of the picture.
    timestamp: seconds, of a camera that stands somewhere in time; None: nobody says.
    Raises FlickerError, naming the field, when a value makes no camera.
    """

    width: int
    height: int
    fx: float
    fy: float
    position: np.ndarray
    rotation: np.ndarray
    name: str = field(default="")
    img_name: str | None = None
    cx: float = None  # type: ignore[assignment]  # None becomes the middle
    cy: float = None  # type: ignore[assignment]
    timestamp: float | None = None

    def __post_init__(self) -> None:
        for key in ("width", "height"):
            number = numbers(getattr(self, key), key, ())
            if not (1 <= number <= MAX_SIZE and number == int(number)):
                raise FlickerError(f"{key}: {number:.12g} is not a whole number from 1 to {MAX_SIZE}")
            object.__setattr__(self, key, int(number))
        for key in ("fx", "fy"):
            number = numbers(getattr(self, key), key, ())
            if number <= 0:
                raise FlickerError(f"{key}: {number:.12g} is not positive")
            object.__setattr__(self, key, float(number))
        for key, side in (("cx", self.width), ("cy", self.height)):
            given = getattr(self, key)
            object.__setattr__(self, key, 0.5 * (side - 1) if given is None else float(numbers(given, key, ())))
        if self.timestamp is not None:
            object.__setattr__(self, "timestamp", float(numbers(self.timestamp, "timestamp", ())))
        object.__setattr__(self, "position", numbers(self.position, "position", (3,)))
        rotation = numbers(self.rotation, "rotation", (3, 3))
        if np.abs(rotation).max() > 2 or np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
            raise FlickerError("rotation: not a rotation matrix")
        object.__setattr__(self, "rotation", rotation)

    @property
    def centred(self) -> bool:
        """Whether the principal point is the middle of the picture."""
        return self.cx == 0.5 * (self.width - 1) and self.cy == 0.5 * (self.height - 1)

    def resized(self, width: int, height: int) -> Camera:
        """The same view at another size: the vertical field of view and the shape of the pixels stay; sideways the picture is cropped or extended.

        The principal point keeps its distance from the middle, in heights of the picture.
        """
        return self._at(width, height, height / self.height, height / self.height)

    def scaled(self, width: int, height: int) -> Camera:
        """The camera of the same picture after it was scaled to another size, each axis by its own factor."""
        return self._at(width, height, width / self.width, height / self.height)

    def _at(self, width: int, height: int, by_x: float, by_y: float) -> Camera:
        cx, cy = 0.5 * (width - 1) + by_x * (self.cx - 0.5 * (self.width - 1)), 0.5 * (height - 1) + by_y * (self.cy - 0.5 * (self.height - 1))
        other = replace(self, width=width, height=height, cx=cx, cy=cy)
        return replace(other, fx=self.fx * by_x, fy=self.fy * by_y)
