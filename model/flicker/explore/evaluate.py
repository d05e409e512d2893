"""One configuration on one view: picture, cycles, quality, area, energy. What report and sweeps are made of.

    view = load_view("scene.ply", 0, (1280, 720))
    row = evaluate(view, "flicker").row
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..front.view import View
from ..params import CHANNELS, SUBTILE
from ..perf.work import Work
from ..scene import metrics
from .configurations import get_configuration
from .machine import Configuration, Counters, Result, run

CLOCK_HZ = 1e9


@dataclass
class Evaluation:
    """row: numbers by column; `photo_psnr_db`, `photo_ssim`, and the same of the float64 reference with `reference_` before, are against the view's
    photograph, None where it has none. counters: None where no cycle model of the stage applies (its cycles are a closed form).
    energy: microjoules by part."""

    configuration: Configuration
    row: dict[str, Any]
    image: np.ndarray
    work: Work
    counters: Counters | None
    energy: dict[str, float]


def draw(view: View, configuration: Configuration) -> Result:
    """`run`, kept by the view until another picture is asked for."""
    key = configuration.picture_key(), configuration.stop
    kept: dict = view.keep("last result", dict)
    if key not in kept:
        kept.clear()  # before the next one takes its memory
        kept[key] = run(configuration, view)
    return kept[key]


def channel_slots(work: Work) -> np.ndarray:
    """int64 (S, 4): pixels that each channel visits in each sub-tile."""
    visited = np.bitwise_count(work.visit_masks() & work.unfinished()).astype(np.int64)
    sums = np.concatenate([np.zeros((1, CHANNELS), np.int64), visited.cumsum(axis=0)])
    return sums[work.start[1:]] - sums[work.start[:-1]]


def work_counts(work: Work, width: int, height: int) -> dict[str, float]:
    """Totals of the work; `listed_per_pixel`: elements of a pixel's list; `visited_per_pixel`: those a VRU visits before the pixel is
    finished; `imbalance`: busiest channel over the mean of the four, sub-tiles weighted by their work."""
    pixels = width * height
    totals = work.totals()
    slots = channel_slots(work)
    return totals | {
        "listed_per_pixel": totals["elements"] * SUBTILE * SUBTILE / pixels,
        "visited_per_pixel": totals["pixels_visited"] / pixels,
        "contributing_per_pixel": totals["pixels_contributing"] / pixels,
        "leaders_per_element": totals["evaluations"] / max(totals["elements"], 1),
        "imbalance": float(CHANNELS * slots.max(axis=1).sum() / max(slots.sum(), 1)),
    }


def photo_quality(view: View, image: np.ndarray, prefix: str = "") -> dict[str, float | None]:
    """A picture of the view against its photograph."""
    if view.photo is None:
        return {f"{prefix}photo_psnr_db": None, f"{prefix}photo_ssim": None}
    return {f"{prefix}photo_psnr_db": metrics.psnr(image, view.photo), f"{prefix}photo_ssim": metrics.ssim(image, view.photo)}


def evaluate(view: View, configuration: Configuration | str) -> Evaluation:
    """Run a configuration on a view."""
    if isinstance(configuration, str):
        configuration = get_configuration(configuration)
    result = draw(view, configuration)
    work = result.work
    cycles, counters = configuration.simulate(work)
    energy = configuration.energy(work, cycles, counters)
    counts = work_counts(work, view.camera.width, view.camera.height)
    bound = counts["pixels_contributing"] / configuration.vrus
    row = {
        "scene": view.name, "view": view.number, "config": configuration.name, "title": configuration.title,
        "width": view.camera.width, "height": view.camera.height, "cycles": cycles, "fps": CLOCK_HZ / cycles if cycles else None,
        "bound_cycles": bound, "bound_share": bound / cycles if cycles else None,
        "psnr_db": metrics.psnr(result.image, view.reference), "ssim": metrics.ssim(result.image, view.reference),
        "flip": metrics.flip(result.image, view.reference), **photo_quality(view, result.image), **photo_quality(view, view.reference, "reference_"),
        "area_ge": configuration.area(), "energy_uj": sum(energy.values()),
        "vru_utilisation": configuration.stage.utilisation(counters) if counters else None, "ctu_stall_rate": counters.stall_rate if counters else None,
        "model_only": configuration.model_only, **counts, **{"energy_uj_" + re.sub(r"\W+", "_", part): value for part, value in energy.items()},
    }
    return Evaluation(configuration, row, result.image, work, counters, energy)
