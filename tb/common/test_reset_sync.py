"""Reset synchroniser: resets that begin and end anywhere in a cycle, of any length, in use and in a scan test; a chain of one flip-flop is refused.

With SLOW=1 also a chain of three.

Not covered: metastability, which no simulation has.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("stages", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_reset_sync(stages: int) -> None:
    build_and_test("flk_reset_sync", "cocotb_reset_sync", parameters={"Stages": stages}, config={"stages": stages})


def test_one_stage_is_refused() -> None:
    refused("flk_reset_sync", {"Stages": 1}, "flk_reset_sync: Stages must be at least 2")
