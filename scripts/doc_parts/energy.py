"""`make docs PART=energy`: energy of a frame by part, in docs/results/energy.md."""

from __future__ import annotations

import re

from flicker import markdown
from flicker.errors import FlickerError
from flicker.explore.configurations import group
from flicker.scene.real import REAL_VIEWS

from .common import Measured, Say, significant

BASE = "gscore"
PREFIX = "energy_uj_"
# Heads of the table with the parts that the stages of channels and of lanes have for them.
PARTS = {
    "VRUs or lanes": ("VRUs", "lanes"), "FIFOs, queues, store": ("feature FIFOs", "queues", "store, dispatch, output"),
    "mask generators, setup": ("mask generators", "setup and masks"), "counters, arbiters": ("counters, arbiters", "counters"),
    "ungated clock": ("ungated clock",), "leakage": ("leakage",),
}


def tables(say: Say) -> dict[str, str]:
    """Of the first real view: total, ratio to the base, and microjoules by part."""
    found = Measured(REAL_VIEWS[0]).rows(group("energy"), say)
    rows = []
    for name, row in found.items():
        by_part = [sum(row.get(PREFIX + re.sub(r"\W+", "_", part)) or 0.0 for part in parts) for parts in PARTS.values()]
        if abs(sum(by_part) / row["energy_uj"] - 1) > 1e-6:
            raise FlickerError(f"energy: {name}: parts of the stage that the table does not have")
        rows.append([
            f"`{name}`", f"{row['energy_uj'] / found[BASE]['energy_uj']:.2f}", significant(row["energy_uj"], 2),
            *(significant(value, 2) if value else "0" for value in by_part),
        ])
    return {"": markdown.table(["configuration", f"over `{BASE}`", "uJ", *PARTS], rows)}
