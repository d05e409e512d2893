"""Core of the lanes: every pixel of every list once and equal to golden.lanes.render, idle_o and finished_o in every cycle, events.

State space: lists of every kind (random splats about the sub-tile, random bits, opaque ones that finish it with many behind, faint ones over all pixels,
single pixels, empty masks, no element); two elements a beat in every split, an end beside the next list's first element or end; lists left early; pauses and
back-pressure of every pattern; clear_i at random times, elements beside and right behind it. Parameter space: few slots and queues of two, of one
sub-tile; with SLOW=1 the default, one element a cycle, 4, 16 and 32 lanes with few slots, two sub-tiles and four. Events in the input's cycles are exact, so
are the sums that do not depend on timing; entries and visits lie between what the golden model needs and what the masks hold. Not covered: cycles
(tb/frames/test_lane_frames.py), which compares them with the cycle model.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SLOW = pytest.mark.slow  # builds of 30 s each


@pytest.mark.parametrize("numbers", [
    (8, 2, 3, 2, 1),
    *(pytest.param(numbers, marks=SLOW) for numbers in (
        (8, 2, 5, 3, 4), (8, 1, 4, 2, 4), (8, 2, 20, 16, 1), (8, 1, 3, 2, 1), (16, 2, 6, 4, 1), (32, 1, 12, 8, 1),
        (4, 2, 6, 4, 1), (8, 2, 6, 4, 2), (32, 1, 12, 8, 4), (4, 1, 4, 2, 4),
    )),
], ids=lambda numbers: "-".join(map(str, numbers)))
def test_lane_core(numbers: tuple[int, ...]) -> None:
    parameters = dict(zip(("Lanes", "InWidth", "Slots", "Depth", "Subtiles"), numbers))
    build_and_test("flk_lane_core", "cocotb_lane_core", parameters=parameters, config={**parameters, "passes": 6, "aborts": 48})


@pytest.mark.parametrize(("parameters", "message"), [
    ({"Lanes": 2}, "Lanes must be"), ({"Subtiles": 3}, "Subtiles must be 1, 2 or 4"),
    ({"InWidth": 3}, "InWidth must be"), ({"Slots": 1}, "Slots and Depth must be"), ({"Depth": 65}, "Slots and Depth must be"),
])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_lane_core", parameters, message)
