"""Volume rendering unit against the golden model: every stage's registers, finished pixels, order and back-pressure of the output.

State space: random splats (as in real scenes, thin, special numbers, covering), pixels in order, bubbles between and within splats, splats
broken off, empty sub-tiles, lists that finish pixels; opacity and transmittance exactly at their bounds; aborts (clear_i) at random times,
registers beginning with random values. Parameter space: both forms with 8 pixels and a blocked output;
with SLOW=1 also without, and 4 and 16 pixels. Not covered: other positions than the second column and row of units (the channel's test has all of them).
The arithmetic of flk_blend_pipe is tested here; flk_weight, flk_pixel_state and flk_pixel_drain also on their own.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.params import Form


@pytest.mark.parametrize(
    ("form", "pixels", "stall"),
    [
        *((form, 8, "heavy") for form in Form),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in (
            *((form, 8, "never") for form in Form), (Form.CONIC, 4, "never"), (Form.FACTORED, 4, "heavy"), (Form.CONIC, 16, "never"),
        )),
    ],
)
def test_vru(form: Form, pixels: int, stall: str) -> None:
    settings = {"Form": int(form), "Pixels": pixels}
    lengths = [0, 40, 30, 1, 0, 60, 25, 3, 50] * (8 // pixels or 1)
    build_and_test("flk_vru", "cocotb_vru", parameters=settings, config={**settings, "stall": stall, "lengths": lengths}, inner=True)
