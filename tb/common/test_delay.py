"""Delay line: depth 0 (a wire), 1 and more, one bit and more than a machine word, random enable. Not covered: other depths and widths."""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("width", "depth"), [(8, 0), (1, 1), (8, 4), (145, 3)])
def test_delay(width: int, depth: int) -> None:
    build_and_test("flk_delay", "cocotb_delay", parameters={"Width": width, "Depth": depth})
