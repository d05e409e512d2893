"""Priority arbiter with a bound on waiting: choice, data, ready in every cycle against a model of its counts.

State space: inputs that pause, wait and give up, outputs that stall in every pattern; all inputs busy; reset while some are urgent.
Parameter space: 2 and 4 inputs, Patience at its least value and 16; with SLOW=1 also 3, 5 and 8 inputs and Patience between.
For all traces: formal/fv_priority_arbiter.sv.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {}, {"Inputs": 2, "Patience": 1, "Width": 1},
    *(pytest.param(case, marks=pytest.mark.slow) for case in ({"Inputs": 5, "Patience": 4}, {"Inputs": 3, "Patience": 5}, {"Inputs": 8, "Patience": 9})),
], ids=str)
def test_priority_arbiter(parameters: dict[str, int]) -> None:
    build_and_test("flk_priority_arbiter", "cocotb_priority_arbiter", parameters=parameters)


@pytest.mark.parametrize(("parameters", "message"), [({"Inputs": 1}, "Inputs must be"), ({"Inputs": 4, "Patience": 2}, "Patience must be")])
def test_illegal_parameters(parameters, message):
    refused("flk_priority_arbiter", parameters, message)
