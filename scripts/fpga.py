#!/usr/bin/env python3
"""Resources of a chip on FPGAs, by unit and in all, and how full known boards are (docs/reference/fpga.md): make fpga [CHIP=tiny]
[BOARD=kv260] [ROUTE=1].

Exits 1 when the chip does not fit the board. Without a board: the family's, all of them. Writes build/fpga/<chip>-<family>.json, which make docs
PART=fpga takes. --route: the chip's rendering stage alone, placed and routed on the board, with its frequency and longest path.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from rich.table import Table

from flicker.chips import chip_of, chips
from flicker.cli.tables import Terminal
from flicker.cost.fpga import COMMANDS, FOLDER, Fpga, Resources, boards
from flicker.cost.fpga_budgets import over_budget
from flicker.cost.place import delays, part_of, place
from flicker.cost.stamp import rtl_stamp
from flicker.errors import FlickerError
from flicker.output import write_text


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chip", default="tiny", help=f"name of a chip: {', '.join(chips())}")
    parser.add_argument("--chips", help="file with chips of your own")
    parser.add_argument("--board", help=f"name of a board: {', '.join(boards())}")
    parser.add_argument("--family", default=None, help=f"of the device, without a board: {', '.join(COMMANDS)} (default: xcup)")
    parser.add_argument("--route", action="store_true", help="place and route the rendering stage on the board: minutes")
    parser.add_argument("--seed", type=int, help="of the placement (default: 1)")
    options = parser.parse_args()
    console, known = Terminal(), boards()
    if options.board and options.board not in known:
        raise FlickerError(f"BOARD: one of {', '.join(known)}, not {options.board}")
    if options.route:
        if options.family:
            raise FlickerError("--family: not with --route, which takes a board")
        return route(options, console)
    if options.seed is not None:
        raise FlickerError("--seed: of a placement, with --route only")
    family = options.family or (known[options.board].family if options.board else "xcup")
    if options.board and known[options.board].family != family:
        raise FlickerError(f"--family {family}: {options.board} has an {known[options.board].family} device")
    chip = chip_of(options.chip, options.chips)
    found = Fpga(family, lambda unit, seconds: None if seconds is None else console.print(f"{unit}: {seconds:.0f} s", highlight=False))
    key = found.unit("flk_top", chip.parameters)["key"]
    units, all_ = found.by_unit(key), found.total(key)
    table = Table(title=f"{chip.name} on {family}", title_justify="left")
    for name in ("unit", "number", "LUT", "memory in LUTs", "FF", "DSP", "BRAM"):
        table.add_column(name, justify="left" if name == "unit" else "right")
    for module, (number, own) in sorted(units.items(), key=lambda item: -item[1][1].lut):
        table.add_row(module.removeprefix("flk_"), str(number), *_cells(own))
    table.add_row("all", "", *_cells(all_))
    console.print(table)
    fits = True
    for name, board in known.items():
        if board.family == family and options.board in (None, name):
            shares = board.full(all_)
            fits &= max(shares.values()) <= 1.0
            console.print(f"{name}: " + ", ".join(f"{what} {share:.0%}" for what, share in shares.items()), highlight=False)
    write_text(FOLDER / f"{chip.name}-{family}.json", json.dumps({
        "rtl": rtl_stamp(), "parameters": chip.parameters, "all": asdict(all_),
        "units": {module: [number, asdict(own)] for module, (number, own) in units.items()},
    }, indent=1) + "\n")
    over = over_budget(chip.name, units, all_) if family == "xcup" and chip.parameters == chips().get(chip.name, chip).parameters else []
    for line in over:
        console.print(f"over its budget: {line}", highlight=False)
    return 1 if over or not (fits or options.board is None) else 0


def route(options: argparse.Namespace, console: Terminal) -> int:
    """The rendering stage, placed and routed."""
    board = options.board or next(name for name, known in boards().items() if known.nextpnr)
    chip = chip_of(options.chip, options.chips)
    with console.status(f"{chip.name} on {board}") as status:
        found = place(chip, board, 1 if options.seed is None else options.seed, lambda phase: status.update(f"{chip.name} on {board}: {phase}"))
    console.print(f"rendering stage of {chip.name} on {found.board}, seed {found.seed}: {found.mhz:.1f} MHz", highlight=False)
    for name, (used, there) in found.used.items():
        console.print(f"  {name:<14} {used:>7,} of {there:>7,}, {used / there:.0%}", highlight=False)
    shares = ", ".join(f"{ns:.1f} ns {kind}" for kind, ns in delays(found).items())
    console.print(f"longest path, {found.path[-1][0]:.1f} ns ({shares}):", highlight=False)
    for at, kind, cell in found.path:
        if kind != "routing":
            console.print(f"  {at:6.2f} {part_of(cell)}: {cell[-48:]}", highlight=False, markup=False)
    return 0


def _cells(of: Resources) -> list[str]:
    return [f"{of.lut:,}", f"{of.lutram:,}", f"{of.ff:,}", f"{of.dsp:,}", f"{of.bram:,.1f}"]


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"fpga: {error}")
