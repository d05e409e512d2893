"""Fixed point from FP16 and to E4M3 against the golden model: corners and random numbers."""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.params import FIXED_FRAC_BITS, FIXED_INT_BITS


@pytest.mark.parametrize(
    ("top", "parameters", "test"),
    [
        ("flk_fp_to_fixed", {"IntBits": FIXED_INT_BITS, "FracBits": FIXED_FRAC_BITS}, "to_fixed"),
        ("flk_fixed_to_fp", {"MagBits": FIXED_INT_BITS + FIXED_FRAC_BITS + 1, "FracBits": FIXED_FRAC_BITS}, "to_e4m3"),
    ],
    ids=["to_fixed", "to_e4m3"],
)
def test_fixed(top: str, parameters: dict[str, int], test: str) -> None:
    build_and_test(top, "cocotb_fixed", parameters=parameters, tests=[test])
