"""Lines to memory: each once, in order, as one burst of one beat with the strobes of its quarters; gathered before they leave.

State space: lines with pauses, memories that pause on every channel, of this project and of another one (cocotbext-axi), DRAM timing; answers with errors;
flush at any time. Parameter space: the rendering half's; the front end's with 256 lines; with SLOW=1 also a small one with fewer bursts than
lines.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {"Gather": 64, "Bursts": 64}, pytest.param({"Gather": 8, "Bursts": 3, "BeatBits": 26, "Id": 2}, marks=pytest.mark.slow),
], ids=str)
def test_line_writer(parameters: dict[str, int]) -> None:
    build_and_test("flk_line_writer", "cocotb_line_writer", parameters=parameters)


def test_of_the_front_end() -> None:
    """256 lines wait and are under way."""
    build_and_test("flk_line_writer", "cocotb_line_writer", tests=["gathering", "rate"])
