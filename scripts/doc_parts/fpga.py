"""`make docs PART=fpga`: chips on FPGAs and how full boards are, from what make fpga has left in build/fpga; `PART=floorplan`: a stage placed and routed."""

from __future__ import annotations

import json

import matplotlib.pyplot as plt
import numpy as np

from flicker import markdown
from flicker.chips import chip_of, chips
from flicker.cost.fpga import COMMANDS, FOLDER, Resources, boards
from flicker.cost.place import Placed, delays, part_of, place
from flicker.cost.stamp import rtl_stamp
from flicker.report.figures import STYLE
from flicker.toolchain import ROOT

from .common import Say

NEXT = "`make fpga CHIP=tiny`, then `make docs PART=fpga`"
BY_UNIT = ("tiny", "small")


def mapped() -> dict[tuple[str, str], dict]:
    """What make fpga has left of the chips of chips.toml with their present parameters and RTL, by chip and family."""
    found, rtl = {}, rtl_stamp()
    for name, chip in chips().items():
        for family in COMMANDS:
            path = FOLDER / f"{name}-{family}.json"
            data = json.loads(path.read_text()) if path.exists() else {}
            if (data.get("rtl"), data.get("parameters")) == (rtl, chip.parameters):
                found[name, family] = data
    return found


def _row(of: Resources) -> list[str]:
    return [f"{of.lut:,}", f"{of.lutram:,}", f"{of.ff:,}", f"{of.dsp:,}", f"{of.bram:,.1f}"]


def tables(say: Say) -> dict[str, str]:
    kept, known = mapped(), boards()
    full, units = [], []
    for (chip, family), data in kept.items():
        all_ = Resources(**data["all"])
        for board in known.values():
            if board.family == family:
                shares = board.full(all_)
                full.append([f"`{chip}`", board.name, *(f"{share:.0%}" for share in shares.values()), "yes" if max(shares.values()) <= 1 else "no"])
        if chip not in BY_UNIT:
            continue
        order = sorted(data["units"].items(), key=lambda item: -item[1][1]["lut"])
        units += [[f"`{chip}`", family, f"`{module}`", str(number), *_row(Resources(**own))] for module, (number, own) in order]
        units.append([f"`{chip}`", family, "all", "", *_row(all_)])
    if not kept:  # said rather than left empty
        full, units = [[f"none mapped with its present RTL and parameters: {NEXT}", *[""] * 6]], [["none mapped", *[""] * 8]]
    head = ["LUT", "memory in LUTs", "FF", "DSP", "BRAM"]
    return {
        "boards": f"Mapped from RTL {rtl_stamp()}.\n\n" + markdown.table(["chip", "board", "LUT with memory", "FF", "DSP", "BRAM", "fits"], full),
        "units": markdown.table(["chip", "family", "unit", "number", *head], units),
        "known": markdown.table(["board", "LUT", "FF", "DSP", "BRAM", "source"], [
            [b.name, f"{b.lut:,}", f"{b.ff:,}", f"{b.dsp:,}", str(b.bram), b.source] for b in known.values()
        ]),
    }


PLACED = (("tiny", "ulx3s"),)
SEEDS = (1, 2, 3)
PICTURE = ROOT / "docs" / "images" / "floorplan.png"
# What nextpnr counts, in words.
_USED = {"TRELLIS_COMB": "LUT4 and carry", "TRELLIS_FF": "FF", "TRELLIS_RAMW": "LUT RAM", "MULT18X18D": "DSP", "DP16KD": "BRAM"}


def floorplan(say: Say) -> dict[str, str]:
    """Placed stages: frequency with each seed; resources and longest path of the fastest; and the picture of the first one."""
    rows, paths = [], []
    for name, board in PLACED:
        tries = [place(chip_of(name), board, seed, lambda phase, seed=seed: say(f"{name} on {board}, seed {seed}: {phase}")) for seed in SEEDS]
        found = max(tries, key=lambda placed: placed.mhz)
        used = [f"{found.used[key][0]:,} of {found.used[key][1]:,}" for key in _USED]
        times = delays(found)
        mhz = ", ".join(f"{placed.mhz:.1f}" for placed in tries)
        rows.append([f"`{name}`", found.board, mhz, *used, f"{times['routing']:.1f} of {sum(times.values()):.1f}"])
        steps: list[tuple[str, float, int]] = []
        for at, kind, cell in found.path:
            part = part_of(cell)
            if not steps or steps[-1][0] != part:
                steps.append((part, at, 0))
            steps[-1] = (part, at, steps[-1][2] + (kind == "logic"))
        paths += [[f"`{name}`", part, str(levels), f"{at:.1f}"] for part, at, levels in steps]
        if (name, board) == PLACED[0]:
            _picture(found, name)
    return {
        "stages": markdown.table(["chip", "board", f"MHz, seeds {SEEDS[0]} to {SEEDS[-1]}", *_USED.values(), "routing in the longest path, ns"], rows),
        "path": markdown.table(["chip", "through", "levels of logic", "until, ns"], paths),
    }


def _picture(found: Placed, name: str) -> None:
    """Each cell where it lies, coloured by part."""
    parts = sorted({part for _, _, part in found.cells}, key=lambda part: (not part.startswith("lane"), part))
    lanes = [part for part in parts if part.startswith("lane")]
    shades = plt.get_cmap("viridis")(np.linspace(0.0, 0.75, len(lanes)))
    others = ("#e41a1c", "#ff9f1c", "#f78fb3", "#8c564b", "#ffd92f", "#b0b0b0")
    colours = dict(zip(lanes, shades)) | {part: others[k % len(others)] for k, part in enumerate(p for p in parts if p not in lanes)}
    with plt.style.context(STYLE):
        figure, axis = plt.subplots(figsize=(8.0, 5.6))
        for part in parts:
            x, y = np.array([(x, y) for x, y, own in found.cells if own == part], float).T
            jitter = np.random.default_rng(1).uniform(-0.45, 0.45, (2, len(x)))
            axis.scatter(x + jitter[0], y + jitter[1], s=0.5, color=colours[part], label=part, linewidths=0)
        axis.set_aspect("equal")
        axis.invert_yaxis()
        axis.set_xlabel("column of the device")
        axis.set_ylabel("row")
        axis.set_title(f"rendering stage of {name} on {found.board}, {found.mhz:.0f} MHz")
        axis.legend(markerscale=10, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        figure.savefig(PICTURE, dpi=110, bbox_inches="tight")
        plt.close(figure)
