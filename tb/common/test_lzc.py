"""Leading-zero counter: every input, of 3 and 14 bits; with SLOW=1 also of 1, 2, 8, 9 and 11. Not covered: other widths."""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("width", [3, 14, *(pytest.param(width, marks=pytest.mark.slow) for width in (1, 2, 8, 9, 11))])
def test_lzc(width: int) -> None:
    build_and_test("flk_lzc", "cocotb_lzc", parameters={"Width": width})


def test_illegal_width() -> None:
    refused("flk_lzc", {"Width": 0}, "Width must be at least 1")
