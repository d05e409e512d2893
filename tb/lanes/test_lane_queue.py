"""Queue of a lane: every output in every cycle against a model, beside a lane that ends pixels and keeps its bank at random.

State space: entries and ends of lists in every mixture, a queue full of ends, pushes while it is full, pixels that end between and during an
entry's visits, flags of the sub-tile before, entries of which nothing is left, clear_i at any time, registers beginning with random values.
Parameter space: 8 pixels and depth 16; with SLOW=1 also 4 and 2 pixels, depths 5 (no power of two) and 2; slots that are no power of two.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    pytest.param({"Pixels": 8, "Slots": 20, "Depth": 16}, id="default"),
    pytest.param({"Pixels": 4, "Slots": 7, "Depth": 5}, id="no-power", marks=pytest.mark.slow),
    pytest.param({"Pixels": 2, "Slots": 64, "Depth": 2}, id="least", marks=pytest.mark.slow),
])
def test_lane_queue(parameters: dict[str, int]) -> None:
    build_and_test("flk_lane_queue", "cocotb_lane_queue", parameters=parameters, config=parameters)


@pytest.mark.parametrize("name", ["Pixels", "Slots", "Depth"])
def test_illegal_parameters(name: str) -> None:
    refused("flk_lane_queue", {name: 1}, "must be at least 2")
