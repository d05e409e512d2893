"""Our FLIP (float64) against NVIDIA's own program (flip-evaluator, C++, float32) at every pixel, with the same pixels per degree.

Pictures: noise, smooth pictures with noise, with a shift and darkened, lines of one pixel, flat colours, the demo frame coarsely quantised,
values outside [0, 1]. Not covered: HDR-FLIP, which we do not have.

Nothing differs in meaning: both clamp to [0, 1], repeat the border, use the same filters and constants. What remains is their float32.
"""

from __future__ import annotations

import math

import flip_evaluator
import numpy as np
import pytest
from flicker_tb.runner import seed
from PIL import Image
from scipy.ndimage import gaussian_filter

from flicker.scene import metrics
from flicker.toolchain import ROOT

UNIT = 2.0**-24  # relative error of a float32 operation


def tolerance(ppd: float) -> float:
    """Bound of their rounding at a pixel, from float32 alone.

    A filter is two passes over n taps whose weights add up to 1 (to 2 in magnitude where they have both signs), so a filtered value of magnitude
    at most 1 is off by 2 passes x n taps x 2 x UNIT, and a difference of two by twice that. Where two features or colours are equal, this noise is all that
    is left of their difference, and the exponents of FLIP magnify it:

    - feature = sqrt(difference / sqrt 2), and colour^(1 - feature) moves by at most 1/e of it;
    - colour = distance^0.7 in Hunt-adjusted L*a*b*, scaled by 0.95 / (0.4 x 41.28). The distance is noise x 116 (lightness) plus as much in either
      chroma, and cube roots of small values, of slope 7.8 at most, precede it.
    """
    taps = 2 * math.ceil(3 * 0.5 * 0.082 * ppd) + 1
    noise = 2 * (2 * taps * 2 * UNIT)
    feature = math.sqrt(noise / math.sqrt(2)) / math.e
    colour = (3 * 116 * 7.8 * noise) ** 0.7 * 0.95 / (0.4 * metrics._largest_colour_error())
    return feature + colour


def pictures() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Pairs (reference, picture), float32."""
    rng = np.random.default_rng(seed())
    smooth = gaussian_filter(rng.random((72, 96, 3)), (6, 6, 0))
    smooth = (smooth - smooth.min()) / (smooth.max() - smooth.min())
    lines = np.zeros((48, 48, 3))
    lines[::8] = 1
    flat = np.zeros((24, 24, 3))
    frame = np.asarray(Image.open(ROOT / "docs/images/demo.png").convert("RGB").crop((300, 200, 460, 320)), np.float64) / 255
    pairs = {
        "noise": (rng.random((48, 64, 3)), rng.random((48, 64, 3))),
        "smooth with noise": (smooth, smooth + 0.02 * rng.standard_normal(smooth.shape)),
        "shifted": (smooth, np.roll(smooth, 2, 1)),
        "darker": (smooth, 0.9 * smooth),
        "lines": (lines, np.roll(lines, 1, 0)),
        "green and blue": (flat + [0, 1, 0], flat + [0, 0, 1]),
        "black and white": (flat, flat + 1),
        "demo frame, five bits": (frame, np.round(frame * 31) / 31),
        "outside [0, 1]": (smooth, smooth + 0.5),
    }
    return {name: (a.astype(np.float32), b.astype(np.float32)) for name, (a, b) in pairs.items()}


@pytest.mark.parametrize("ppd", [metrics.PIXELS_PER_DEGREE, 30.0])
@pytest.mark.parametrize("name", list(pictures()))
def test_flip_is_nvidias(name: str, ppd: float) -> None:
    reference, picture = pictures()[name]
    theirs, mean, used = flip_evaluator.evaluate(reference, picture, "LDR", inputsRGB=True, applyMagma=False, parameters={"ppd": ppd})
    assert used["ppd"] == pytest.approx(ppd)
    ours = metrics.flip_map(picture, reference, ppd)
    assert ours.max() > 0.005  # the pictures do differ
    assert np.abs(ours - theirs[..., 0]).max() <= tolerance(ppd)
    # A mean is shown with four digits: half of the last one. Their own mean adds the pixels up in float32, one by one.
    assert ours.mean() == pytest.approx(float(theirs.mean(dtype=np.float64)), abs=5e-5)
    assert ours.mean() == pytest.approx(mean, abs=5e-5 + ours.size * UNIT)


def test_default_distance_is_theirs() -> None:
    """Without a parameter theirs assumes our PIXELS_PER_DEGREE."""
    reference, picture = pictures()["noise"]
    theirs, _, used = flip_evaluator.evaluate(reference, picture, "LDR", applyMagma=False)
    assert used["ppd"] == pytest.approx(metrics.PIXELS_PER_DEGREE)
    assert metrics.flip(picture, reference) == pytest.approx(float(theirs.mean(dtype=np.float64)), abs=5e-5)


def test_the_bound_separates() -> None:
    """An observer two percent further away would be seen."""
    reference, picture = pictures()["smooth with noise"]
    theirs, _, _ = flip_evaluator.evaluate(reference, picture, "LDR", applyMagma=False)
    wrong = metrics.flip_map(picture, reference, 1.02 * metrics.PIXELS_PER_DEGREE)
    assert abs(wrong.mean() - theirs.mean(dtype=np.float64)) > 5e-5
