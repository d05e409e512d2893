"""Delay line: depth 0 (a wire) and 3, more than a machine word, random enable; with SLOW=1 also one bit, depths 1 and 4.

Not covered: other depths and widths.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("width", "depth"), [(8, 0), *(pytest.param(*size, marks=pytest.mark.slow) for size in ((1, 1), (8, 4))), (145, 3)])
def test_delay(width: int, depth: int) -> None:
    build_and_test("flk_delay", "cocotb_delay", parameters={"Width": width, "Depth": depth})
