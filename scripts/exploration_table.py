#!/usr/bin/env python3
"""Tables of docs/exploration.md from a report's summary.csv.

    flicker report SCENES... --out build/report && scripts/exploration_table.py [build/report/summary.csv] [--print]

Writes its parts of docs/exploration.md and README.md and copies the chart of speed against accuracy; --print only prints.
"""

from __future__ import annotations

import csv
import shutil
import sys
from pathlib import Path

import pages
from flicker.explore.methods import get_method

from flicker import markdown
from flicker.cost.area import lane_stage_parts
from flicker.errors import FlickerError
from flicker.explore.evaluate import LANES_METHOD, get_configuration
from flicker.perf.lane_stage import LaneStage

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "exploration.md"
README = ROOT / "README.md"
NAME = "scripts/exploration_table.py"
SUMMARY = ("vanilla", "gscore", "no-ctu-64", "faithful", "flicker", "rows-ellipse", "lanes", "lanes-deep", "lanes-64")
GROUPS = (
    ("rivals and the RTL", ("gscore", "seele", "no-ctu-32", "faithful", "flicker")),
    ("barriers, finished sub-tiles, FIFOs, VRUs", ("flicker-barrier", "flicker-stop", "flicker-fifo-64", "flicker-16", "flicker-64")),
    ("exact rectangle, by format", ("exact", "exact-e4m4", "exact-e5m3", "exact-e4m3", "exact-e5m2", "exact-q8.8")),
    ("only pixels that contribute", ("rows-minitile", "rows", "rows-ellipse", "rows-ellipse-64", "oracle")),
    ("lanes", ("lanes", "lanes-deep", "lanes-64", "oracle-lanes")),
    ("accumulators", ("lanes-fp16", "lanes-acc10", "lanes-acc12", "lanes-acc16", "lanes-acc20")),
)


def read(path: Path) -> dict[str, dict[str, dict[str, str]]]:
    """Rows by view and configuration."""
    if not path.is_file():
        raise FlickerError(f"{path}: no such file; run flicker report first")
    views: dict[str, dict[str, dict[str, str]]] = {}
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            views.setdefault(f"{row['scene']} {row['view']}", {})[row["config"]] = row
    return views


def explored(views: dict[str, dict[str, dict[str, str]]]) -> str:
    """Every explored configuration: area, and of each view PSNR, cycles, share of the bound, energy."""
    lines = ["| configuration | what | MGE | " + " | ".join(views) + " |", "|---" * (3 + len(views)) + "|"]
    for title, names in GROUPS:
        lines.append(f"| **{title}** |" + " |" * (2 + len(views)))
        for name in names:
            cells = []
            for rows in views.values():
                row = rows.get(name)
                if row is None:
                    cells.append("")
                    continue
                psnr, cycles, share, energy = (float(row[key]) for key in ("psnr_db", "cycles", "bound_share", "energy_uj"))
                cells.append(f"{psnr:.1f} / {cycles / 1e6:.3f} / {share:.0%} / {energy:.0f}")
            area = next((float(rows[name]["area_ge"]) for rows in views.values() if name in rows), None)
            what = get_configuration(name).title
            lines.append(f"| `{name}` | {what} | {'' if area is None else f'{area / 1e6:.2f}'} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def summary(views: dict[str, dict[str, dict[str, str]]]) -> str:
    """For the README: what this project is about, in few rows."""
    rows = []
    for name in SUMMARY:
        found = [view.get(name) for view in views.values()]
        first = next((row for row in found if row), None)
        if first is None:
            raise FlickerError(f"summary.csv: no row of {name}")
        rows.append([
            f"`{name}`", get_configuration(name).title, f"{float(first['area_ge']) / 1e6:.2f}", "model" if first["model_only"] == "True" else "RTL",
            *("" if row is None else f"{float(row['cycles']) / 1e6:.2f} / {float(row['psnr_db']):.1f} / {float(row['energy_uj']):,.0f}" for row in found),
        ])
    return markdown.table(["configuration", "what", "MGE", "from", *views], rows)


def lanes_that_fit(area: float) -> int:
    """How many lanes of four pixels with FIFOs of depth 4 an area has room for, beside mask generators, counters and arbiters."""
    method = get_method(LANES_METHOD)
    parts = lane_stage_parts(LaneStage(), method.operations, 64, 4, method.accumulator)
    return int((area - sum(parts.values())) // ((parts["VRUs"] + parts["feature FIFOs"]) / 64)) + 64


def halves(views: dict[str, dict[str, dict[str, str]]]) -> str:
    """Half of GSCore's cycles at its area: what it takes, what is reached."""
    lines = [
        "| view | GSCore, M cycles | half | VRUs that half needs, all busy with what contributes | the same with what lanes-64 visits | lanes that fit "
        "| fastest configuration that fits | M cycles | reached |", "|---|---|---|---|---|---|---|---|---|",
    ]
    for view, rows in views.items():
        if not {"gscore", "lanes-64"} <= rows.keys():
            continue
        area, cycles = float(rows["gscore"]["area_ge"]), float(rows["gscore"]["cycles"])
        half = cycles / 2
        fitting = {
            name: float(row["cycles"]) for name, row in rows.items()
            if float(row["area_ge"]) <= area and float(row["psnr_db"]) >= 58 and not name.startswith(("oracle", "flicker-barrier"))
        }
        best = min(fitting, key=fitting.get)
        lanes = rows["lanes-64"]
        visits = float(lanes["vru_utilisation"]) * float(lanes["cycles"]) * 64
        lines.append(
            f"| {view} | {cycles / 1e6:.3f} | {half / 1e6:.3f} | {float(lanes['pixels_contributing']) / half:.1f} | {visits / half:.1f} | "
            f"{lanes_that_fit(area)} | `{best}`, {float(rows[best]['area_ge']) / 1e6:.2f} MGE | {fitting[best] / 1e6:.3f} | "
            f"{'yes' if fitting[best] <= half else 'no'} |"
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    arguments = [a for a in sys.argv[1:] if a != "--print"]
    source = Path(arguments[0]) if arguments else ROOT / "build" / "report" / "summary.csv"
    views = read(source)
    text = f"{explored(views)}\n{halves(views)}"
    if "--print" in sys.argv:
        print(text)
        return 0
    pages.put(PAGE, NAME, text)
    pages.put(README, NAME, summary(views))
    shutil.copy(source.parent / "figures" / "speed_accuracy.png", ROOT / "docs" / "images")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"exploration_table: {error}")
