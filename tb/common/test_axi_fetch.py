"""Reads of a consumer with a buffer: flk_axi_fetch.

State space: random requests with and without places, one to 100 beats, under pauses of requests, memory and consumer; stops in mid-traffic, with bursts
on offer, on their way and held back. Parameter space: pieces of 8 beats, with SLOW=1 also of 2, places for one piece and more. Not covered: several managers
at one port.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {"Width": 64, "BeatBits": 7, "Places": 20, "MaxBeats": 8},
    pytest.param({"Width": 32, "BeatBits": 6, "Places": 3, "TagBits": 3, "MaxBeats": 2, "Bursts": 3}, marks=pytest.mark.slow),
])
def test_axi_fetch(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_fetch", "cocotb_axi_fetch", parameters={"AddrBits": 20, **parameters}, inner=False)


@pytest.mark.parametrize(("parameters", "message"), [
    ({"MaxBeats": 6}, "MaxBeats must be a power of two"), ({"MaxBeats": 1}, "MaxBeats must be a power of two"),
    ({"Places": 15}, "Places must be at least MaxBeats"), ({"BeatBits": 4}, "BeatBits must hold MaxBeats"),
])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_axi_fetch", parameters, message)
