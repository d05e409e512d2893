"""AXI4 managers: flk_axi_split, flk_axi_read, flk_axi_write.

State space: random requests, many across 4 KB, one to 300 beats, under pauses of requests, beats, consumer and memory; memory perfect,
LPDDR4 and of another project (cocotbext-axi); answers with errors; memories that want addresses or data first; one that never answers.
Parameter space: the defaults; with SLOW=1 also 64 to 512 bits, bursts of 1 to 256 beats, 1 to 8 bursts under way. Not covered: several managers at one port.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SLOW = pytest.mark.slow  # the same with other numbers
LONG_BURSTS, ONE_BURST = {"Width": 64, "MaxBeats": 64, "TagBits": 8, "Bursts": 3}, {"Width": 128, "MaxBeats": 4, "Bursts": 1, "IdBits": 1, "Id": 1}
ONE_BEAT = {"Width": 64, "MaxBeats": 1, "BeatBits": 1, "Bursts": 5}


@pytest.mark.parametrize("parameters", [{}, *(pytest.param(case, marks=SLOW) for case in (
    {"MaxBeats": 64, "TagBits": 8}, {"Bytes": 8, "MaxBeats": 256, "BeatBits": 10}, {"MaxBeats": 1, "BeatBits": 5}, {"Bytes": 16, "MaxBeats": 7, "AddrBits": 32},
))])
def test_axi_split(parameters):
    build_and_test("flk_axi_split", "cocotb_axi", parameters=parameters, config={"top": "flk_axi_split"})


@pytest.mark.parametrize("parameters", [{}, *(pytest.param(case, marks=SLOW) for case in (LONG_BURSTS, ONE_BURST, {**ONE_BEAT, "Listed": 0}))])
def test_axi_read(parameters):
    rate = [] if not parameters else ["read", "read_other_memory", "no_answer"]
    build_and_test("flk_axi_read", "cocotb_axi", parameters=parameters, config={"top": "flk_axi_read"}, tests=rate)


@pytest.mark.parametrize("parameters", [{}, *(pytest.param(case, marks=SLOW) for case in (LONG_BURSTS, ONE_BURST, {**ONE_BEAT, "Tagged": 0}))])
def test_axi_write(parameters):
    rate = [] if not parameters else ["write", "write_other_memory", "no_answer"]
    build_and_test("flk_axi_write", "cocotb_axi", parameters=parameters, config={"top": "flk_axi_write"}, tests=rate)


@pytest.mark.parametrize(("parameters", "message"), [
    ({"Bytes": 48}, "Bytes must be"), ({"MaxBeats": 0}, "MaxBeats must be"), ({"MaxBeats": 257}, "MaxBeats must be"), ({"AddrBits": 12}, "AddrBits must be"),
])
def test_illegal_parameters(parameters, message):
    refused("flk_axi_split", parameters, message)
