"""`make docs PART=synthesis` and `PART=library`: tables of docs/results/synthesis.md from the results of `make synth`.

Nothing is synthesised here: what build/synth lacks is named.
"""

from __future__ import annotations

from pathlib import Path

from flicker.cost.stamp import LIBERTY, rtl_stamp
from flicker.cost.synth import report
from flicker.cost.synth.run import FOLDER, UNITS, Runner
from flicker.cost.synth.units import all_units
from flicker.errors import FlickerError
from flicker.toolchain import ROOT

from .areas import unsynthesised
from .common import Say


def missing() -> str | None:
    """Why there is nothing to write."""
    if not UNITS.exists():
        return "no results of synthesis; run make synth first"
    lacking = unsynthesised()
    return f"build/synth lacks {len(lacking)} results of this RTL ({lacking[0]}, ...); run make synth first" if lacking else None


def stamp() -> str:
    """Begin of a place with results of synthesis: of which RTL they are (`flicker.cost.stamp`)."""
    return f"Synthesised from RTL {rtl_stamp()}.\n\n"


def tables(say: Say) -> dict[str, str]:
    """`units`: all tables of docs/results/synthesis.md, those of units last. `summary`: the first one there."""
    runner = Runner(LIBERTY)
    results = runner.run(all_units())  # of the cache
    comparison = report.Comparison(runner, results)
    sheets = [*comparison.sheets(), report.units_sheet(results, LIBERTY.stem)]
    return {"units": stamp() + "\n".join(sheet.markdown() for sheet in sheets), "summary": f"<!-- RTL {rtl_stamp()} -->\n" + comparison.summary().table()}


def _libraries() -> list[Path]:
    return sorted(path.parent for path in FOLDER.glob("*/area.csv"))


def library_missing() -> str | None:
    """Why another library cannot be put beside our own."""
    if not (FOLDER / "area.csv").exists():
        return "build/synth/area.csv is not there; run make synth first"
    return None if _libraries() else "no other cell library; run make synth LIBERTY=path first"


def library_tables(say: Say) -> dict[str, str]:
    """Ratios between units in every other library that `make synth LIBERTY=path` has been run with."""
    sheets = [report.against(folder, FOLDER, folder.name)[:1] for folder in _libraries()]
    if not all(sheets):
        raise FlickerError(f"{FOLDER.relative_to(ROOT)}: an area.csv is incomplete; run make synth again")
    return {"": stamp() + "\n".join(sheet.markdown() for (sheet,) in sheets)}
