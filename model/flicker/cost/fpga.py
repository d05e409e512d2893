"""Resources of the chip on an FPGA: units by Yosys, summed along the hierarchy (docs/reference/fpga.md).

    found = Fpga("xcup").chip(chip_of("tiny").parameters)    # resources by unit and in all
    boards()["kv260"]

Units of UNITS are synthesised one by one, each with what is below it up to the next unit, so nothing is optimised across their borders: sums are
somewhat high. A result is kept in ``build/fpga`` by its sources, parameters and flow. As a process of its own: ``python -m flicker.cost.fpga JOB.json``.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from ..errors import FlickerError
from ..toolchain import BUILD, locked, sources_of
from .stamp import words
from .synth.flow import Yosys, children, read
from .synth.units import COMPOSED

FOLDER = BUILD / "fpga"
BOARDS = Path(__file__).with_name("boards.toml")
# Yosys' own commands for a family, but that on UltraScale+ multiplexers take MUXF7 and MUXF8 and ABC maps for few LUTs of any size: its own costs are those
# of LUTs that share a place.
_AREA = "+&scorr;&sweep;&dc2;&dc2;&syn3;&dch,-f;&if,-W,300;&mfs;&st;&dch,-f;&if,-W,300;&mfs;&st;&dch,-f;&if,-W,300,-a;&mfs"
_XILINX = "synth_xilinx -family xcup -flatten -noiopad -noclkbuf -widemux 3 -top {top}"
COMMANDS = {
    "xcup": (
        f"{_XILINX} -run begin:map_luts", "opt_expr -mux_undef -noclkinv", f"abc9 -luts 6:5,10,20 -script {_AREA}", "clean", "xilinx_srl -fixed -minlen 3",
        "techmap -map +/techmap.v -D LUT_SIZE=6 -map +/xilinx/lut_map.v -map +/xilinx/cells_map.v -D LUT_WIDTH=6", "xilinx_dffopt",
        "opt_lut_ins -tech xilinx", "clean", "blackbox =A:whitebox",
    ),
    # A block of memory gives its word ten times as late as a register: tables of few bits are logic, up to 2,048 words.
    "ecp5": (
        "synth_ecp5 -top {top} -run begin:map_ram", 'setattr -set rom_style "logic" t:$mem_v2 r:WR_PORTS=0 %i r:WIDTH<16 %i r:ABITS<12 %i',
        "synth_ecp5 -top {top} -run map_ram:",
    ),
}
# Modules that are synthesised apart.
UNITS = {
    f"flk_{name}" for name in (
        "registers frame_control frame_counters axi_arbiter axi_downsizer preprocessing rendering cluster_cull cluster_test cluster_header geometry_fetch "
        "colour_fetch preprocessing_core geometry_decode projection projection_conic splat_bounds colour_basis colour_group colour_constant colour_term "
        "tile_walker record_writer entry_merge list_writer line_writer list_reader list_sorter sorting_unit run_merge entry_buffer delivery record_cache "
        "stage lane_stage lane_core lane splat_setup row_mask render_stage rendering_core channel vru mask_generator ctu prtu frame_writer top"
    ).split()
}
# LUTs that a memory in LUTs takes, by the beginning of its cell's name.
_LUTRAM = {
    "RAM32M16": 8, "RAM64M8": 8, "RAM32M": 4, "RAM64M": 4, "RAM32X1D": 2, "RAM64X1D": 2, "RAM128X1D": 4, "RAM256X1D": 8, "RAM32X1S": 1, "RAM64X1S": 1,
    "RAM128X1S": 2, "RAM256X1S": 4, "RAM512X1S": 8, "SRL16E": 1, "SRLC32E": 1, "SRLC16E": 1,
}


@dataclass(frozen=True)
class Resources:
    """lut: without memories in LUTs, which lutram counts in LUTs. bram: blocks as of `Board`."""

    lut: int = 0
    lutram: int = 0
    ff: int = 0
    dsp: int = 0
    bram: float = 0.0

    def __add__(self, other: Resources) -> Resources:
        return Resources(*(getattr(self, name) + getattr(other, name) for name in self.__dataclass_fields__))

    def times(self, count: int) -> Resources:
        """Of so many."""
        return Resources(*(count * getattr(self, name) for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Board:
    """lut, ff, dsp, bram: what its device has. source: the document that says so. nextpnr: the device's options, where it is placed and routed."""

    name: str
    family: str
    lut: int
    ff: int
    dsp: int
    bram: int
    source: str
    nextpnr: str = ""

    def full(self, of: Resources) -> dict[str, float]:
        """Shares of the device that resources take."""
        return {"lut": (of.lut + of.lutram) / self.lut, "ff": of.ff / self.ff, "dsp": of.dsp / self.dsp, "bram": of.bram / self.bram}


def boards() -> dict[str, Board]:
    """Known boards by name."""
    return {name: Board(**values) for name, values in tomllib.loads(BOARDS.read_text()).items()}


def count(cells: Mapping[str, int], family: str) -> Resources:
    """Resources of a netlist's cells by type."""
    found: Counter[str] = Counter()
    bram = 0.0
    for cell, number in cells.items():
        if cell in _LUTRAM:
            found["lutram"] += _LUTRAM[cell] * number
        elif cell.startswith("LUT") or cell == "INV":
            found["lut"] += number
        elif cell.startswith(("FD", "TRELLIS_FF")):
            found["ff"] += number
        elif cell.startswith(("DSP48", "MULT18")):
            found["dsp"] += number
        elif cell.startswith("RAMB36"):
            bram += number
        elif cell.startswith("RAMB18"):
            bram += number / 2
        elif cell in ("DP16KD", "PDPW16KD"):
            bram += number
        elif cell == "CCU2C":
            found["lut"] += 2 * number
        elif cell == "TRELLIS_DPR16X4":
            found["lutram"] += 6 * number
        elif cell.startswith("LD"):
            raise FlickerError(f"a latch ({cell})")
        elif cell.startswith("$"):
            raise FlickerError(f"{cell} is not mapped to {family}")
    return Resources(found["lut"], found["lutram"], found["ff"], found["dsp"], bram)


class Fpga:
    """Synthesises units for a family, one at a time. report: called with (unit, seconds or None where it was kept)."""

    def __init__(self, family: str, report: Callable[[str, float | None], None] = lambda name, seconds: None) -> None:
        if family not in COMMANDS:
            raise FlickerError(f"family: one of {', '.join(COMMANDS)}, not {family}")
        self.family, self.report = family, report
        self.found: dict[str, dict] = {}

    def unit(self, top: str, parameters: Mapping[str, int]) -> dict:
        """A unit alone and its parts: {"top", "own": Resources, "parts": [(instance, key)], "key"}; parts are in `found` too."""
        boxes = [module for module in COMPOSED.get(top, []) if module in UNITS]
        job = {
            "top": top, "parameters": dict(parameters), "extra": [], "boxes": boxes, "family": self.family,
            "commands": [command.format(top=top) for command in COMMANDS[self.family]],
        }
        text = "".join(" ".join(words(path.read_text())) for path in sources_of(top))
        digest = hashlib.sha256(json.dumps([job, text, Path(__file__).read_text(), version("pyosys")], sort_keys=True).encode()).hexdigest()[:12]
        key = f"{top}-{self.family}-{digest}"
        if key in self.found:
            return self.found[key]
        folder = FOLDER / key
        with locked(folder.with_suffix(".lock")):
            kept = (folder / "result.json").exists()
            if not kept:
                _process(folder, job)
        result = json.loads((folder / "result.json").read_text())
        self.report(top.removeprefix("flk_"), None if kept else result["seconds"])
        entry: dict = {"top": top, "key": key, "own": count(result["cells"], self.family), "parts": []}
        self.found[key] = entry
        for _, module, everything in result["children"]:
            own = parameters_of(module)
            entry["parts"].append(self.unit(module, {name: value for name, value in everything.items() if name in own})["key"])
        return entry

    def total(self, key: str) -> Resources:
        """Of a unit and all below it."""
        entry = self.found[key]
        return sum((self.total(part) for part in entry["parts"]), entry["own"])

    def by_unit(self, key: str) -> dict[str, tuple[int, Resources]]:
        """Of the units in one: how many there are and what all of them take themselves, by module."""
        found: dict[str, tuple[int, Resources]] = {}

        def add(key: str) -> None:
            entry = self.found[key]
            number, sum_ = found.get(entry["top"], (0, Resources()))
            found[entry["top"]] = number + 1, sum_ + entry["own"]
            for part in entry["parts"]:
                add(part)

        add(key)
        return found


def parameters_of(module: str) -> set[str]:
    """Names of a module's parameters."""
    text = next(path for path in sources_of(module) if path.stem == module).read_text()
    return set(re.findall(r"^\s*parameter\s+[\w\s]*?(\w+)\s*=", text, re.M))


def _process(folder: Path, job: dict) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path, log = folder / "job.json", folder / "log"
    path.write_text(json.dumps(job))
    with log.open("w") as out:
        done = subprocess.run([sys.executable, "-m", "flicker.cost.fpga", str(path)], stdout=out, stderr=subprocess.STDOUT)
    if done.returncode or not (folder / "result.json").exists():
        lines = [line for line in log.read_text(errors="replace").splitlines() if "error" in line.lower()]
        raise FlickerError(f"{job['top']}: {lines[-1] if lines else 'synthesis failed'} (see {log})")


def main() -> int:
    """A job: the unit's cells by type, the units inside it."""
    path = Path(sys.argv[1])
    job, folder, began = json.loads(path.read_text()), path.parent, time.monotonic()
    yosys = Yosys(folder)
    read(yosys, job)
    yosys.run(f"write_json {folder / 'read.json'}")
    inside = children(json.loads((folder / "read.json").read_text()), job["top"], job["boxes"]) if job["boxes"] else []
    (folder / "read.json").unlink()
    # Yosys takes a module without contents as one without parameters.
    for module, name in sorted({(module, name) for _, module, everything in inside for name in everything}):
        yosys.run(f"setparam -unset {name} t:{module}")
    for command in job["commands"]:
        yosys.run(command)
    yosys.run(f"write_json {folder / 'mapped.json'}")
    modules = json.loads((folder / "mapped.json").read_text())["modules"]
    (folder / "mapped.json").unlink()
    own = next(module for name, module in modules.items() if name == job["top"] or int(module.get("attributes", {}).get("top", "0"), 2))
    cells = Counter(cell["type"] for cell in own["cells"].values() if not cell["type"].startswith("flk_"))
    (folder / "result.json").write_text(json.dumps({"cells": cells, "children": inside, "seconds": round(time.monotonic() - began, 1)}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
