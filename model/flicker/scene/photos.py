"""Photographs of views: how they are found, and how they are made comparable with a rendered picture (docs/reference/report.md, "Photographs").

A photograph has the name `img_name` of its camera, with or without the suffix. It is turned upright as EXIF says (`scene.image`), composed over the background
where it is transparent, then averaged over the area of each pixel of the rendered picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import FlickerError
from .image import load_picture, picture_size, same_shape

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
# Folders beside cameras.json, searched in this order; the members of a group are equals, so that one name in two of them is refused.
PLACES = (("images",), (".",), ("input",), ("photos",), ("train", "test", "val"))
NONE = "none"  # instead of a folder: no photographs
COLOURS = {"black": (0.0, 0.0, 0.0), "white": (1.0, 1.0, 1.0)}
BLACK = COLOURS["black"]


def parse_background(text: str) -> tuple[float, float, float]:
    """`black`, `white` or `r,g,b` with numbers from 0 to 1. FlickerError for anything else."""
    if text in COLOURS:
        return COLOURS[text]
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(0.0 <= n <= 1.0 for n in numbers):
        raise FlickerError(f"background: expected black, white or r,g,b with numbers from 0 to 1, not '{text}'")
    return numbers[0], numbers[1], numbers[2]


def _named(folder: Path, name: str) -> list[Path]:
    """Pictures of this name in a folder; a name with a suffix is that file."""
    wanted = folder / name
    if not Path(name).name:
        return []
    if wanted.suffix and wanted.is_file():
        return [wanted]
    try:
        return sorted(p for p in wanted.parent.iterdir() if p.stem == wanted.name and p.suffix.lower() in SUFFIXES and p.is_file())
    except (OSError, ValueError):
        return []


def _only(found: list[Path], name: str) -> Path:
    if len(found) > 1:
        raise FlickerError(f"{found[0]}: {found[1]} is a picture of '{name}' too: say which folder is meant, --photos FOLDER (--photos {NONE}: no photographs)")
    return found[0]


def photo_in(folder: Path, name: str) -> Path:
    """The picture of a name in a folder that the user gave. FlickerError when there is none, or more than one."""
    if not folder.is_dir():
        raise FlickerError(f"photos: {folder}: no such folder")
    found = _named(folder, name)
    if not found:
        raise FlickerError(f"photos: {folder}: no picture '{name}' ({', '.join(SUFFIXES)})")
    return _only(found, name)


def photo_beside(cameras: Path, name: str) -> Path | None:
    """The picture of a name in `PLACES` beside a cameras.json; None when there is none. FlickerError for two in equal places."""
    for group in PLACES:
        found = [picture for place in group for picture in _named(cameras.parent / place, name)]
        if found:
            return _only(found, name)
    return None


def check_photo(path: Path, size: tuple[int, int], stored: bool = False) -> None:
    """FlickerError when a photograph cannot be averaged to a picture of size (width, height).

    It must be as large or larger, and of the same shape: at the picture's width its height is the picture's within one pixel. stored: of a camera of COLMAP,
    as in `picture_size`.
    """
    (width, height), (w, h) = size, picture_size(path, size, stored)
    if not same_shape(size, (w, h)):
        raise FlickerError(f"{path}: is {w}x{h}, which is not the shape of {width}x{height}: leave out the size, or the photographs (--photos {NONE})")
    if w < width or h < height:
        raise FlickerError(f"{path}: is {w}x{h}, smaller than the picture of {width}x{height}: photographs are never enlarged")


def area_average(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture (H, W, 3) at size (width, height), both at most its own: means over the area of each new pixel, cut pixels by their share."""
    for axis, count in ((0, size[1]), (1, size[0])):
        image = np.moveaxis(image, axis, 0)
        if (own := len(image)) != count:
            # The integral up to every border between new pixels.
            borders = np.arange(count + 1) * own / count
            whole = np.minimum(borders.astype(np.int64), own - 1)
            sums = np.concatenate([np.zeros_like(image[:1]), image.cumsum(axis=0)])
            integral = sums[whole] + (borders - whole)[:, None, None] * image[whole]
            image = np.diff(integral, axis=0) * (count / own)
        image = np.moveaxis(image, 0, axis)
    return image


def load_photo(path: Path, size: tuple[int, int], background: tuple[float, float, float] = BLACK, stored: bool = False) -> np.ndarray:
    """float64 (height, width, 3) in [0, 1]: a photograph over the background, averaged to size (width, height). stored, FlickerError: as `check_photo`."""
    check_photo(path, size, stored)
    return area_average(load_picture(path, background, size, stored), size)
