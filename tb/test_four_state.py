"""Units with state in a 4-state simulator: registers and memories begin with X, which must have left valid, ready and data that are compared.

Each runs tests of its own in Icarus Verilog (`flicker_tb.four_state`), of some units a part. Slow: a second of Verilator takes Icarus a minute. `top` is
flk_top with stand-ins for its halves: no output that says something is X from reset to the end of a frame. Not covered: units whose tests look at inner
signals or at the noise that `flk_sram` gives for a collision, and whole halves.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys

import pytest

from flicker.toolchain import ROOT

# Test file and a word that chooses among its tests.
UNITS = {
    "axi": "split", "axi_arbiter": "Width", "axi_fetch": "parameters0", "axi_half": "", "colour_fetch": "", "delay": "8-4", "entry_merge": "test_entry_merge",
    "event_counter": "1", "frame_control": "", "line_writer": "", "list_writer": "64-64", "pair_fifo": "3-4", "pointer_port": "test_pointer_port",
    "priority_arbiter": "", "record_queue": "3-8", "record_writer": "",
    "reset_sync": "2", "sram_fifo": "1-2", "stream_cells": "fifo or pipe_reg", "top": "test_top",
}


@pytest.mark.slow
@pytest.mark.parametrize("unit", UNITS)
def test_four_state(unit: str) -> None:
    if shutil.which("iverilog") is None:
        pytest.skip("iverilog is missing (Debian: apt-get install iverilog)")
    environment = {**os.environ, "FOUR_STATE": "1", "SLOW": "", "NETLIST": ""}
    for name in [name for name in environment if name.startswith("PYTEST_")]:
        del environment[name]
    choice = ["-k", UNITS[unit]] if UNITS[unit] else []
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "sim and not slow", "--unit", unit, *choice, "tb"]
    done = subprocess.run(command, cwd=ROOT, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    passed = re.search(r"(\d+) passed", done.stdout)
    if done.returncode == 0 and passed is None:
        pytest.skip(f"this iverilog does not take {unit}")
    assert done.returncode == 0 and passed, done.stdout[-4000:]
