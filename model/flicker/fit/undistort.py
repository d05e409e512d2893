"""Photographs of a `transforms.json` without the distortion of their lenses, the principal point in the middle (`flicker undistort`; docs/fit.md).

Lens model: radial and tangential, as COLMAP's and OpenCV's with `k1`, `k2`, `k3`, `p1`, `p2`; `k4` goes on as r^8. A direction (x, y, 1) of the camera falls
on pixel (fl_x x' + cx, fl_y y' + cy), edges of the picture at 0 and w, with

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 y^2) + 2 p2 x y,      r^2 = x^2 + y^2

A new picture has the same focal lengths and as large a part of the old one's sides as shows nothing from beyond it, by the same share of both.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from ..errors import FlickerError
from ..scene.image import load_picture, save_png
from ..scene.photos import area_average
from .dataset import DISTORTIONS, Frame, frames_of

LEAST_SHARE = 0.5  # of the sides that are left: less means that the lens is not what its numbers say


@dataclass(frozen=True)
class Lens:
    """Focal lengths and principal point in pixels of a picture of size (width, height), and the six coefficients (`DISTORTIONS`)."""

    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    coefficients: tuple[float, ...]

    @staticmethod
    def of(frame: Frame) -> Lens:
        width, height = frame.picture_size
        w, h = frame.number["w"] or width, frame.number["h"] or height
        fx, fy = frame.focal(w, h)
        cx, cy = (side / 2 if centre is None else centre for centre, side in ((frame.number["cx"], w), (frame.number["cy"], h)))
        x, y = width / w, height / h  # of the picture, which may be smaller than its camera says
        return Lens(width, height, (fx * x, fy * y), (cx * x, cy * y), tuple(frame.number[key] or 0.0 for key in DISTORTIONS))

    def places(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """float64 (2, ...): row and column of this picture, centres of pixels at whole numbers, in the directions (x, y, 1)."""
        (fx, fy), (k1, k2, k3, k4, p1, p2) = self.focal, self.coefficients
        r = x * x + y * y
        radial = 1.0 + r * (k1 + r * (k2 + r * (k3 + r * k4)))
        u = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)
        v = y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y
        return np.stack([fy * v + self.centre[1] - 0.5, fx * u + self.centre[0] - 0.5])

    def directions(self, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """x (width,) and y (height,) of the pixels of a new picture."""
        return (np.arange(width) + 0.5 - width / 2) / self.focal[0], (np.arange(height) + 0.5 - height / 2) / self.focal[1]

    @cached_property
    def new_size(self) -> tuple[int, int]:
        """Width and height of the new picture; tiny where the lens is not what its numbers say."""

        def inside(share: float) -> bool:
            x, y = self.directions(*self._shared(share))
            border = [self.places(x, np.full(len(x), end)) for end in (y[0], y[-1])] + [self.places(np.full(len(y), end), y) for end in (x[0], x[-1])]
            row, column = np.concatenate(border, axis=1)
            return bool((row >= 0).all() and (row <= self.height - 1).all() and (column >= 0).all() and (column <= self.width - 1).all())

        low, high = 0.0, 1.0
        if inside(high):
            return self.width, self.height
        for _ in range(20):
            middle = (low + high) / 2
            low, high = (middle, high) if inside(middle) else (low, middle)
        return self._shared(low)

    def _shared(self, share: float) -> tuple[int, int]:
        return max(1, int(self.width * share)), max(1, int(self.height * share))


def undistort(dataset: Path, out: Path, size: int | None = None, progress: Callable[[int, int], None] = lambda done, total: None) -> list[tuple[int, int]]:
    """Write the photographs as PNG, and a transforms.json that has no lens any more, into folder `out`: sizes of the pictures. size: longer side, larger ones
    are averaged. Transparent parts are composed over black. FlickerError, naming file and field."""
    path = dataset / "transforms.json" if dataset.is_dir() else dataset
    if not path.is_file():
        raise FlickerError(f"{dataset}: no transforms.json; COLMAP undistorts its own (image_undistorter)")
    data, frames = frames_of(path)
    names = [Path(frame.picture.name).with_suffix(".png").name for frame in frames]
    if len(set(names)) != len(names):
        raise FlickerError(f"{path}: two of its pictures have one name, and all go into one folder")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise FlickerError(f"{out}: is there already, and not empty")
    lenses = [Lens.of(frame) for frame in frames]
    poses = [frame.pose() for frame in frames]
    for frame, lens in zip(frames, lenses):
        if lens.new_size[0] < LEAST_SHARE * lens.width:
            raise FlickerError(f"{frame.where}: its lens leaves less than {LEAST_SHARE:.0%} of the picture's sides")
    written, sizes = [], []
    try:
        (out / "images").mkdir(parents=True, exist_ok=True)
        for n, (frame, lens, pose, name) in enumerate(zip(frames, lenses, poses, names)):
            progress(n, len(frames))
            width, height = lens.new_size
            picture, (x, y) = load_picture(frame.picture), lens.directions(width, height)
            place = lens.places(x[None, :], y[:, None])
            picture = np.stack([map_coordinates(picture[..., k], place, order=1, mode="nearest") for k in range(3)], axis=2)
            shrink = min(1.0, size / max(width, height)) if size else 1.0
            used = max(1, round(width * shrink)), max(1, round(height * shrink))
            save_png(out / "images" / name, area_average(picture, used))
            sizes.append(used)
            written.append({
                "file_path": f"images/{name}", "w": used[0], "h": used[1], "fl_x": lens.focal[0] * used[0] / width, "fl_y": lens.focal[1] * used[1] / height,
                "transform_matrix": pose.tolist(),
            })
        gone = {"camera_angle_x", "camera_angle_y", "fl_x", "fl_y", "cx", "cy", "w", "h", "frames", *DISTORTIONS}
        kept = {key: value for key, value in data.items() if key not in gone}
        (out / "transforms.json").write_text(json.dumps(kept | {"frames": written}, indent=2) + "\n")
    except OSError as error:
        raise FlickerError(f"{out}: cannot be written ({error.strerror})") from None
    progress(len(frames), len(frames))
    return sizes
