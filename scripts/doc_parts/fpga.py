"""`make docs PART=fpga`: chips on FPGAs and how full boards are, from what make fpga has left in build/fpga."""

from __future__ import annotations

import json

from flicker import markdown
from flicker.chips import chips
from flicker.cost.fpga import COMMANDS, FOLDER, Resources, boards

from .common import Say

WANTED = ("tiny", "small", "default")
NEXT = "`make fpga CHIP=tiny`, then `make docs PART=fpga`"


def _kept() -> dict[tuple[str, str], dict]:
    found = {}
    for name in WANTED:
        for family in COMMANDS:
            path = FOLDER / f"{name}-{family}.json"
            if path.exists() and (data := json.loads(path.read_text()))["parameters"] == chips()[name].parameters:
                found[name, family] = data
    return found


def _row(of: Resources) -> list[str]:
    return [f"{of.lut:,}", f"{of.lutram:,}", f"{of.ff:,}", f"{of.dsp:,}", f"{of.bram:,.1f}"]


def tables(say: Say) -> dict[str, str]:
    kept, known = _kept(), boards()
    full, units = [], []
    for (chip, family), data in kept.items():
        all_ = Resources(**data["all"])
        for board in known.values():
            if board.family == family:
                shares = board.full(all_)
                full.append([f"`{chip}`", board.name, *(f"{share:.0%}" for share in shares.values()), "yes" if max(shares.values()) <= 1 else "no"])
        order = sorted(data["units"].items(), key=lambda item: -item[1][1]["lut"])
        units += [[f"`{chip}`", family, f"`{module}`", str(number), *_row(Resources(**own))] for module, (number, own) in order]
        units.append([f"`{chip}`", family, "all", "", *_row(all_)])
    if not kept:  # said rather than left empty
        full, units = [[f"none mapped with its present parameters: {NEXT}", *[""] * 6]], [["none mapped", *[""] * 8]]
    head = ["LUT", "memory in LUTs", "FF", "DSP", "BRAM"]
    return {
        "boards": markdown.table(["chip", "board", "LUT with memory", "FF", "DSP", "BRAM", "fits"], full),
        "units": markdown.table(["chip", "family", "unit", "number", *head], units),
        "known": markdown.table(["board", "LUT", "FF", "DSP", "BRAM", "source"], [
            [b.name, f"{b.lut:,}", f"{b.ff:,}", f"{b.dsp:,}", str(b.bram), b.source] for b in known.values()
        ]),
    }
