"""Memory with a write and a read port: what was written is read a cycle later and stays; a read beside a write of the same address gives no one's data.

State space: random traffic on few addresses, both ports free. Parameter space: one word, a depth that is no power of two, words wider than a machine word.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test, refused


@pytest.mark.parametrize(("width", "depth"), [(1, 1), (52, 6), (146, 16)])
def test_sram(width: int, depth: int) -> None:
    build_and_test("flk_sram", "cocotb_sram", parameters={"Width": width, "Depth": depth}, config={"width": width, "depth": depth})


def test_illegal_parameters() -> None:
    with refused("must be at least 1"):
        build_and_test("flk_sram", "cocotb_sram", parameters={"Width": 0})
