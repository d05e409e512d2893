"""Memories: what was written is read a cycle later and stays; of two ports, a read beside a write of the same address gives no one's data.

State space: random traffic on few addresses, all ports free. Parameter space: words wider than a machine word; with SLOW=1 also one word, a
depth that is no power of two.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("module", ["flk_sram", "flk_sram_single"])
@pytest.mark.parametrize(("width", "depth"), [(146, 16), *(pytest.param(*size, marks=pytest.mark.slow) for size in ((1, 1), (52, 6)))])
def test_sram(module: str, width: int, depth: int) -> None:
    test = "one_port" if module == "flk_sram_single" else "random_traffic"
    build_and_test(module, "cocotb_sram", parameters={"Width": width, "Depth": depth}, config={"width": width, "depth": depth}, tests=[test])


@pytest.mark.parametrize("module", ["flk_sram", "flk_sram_single"])
def test_illegal_parameters(module: str) -> None:
    refused(module, {"Width": 0}, "must be at least 1")
