"""Lenses of photographs, and photographs without them: radial, tangential, rational, FOV and fisheye models, a principal point off the middle.

A direction (x, y, 1) of the camera falls on pixel (fx x' + cx, fy y' + cy), edges of the picture at 0 and w. With r^2 = x^2 + y^2, theta = atan r:

    radial, tangential   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + 2 p1 x y + p2 (r^2 + 2 x^2), y' likewise with p1 and p2 exchanged
    FULL_OPENCV          x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + the same
    FOV                  x' = x atan(2 r tan(omega / 2)) / (r omega)
    division             x' = 2 x / (1 + sqrt(1 - 4 k1 r^2))
    fisheye              x' = x theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) / r
    THIN_PRISM_FISHEYE   with (u, v) = (x, y) theta / r in place of (x, y) in the first line, + sx1 (u^2 + v^2), sy1 (u^2 + v^2)

as COLMAP, OpenCV and nerfstudio have them. A fisheye lens is none of a pinhole even where all its coefficients are 0. A new picture has the same focal lengths
and as large a part of the old one's sides as shows nothing from beyond it, by the same share of both: of a fisheye lens the middle, at most.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from ..errors import FlickerError
from ..scene.lens import PERSPECTIVE

CENTRE = 0.5  # pixels by which the lens of a pinhole may move any pixel
LEAST_SHARE = 0.5  # of the sides that are left: less means that the lens is not what its numbers say
_GRID = 33  # places along a side where a lens is looked at
_RADIAL = ("k", "k1", "k2", "k3", "k4", "p1", "p2")
_FISHEYE = ("k", "k1", "k2", "k3", "k4")
# Coefficients that a model has. k: of the models of one; it is k1 of the others.
FISHEYES = {
    "SIMPLE_FISHEYE": (), "FISHEYE": _FISHEYE, "OPENCV_FISHEYE": _FISHEYE, "SIMPLE_RADIAL_FISHEYE": _FISHEYE, "RADIAL_FISHEYE": _FISHEYE,
    "THIN_PRISM_FISHEYE": (*_RADIAL, "sx1", "sy1"),
}
_DIVISIONS = {"SIMPLE_DIVISION": ("k", "k1"), "DIVISION": ("k", "k1")}
_MODELS = {model: _RADIAL for model in PERSPECTIVE} | {"FULL_OPENCV": (*_RADIAL, "k5", "k6"), "FOV": ("omega",)} | _DIVISIONS | FISHEYES
PLAIN = "OPENCV"  # where a file names coefficients and no model


@dataclass(frozen=True, eq=False)
class Lens:
    """model: its name in COLMAP. width, height: of the picture, pixels. focal, centre: focal lengths and principal point (x, y) in pixels of it, the picture's
    corner at 0. coefficients: by name, those that are not 0."""

    model: str
    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    coefficients: dict[str, float]

    @staticmethod
    def of(
        model: str | None, coefficients: Mapping[str, float | None], size: tuple[int, int], shape: tuple[float, float], focal: tuple[float, float],
        centre: tuple[float | None, float | None],
    ) -> Lens:
        """size: of the picture. shape: width and height of the camera, whose pixels focal lengths and principal point are in; centre: None is the middle.
        FlickerError, naming the field, for a model that is not one of these."""
        name = (model or PLAIN).upper()
        if name not in _MODELS:
            raise FlickerError(f"camera_model: {model} is not one of those that can be undistorted: {', '.join(sorted(_MODELS))}")
        given = {key: value for key, value in coefficients.items() if value}
        for key in given:
            if key not in _MODELS[name]:
                raise FlickerError(f"{key}: {given[key]:g}: " + (f"camera_model {model} has no such coefficient" if model else "of which camera_model?"))
        if "k" in given:
            given["k1"] = given.pop("k")
        x, y = size[0] / shape[0], size[1] / shape[1]
        cx, cy = (side / 2 if value is None else value for value, side in zip(centre, shape))
        return Lens(name, *size, (focal[0] * x, focal[1] * y), (cx * x, cy * y), given)

    def places(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """float64 (2, ...): row and column of this picture, centres of pixels at whole numbers, in the directions (x, y, 1)."""
        k1, k2, k3, k4, k5, k6, p1, p2, sx1, sy1 = (self.coefficients.get(key, 0.0) for key in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "sx1", "sy1"))
        u, v = np.broadcast_arrays(x, y)
        r = np.sqrt(u * u + v * v)
        if self.model in FISHEYES:
            scale = np.where(r > 1e-9, np.arctan(r) / np.maximum(r, 1e-9), 1.0)
            u, v, r = u * scale, v * scale, r * scale
        s = r * r
        if self.model == "FULL_OPENCV":
            radial = (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
        elif self.model in _DIVISIONS:
            radial = 2.0 / (1.0 + np.sqrt(1.0 - 4.0 * k1 * s))
        elif "omega" in self.coefficients:
            omega = self.coefficients["omega"]
            wide = 2.0 * np.tan(omega / 2)
            radial = np.where(r > 1e-9, np.arctan(r * wide) / (np.maximum(r, 1e-9) * omega), wide / omega)
        else:
            radial = 1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))
        a = u * radial + 2 * p1 * u * v + p2 * (s + 2 * u * u) + sx1 * s
        b = v * radial + p1 * (s + 2 * v * v) + 2 * p2 * u * v + sy1 * s
        return np.stack([self.focal[1] * b + self.centre[1] - 0.5, self.focal[0] * a + self.centre[0] - 0.5])

    def _grid(self, width: int, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of some pixels of a new picture, its corners among them, and their places in this one (2, rows, columns)."""
        row, column = np.linspace(0, height - 1, min(height, _GRID)), np.linspace(0, width - 1, min(width, _GRID))
        x, y = (column + 0.5 - width / 2) / self.focal[0], (row + 0.5 - height / 2) / self.focal[1]
        with np.errstate(all="ignore"):  # what is not finite is inside of nothing
            return row, column, self.places(x[None, :], y[:, None])

    @cached_property
    def needed(self) -> bool:
        """Whether it moves a pixel by more than `CENTRE`, beside a pinhole that looks through the middle."""
        row, column, place = self._grid(self.width, self.height)
        return not (np.abs(place - np.stack(np.broadcast_arrays(row[:, None], column[None, :]))).max() <= CENTRE)

    @cached_property
    def new_size(self) -> tuple[int, int]:
        """Width and height of the new picture. FlickerError where hardly anything is left."""

        def inside(share: float) -> bool:
            place = self._grid(*self._shared(share))[2]
            ends = np.array([self.height - 1, self.width - 1])[:, None, None] + 1e-9
            if not ((place >= -1e-9) & (place <= ends)).all():
                return False
            down, along = np.gradient(place, axis=1) if place.shape[1] > 1 else 0 * place, np.gradient(place, axis=2) if place.shape[2] > 1 else 0 * place
            return bool((down[0] * along[1] - down[1] * along[0] > 0).all())  # a lens that folds shows a place twice

        low, high = 0.0, 1.0
        if inside(high):
            low = 1.0
        for _ in range(20 if low < 1.0 else 0):
            middle = (low + high) / 2
            low, high = (middle, high) if inside(middle) else (low, middle)
        if low < LEAST_SHARE:
            raise FlickerError(f"its lens leaves less than {LEAST_SHARE:.0%} of the picture's sides")
        return self._shared(low)

    def _shared(self, share: float) -> tuple[int, int]:
        return max(1, int(self.width * share)), max(1, int(self.height * share))

    def straight(self, picture: np.ndarray) -> np.ndarray:
        """A picture (height, width, C) as a pinhole of `new_size` that looks through its middle sees it, (new height, new width, C); bilinear."""
        width, height = self.new_size
        x, y = (np.arange(width) + 0.5 - width / 2) / self.focal[0], (np.arange(height) + 0.5 - height / 2) / self.focal[1]
        place = self.places(x[None, :], y[:, None])
        return np.stack([map_coordinates(picture[..., k], place, order=1, mode="nearest") for k in range(picture.shape[2])], axis=2)
