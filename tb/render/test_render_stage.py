"""Rendering stage on a few lists: pixels against the golden models, counters through their port, stall of the mask generator.

State space: one short frame of random lists on four cores, random back-pressure; a stream of tokens against blocked pixels. Parameter space: the CTU,
with SLOW=1 also the generator of full masks, one VRU per channel; illegal parameters. Not covered:
everything that whole frames cover (tb/frames): modes, aborts, other sizes, cycle counts.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.params import MASK_GENERATORS


# Minutes of building each; whole frames run every generator with assertions.
@pytest.mark.parametrize("generator", [name if name == "ctu" else pytest.param(name, marks=pytest.mark.slow) for name in MASK_GENERATORS])
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
