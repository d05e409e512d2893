"""Pictures in files: PNG, 8 bits a channel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from ..errors import FlickerError


def save_png(path: str | Path, image: np.ndarray) -> None:
    """Write a float picture (H, W, 3), clamped to [0, 1] and rounded to 8 bits. Raises OSError."""
    pixels = np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)
    Image.fromarray(pixels).save(path, format="PNG")


def load_png(path: str | Path) -> np.ndarray:
    """float64 (H, W, 3) in [0, 1]."""
    try:
        with Image.open(path) as picture:
            return np.asarray(picture.convert("RGB"), np.float64) / 255.0
    except UnidentifiedImageError:
        raise FlickerError(f"{path}: not a picture") from None
    except (OSError, SyntaxError, ValueError) as error:
        raise FlickerError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
