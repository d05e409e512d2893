"""`make docs PART=energy`: energy of a frame by part, in docs/energy.md."""

from __future__ import annotations

import re

from flicker import markdown
from flicker.explore.configurations import group
from flicker.scene.real import REAL_VIEWS

from .common import Measured, Say, significant

BASE = "gscore"
PREFIX = "energy_uj_"
PARTS = ("VRUs", "feature FIFOs", "mask generators", "counters, arbiters", "ungated clock", "leakage")


def tables(say: Say) -> dict[str, str]:
    """Of the first real view: total, ratio to the base, and microjoules by part."""
    found = Measured(REAL_VIEWS[0]).rows(group("energy"), say)
    rows = []
    for name, row in found.items():
        by_part = [row[PREFIX + re.sub(r"\W+", "_", part)] for part in PARTS]
        rows.append([
            f"`{name}`", f"{row['energy_uj'] / found[BASE]['energy_uj']:.2f}", significant(row["energy_uj"], 2),
            *(significant(value, 2) if value else "0" for value in by_part),
        ])
    return {"": markdown.table(["configuration", f"over `{BASE}`", "uJ", *PARTS], rows)}
