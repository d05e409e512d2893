"""Rendering core: four channels behind one dispatch, against the golden model, under stalls.

State space: random lists with random masks, empty sub-tiles, lists that finish early. Parameter space: FIFO depths 1 and 16, both forms; full
rate, idle input, blocked output. Not covered: other depths (tb/render/test_channel.py).
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.params import Form

LENGTHS = [0, 1, 40, 0, 12, 70, 0, 0, 3, 30, 25, 50]


@pytest.mark.parametrize("idle,stall", [("never", "never"), ("half", "half"), ("never", "heavy")])
@pytest.mark.parametrize("form,depth", [(Form.FACTORED, 16), (Form.CONIC, 1)])
def test_rendering_core(form: Form, depth: int, idle: str, stall: str) -> None:
    build_and_test(
        "flk_rendering_core", "cocotb_rendering_core",
        parameters={"Form": int(form), "FifoDepth": depth},
        config={"Form": int(form), "lengths": LENGTHS, "idle": idle, "stall": stall},
    )
