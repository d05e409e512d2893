"""Pictures in files, 8 bits a channel: PNG is written, what Pillow knows is read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from ..errors import FlickerError


def save_png(path: str | Path, image: np.ndarray) -> None:
    """Write a float picture (H, W, 3), clamped to [0, 1] and rounded to 8 bits. Raises OSError."""
    pixels = np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)
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


def picture_size(path: str | Path) -> tuple[int, int]:
    """(width, height) of a picture, without its pixels."""
    with _opened(path) as picture:
        return picture.size


def load_picture(path: str | Path, background: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """float64 (H, W, 3) in [0, 1]; what is transparent is composed over the background, as the values are stored (no gamma)."""
    with _opened(path) as picture:
        if picture.mode.startswith(("I", "F")):
            raise FlickerError(f"{path}: pixels of more than 8 bits (mode {picture.mode}) are not read")
        rgba = np.asarray(picture.convert("RGBA"), np.float64) / 255.0
        return rgba[..., :3] * rgba[..., 3:] + np.asarray(background, np.float64) * (1.0 - rgba[..., 3:])


def load_coverage(path: str | Path) -> np.ndarray | None:
    """float64 (H, W) in [0, 1], alpha of a picture; None where it is 1 everywhere."""
    with _opened(path) as picture:
        if not picture.has_transparency_data:
            return None
        alpha = np.asarray(picture.convert("RGBA").getchannel("A"), np.float64) / 255.0
    return alpha if alpha.min() < 1.0 else None
