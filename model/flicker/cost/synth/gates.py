"""Netlists of units as sources for simulation: mapped Verilog and cell models made from the library's functions."""

from __future__ import annotations

import re
from pathlib import Path

from ...toolchain import ROOT, locked
from .flow import box_name
from .liberty import CLOCK_GATE, Cell, Library, to_verilog
from .run import FOLDER, UNITS, Runner

DEFAULT_LIBERTY = ROOT / "scripts" / "cells" / "flicker.lib"


def _model(cell: Cell) -> str:
    if cell.name == CLOCK_GATE:
        return (
            f"module {CLOCK_GATE} (input ce, input clk, output gclk);\n  reg open;\n"
            "  always @* if (!clk) open = ce;\n  assign gclk = clk & open;\nendmodule\n"
        )
    inputs, outputs = list(cell.loads), list(cell.functions)
    ports = [f"input {pin}" for pin in inputs] + [f"output {pin}" for pin in outputs]
    lines = [f"module {cell.name} ({', '.join(ports)});"]
    if cell.sequential:
        ff = cell.sequential
        state, inverse = ff["state"], ff["inverse"]
        clock, edge = to_verilog(ff["clocked_on"]), "posedge"
        if clock.startswith("(~"):
            clock, edge = clock[2:-1], "negedge"
        events, branches, start = [f"{edge} {clock}"], "", ""
        for kind, value in (("clear", "1'b0"), ("preset", "1'b1")):
            if condition := ff.get(kind):
                level = to_verilog(condition)
                # A reset that is active from the start has no edge, and a gated clock may have none meanwhile.
                start = f"  initial {state} = {value};"
                events.append(f"negedge {level[2:-1]}" if level.startswith("(~") else f"posedge {level}")
                branches += f"if ({level}) {state} <= {value}; else "
        lines += [
            f"  reg {state};",
            f"  wire {inverse} = ~{state};" if inverse else "",
            start,
            f"  always @({' or '.join(events)}) {branches}{state} <= {to_verilog(ff['next_state'])};",
        ]
    lines += [f"  assign {pin} = {to_verilog(function)};" for pin, function in cell.functions.items()]
    return "\n".join(line for line in lines if line) + "\nendmodule\n"


def cell_models(library: Library) -> str:
    """A Verilog module for every cell of the library, zero delay, from its Liberty function."""
    return "/* verilator lint_off DECLFILENAME */\n/* verilator lint_off COMBDLY */\n" + "\n".join(map(_model, library.cells.values()))


def sources(top: str, parameters: dict[str, int], liberty: Path = DEFAULT_LIBERTY) -> list[Path]:
    """Verilog files that hold the netlist of ``top`` (a module without parameters) and the cells it uses, and Verilator's
    configuration that makes the ports of ``top`` visible to a test bench.

    The unit is synthesised if it is not in the cache. Parts of a composed unit come as modules of their own.
    """
    runner = Runner(liberty)
    key = runner.add(top, dict(parameters))
    folder = FOLDER / "gates"
    with locked(FOLDER / "gates.lock"):
        runner.run_planned()
        folder.mkdir(parents=True, exist_ok=True)
        models = folder / f"{runner.liberty.stem}_cells.v"
        text = cell_models(Library(runner.liberty))
        if not models.exists() or models.read_text() != text:
            models.write_text(text)
        files = [models]
        pending, seen = [key], set()
        while pending:
            part = pending.pop()
            if part in seen:
                continue
            seen.add(part)
            name = top if part == key else box_name(part)
            text = (UNITS / part / "netlist.v").read_text()
            text = re.sub(rf"\bmodule {runner.tasks[part]['top']}\b", f"module {name}", text)
            path = folder / part / f"{name}.v"
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists() or path.read_text() != text:
                path.write_text(text)
            files.append(path)
            pending += runner.tasks[part]["children"].values()
        # Only the ports: Verilator may then dissolve the cells.
        path = folder / key / "ports.vlt"
        lines = [f'public_flat_rw -module "{top}" -var "{port}"\n' for port in runner.results[key]["widths"]]
        text = "`verilator_config\n" + "".join(lines)
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    return [path, *files]
