"""Area and timing estimate: cell library, delays worked out by hand, netlists that equal the RTL, and designs that must be refused.

Parameter space: combinational, sequential and composed units, small ones only. Not covered: the numbers themselves,
which are what `make synth` reports.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyosys
import pytest

from flicker.cost.synth import run
from flicker.cost.synth.gates import DEFAULT_LIBERTY, cell_models
from flicker.cost.synth.liberty import Library, to_verilog, truth
from flicker.cost.synth.timing import Timing
from flicker.cost.synth.units import all_units, unit
from flicker.errors import FlickerError
from flicker.toolchain import ROOT, filelist


@pytest.fixture(scope="module")
def library() -> Library:
    return Library(DEFAULT_LIBERTY)


def test_library_is_generated() -> None:
    done = subprocess.run([sys.executable, ROOT / "scripts/cells/gen_cells.py", "--check"], text=True, capture_output=True)
    assert done.returncode == 0, done.stdout


def test_library_scalars(library: Library) -> None:
    assert library.ge == 1 and library.inverter.name == "INV_X1"
    assert library.fo4 == pytest.approx(50)  # 10 (1 + 4)
    assert library.cells["NAND2_X1"].arcs["Y"][0].resistance == pytest.approx(10)
    assert library.cells["DFF"].setup == pytest.approx(50) and library.cells["DFF"].clock == "CK"
    assert library.cells["DFFR"].sequential["clear"] == "!RN"


@pytest.mark.parametrize(
    ("function", "table"),
    [
        ("!(A B)", (1, 1, 1, 0)),
        ("A' + B", (1, 1, 0, 1)),
        ("A ^ B", (0, 1, 1, 0)),
        ("!A*B | A&!B", (0, 1, 1, 0)),
        ("(A + B)'", (1, 0, 0, 0)),
    ],
)
def test_functions(function: str, table: tuple[int, ...]) -> None:
    assert truth(function, ["A", "B"]) == table, to_verilog(function)


def test_liberty_errors(tmp_path: Path) -> None:
    path = tmp_path / "x.lib"
    with pytest.raises(FlickerError, match="cannot be read"):
        Library(path)
    path.write_text("no liberty")
    with pytest.raises(FlickerError, match="x.lib"):
        Library(path)
    path.write_text("library(x) { cell(INV) { area : 1; pin(A) { direction : input; } } }")
    with pytest.raises(FlickerError, match="no cell with the function"):
        Library(path)


def module(cells: dict[str, tuple[str, dict[str, int]]], ports: dict[str, tuple[str, int | list[int]]]) -> dict:
    """A netlist as `write_json` gives it."""
    return {
        "ports": {name: {"direction": direction, "bits": np.atleast_1d(bit).tolist()} for name, (direction, bit) in ports.items()},
        "netnames": {f"n{bit}": {"hide_name": 0, "bits": [bit]} for bit in range(20)},
        "cells": {
            name: {"type": kind, "connections": {pin: [bit] for pin, bit in pins.items()}}
            for name, (kind, pins) in cells.items()
        },
    }


def chain(fanout: int) -> dict:
    """Flip-flop, inverter, flip-flops: n1 -> n2 -> ``fanout`` registers."""
    cells = {"a": ("DFF", {"D": 0, "CK": 19, "Q": 1}), "i": ("INV_X1", {"A": 1, "Y": 2})}
    cells |= {f"b{k}": ("DFF", {"D": 2, "CK": 19, "Q": 3}) for k in range(fanout)}
    return module(cells, {"d": ("input", 0), "ck": ("input", 19), "q": ("output", 3)})


def test_delays_by_hand(library: Library) -> None:
    timing = Timing(chain(2), library, {})
    path = next(path for path in timing.paths() if path.target == "n3" and not path.port)
    # Clock to output 60 and load 1; inverter 10 and load 2; set-up 50.
    assert path.delay == pytest.approx(60 + 10 * 1 + 10 + 10 * 2 + 50)
    assert (path.source, path.target) == ("n1", "n3")
    assert timing.driver_area == 0


def test_netlist_by_hand(library: Library) -> None:
    """Registers a, b; g = NAND2(a, b) drives an inverter i and a register p; h = XOR2(a, i) drives a register q. Delays are parasitic + 10 ps x load, loads
    the inputs driven (inverter 1, NAND2 1.333, XOR2 3, D 1), FO4 = 50 ps. In ps:

    a, clock to output, drives g and h: 60 + 10 x 4.333 = 103.33; g drives i and p: + 20 + 10 x 2 = 143.33; i drives h: + 10 + 10 x 3 = 183.33;
    h drives q: + 55 + 10 x 1 = 248.33; set-up of q: + 50 = 298.33. From b, which drives g alone, it is 30 less; the path to p is 143.33 + 50 = 193.33.
    """
    cells = {
        "a": ("DFF", {"D": 10, "CK": 19, "Q": 1}), "b": ("DFF", {"D": 11, "CK": 19, "Q": 2}),
        "g": ("NAND2_X1", {"A": 1, "B": 2, "Y": 3}), "i": ("INV_X1", {"A": 3, "Y": 4}), "h": ("XOR2_X1", {"A": 1, "B": 4, "Y": 5}),
        "p": ("DFF", {"D": 3, "CK": 19, "Q": 6}), "q": ("DFF", {"D": 5, "CK": 19, "Q": 7}),
    }
    timing = Timing(module(cells, {"ck": ("input", 19)}), library, {})
    found = {path.target: (path.source, path.delay) for path in timing.paths() if not path.port}
    assert found == {"n7": ("n1", pytest.approx(298.33, abs=0.01)), "n6": ("n1", pytest.approx(193.33, abs=0.01))}


ABC = Path(pyosys.__file__).parent / "yosys-abc"


@pytest.mark.parametrize("parameters", [
    pytest.param(dict(ExpBits=4, ManBits=3, Fn=1, Saturate=1), id="e4m3"), pytest.param({}, id="fp16", marks=pytest.mark.slow),
])
@pytest.mark.parametrize("top", ["flk_fp_add", "flk_fp_mul"])
def test_timing_equals_abc(top: str, parameters: dict, library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """ABC's own static timing (`stime`) of the mapped netlist with the same Liberty file, port to port.

    ABC prints hundredths of a picosecond. It drives each net directly, so our chains of inverters are off; with them a path is never longer.
    """
    runner = run.Runner(DEFAULT_LIBERTY)
    key = runner.add(top, parameters)
    runner.run_planned()
    blif, netlist = tmp_path / "netlist.blif", tmp_path / "netlist.json"
    commands = [
        f"read_liberty -lib {DEFAULT_LIBERTY}", f"read_verilog {run.UNITS / key / 'netlist.v'}", f"hierarchy -top {top}", "opt_clean -purge",
        "splitnets -ports", f"write_blif -gates {blif}", f"write_json {netlist}",
    ]
    code = "import sys; from pyosys import libyosys as y; d = y.Design(); [y.run_pass(c, d) for c in sys.argv[1:]]"
    subprocess.run([sys.executable, "-c", code, *commands], check=True, capture_output=True)
    # Constants that nothing uses would make ABC take the netlist for unmapped logic.
    blif.write_text(re.sub(r"^\.names \$\w+\n(1\n)?", "", blif.read_text(), flags=re.M))
    done = subprocess.run([ABC, "-c", f"read_lib {DEFAULT_LIBERTY}; read -m {blif}; topo; stime"], capture_output=True, text=True)
    theirs = re.search(r"Gates = *(\d+).*Delay = *([\d.]+) ps", done.stdout)
    assert theirs, done.stdout

    def longest() -> float:
        timing = Timing(module, library, {})
        at = timing.arrive({bit: (0.0, name) for name, port in inputs.items() for bit in port["bits"]})
        return max(at[bit][0] for port in module["ports"].values() if port["direction"] == "output" for bit in port["bits"] if bit in at)

    module = json.loads(netlist.read_text())["modules"][top]
    inputs = {name: port for name, port in module["ports"].items() if port["direction"] == "input"}
    with_chains = longest()
    monkeypatch.setattr("flicker.cost.synth.timing.EFFORT_LIMIT", float("inf"))
    assert len(module["cells"]) == int(theirs[1])
    assert longest() == pytest.approx(float(theirs[2]), abs=0.006)
    assert longest() >= with_chains


def test_large_fanout_gets_drivers(library: Library) -> None:
    timing = Timing(chain(64), library, {})
    path = next(path for path in timing.paths() if path.target == "n3" and not path.port)
    # Two more inverters, each stage with an effort of 4: 3 * 4 tau + 2 parasitic delays instead of 64 tau.
    assert path.delay == pytest.approx(60 + 10 * 1 + 10 + 10 * (3 * 4 + 2) + 50)
    # Sizes 4 and 16, half an inverter and half of one per unit.
    assert timing.driver_area == pytest.approx(library.inverter.area * (5 + 17) / 2)


def test_combinational_loop(library: Library) -> None:
    cells = {"a": ("INV_X1", {"A": 1, "Y": 2}), "b": ("INV_X1", {"A": 2, "Y": 1})}
    with pytest.raises(FlickerError, match="combinational loop"):
        Timing(module(cells, {}), library, {})


def test_interface_adds_up(library: Library) -> None:
    """A path through a black box is as long as the same path flat, up to the net at the box's output."""
    inner = module(
        {"i": ("INV_X1", {"A": 0, "Y": 1}), "j": ("INV_X1", {"A": 1, "Y": 2})}, {"a": ("input", 0), "y": ("output", 2)}
    )
    face = Timing(inner, library, {}).interface()
    assert face["inputs"]["a"]["loads"] == [1] and face["inputs"]["a"]["captures"] == [None]
    assert face["outputs"]["y"]["through"] == {"a": pytest.approx(10 + 10 + 10)}
    cells = {
        "a": ("DFF", {"D": 5, "CK": 19, "Q": 0}), "box": ("box", {"a": 0, "y": 2}), "b": ("DFF", {"D": 2, "CK": 19, "Q": 3})
    }
    timing = Timing(module(cells, {"d": ("input", 5), "q": ("output", 3)}), library, {"box": face})
    path = next(path for path in timing.paths() if path.target == "n3" and not path.port)
    assert path.delay == pytest.approx(60 + 10 + 30 + 10 + 50)


def test_bits_of_a_box_have_their_own_times(library: Library) -> None:
    """A late signal at a bit that goes straight to a register does not meet the long path of another bit of its port."""
    inner = module(
        {
            "i": ("INV_X1", {"A": 0, "Y": 4}), "j": ("INV_X1", {"A": 4, "Y": 5}), "r": ("DFF", {"D": 5, "CK": 19, "Q": 6}),
            "s": ("DFF", {"D": 1, "CK": 19, "Q": 7}), "k": ("INV_X1", {"A": 6, "Y": 8}),
        },
        {"a": ("input", [0, 1]), "y": ("output", [7, 8])},
    )
    face = Timing(inner, library, {}).interface()
    through, straight = (delay for delay, _ in face["inputs"]["a"]["captures"])
    assert straight == pytest.approx(50) and through == pytest.approx(10 + 10 + 10 + 10 + 50)
    plain, inverted = (delay for delay, _ in face["outputs"]["y"]["launches"])
    assert inverted > plain


def test_units_cover_the_design() -> None:
    modules = {path.stem for path in filelist() if not path.stem.endswith("_pkg")}
    modules -= {"flk_mask_generator", "flk_stage", "flk_descriptor", "flk_clock_gate"}  # no logic of their own: generated switches, wires, a place for a cell
    assert modules <= {unit.top for unit in all_units()}


def test_composed_unit_is_the_sum_of_its_parts(library: Library) -> None:
    sorter = unit("flk_bitonic_sorter", Lanes=2, KeyWidth=4, PayloadWidth=2, StagesPerReg=1)
    runner = run.Runner(DEFAULT_LIBERTY)
    total = runner.run([sorter])[sorter]
    own = runner.results[total["key"]]
    parts = {runner.results[key]["top"]: runner.results[key] for key in own["children"]}
    assert set(parts) == {"flk_compare_exchange", "flk_pipe_reg"}
    area = sum(result["ge_comb"] + result["ge_seq"] for result in (own, *parts.values()))
    assert total["ge"] == pytest.approx(area)
    cells = parts["flk_pipe_reg"]["cells"]
    assert sum(count * library.cells[name].area for name, count in cells.items()) == pytest.approx(
        parts["flk_pipe_reg"]["ge_comb"] + parts["flk_pipe_reg"]["ge_seq"]
    )
    # Two lanes of key, lane number and payload, and valid.
    assert total["ff"] == 2 * (5 + 2) + 1
    assert total["fo4"] >= max(path["fo4"] for path in own["paths"])


E4M3 = dict(ExpBits=4, ManBits=3, Fn=1, Saturate=1)


FPGAS = {
    "synth_ecp5": {"DP16KD": 8}, "synth_ice40": {"SB_RAM40_4K": 16, "SB_LUT4": 1}, "synth_gowin": {"SDPX9B": 8},
    "synth_xilinx -family xcup": {"RAMB36E2": 4},
}


@pytest.mark.parametrize("flow", [pytest.param(flow, marks=[pytest.mark.slow] * (flow != "synth_ecp5")) for flow in FPGAS])
def test_memory_on_an_fpga(flow: str, tmp_path: Path) -> None:
    """A memory of 256 words of 256 bits is blocks alone: no flip-flop and no logic for a read and a write of the same place."""
    stat = tmp_path / "stat"
    source = ROOT / "rtl/common/flk_sram.sv"
    commands = [f"read_slang --std 1800-2023 {source} --top flk_sram -G Width=256 -G Depth=256", f"{flow} -top flk_sram", f"tee -o {stat} stat"]
    code = "import sys; from pyosys import libyosys as y; d = y.Design(); [y.run_pass(c, d) for c in sys.argv[1:]]"
    subprocess.run([sys.executable, "-c", code, *commands], check=True, capture_output=True)
    cells = {name: int(count) for count, name in re.findall(r"^ +(\d+) +([A-Z]\w+)$", stat.read_text(), re.M)}
    assert {name: count for name, count in cells.items() if name not in ("BUFG", "IBUF", "OBUF", "GND", "VCC")} == FPGAS[flow]


@pytest.mark.parametrize("top", ["flk_fp_add", "flk_fp_mul"])
def test_netlist_equals_rtl(top: str, library: Library, tmp_path: Path) -> None:
    """Proved for all inputs: the mapped netlist with the generated cell models, and the RTL, E4M3."""
    runner = run.Runner(DEFAULT_LIBERTY)
    key = runner.add(top, E4M3)
    runner.run_planned()
    cells = tmp_path / "cells.v"
    cells.write_text(cell_models(library))
    script = "\n".join([
        f"read_verilog {cells} {run.UNITS / key / 'netlist.v'}", f"rename {top} netlist", "proc", "flatten netlist",
        "design -stash gate",
        f"read_slang --std 1800-2023 -F {ROOT / 'rtl/flk.f'} --top {top} " + " ".join(f"-G {k}={v}" for k, v in E4M3.items()),
        "proc", "flatten", f"rename {top} rtl", "design -copy-from gate -as netlist netlist",
        "miter -equiv -flatten -make_outputs rtl netlist miter", "sat -verify -prove trigger 0 miter",
    ])
    (tmp_path / "prove.ys").write_text(script)
    code = "import sys; from pyosys import libyosys as y; d = y.Design(); [y.run_pass(c, d) for c in open(sys.argv[1]).read().splitlines()]"
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "prove.ys"], capture_output=True, text=True)
    assert done.returncode == 0 and "SAT proof finished - no model found: SUCCESS!" in done.stdout, done.stdout[-2000:]


LATCH = "module bad (input logic e, d, output logic q); always_latch if (e) q = d; endmodule"
MEMORY = """module bad (input logic clk, w, input logic [3:0] a, d, output logic [3:0] q);
logic [3:0] other [16]; always_ff @(posedge clk) if (w) other[a] <= d; assign q = other[a]; endmodule"""
OPEN_INPUT = "module bad (input logic [1:0] a, output logic y); assign y = a[0]; endmodule"
UNDRIVEN = "module bad (input logic a, output logic [1:0] y); assign y[0] = a; endmodule"
LOOP = "module bad (input logic a, output logic y); assign y = !(a && y); endmodule"
SYNTAX = "module bad (input logic a; endmodule"


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (LATCH, "latch"), (MEMORY, "unintended memory other"), (OPEN_INPUT, r"input a\[1\] is not connected"),
        (UNDRIVEN, "no driver|not connected"), (LOOP, "bad:.*(loop|problem)"), (SYNTAX, "bad: .*ERROR"),
    ],
    ids=["latch", "memory", "open-input", "undriven", "loop", "syntax"],
)
def test_bad_designs_are_refused(source: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.sv"
    path.write_text(source)
    job = {
        "action": "synthesise", "top": "bad", "parameters": {}, "extra": [str(path)], "boxes": [], "children": {},
        "child_parameters": {}, "liberty": str(DEFAULT_LIBERTY), "results": "", "open": [],
    }
    with pytest.raises(FlickerError, match=message):
        run._process(tmp_path / "out", job)


def test_report_of_one_unit() -> None:
    """The command prints the rows of one unit and needs no comparisons."""
    done = subprocess.run(
        [sys.executable, ROOT / "scripts/synth.py", "--unit", "mmu"], text=True, capture_output=True, cwd=ROOT
    )
    assert done.returncode == 0 and "mmu" in done.stdout, done.stderr
    result = json.loads(next((run.UNITS).glob("flk_mmu-*/result.json")).read_text())
    assert result["ff"] == 2
    done = subprocess.run([sys.executable, ROOT / "scripts/synth.py", "--unit", "nothing"], text=True, capture_output=True)
    assert done.returncode == 1 and "no unit 'nothing'" in done.stderr


def test_one_parameter_set() -> None:
    """One row of a unit; a set that does not exist is named beside those that do."""
    def drive(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run([sys.executable, ROOT / "scripts/synth.py", *arguments], text=True, capture_output=True, cwd=ROOT)

    done = drive("--unit", "fp_cmp", "--config", "e4m3")
    assert done.returncode == 0 and "synth: 1 rows" in done.stdout and "fp16" not in done.stdout, done.stdout + done.stderr
    done = drive("--unit", "fp_cmp", "--config", "e9m9")
    assert done.returncode == 1 and "no parameter set 'e9m9' of fp_cmp; there are fp16, e4m3, e5m2" in done.stderr
    assert "--config needs --unit" in drive("--config", "e4m3").stderr
