"""A photograph, the camera that took it, and what lies between them: EXIF's orientation, a lens, a mask."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from ..scene.image import Shape, load_coverage, load_picture, picture_size, picture_turned, same_shape
from ..scene.photos import BLACK, area_average
from ..scene.pinhole import Camera
from .lens import Lens


@dataclass(frozen=True, eq=False)
class Shot:
    """camera: of the photograph at the size at which it is used, a pinhole that looks through its middle. camera.img_name: name of the photograph, as `flicker
    report` looks for it. shape: width and height that the data set has for it; None: it has none. lens: taken out when it is loaded; None: there is none.
    mask: picture whose black pixels do not count. turned: whether EXIF's orientation was followed, or not since the stored pixels have the shape; None: it is
    upright. crop: radius, in pixels of the picture, of the circle around its middle outside of which pixels do not count; None: there is none. stored: the
    stored pixels come first where both have the shape. changed: whether the picture that is used is another than its file shows without its camera."""

    camera: Camera
    path: Path
    shape: Shape | None = None
    lens: Lens | None = None
    mask: Path | None = None
    turned: bool | None = None
    crop: float | None = None
    stored: bool = False
    changed: bool = False

    @property
    def masked(self) -> bool:
        """Whether there are pixels that may not count."""
        return self.mask is not None or self.crop is not None

    def _used(self, values: np.ndarray) -> np.ndarray:
        """A picture (H, W, C) of the file's size, without the lens, at the size at which it is used."""
        return area_average(values if self.lens is None else self.lens.straight(values), (self.camera.width, self.camera.height))

    def load(self, background: tuple[float, float, float] = BLACK) -> np.ndarray:
        """float32 (H, W, 3) in [0, 1], transparent parts over the background."""
        return self._used(load_picture(self.path, background, self.shape, self.stored)).astype(np.float32)

    def solid(self) -> np.ndarray | None:
        """bool (H, W): pixels that are not wholly transparent; None for a picture without transparent parts."""
        coverage = load_coverage(self.path, self.shape, self.stored)
        return None if coverage is None else self._used(coverage[..., None])[..., 0] > 0.0

    def counted(self) -> np.ndarray | None:
        """bool (H, W): pixels that count, those of which neither the mask nor the circle of `crop` hides a part; None without both.

        A mask is white where pixels count, by half of its largest value; one of 0 and 1 counts where it is 1, transparent parts are black.
        """
        if not self.masked:
            return None
        width, height = picture_size(self.path, self.shape, self.stored)
        counted = np.ones((height, width), np.bool_)
        if self.mask is not None:
            values = load_picture(self.mask, shape=self.shape, stored=self.stored).mean(axis=2)
            white = values > (0.0 if values.max() < 2 / 255 else 0.5)
            line, column = ((np.arange(side) + 0.5) * own / side for side, own in zip((height, width), white.shape))
            counted &= white[line.astype(int)][:, column.astype(int)]
        if self.crop is not None:
            y, x = np.ogrid[:height, :width]
            counted &= np.hypot(x + 0.5 - width / 2, y + 0.5 - height / 2) <= self.crop
        return self._used(counted[..., None].astype(np.float64))[..., 0] > 0.999


def shot_of(
    where: str, picture: Path, name: str, size: int | None, shape: tuple[float | None, float | None], focal: Callable[[float, float], tuple[float, float]],
    centre: tuple[float | None, float | None], model: str | None, coefficients: Mapping[str, float | None], pose: tuple[np.ndarray, np.ndarray],
    mask: Path | None = None, exact: bool = False, crop: float | None = None, stored: bool = False,
) -> Shot:
    """A photograph with its camera. where: for messages. name: by which `flicker report` finds it. size: longer side that is used, at most. shape: width and
    height that the data set has. focal: (fx, fy) of a width and height. centre: principal point from the picture's corner. model, coefficients: of the lens.
    pose: position, rotation. exact: a lens is taken out even where it moves no pixel by half of one. crop: radius of the circle of pixels that count, in pixels
    of the shape. stored: as in `Shot`. FlickerError, naming file and field."""
    for key, value in zip(("width", "height"), shape):
        if value is not None and not 0 < value < math.inf:
            raise FlickerError(f"{where}: {key}: {value:g} is not positive")
    given = None if shape[0] is None or shape[1] is None else (shape[0], shape[1])
    own = picture_size(picture, given, stored)
    w, h = shape[0] or own[0], shape[1] or own[1]
    turned = picture_turned(picture, given, stored)
    if not same_shape(own, (w, h)):
        either = ", as it is stored or as EXIF turns it" if turned is not None else ""
        raise FlickerError(f"{where}: {picture} is {own[0]}x{own[1]}, not of the shape of the camera's {w:g}x{h:g}{either}")
    if mask is not None and not same_shape(found := picture_size(mask, given, stored), own):
        raise FlickerError(f"{where}: mask {mask} is {found[0]}x{found[1]}, not of the shape of its picture's {own[0]}x{own[1]}")
    fx, fy = focal(w, h)
    try:
        for key, number in (("fx", fx), ("fy", fy), *zip(("cx", "cy"), centre), *coefficients.items()):
            if number is not None and not (math.isfinite(number) and (number > 0 or key not in ("fx", "fy"))):
                raise FlickerError(f"{key}: {number:g} is not {'positive' if key in ('fx', 'fy') else 'finite'}")
        lens: Lens | None = Lens.of(model, coefficients, own, (w, h), (fx, fy), centre)
        assert lens is not None
        if lens.needed or exact:
            left, sides, (fx, fy) = lens.new_size, lens.new_size, lens.focal
        else:
            lens, left, sides = None, own, (round(w), round(h))
        changed = lens is not None or turned != picture_turned(picture, given)
        if changed:
            name = name if name.lower().endswith(".png") else name + ".png"  # as it is written
        shrink = min(1.0, size / max(left)) if size else 1.0
        used = max(1, round(left[0] * shrink)), max(1, round(left[1] * shrink))
        camera = Camera(*used, fx * (used[0] / sides[0]), fy * (used[1] / sides[1]), *pose, name=picture.stem, img_name=name)
        return Shot(camera, picture, given, lens, mask, turned, None if crop is None else crop * own[0] / w, stored, changed)
    except FlickerError as error:
        raise FlickerError(f"{where}: {error}") from None
