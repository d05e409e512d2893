""".splat files: records of 32 bytes without a header."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import FlickerError
from .raw import Raw, sh_of_colours

_RECORD = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])


def read_splat(path: Path) -> Raw:
    """Position and linear scale as float32, RGBA as bytes, quaternion (b - 128) / 128, w first.

    Nothing in a file says that it is one: FlickerError where more than half of the records are no Gaussians.
    """
    size = path.stat().st_size
    if size % _RECORD.itemsize:
        raise FlickerError(f"{path}: truncated, or not a .splat file: {size} bytes are not a multiple of {_RECORD.itemsize}")
    data = np.fromfile(path, _RECORD)
    wrong = ~np.isfinite(data["mean"]).all(axis=1) | ~np.isfinite(data["scale"]).all(axis=1) | (data["scale"] < 0).any(axis=1)
    if 2 * wrong.sum() > len(data):
        raise FlickerError(f"{path}: not a .splat file: {wrong.sum()} of {len(data)} records have positions or scales that make no sense")
    rgba = data["rgba"].astype(np.float64) / 255.0
    return Raw(data["mean"], data["scale"], (data["quat"].astype(np.float64) - 128.0) / 128.0, rgba[:, 3], sh_of_colours(rgba[:, :3]))
