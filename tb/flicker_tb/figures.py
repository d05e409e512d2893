"""Figures that a change may not move unseen: cycles, bytes, areas, and how well the cycle model fits the RTL (tb/figures.csv).

A test holds a value against the recorded one; more than TOLERANCE apart, better or worse, it fails until `make record REASON="..."` has written the new one
with its reason. The file carries a digest of each line, so that it is written by that alone.
"""

from __future__ import annotations

import csv
import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

from flicker import toolchain
from flicker.errors import FlickerError

FILE = toolchain.ROOT / "tb" / "figures.csv"
TOLERANCE = 0.01
REASON = "FLICKER_RECORD"  # environment variable: why figures move in this run
_COLUMNS = ("figure", "value", "reason", "digest")


def digest(figure: str, value: str, reason: str) -> str:
    return hashlib.sha256("\0".join((figure, value, reason)).encode()).hexdigest()[:12]


def read(file: Path = FILE) -> dict[str, tuple[str, str]]:
    """Value and reason of each figure. FlickerError for a line that `record` has not written."""
    with file.open(newline="") as rows:
        found = {}
        for row in csv.DictReader(rows):
            if row["digest"] != digest(row["figure"], row["value"], row["reason"]):
                raise FlickerError(f"{file.name}: {row['figure']}: digest does not fit: make record REASON=\"...\" writes figures")
            found[row["figure"]] = row["value"], row["reason"]
    return found


def moved(known: Mapping[str, tuple[str, str]], figure: str, value: float) -> str:
    """What is wrong with a value: an empty text if it is the recorded one."""
    if figure not in known:
        return f"{figure}: {value:.10g} is not recorded"
    old = float(known[figure][0])
    if abs(value - old) <= TOLERANCE * abs(old):
        return ""
    return f"{figure}: {value:.10g}, recorded are {old:.10g} ({value / old - 1:+.1%}; {known[figure][1]})" if old else f"{figure}: {value:.10g}, recorded are 0"


def record(figure: str, value: float, reason: str, file: Path = FILE) -> None:
    """Write a figure that has moved, or that is new."""
    with toolchain.locked(toolchain.BUILD / "tests" / "figures.lock"):
        known = read(file) if file.exists() else {}
        if moved(known, figure, value):
            known[figure] = f"{value:.10g}", reason
        with file.open("w", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(_COLUMNS)
            writer.writerows((name, *entry, digest(name, *entry)) for name, entry in sorted(known.items()))


def hold(figure: str, value: float) -> None:
    """Fails when a figure is not the recorded one; with FLICKER_RECORD, records it."""
    if reason := os.environ.get(REASON, "").strip():
        record(figure, value, reason)
        return
    wrong = moved(read(), figure, value)
    assert not wrong, f'{wrong}: if that is meant, make record REASON="why"'
