"""The frame buffer's bytes: colours against exact sums, corners of FP16, layout. Not covered: the RTL (tb/render/test_frame_writer.py)."""

from __future__ import annotations

import numpy as np
from flicker_tb.runner import seed

from flicker.golden.frame_buffer import PixelFormat, frame_buffer, least_stride, rgb8, rgba16f


def _pixel(*values: float) -> np.ndarray:
    return np.array(values, np.float16).view(np.uint16)


def test_rgb8_is_the_rounded_sum() -> None:
    """Within half a step and what 14 fraction bits of colour and transmittance cost."""
    rng = np.random.default_rng(seed())
    pixels = rng.random((20_000, 4)).astype(np.float16)
    background = rng.integers(0, 256, 3)
    exact = 255 * pixels[:, 1:].astype(np.float64) + pixels[:, :1].astype(np.float64) * background
    got = rgb8(pixels.view(np.uint16), background).astype(np.float64)
    assert np.abs(got - np.minimum(exact, 255)).max() <= 0.5 + 2 * 255 * 2.0**-15


def test_corners() -> None:
    black, white = np.zeros(3, np.int64), np.full(3, 255)
    assert rgb8(_pixel(1, 0, 0, 0), white).tolist() == [255] * 3 and rgb8(_pixel(1, 0, 0, 0), black).tolist() == [0] * 3
    assert rgb8(_pixel(0, 1, 0.5, 1 / 255), white).tolist() == [255, 128, 1]
    assert rgb8(_pixel(0, 2, np.inf, -1), black).tolist() == [255, 255, 0]
    assert rgb8(_pixel(0.5, -1, 1, 0), np.array([100, 100, 101])).tolist() == [50, 255, 51]  # 50.5 rounds up
    assert rgba16f(_pixel(0.25, 0.1, 0.2, 0.3)).tolist() == _pixel(0.1, 0.2, 0.3, 0.75).tolist()


def test_layout() -> None:
    """Pixel (x, y) lies at y stride + x bytes; what the grid of sub-tiles lacks is background."""
    rng = np.random.default_rng(seed())
    cols, rows = 5, 3
    pixels = rng.random((cols * rows, 64, 4)).astype(np.float16).view(np.uint16)
    for form in PixelFormat:
        stride = least_stride(8 * cols, form) + 64
        data = frame_buffer(pixels, cols, rows, 8 * cols, 8 * rows, form, stride, (10, 20, 30))
        assert data.shape == (32, stride)
        for x, y in ((0, 0), (13, 6), (39, 23), (32, 8)):
            mx, my, px, py = x % 8 // 4, y % 8 // 4, x % 4, y % 4
            pixel = pixels[y // 8 * cols + x // 8, 16 * (2 * my + mx) + 4 * py + px]
            own = rgb8(pixel, np.array([10, 20, 30])) if form is PixelFormat.RGB8 else rgba16f(pixel).view(np.uint8)
            assert np.array_equal(data[y, x * form.bytes : (x + 1) * form.bytes], own)
        beyond = data[31, 63 * form.bytes : 64 * form.bytes]
        assert beyond.tolist() == ([10, 20, 30] if form is PixelFormat.RGB8 else [0] * 8)
        assert not data[:, least_stride(8 * cols, form) :].any()
