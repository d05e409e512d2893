"""Cameras, images and points of a COLMAP sparse model, binary (`cameras.bin`, `images.bin`, `points3D.bin`)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line

MODELS = (  # in the order of COLMAP's numbers, with the count of their parameters
    ("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8), ("OPENCV_FISHEYE", 8), ("FULL_OPENCV", 12), ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4), ("RADIAL_FISHEYE", 5), ("THIN_PRISM_FISHEYE", 12),
)


@dataclass(frozen=True)
class ColmapCamera:
    """width, height: pixels. fx, fy, cx, cy: pixels; the first pixel's centre is at (0.5, 0.5)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """quat: float64 (4,), w first, shift: float64 (3,): world to camera."""

    name: str
    camera: int
    quat: np.ndarray
    shift: np.ndarray


class _Reader:
    """Numbers of a binary file, one after the other."""

    def __init__(self, path: Path) -> None:
        self.path, self.at = path, 0
        try:
            self.data = path.read_bytes()
        except OSError as error:
            hint = "; models as text are not read" if path.with_suffix(".txt").exists() else ""
            raise FlickerError(f"{path}: cannot be read ({error.strerror}{hint})") from None

    def take(self, form: str) -> tuple:
        size = struct.calcsize("<" + form)
        self.skip(size)
        return struct.unpack_from("<" + form, self.data, self.at - size)

    def skip(self, size: int) -> None:
        self.at += size
        if self.at > len(self.data):
            raise FlickerError(f"{self.path}: truncated: {len(self.data)} bytes, {self.at} are needed")

    def text(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise FlickerError(f"{self.path}: truncated: a name without end")
        name, self.at = self.data[self.at : end], end + 1
        try:
            return name.decode()
        except UnicodeDecodeError:
            raise FlickerError(f"{self.path}: a name is not UTF-8 ({one_line(name)})") from None

    def end(self) -> None:
        if self.at != len(self.data):
            raise FlickerError(f"{self.path}: {len(self.data) - self.at} bytes after the last entry")


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """By number. FlickerError for lenses that are no pinhole."""
    file, found = _Reader(path), {}
    for _ in range(file.take("Q")[0]):
        number, model, width, height = file.take("iiQQ")
        if not 0 <= model < len(MODELS):
            raise FlickerError(f"{path}: camera {number}: unknown model {model}")
        name, count = MODELS[model]
        numbers = file.take(f"{count}d")
        if name not in ("SIMPLE_PINHOLE", "PINHOLE"):
            raise FlickerError(f"{path}: camera {number}: model {name}, not PINHOLE or SIMPLE_PINHOLE: undistort the pictures first")
        found[number] = ColmapCamera(width, height, *(numbers if count == 4 else (numbers[0], *numbers)))
    file.end()
    return found


def read_images(path: Path) -> list[ColmapImage]:
    """Sorted by name."""
    file, found = _Reader(path), []
    for _ in range(file.take("Q")[0]):
        numbers = file.take("I7dI")
        name = file.text()
        file.skip(24 * file.take("Q")[0])
        found.append(ColmapImage(name, numbers[8], np.array(numbers[1:5]), np.array(numbers[5:8])))
    file.end()
    return sorted(found, key=lambda image: image.name)


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions float64 (N, 3) and colours float64 (N, 3) in [0, 1]."""
    file, places, colours = _Reader(path), [], []
    for _ in range(file.take("Q")[0]):
        numbers = file.take("Q3d3BdQ")
        file.skip(8 * numbers[8])
        places.append(numbers[1:4])
        colours.append(numbers[4:7])
    file.end()
    return np.array(places).reshape(-1, 3), np.array(colours).reshape(-1, 3) / 255.0
