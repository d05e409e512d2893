"""Fields of a record: flk_mean_field, flk_shape_field, flk_ff_to_fp16, flk_opacity_to_fp16 against the golden model.

Not covered: other widths than the front end's.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.golden.front.setup import FORMATS


@pytest.mark.parametrize("top", ["flk_mean_field", "flk_shape_field", "flk_ff_to_fp16", "flk_opacity_to_fp16"])
def test_field(top: str) -> None:
    parameters = {"ManBits": FORMATS.shape} if top == "flk_ff_to_fp16" else {}
    build_and_test(top, "cocotb_fields", parameters=parameters, config={"top": top})
