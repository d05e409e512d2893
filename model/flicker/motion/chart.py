"""Figures of a path over time, as a chart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..output import write_atomically
from ..scene.metrics import decibels

_TOP = 100.0  # dB: where equal pictures are drawn


def _shown(values: Sequence[float | None]) -> list[float]:
    return [math.nan if value is None else min(value, _TOP) for value in values]


def write_chart(path: Path, rows: Sequence[dict[str, Any]], title: str, slot: float, fps: float) -> None:
    """A PNG with a panel for what the rows of `record` have: PSNR of the still and of the change, jumps, warping error, cycles with the frame's slot, bytes by
    purpose."""
    from matplotlib.figure import Figure

    time = [row["time_s"] for row in rows]
    panels: list[str] = []
    if any("mse" in row for row in rows):
        panels += ["quality", "jumps"]
    if any(row.get("warping_error") is not None for row in rows):
        panels.append("warping")
    if any("cycles" in row for row in rows):
        panels += ["cycles", "bytes"]
    if not panels:
        panels = ["entries"]
    figure = Figure(figsize=(9, 1.0 + 2.0 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels):
        if panel == "quality":
            axis.plot(time, _shown([decibels(row["mse"]) for row in rows]), label="PSNR")
            axis.plot(time, _shown([None if row["change"] is None else decibels(row["change"]) for row in rows]), label="temporal PSNR")
            axis.set_ylabel("dB")
            axis.legend(loc="best", fontsize=8)
        elif panel == "jumps":
            axis.plot(time, [math.nan if row["jumps"] is None else 100 * row["jumps"] for row in rows], color="tab:red")
            axis.set_ylabel("jumps, % of pixels")
            axis.set_ylim(bottom=0)
        elif panel == "warping":
            for name, label in (("warping_error", "picture"), ("warping_error_reference", "reference")):
                axis.plot(time, [math.nan if row.get(name) is None else row[name] for row in rows], label=label)
            axis.set_ylabel("warping error")
            axis.legend(loc="best", fontsize=8)
        elif panel == "cycles":
            for name, label in (("cycles", "frame to frame"), ("latency_cycles", "a frame alone")):
                axis.plot(time, [row.get(name, math.nan) / 1e6 for row in rows], label=label)
            axis.axhline(slot / 1e6, color="black", linestyle=":", label=f"slot at {fps:g} Hz")
            axis.set_ylabel("million cycles")
            axis.set_ylim(bottom=0)
            axis.legend(loc="best", fontsize=8)
        elif panel == "bytes":
            names = [name for name in rows[0] if name.startswith("bytes_")]
            axis.stackplot(time, [[row.get(name, 0) / 1e6 for row in rows] for name in names], labels=[name.removeprefix("bytes_") for name in names])
            axis.set_ylabel("MB a frame")
            axis.legend(loc="upper left", fontsize=7, ncols=4)
        else:
            axis.plot(time, [row.get("tile_entries") or math.nan for row in rows])
            axis.set_ylabel("tile entries")
    axes[-1].set_xlabel("seconds")
    axes[0].set_title(title, fontsize=10)
    write_atomically(path, lambda place: figure.savefig(place, dpi=110, format="png"))
