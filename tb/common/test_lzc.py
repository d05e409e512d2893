"""Leading-zero counter: every input, in one bit, powers of two, one beside them, and the widths of the operators. Not covered: other widths."""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.errors import FlickerError


@pytest.mark.parametrize("width", [1, 3, 9, 14, *(pytest.param(width, marks=pytest.mark.slow) for width in (2, 8, 11))])
def test_lzc(width: int) -> None:
    build_and_test("flk_lzc", "cocotb_lzc", parameters={"Width": width})


def test_illegal_width() -> None:
    with pytest.raises(FlickerError, match="Width must be at least 1"):
        build_and_test("flk_lzc", "cocotb_lzc", parameters={"Width": 0})
