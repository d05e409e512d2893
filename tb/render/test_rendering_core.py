"""Rendering core: four channels behind one dispatch, against the golden model, under stalls.

State space: random lists with random masks, empty sub-tiles, lists that finish early; clear in mid-traffic; idle_o in every cycle. Parameter space:
factored form with FIFOs of 16 places, masks of mini-tiles, blocked output; illegal parameters. With SLOW=1 also conic form with FIFOs of one
place, masks of pixels (4 places, one VRU), the other patterns. Not covered: other depths and numbers of VRUs
(tb/render/test_channel.py).
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.params import SUBTILE_PIXELS, Form

LENGTHS = [0, 1, 40, 0, 12, 90, 0, 0, 3, 30, 25, 50]


@pytest.mark.parametrize("form,depth,idle,stall", [
    (Form.FACTORED, 16, "never", "heavy"),
    *(pytest.param(*case, marks=pytest.mark.slow) for case in (
        (Form.CONIC, 1, "half", "half"), (Form.FACTORED, 16, "never", "never"),
        (Form.FACTORED, 16, "half", "half"), (Form.CONIC, 1, "never", "never"), (Form.CONIC, 1, "never", "heavy"),
    )),
])
def test_rendering_core(form: Form, depth: int, idle: str, stall: str) -> None:
    build_and_test(
        "flk_rendering_core", "cocotb_rendering_core",
        parameters={"Form": int(form), "FifoDepth": depth},
        config={"Form": int(form), "lengths": LENGTHS, "idle": idle, "stall": stall},
    )


@pytest.mark.slow
def test_pixel_masks() -> None:
    """A mini-tile gets a splat when any of its 16 mask bits is set."""
    build_and_test(
        "flk_rendering_core", "cocotb_rendering_core",
        parameters={"Form": int(Form.FACTORED), "FifoDepth": 4, "MaskBits": SUBTILE_PIXELS, "VrusPerChannel": 1},
        config={"Form": int(Form.FACTORED), "MaskBits": SUBTILE_PIXELS, "VrusPerChannel": 1, "lengths": LENGTHS, "idle": "rare", "stall": "rare"},
    )


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"Form": 2}, "Form must be"),
        ({"FifoDepth": 0}, "Depth must be 1 to 128"),
        ({"FifoDepth": 129}, "Depth must be 1 to 128"),
        ({"VrusPerChannel": 3}, "VrusPerChannel must be"),
        ({"MaskBits": 16}, "MaskBits must be"),
    ],
)
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_rendering_core", parameters, message)
