#!/usr/bin/env python3
"""Writes flicker.core (FuseSoC, CAPI2) and Bender.yml from rtl/flk.f, the one list of sources; ``--check`` only compares.

Name, version and description are those of pyproject.toml.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path

from flicker.errors import FlickerError
from flicker.toolchain import ROOT, filelist

TOP = "flk_top_axi"
WAIVER = "lint/waiver.vlt"
BENCH = "tb/top/flk_top_tb.sv"
# Parameters of the targets, and what they are: those of lint are flk_top_axi's, those of sim the bench's, which hands them on.
PARAMETERS = {
    "Stage": "0: channels, 1: lanes", "Lanes": "of the stage of lanes: 16, 32, 64 or 128", "IdWidth": "bits of AXI identifiers, 7 or more",
    "ResetStages": "flip-flops of the reset synchroniser; 0: none",
}
NOTE = "# Written by scripts/gen_manifests.py from rtl/flk.f: do not edit."


def manifests() -> dict[str, str]:
    """Text of each manifest by its name; paths are relative to the root of the repository."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    files = [path.relative_to(ROOT).as_posix() for path in filelist()]
    parameters = "".join(
        f'  {name}:\n    datatype: int\n    paramtype: vlogparam\n    description: "{text}"\n' for name, text in PARAMETERS.items()
    )
    core = f"""CAPI=2:
{NOTE}
name: "::flicker:{version}"
description: "FLICKER: an accelerator for 3D Gaussian Splatting"

filesets:
  rtl:
    files:
{"".join(f"      - {name}{chr(10)}" for name in files)}    file_type: systemVerilogSource
  lint:
    files:
      - {WAIVER}
    file_type: vlt
  bench:
    files:
      - {BENCH}
    file_type: systemVerilogSource

parameters:
{parameters}
targets:
  default:
    filesets: [rtl]
    toplevel: {TOP}
  lint:
    description: "Verilator -Wall on the whole chip"
    filesets: [rtl, lint]
    toplevel: {TOP}
    parameters: [{", ".join(PARAMETERS)}]
    flow: lint
    flow_options:
      tool: verilator
      verilator_options: [-Wall]
  lint_stage:
    description: "Verilator -Wall on the rendering stage alone"
    filesets: [rtl, lint]
    toplevel: flk_render_stage
    flow: lint
    flow_options:
      tool: verilator
      verilator_options: [-Wall]
  sim:
    description: "Smoke test of the whole chip: registers, a refused frame"
    filesets: [rtl, bench]
    toplevel: {Path(BENCH).stem}
    parameters: [{", ".join(PARAMETERS)}]
    flow: sim
    flow_options:
      tool: verilator
      mode: binary
      verilator_options: [--timing, --assert, -j, "0"]
"""
    bender = f"""{NOTE}
package:
  name: flicker

sources:
{"".join(f"  - {name}{chr(10)}" for name in files)}"""
    return {"flicker.core": core, "Bender.yml": bender}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit with 1 if a manifest is not what rtl/flk.f says")
    check = parser.parse_args().check
    stale = 0
    for name, text in manifests().items():
        path = ROOT / name
        if check and (not path.is_file() or path.read_text() != text):
            print(f"{name}: does not follow from rtl/flk.f: run scripts/gen_manifests.py")
            stale += 1
        elif not check:
            path.write_text(text)
    return 1 if stale else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"gen_manifests: {error}")
