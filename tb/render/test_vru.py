"""Volume rendering unit against the golden model: every stage's registers, finished pixels, order and back-pressure of the output.

State space: random splats (as in real scenes, thin, special numbers, covering), pixels in order and in random order with repeats in consecutive
cycles, bubbles, empty sub-tiles, lists that finish pixels. Parameter space: both forms. Not covered: other positions than column 4, row 2 (the channel's
test has all of them).
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test
from flicker_tb.splats import QUICK_BUILD

from flicker.params import Form


@pytest.mark.parametrize("stall", ["never", "heavy"])
@pytest.mark.parametrize("form", list(Form), ids=lambda f: f.name.lower())
def test_vru(form: Form, stall: str) -> None:
    settings = {"Form": int(form)}
    lengths = [0, 40, 30, 1, 0, 60, 25, 3, 50]
    build_and_test("flk_vru", "cocotb_vru", parameters=settings, config={**settings, "stall": stall, "lengths": lengths}, **QUICK_BUILD)
