"""Read managers at one port: every address once, unchanged, under its manager's identifier, in each manager's order; beats only to the one that is meant.

State space: managers of different pace, one alone and all at once, ports that pause, answers of different identifiers in any order, those of one in theirs;
bits of the identifier that no manager has. Parameter space: 4 managers, with SLOW=1 also 2 and 3.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {}, *(pytest.param(case, marks=pytest.mark.slow) for case in ({"Managers": 3}, {"Managers": 2})),
], ids=str)
def test_axi_read_mux(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_read_mux", "cocotb_axi_read_mux", parameters=parameters)
