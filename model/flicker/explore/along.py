"""Configurations along a camera path: what `evaluate` tells of stills, and what changes from frame to frame (docs/reference/motion.md)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from ..front.view import View
from ..perf.timing import Timing
from ..scene.temporal import Change, TemporalError, summarise
from .evaluate import evaluate
from .points import Target

TOGETHER = 8  # configurations that a frame is drawn with before the next: each keeps its error


def _mean(values: Sequence[Any]) -> Any:
    """Of numbers; None where one is missing. What is no number is the same in all frames."""
    if any(value is None for value in values):
        return None
    return values[0] if isinstance(values[0], (str, bool)) else math.fsum(values) / len(values)


def _row(target: Target, rows: Sequence[dict[str, Any]], changes: Sequence[Change]) -> dict[str, Any]:
    assert target.path is not None
    found, cycles = summarise(changes, target.path.fps), [row["cycles"] for row in rows]
    timing = Timing.of(cycles, 1e9 * target.clock / target.path.fps)
    return {name: _mean([row[name] for row in rows]) for name in rows[0]} | {
        "view": target.view, "width": rows[0]["width"], "height": rows[0]["height"], "psnr_db": found.psnr_db, "path": target.path_title, "frames": len(rows),
        "path_fps": target.path.fps, "temporal_psnr_db": found.temporal_psnr_db, "jumps": found.jumps, "worst_frame": found.worst_frame,
        "worst_frame_db": found.worst_frame_db, "cycles_p50": timing.p50, "cycles_p99": timing.p99, "cycles_worst": timing.worst,
        "cycles_worst_frame": timing.worst_frame, "clock_ghz": target.clock, "late": timing.late,
    }


def evaluate_along(target: Target, names: Sequence[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Rows of configurations along a path, some at a time, each with its name: the columns of `evaluate`, their means over the frames (PSNR: of the mean
    square), and those of the path. cycles are the rendering stage's, late frames those that take it longer than clock / rate."""
    scene, cameras = target.cameras()
    for first in range(0, len(names), TOGETHER):
        some = names[first : first + TOGETHER]
        errors = {name: TemporalError() for name in some}
        rows: dict[str, list[dict[str, Any]]] = {name: [] for name in some}
        changes: dict[str, list[Change]] = {name: [] for name in some}
        for number, camera in enumerate(cameras):
            view = View(camera, scene, name=target.scene.name, number=number, background=target.scene.background, order=target.scene.order)
            for name in some:
                found = evaluate(view, name)
                rows[name].append(found.row)
                changes[name].append(errors[name].add(found.image, view.reference))
        for name in some:
            yield name, _row(target, rows[name], changes[name])
