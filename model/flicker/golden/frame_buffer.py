"""The frame buffer as the chip leaves it in memory (docs/reference/frame_writer.md): bytes of every pixel, and where they lie.

Pixels are FP16 bits (transmittance, red, green, blue), as in `golden.render.Frame.pixels`. Rows of the buffer are `stride` bytes apart and hold whole pairs of
tiles, so columns beyond the picture's width and rows beyond its height are written too, up to multiples of 32 and 16.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from ..params import SUBTILE, TILE
from .walk import tile_walk

PAIR = 2 * TILE  # columns of pixels that are written together
BURST = 32  # bytes; a pair's row is a whole number of them
FRAC_BITS = 14  # of colour and transmittance in fixed point, one bit before the point


class PixelFormat(IntEnum):
    """RGB8: 3 bytes, over the background. RGBA16F: four FP16, colour times alpha, alpha = 1 - transmittance."""

    RGB8 = 0
    RGBA16F = 1

    @property
    def bytes(self) -> int:
        return 8 if self is PixelFormat.RGBA16F else 3


def unsigned_fixed(bits: np.ndarray) -> np.ndarray:
    """FP16 bits to int64 in units of 2^-14, to nearest even; negative numbers are 0, what is too large (inf, NaN) is 2 - 2^-14."""
    value = bits.astype(np.uint16).view(np.float16).astype(np.float64)
    largest = (2 << FRAC_BITS) - 1
    with np.errstate(invalid="ignore"):
        fixed = np.where(np.isnan(value) | (value >= 2), largest, np.minimum(np.rint(np.nan_to_num(value, posinf=0.0, neginf=0.0) * (1 << FRAC_BITS)), largest))
    return np.where(bits >> 15 & 1, 0, fixed).astype(np.int64)


def rgb8(pixels: np.ndarray, background: np.ndarray) -> np.ndarray:
    """uint16 (..., 4) over a background uint8 (3,) to uint8 (..., 3): round(255 colour + transmittance background)."""
    fixed = unsigned_fixed(pixels)
    sum_ = 255 * fixed[..., 1:] + fixed[..., :1] * np.asarray(background, np.int64)
    return np.minimum((sum_ + (1 << FRAC_BITS - 1)) >> FRAC_BITS, 255).astype(np.uint8)


def rgba16f(pixels: np.ndarray) -> np.ndarray:
    """uint16 (..., 4) to uint16 (..., 4): red, green, blue as they are, alpha = 1 - transmittance in FP16, to nearest even."""
    alpha = (np.float16(1) - pixels[..., :1].view(np.float16)).view(np.uint16)
    return np.concatenate([pixels[..., 1:], alpha], axis=-1)


def least_stride(width: int, format_: PixelFormat) -> int:
    """Bytes of a row."""
    return -(-width // PAIR) * PAIR * format_.bytes


def frame_buffer(pixels: np.ndarray, cols: int, rows: int, width: int, height: int, format_: PixelFormat, stride: int, background=(0, 0, 0)) -> np.ndarray:
    """uint8 (rows of pixels, stride): what a frame writes; bytes between a row's end and the stride are 0 here and not written by the chip.

    pixels: uint16 (S, 64, 4) of a grid of `cols` x `rows` sub-tiles; sub-tiles that the grid lacks are empty: transmittance 1, no colour.
    """
    wide, high = -(-width // PAIR) * PAIR, -(-height // TILE) * TILE
    full = np.zeros((high // SUBTILE, wide // SUBTILE, SUBTILE * SUBTILE, 4), np.uint16)
    full[..., 0] = 0x3C00
    full[:rows, :cols] = pixels.reshape(rows, cols, SUBTILE * SUBTILE, 4)
    picture = full.reshape(high // SUBTILE, wide // SUBTILE, 2, 2, 4, 4, 4).transpose(0, 2, 4, 1, 3, 5, 6).reshape(high, wide, 4)
    data = rgb8(picture, np.asarray(background)) if format_ is PixelFormat.RGB8 else rgba16f(picture).view(np.uint8)
    out = np.zeros((high, stride), np.uint8)
    out[:, : wide * format_.bytes] = data.reshape(high, -1)
    return out


def late_frame_buffer(before: np.ndarray, whole: np.ndarray, pairs: int, cols: int, rows: int, format_: PixelFormat) -> np.ndarray:
    """uint8 (rows of pixels, stride): what a frame leaves that its deadline ends after so many pairs of tiles, the first ones of the walk.

    before: what the buffer held. whole: the frame's `frame_buffer`. cols, rows: of tiles, whole pairs.
    """
    x, y = tile_walk(cols // 2, rows)
    out, bytes_ = before.copy(), PAIR * format_.bytes
    for column, row in zip(x[::2][:pairs] // 2, y[::2][:pairs]):
        part = slice(TILE * row, TILE * (row + 1)), slice(bytes_ * column, bytes_ * (column + 1))
        out[part] = whole[part]
    return out
