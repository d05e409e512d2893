"""Rendering stage on a few lists: pixels against the golden models, counters through their port, stall of the mask generator.

State space: one short frame of random lists on four cores, random back-pressure; a stream of tokens against blocked pixels. Parameter space: every mask
generator with one VRU per channel, with SLOW=1 only; illegal parameters. The default's frames: tb/frames. Not covered:
everything that whole frames cover (tb/frames): modes, aborts, other sizes, cycle counts.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.params import MASK_GENERATORS


@pytest.mark.slow  # minutes of building each; whole frames run every generator with assertions
@pytest.mark.parametrize("generator", MASK_GENERATORS)
def test_render_stage(generator: str) -> None:
    settings = {"FifoDepth": 4, "VrusPerChannel": 1, "MaskGenerator": list(MASK_GENERATORS).index(generator)}
    build_and_test("flk_render_stage", "cocotb_render_stage", parameters=settings, config=settings)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"Form": 2}, "Form must be"),
        ({"Precision": 4}, "Precision must be"),
        ({"FifoDepth": 0}, "Depth must be 1 to 128"),
        ({"CtuFifoDepth": 129}, "CtuFifoDepth must be"),
        ({"VrusPerChannel": 8}, "VrusPerChannel must be"),
        ({"MaskGenerator": len(MASK_GENERATORS)}, "MaskGenerator must be"),
    ],
)
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_render_stage", parameters, message)
