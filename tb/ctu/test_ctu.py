"""Contribution test unit as a stream: masks, order, counters, automatic fall, all against the golden model.

State space: lists of random splats (as in scenes, thin, covering, special numbers), empty sub-tiles, sub-tiles of one and of 5,000 splats; all modes;
idle input, blocked output and blocked acceptance (stall_i) in many patterns; automatic mode with lists that make it fall and return, under different
stalls; reset and clear in mid-traffic. Parameter space: without output FIFO the factored form in fixed point; the output FIFO of the faithful configuration,
conic in mixed precision; VRU cycles of channels with 2 VRUs; illegal parameters. With SLOW=1 also the other precisions of each form, output FIFOs of 1, 2 and 3
places, channels with 1 and 4 VRUs. Not covered: a change of mode in mid-frame, which the contract excludes (tb/render/test_stage_control.py: the mode is
latched).
"""

from __future__ import annotations

import pytest
from flicker_tb.bench import netlist
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.params import FAITHFUL, Form, Precision, RenderConfig


def run(form: Form, precision: Precision, depth: int, tests: list[str], **more: int) -> None:
    parameters = {"Form": int(form), "Precision": int(precision), "CtuFifoDepth": depth, **more}
    build_and_test("flk_ctu", "cocotb_ctu", parameters=parameters, config=parameters, tests=tests, inner=True)


# The test's arithmetic is the PRTU's, which has every combination; those marked slow differ in nothing else.
COMBINATIONS = [
    pytest.param(form, precision, id=f"{form.name}-{precision.name}".lower(), marks=[pytest.mark.slow] if slow else [])
    for form, precision, slow in (
        (Form.FACTORED, Precision.FIXED, False), (Form.FACTORED, Precision.FP16, True), (Form.FACTORED, Precision.FP8, True),
        (Form.FACTORED, Precision.MIXED, True), (Form.CONIC, Precision.MIXED, True), (Form.CONIC, Precision.FP16, True),
        (Form.CONIC, Precision.FP8, True), (Form.CONIC, Precision.FIXED, True),
    )
]


@pytest.mark.parametrize(("form", "precision"), COMBINATIONS)
def test_ctu(form: Form, precision: Precision) -> None:
    tests = ["lists", "rate", "automatic"]
    if RenderConfig(form=form, precision=precision) == RenderConfig():
        tests += ["rejected_drain", "long_list", "forgets"]
        if not netlist():
            tests.append("saturation")  # sets registers by name
    run(form, precision, 0, tests)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [1, 2, 3])
def test_fifo_depth(depth: int) -> None:
    run(Form.FACTORED, Precision.MIXED, depth, ["lists", "automatic"])


def test_faithful() -> None:
    run(FAITHFUL.form, FAITHFUL.precision, FAITHFUL.ctu_fifo_depth, ["lists", "rate", "automatic", "rejected_drain"])


@pytest.mark.slow
@pytest.mark.parametrize("cycles", [4, 16])
def test_vru_cycles(cycles: int) -> None:
    """Of a channel with four VRUs and with one: the fall compares with them."""
    run(Form.FACTORED, Precision.FIXED, 0, ["automatic"], VruCycles=cycles)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"Form": 2}, "Form must be"),
        ({"Precision": 4}, "Precision must be"),
        ({"CtuFifoDepth": 129}, "CtuFifoDepth must be"),
        ({"VruCycles": 6}, "VruCycles must be a power of two"),
    ],
)
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_ctu", parameters, message)
