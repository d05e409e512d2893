#!/usr/bin/env python3
"""Area and timing of every unit, from a Yosys netlist (docs/reference/synthesis.md).

Prints tables and writes area.csv, report.md, area.png and area.svg to build/synth, or with another cell library to build/synth/<library>;
`make docs` takes its tables from these.
Exits 1 if a unit cannot be synthesised or has a latch, an unintended memory or an unconnected port.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from flicker.cli.tables import Terminal
from flicker.cost.stamp import LIBERTY
from flicker.cost.synth import report
from flicker.cost.synth.run import FOLDER, Runner
from flicker.cost.synth.units import all_units
from flicker.errors import FlickerError
from flicker.toolchain import ROOT


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--liberty", type=Path, default=LIBERTY, help="cell library (default: our own)")
    parser.add_argument("--unit", help="only the rows of one unit, without comparisons")
    parser.add_argument("--config", help="only this parameter set of the unit, such as 'factored fixed'")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time")
    arguments = parser.parse_args()
    console = Terminal()

    units = all_units()
    if arguments.unit:
        units = [unit for unit in units if unit.name == arguments.unit.removeprefix("flk_")]
        if not units:
            names = ", ".join(sorted({unit.name for unit in all_units()}))
            raise FlickerError(f"no unit {arguments.unit!r}; there are {names}")
    if arguments.config is not None:
        if not arguments.unit:
            raise FlickerError("--config needs --unit")
        names = ", ".join(unit.config for unit in units)
        units = [unit for unit in units if unit.config == arguments.config]
        if not units:
            raise FlickerError(f"no parameter set {arguments.config!r} of {arguments.unit}; there are {names}")
    started = time.monotonic()
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=console,
        transient=True, disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("synthesis")

        def finished(name: str, seconds: float | None) -> None:
            progress.update(task, total=len(runner.tasks), advance=1, description=name.rsplit("-", 1)[0])

        runner = Runner(arguments.liberty, arguments.jobs, finished)
        results = runner.run(units)

    library = runner.liberty.stem
    sheets = [report.units_sheet(results, library)]
    folder = FOLDER if runner.liberty == LIBERTY.resolve() else FOLDER / library
    if not arguments.unit:
        folder.mkdir(parents=True, exist_ok=True)
        comparison = report.Comparison(runner, results)
        sheets += comparison.sheets()
        report.write_csv(folder / "area.csv", results)
        sheets += report.against(folder, FOLDER, library) if folder != FOLDER else []
        report.write_markdown(folder / "report.md", sheets)
        comparison.chart(folder, library)
    for sheet in sheets:
        sheet.print(console)
    console.print(f"synth: {len(units)} rows, {time.monotonic() - started:.0f} s" + (
        "" if arguments.unit else f"; written to {folder.relative_to(ROOT)}"
    ))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"synth: {error}")
