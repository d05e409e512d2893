"""Synthesis of one unit with Yosys: RTL to a checked, mapped netlist, its area and timing.

Runs as a process of its own, since Yosys writes to standard output and keeps global state:
``python -m flicker.cost.synth.flow JOB.json`` reads a job and writes ``result.json``, ``netlist.json`` and, on failure, ``error`` beside it.
"""

from __future__ import annotations

import json
import re
import sys
import time
from pathlib import Path

from ...errors import FlickerError
from ...toolchain import FILELIST
from .liberty import CLOCK_GATE, Library
from .timing import Timing
from .units import SINGLE

# Longest path wanted, in FO4; gates are made larger only where a path needs it.
CLOCK_FO4 = 60
# ABC does not see the inverters that drive large nets (timing.Nets): the share of the time that it is given.
CLOCK_MARGIN = 0.87

# Choices (dch) and structural matching of the library's gates (amap), which finds XOR, AOI and OAI cells.
_ABC = "+strash;ifraig;scorr;dc2;dc2;dc2;strash;dch,-f;amap,-m"
_ABC_CLOCK = ";topo;upsize,-D,{delay};dnsize,-D,{delay}"

# Flip-flops with a common enable, from this many on, get a gated clock instead of multiplexers.
CLOCK_GATE_MIN = 4

# The only storage arrays there are: those of the FIFOs, in flip-flops.
STORAGE = re.compile(r"(^|\.)storage_q$")

# Before any optimisation, so that what is checked is what was written.
_READ = ["hierarchy -check -top {top}", "proc", "flatten", "opt_expr", "opt_clean"]
_COARSE = [
    "opt -nosdff", "fsm", "opt", "wreduce", "peepopt", "opt_clean", "alumacc", "share", "opt -nosdff", "memory -nomap",
    "opt_clean",
]
_FINE = [
    "opt -fast -full -nosdff", "memory_map", "opt -undriven -fine -nosdff", "techmap", "opt -fast -nosdff", "opt_clean",
    "clockgate -pos {gate} ce:clk:gclk -min_net_size {gate_min}", "opt_clean",
    "dfflibmap -liberty {liberty}", "opt -fast -nodffe -nosdff", "opt_clean",
]
_MAP = [
    "abc -liberty {liberty} -script {script}", "opt_clean", "read_liberty -lib -ignore_miss_func {liberty}",
    "read_verilog -lib {stub}", "check -assert -mapped",
]



class Yosys:
    """A Yosys design; every command's failure is a FlickerError with the command's message."""

    def __init__(self, folder: Path) -> None:
        from pyosys import libyosys

        self.yosys, self.folder = libyosys, folder
        self.design = libyosys.Design()

    def run(self, command: str) -> None:
        self.yosys.run_pass(command, self.design)

    def select(self, what: str) -> list[str]:
        """Names ``module/object`` of a selection."""
        path = self.folder / "selection"
        self.run(f"select -write {path} {what}")
        names = path.read_text().split()
        path.unlink()
        return names


def read(yosys: Yosys, job: dict) -> None:
    """Elaborate the unit; its children stay black boxes."""
    words = ["read_slang", "--std", "1800-2023", "-F", str(FILELIST), *job["extra"], "--top", job["top"]]
    for name, value in job["parameters"].items():
        words += ["-G", f"{name}={value}"]
    for child in job["boxes"]:
        words += ["--blackboxed-module", child]
    yosys.run(" ".join(words))


def children(netlist: dict, top: str, boxes: list[str]) -> list[tuple[str, str, dict[str, int]]]:
    """Black boxes of an elaborated netlist: instance, module, all its parameters."""
    found = []
    for name, cell in netlist["modules"][top]["cells"].items():
        if cell["type"] in boxes:
            parameters = {key: int(value, 2) for key, value in cell["parameters"].items()}
            found.append((name, cell["type"], parameters))
    return found


def plan(job: dict, folder: Path) -> list[tuple[str, str, dict[str, int]]]:
    """Children of a composed unit."""
    yosys = Yosys(folder)
    read(yosys, job)
    path = folder / "elaborated.json"
    yosys.run(f"write_json {path}")
    netlist = json.loads(path.read_text())
    path.unlink()
    return children(netlist, job["top"], job["boxes"])


def box_name(key: str) -> str:
    """Cell type of a part in the netlist of what contains it."""
    return f"box_{key}".replace("-", "_")


def _stub(name: str, child: dict) -> str:
    """Empty module with the ports of a synthesised child."""
    face = child["interface"]
    ports = []
    for direction, key in (("input", "inputs"), ("output", "outputs")):
        for port in face[key]:
            ports.append(f"{direction} [{child['widths'][port] - 1}:0] {port}")
    return f"(* blackbox *) module {name}({', '.join(ports)}); endmodule\n"


def check(yosys: Yosys, job: dict) -> None:
    """What must not be in a design: latches, undriven or doubly driven nets, loops, unknown storage."""
    top = job["top"]
    yosys.run("check -assert")
    latches = yosys.select("t:$dlatch t:$adlatch t:$dlatchsr t:$sr")
    if latches:
        raise FlickerError(f"{top}: latch {latches[0]}")


def check_ports(module: dict, job: dict) -> None:
    """Every input bit reaches something and every output bit comes from something, or is named in the job."""
    used: set[object] = set()
    for cell in module["cells"].values():
        for bits in cell["connections"].values():
            used.update(bits)
    sides: dict[str, set[object]] = {"input": set(), "output": set()}
    for port in module["ports"].values():
        sides[port["direction"]].update(port["bits"])
    for name, port in module["ports"].items():
        other = sides["output" if port["direction"] == "input" else "input"]
        for index, bit in enumerate(port["bits"]):
            if f"{name}[{index}]" in job["open"]:
                continue
            constant = isinstance(bit, str)
            if (constant and (port["direction"] == "input" or bit == "x")) or (
                not constant and bit not in used and bit not in other
            ):
                raise FlickerError(f"{job['top']}: {port['direction']} {name}[{index}] is not connected")


def synthesise(job: dict, folder: Path) -> dict:
    """Run the flow and return the result (also the interface for a unit that contains this one)."""
    started = time.monotonic()
    top, library = job["top"], Library(Path(job["liberty"]))
    yosys = Yosys(folder)
    read(yosys, job)
    boxes: dict[str, dict] = {}
    count: dict[str, int] = {}
    for instance, key in job["children"].items():
        child = json.loads((Path(job["results"]) / key / "result.json").read_text())
        kind = box_name(key)
        if kind not in boxes:
            stub = folder / "stub.v"
            stub.write_text(_stub(kind, child))
            yosys.run(f"read_verilog {stub}")
            stub.unlink()
        boxes[kind] = child["interface"]
        count[key] = count.get(key, 0) + 1
        yosys.run(f"select -set inst {top}/c:{instance.replace('[', '?').replace(']', '?')}")
        parameters = job["child_parameters"][instance]
        yosys.run("setparam " + " ".join(f"-unset {name}" for name in parameters) + " @inst")
        yosys.run(f"chtype -set {kind} @inst")
    for command in _READ:
        yosys.run(command.format(top=top))
    check(yosys, job)
    storage = 0
    for command in _COARSE:
        yosys.run(command)
    path = folder / "netlist.json"
    yosys.run(f"write_json {path}")
    for cell in json.loads(path.read_text())["modules"][top]["cells"].values():
        if cell["type"].startswith("$mem"):
            name = cell["parameters"]["MEMID"].removeprefix("\\")
            if int(cell["parameters"]["WR_PORTS"], 2) == 0:
                continue  # a table: becomes logic
            if not STORAGE.search(name):
                raise FlickerError(f"{top}: unintended memory {name}")
            storage += int(cell["parameters"]["SIZE"], 2) * int(cell["parameters"]["WIDTH"], 2)
    words = {
        "liberty": job["liberty"], "gate": CLOCK_GATE, "gate_min": CLOCK_GATE_MIN, "stub": folder / "clock_gate.v",
        "script": _ABC,
    }
    for command in _FINE:
        yosys.run(command.format(**words))
    yosys.run(f"write_json {path}")
    if any("DFF" in cell["type"] for cell in json.loads(path.read_text())["modules"][top]["cells"].values()):
        words["script"] += _ABC_CLOCK.format(delay=round(clock_period(library)))
    words["stub"].write_text(f"module {CLOCK_GATE} (input ce, input clk, output gclk); endmodule\n")
    for command in _MAP:
        yosys.run(command.format(**words))
    yosys.run(f"write_json {path}")
    yosys.run(f"write_verilog -noattr -noexpr {folder / 'netlist.v'}")
    module = json.loads(path.read_text())["modules"][top]
    check_ports(module, job)
    result = {
        "top": top, "parameters": job["parameters"], "mem_bits": storage, "sram_bits": 0, "children": count,
        **measure(module, library, boxes),
    }
    result["widths"] = {name: len(port["bits"]) for name, port in module["ports"].items()}
    path.unlink()
    return result | {"seconds": time.monotonic() - started}


# A memory macro: its data stand so long after the clock, its inputs so long before it, in FO4.
MACRO_ACCESS, MACRO_SETUP = 25.0, 8.0


def macro(job: dict) -> dict:
    """Result of a memory: bits, and ports with the times of a macro; inputs load as a flip-flop's do."""
    library = Library(Path(job["liberty"]))
    width, depth = job["parameters"]["Width"], job["parameters"]["Depth"]
    address = max((depth - 1).bit_length(), 1)
    if job["top"] == SINGLE:
        ports = {"en_i": 1, "write_i": 1, "addr_i": address}
    else:
        ports = {"wr_en_i": 1, "wr_addr_i": address, "rd_en_i": 1, "rd_addr_i": address}
    widths = {"clk_i": 1, **ports, "wr_data_i": width, "rd_data_o": width}
    load = max(library.flip_flop.loads.values())
    inputs = {
        name: {"loads": [load] * bits, "captures": [None if name == "clk_i" else (MACRO_SETUP * library.fo4, "storage")] * bits}
        for name, bits in widths.items() if name != "rd_data_o"
    }
    outputs = {"rd_data_o": {"launches": [(MACRO_ACCESS * library.fo4, "storage")] * width, "through": {}}}
    return {
        "top": job["top"], "parameters": job["parameters"], "mem_bits": 0, "sram_bits": width * depth, "children": {}, "ge_seq": 0.0, "ge_comb": 0.0,
        "ge_drivers": 0.0, "ff": 0, "cells": {}, "paths": [], "interface": {"inputs": inputs, "outputs": outputs}, "widths": widths, "seconds": 0.0,
    }


def clock_period(library: Library) -> float:
    """Time for logic between flip-flops, in ps."""
    flop = library.flip_flop
    clock_to_output = max(arc.intrinsic for arcs in flop.arcs.values() for arc in arcs)
    return CLOCK_MARGIN * library.ps * (CLOCK_FO4 * library.fo4 - clock_to_output - flop.setup)


def measure(module: dict, library: Library, boxes: dict[str, dict]) -> dict:
    """Area and timing of a mapped module, without what is in its black boxes."""
    timing = Timing(module, library, boxes)
    sequential = combinational = 0.0
    flops, cells = 0, {}
    for cell in module["cells"].values():
        if cell["type"] in boxes:
            continue
        gate = library.cells[cell["type"]]
        cells[gate.name] = cells.get(gate.name, 0) + 1
        if gate.sequential:
            sequential += gate.area
            flops += gate.name != CLOCK_GATE
        else:
            combinational += gate.area
    return {
        "ge_seq": sequential / library.ge,
        "ge_comb": combinational / library.ge,
        "ge_drivers": timing.driver_area / library.ge,
        "ff": flops,
        "cells": cells,
        "paths": [
            {"fo4": path.delay / library.fo4, "from": path.source, "to": path.target, "port": path.port}
            for path in timing.paths()
        ],
        "interface": timing.interface(),
    }


def main() -> int:
    path = Path(sys.argv[1])
    job = json.loads(path.read_text())
    folder = path.parent
    try:
        if job["action"] == "plan":
            (folder / "plan.json").write_text(json.dumps(plan(job, folder)))
        elif job["action"] == "macro":
            (folder / "netlist.v").write_text("")
            (folder / "result.json").write_text(json.dumps(macro(job)))
        else:
            (folder / "result.json").write_text(json.dumps(synthesise(job, folder)))
    except FlickerError as error:
        (folder / "error").write_text(str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
