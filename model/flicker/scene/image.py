"""Pictures in files: PNG is written, what Pillow knows is read.

A photograph may be stored lying: EXIF's orientation (1 to 8) says how it is turned upright. It is turned, unless its camera's shape is known and only the
stored pixels have that shape: then they are what the camera describes. Of a program that reads pixels as they are stored, such as COLMAP, they come first
where both have the shape (`stored`). Grey of 16 bits is read as such; of colours with 16 bits Pillow gives the upper 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

from ..errors import FlickerError

Shape = tuple[float, float]  # width and height of a camera, of which only the ratio counts here
# What makes the stored picture of an upright one, by the orientations of EXIF.
_BACK = {
    2: Image.Transpose.FLIP_LEFT_RIGHT, 3: Image.Transpose.ROTATE_180, 4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE, 6: Image.Transpose.ROTATE_90, 7: Image.Transpose.TRANSVERSE, 8: Image.Transpose.ROTATE_270,
}


def save_png(path: str | Path, image: np.ndarray) -> None:
    """Write a float picture (H, W, 3), clamped to [0, 1] and rounded to 8 bits. Raises OSError."""
    pixels = np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)
    Image.fromarray(pixels).save(path, format="PNG")


def save_grey16(path: str | Path, values: np.ndarray) -> None:
    """Write numbers (H, W), clamped to [0, 1] and rounded to 16 bits, as a grey PNG. Raises OSError."""
    pixels = np.rint(np.clip(np.nan_to_num(values), 0.0, 1.0) * 65535.0).astype(np.uint16)
    Image.fromarray(pixels).save(path, format="PNG")


@contextmanager
def _opened(path: str | Path) -> Iterator[Image.Image]:
    """A picture of a file; FlickerError, naming it, for whatever goes wrong in reading it."""
    try:
        with Image.open(path) as picture:
            yield picture
    except UnidentifiedImageError:
        raise FlickerError(f"{path}: not a picture") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FlickerError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def same_shape(size: tuple[int, int], shape: Shape) -> bool:
    """A picture of size (width, height) has the shape of a camera: at its width its height is the camera's within one pixel."""
    return abs(shape[1] * size[0] / shape[0] - size[1]) <= 1.0


def _orientation(picture: Image.Image) -> int:
    """EXIF's orientation, 1 to 8; 1 (upright) where there is none, or another number."""
    number = picture.getexif().get(ExifTags.Base.Orientation, 1)
    return number if isinstance(number, int) and 1 <= number <= 8 else 1


def _turned(picture: Image.Image, shape: Shape | None, stored: bool) -> tuple[bool, tuple[int, int]]:
    """Whether the picture is to be turned, and its size (width, height) then."""
    orientation, (width, height) = _orientation(picture), picture.size
    if orientation >= 5 and picture.format == "TIFF":  # whose size Pillow tells as of the upright picture
        width, height = height, width
    upright = (height, width) if orientation >= 5 else (width, height)
    if orientation == 1 or (shape is not None and same_shape((width, height), shape) and (stored or not same_shape(upright, shape))):
        return False, (width, height)
    return True, upright


def _as_taken(picture: Image.Image, shape: Shape | None, stored: bool) -> Image.Image:
    """The picture upright, or as it is stored where its camera has that shape."""
    turned, orientation = _turned(picture, shape, stored)[0], _orientation(picture)
    picture.load()
    if turned:
        return ImageOps.exif_transpose(picture)
    if orientation != _orientation(picture):  # Pillow turns a TIFF as it reads it
        return picture.transpose(_BACK[orientation])
    return picture


def picture_size(path: str | Path, shape: Shape | None = None, stored: bool = False) -> tuple[int, int]:
    """(width, height) of a picture, without its pixels. shape: (width, height) of its camera. stored: of a camera of stored pixels."""
    with _opened(path) as picture:
        return _turned(picture, shape, stored)[1]


def picture_turned(path: str | Path, shape: Shape | None = None, stored: bool = False) -> bool | None:
    """Whether EXIF turns a picture as it is read here; None: EXIF has it upright."""
    with _opened(path) as picture:
        return None if _orientation(picture) == 1 else _turned(picture, shape, stored)[0]


def _grey16(picture: Image.Image) -> bool:
    """Whether it is grey of 16 bits, of which Pillow would cut what is above 255."""
    return picture.mode.startswith("I;16")


def load_picture(path: str | Path, background: Sequence[float] = (0.0, 0.0, 0.0), shape: Shape | None = None, stored: bool = False) -> np.ndarray:
    """float64 (H, W, 3) in [0, 1]; what is transparent is composed over the background, as the values are stored (no gamma). shape: of its camera. stored: as
    in `picture_size`."""
    with _opened(path) as picture:
        deep = _grey16(picture)
        if picture.mode.startswith(("I", "F")) and not deep:
            raise FlickerError(f"{path}: pixels of mode {picture.mode} are not read: 8 bits a channel, or 16 of grey")
        upright = _as_taken(picture, shape, stored)
        behind = np.asarray(background, np.float64)
        if deep:
            values = np.asarray(upright, np.uint16)
            grey, through = np.repeat(values[..., None] / 65535.0, 3, axis=2), upright.info.get("transparency")
            return grey if through is None else np.where((values == through)[..., None], behind, grey)
        if not upright.has_transparency_data:
            return np.asarray(upright.convert("RGB"), np.float64) / 255.0
        rgba = np.asarray(upright.convert("RGBA"), np.float64) / 255.0
        return rgba[..., :3] * rgba[..., 3:] + behind * (1.0 - rgba[..., 3:])


def load_coverage(path: str | Path, shape: Shape | None = None, stored: bool = False) -> np.ndarray | None:
    """float64 (H, W) in [0, 1], alpha of a picture; None where it is 1 everywhere. shape: of its camera. stored: as in `picture_size`."""
    with _opened(path) as picture:
        if not picture.has_transparency_data:
            return None
        upright = _as_taken(picture, shape, stored)
        if _grey16(picture):
            alpha = (np.asarray(upright, np.uint16) != upright.info.get("transparency")).astype(np.float64)
        else:
            alpha = np.asarray(upright.convert("RGBA").getchannel("A"), np.float64) / 255.0
    return alpha if alpha.min() < 1.0 else None
