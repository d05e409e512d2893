"""Walk over the tiles: every tile once, in the order of the golden model, then done; a start at any time begins anew.

State space: pictures of one pair or row up to the largest, all small sizes, random pauses, starts in the middle of a walk and behind its end. Parameter space:
coordinates of 8 bits, with SLOW=1 of 4, whose ends all come.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("bits", [8, pytest.param(4, marks=pytest.mark.slow)])
def test_tile_walk(bits: int) -> None:
    build_and_test("flk_tile_walk", "cocotb_tile_walk", parameters={"CoordBits": bits})
