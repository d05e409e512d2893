"""Resources on FPGAs: cells counted, boards, units mapped for both families and summed along the hierarchy."""

from __future__ import annotations

import subprocess

import pytest

from flicker.cost.fpga import COMMANDS, Fpga, Resources, boards, count
from flicker.errors import FlickerError
from flicker.toolchain import ROOT


def test_count() -> None:
    cells = {
        "LUT6": 3, "LUT2": 1, "INV": 1, "FDRE": 4, "FDCE": 2, "DSP48E2": 1, "RAMB36E2": 1, "RAMB18E2": 3, "RAM32M": 2, "SRL16E": 5, "CARRY8": 7, "MUXF7": 2,
    }
    assert count(cells, "xcup") == Resources(lut=5, lutram=13, ff=6, dsp=1, bram=2.5)
    assert count({"LUT4": 2, "CCU2C": 3, "TRELLIS_FF": 4, "MULT18X18D": 1, "DP16KD": 2, "TRELLIS_DPR16X4": 1}, "ecp5") == Resources(8, 6, 4, 1, 2)
    for cell, text in (("LDCE", "a latch"), ("$mul", "is not mapped")):
        with pytest.raises(FlickerError, match=text):
            count({cell: 1}, "xcup")


def test_boards() -> None:
    known = boards()
    assert {"kv260", "zcu104", "zcu102", "vcu118", "ulx3s"} <= known.keys() and {b.family for b in known.values()} == set(COMMANDS)
    assert known["kv260"].full(Resources(100_000, 17_120, 0, 624, 36.0)) == {"lut": 1.0, "ff": 0.0, "dsp": 0.5, "bram": 0.25}
    with pytest.raises(FlickerError, match="family: one of xcup, ecp5, not ice40"):
        Fpga("ice40")


@pytest.mark.parametrize("family", [pytest.param("xcup", marks=pytest.mark.slow), "ecp5"])
def test_unit(family: str) -> None:
    """Multipliers become DSPs, a memory blocks or LUTs; parts are counted once for each instance."""
    found = Fpga(family)
    down = found.unit("flk_axi_downsizer", {"PortBits": 256})
    assert not down["parts"] and down["own"].lut > 100 and down["own"].ff > 200 and down["own"].lutram + down["own"].bram > 0
    lane = found.unit("flk_lane", {"Lanes": 32, "Lane": 0, "Slots": 20})["own"]
    assert lane.dsp >= 2 and lane.ff > 400
    assert found.unit("flk_lane", {"Lanes": 32, "Lane": 0, "Slots": 20})["own"] is lane
    found.found["two"] = {"top": "x", "key": "two", "own": Resources(lut=1), "parts": [down["key"], down["key"]]}
    assert found.total("two") == Resources(lut=1) + down["own"].times(2)
    assert found.by_unit("two")["flk_axi_downsizer"] == (2, down["own"].times(2))


@pytest.mark.parametrize(("words", "message"), [
    ("BOARD=nope", "fpga: BOARD: one of kv260, zcu104, zcu102, vcu118, ulx3s, not nope"),
    ("CHIP=nope", "fpga: chip: one of tiny, small, default, wide, max, channels, faithful, not nope"),
])
def test_refused(words: str, message: str) -> None:
    done = subprocess.run(["make", "fpga", words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode and message in done.stderr and "Traceback" not in done.stderr
