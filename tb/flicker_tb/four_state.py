"""Designs in Icarus Verilog, whose registers and memories begin with X: Yosys reads the RTL and writes plain Verilog of it.

Assertions are left out, multiplexers are `?:`, which gives X where an X chooses: as pessimistic as a netlist.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from flicker import toolchain
from flicker.errors import FlickerError

READ = """
import sys
from pyosys import libyosys
design = libyosys.Design()
for command in sys.argv[1:]:
    libyosys.run_pass(command, design)
"""


def build(top: str, parameters: Mapping[str, str | int], sources: list[Path]) -> Path:
    """The program for vvp; skips the test, with the reason, where Icarus Verilog is missing or does not take the unit. FlickerError for a design that does not
    elaborate, such as one with illegal parameters."""
    if shutil.which("iverilog") is None:
        pytest.skip("FOUR_STATE: iverilog is missing (Debian: apt-get install iverilog)")
    text = "".join(path.read_text() for path in sources)
    # What is built follows from this file, too.
    key = hashlib.sha256(json.dumps([Path(__file__).read_text(), text, top, sorted(parameters.items())]).encode()).hexdigest()[:16]
    folder = toolchain.BUILD / "four-state" / f"{top}-{key}"
    program, log = folder / "sim.vvp", folder / "build.log"
    with toolchain.locked(folder.with_suffix(".lock")):
        if not program.exists():
            folder.mkdir(parents=True, exist_ok=True)
            verilog = folder / f"{top}.v"
            words = ["read_slang", "--std 1800-2023", *map(str, sources), f"--top {top}", *(f"-G {name}={value}" for name, value in parameters.items())]
            commands = [" ".join(words), f"hierarchy -check -top {top}", "proc", "opt_expr", "bwmuxmap", "opt_clean", f"write_verilog -noattr {verilog}"]
            _run([sys.executable, "-c", READ, *commands], log)  # a process of its own: Yosys writes to standard output and keeps global state
            values = _parameters(top, parameters, sources, folder)
            lines = "".join(f"  parameter {name} = {value};\n" for name, value in values.items())
            head = re.compile(rf"^(module {top}\s?\(.*?\);\n)", re.M | re.S)
            verilog.write_text("`timescale 1ns/1ps\n" + head.sub(lambda match: match[1] + lines, verilog.read_text(), count=1))
            done = subprocess.run(["iverilog", "-g2012", "-s", top, "-o", str(program), str(verilog)], text=True, capture_output=True)
            if done.returncode:
                program.unlink(missing_ok=True)
                pytest.skip(f"FOUR_STATE: this iverilog does not take {top}: {done.stderr.splitlines()[0]}")
    return program


def _parameters(top: str, parameters: Mapping[str, str | int], sources: list[Path], folder: Path) -> dict[str, int]:
    """Values of the parameters and constants of the header, which tests read."""
    tree = folder / "tree.json"
    _run(["verilator", "--json-only", "--json-only-output", str(tree), "--json-only-meta-output", str(folder / "meta.json"), "-Mdir", str(folder), "-Wno-fatal",
          "-Wno-lint", "-DSYNTHESIS", *(f"-G{name}={value}" for name, value in parameters.items()), "--top-module", top, *map(str, sources)],
         folder / "build.log")
    module = next(m for m in json.loads(tree.read_text())["modulesp"] if m.get("origName") == top)
    tree.unlink()
    found = {}
    for variable in module["stmtsp"]:
        if variable["type"] == "VAR" and variable.get("isParam") and variable["valuep"] and variable["valuep"][0]["type"] == "CONST":
            digits = re.fullmatch(r"\d+'(s?)h([0-9a-f]+)", variable["valuep"][0]["name"])
            if digits and len(digits[2]) <= 8:
                found[variable["name"]] = int(digits[2], 16)
    return found


def _run(command: list[str], log: Path) -> None:
    done = subprocess.run(command, env=toolchain.environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode:
        log.write_text(done.stdout)
        first = re.search(r"^.*error.*$", done.stdout, re.M | re.I)
        raise FlickerError(f"{first[0] if first else f'exit code {done.returncode}'} (see {log})")
