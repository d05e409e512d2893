"""Resources on FPGAs: cells counted, boards, units mapped for both families and summed along the hierarchy; the harness of what is placed, and with SLOW=1
the stage of the smallest chip placed and routed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from flicker_tb.bench import rounds

from flicker.chips import chip_of, chips
from flicker.cost.fpga import COMMANDS, UNITS, Fpga, Resources, boards, count
from flicker.cost.fpga_budgets import BUDGETED, BUDGETS, over_budget
from flicker.cost.place import Placed, delays, harness, part_of, place
from flicker.cost.synth.flow import Yosys
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


def test_budgets() -> None:
    """Budgets are of chips and units that there are, and their sum leaves the chip within its own; what is above one or has none is said."""
    table = tomllib.loads(BUDGETS.read_text())
    assert table.keys() <= chips().keys() and "tiny" in table
    for most in table.values():
        assert most.keys() - {"all"} <= UNITS and all(limit.keys() == {"lut", "dsp", "bram"} for limit in most.values())
        assert sum(limit["lut"] for name, limit in most.items() if name != "all") < 1.05 * most["all"]["lut"]
    most = table["tiny"]["flk_lane"]
    lane = Resources(lut=most["lut"] - 10, lutram=10, dsp=most["dsp"], bram=most["bram"])
    assert over_budget("tiny", {"flk_lane": (8, lane)}, lane) == []
    assert over_budget("tiny", {"flk_lane": (8, lane + Resources(lutram=1))}, lane) == [f"flk_lane: {most['lut'] + 1:,} lut, budget {most['lut']:,}"]
    assert over_budget("tiny", {"flk_lane": (8, lane + Resources(bram=0.5))}, lane) == [f"flk_lane: {most['bram'] + 0.5:g} bram, budget {most['bram']:g}"]
    assert over_budget("tiny", {"flk_new": (1, Resources(lut=BUDGETED - 1))}, lane) == []
    assert over_budget("tiny", {"flk_new": (1, Resources(lut=BUDGETED))}, lane) == ["flk_new: 1,000 lut, no budget (fpga_budgets.toml)"]
    assert over_budget("tiny", {}, Resources(dsp=301)) == ["all: 301 dsp, budget 300"]
    assert over_budget("wide", {}, Resources(lut=10**9)) == []


@pytest.mark.slow
def test_within_budget() -> None:
    """The smallest chip: ten minutes where no unit is kept."""
    done = subprocess.run(["make", "fpga", "CHIP=tiny"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and "over its budget" not in done.stdout and "kv260: lut" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize("family", [pytest.param("xcup", marks=pytest.mark.slow), "ecp5"])
def test_unit(family: str) -> None:
    """Multipliers become DSPs (of a lane, with SLOW=1), a memory blocks or LUTs; parts are counted once for each instance."""
    found = Fpga(family)
    down = found.unit("flk_axi_downsizer", {"PortBits": 256})
    assert not down["parts"] and down["own"].lut > 100 and down["own"].ff > 200 and down["own"].lutram + down["own"].bram > 0
    assert found.unit("flk_axi_downsizer", {"PortBits": 256})["own"] is down["own"]
    if rounds(0, 1):
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


@pytest.mark.parametrize(("words", "message"), [
    ("--route --board kv260", "fpga: BOARD: kv260: only boards with an ECP5 are placed and routed here"),
    ("--route --family ecp5", "fpga: --family: not with --route, which takes a board"),
    ("--board kv260 --seed 2", "fpga: --seed: of a placement, with --route only"),
])
def test_refused_routes(words: str, message: str) -> None:
    """Without make, which would install nextpnr first."""
    done = subprocess.run([sys.executable, "scripts/fpga.py", *words.split()], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode and done.stderr.strip() == message


def sources(yosys: Yosys, folder: Path) -> set[str]:
    """Outputs of the stage, y_o[0] and so on, from which q comes through flip-flops and XOR alone."""
    yosys.run(f"write_json {folder / 'flat.json'}")
    module = json.loads((folder / "flat.json").read_text())["modules"]["pins"]
    names = {bit: f"{name}[{k}]" for name in ("y_o", "z_o") for k, bit in enumerate(module["netnames"][f"i_stage.{name}"]["bits"])}
    driver = {bit: cell for cell in module["cells"].values() for port in "QY" for bit in cell["connections"].get(port, [])}
    found, pending = set(), list(module["ports"]["q"]["bits"])
    while pending:
        bit = pending.pop()
        if bit in names:
            found.add(names[bit])
            continue
        cell = driver[bit]
        assert cell["type"] in ("$_DFF_P_", "$_XOR_"), cell["type"]
        pending += [b for port in ("A", "B", "D") for b in cell["connections"].get(port, [])]
    return found


def test_harness(tmp_path: Path) -> None:
    """Every input bit is a flip-flop of the shift register, every output bit reaches q through flip-flops alone: two levels here, of 4 and 2 bits."""
    (tmp_path / "pins.v").write_text(harness({"a_i": 3, "b_i": 2}, {"y_o": 6, "z_o": 1}))
    (tmp_path / "stage.v").write_text(
        "module flk_stage(input clk_i, input rst_ni, input [2:0] a_i, input [1:0] b_i, output [5:0] y_o, output z_o);\n"
        "  assign {z_o, y_o} = {a_i, b_i, a_i[1:0] & b_i} ^ {7{rst_ni}};\nendmodule\n"
    )
    yosys = Yosys(tmp_path)
    files = f"{tmp_path / 'pins.v'} {tmp_path / 'stage.v'}"
    for command in (f"read_verilog {files}", "hierarchy -check -top pins", "proc", "flatten", "check -assert", "opt_clean", "simplemap"):
        yosys.run(command)
    assert len(yosys.select("pins/t:$_DFF_P_")) == 2 + 5 + 7 + 2 + 1  # reset, inputs, outputs, and two levels of the tree
    assert sources(yosys, tmp_path) == {*(f"y_o[{k}]" for k in range(6)), "z_o[0]"}
    assert all(part_of(name) == "harness" for name in ("in_q_TRELLIS_FF_Q", "x0_TRELLIS_FF_Q_4", "x12"))
    assert [part_of(f"i_stage.gen_lanes.i_stage.gen_core[0].i_core.{name}") for name in ("gen_lane[7].i_lane.u_q", "gen_way[0].i_mask.x", "slot")] == [
        "lane 7", "setup and masks", "dispatch and output",
    ]
    placed = Placed("x", 1, 50.0, {}, [(0.5, "clk-to-q", "a"), (2.5, "routing", "b"), (3.0, "logic", "b"), (5.0, "routing", "c")], [])
    assert delays(placed) == {"clk-to-q": 0.5, "routing": 4.0, "logic": 0.5}


@pytest.mark.slow
def test_placed() -> None:
    """As the page names it: the command says a frequency, and the same placement again."""
    done = subprocess.run(["make", "fpga", "CHIP=tiny", "BOARD=ulx3s", "ROUTE=1"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = place(chip_of("tiny"), "ulx3s")
    said = re.search(r"seed 1: ([\d.]+) MHz", done.stdout)
    assert said and float(said[1]) == round(found.mhz, 1) and found.used["TRELLIS_FF"][0] > 5000
    assert {f"lane {k}" for k in range(8)} <= {part for _, _, part in found.cells} and found.path[-1][0] <= 1000 / found.mhz
