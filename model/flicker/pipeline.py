"""From a scene and a camera to a picture, its statistics and its distance from the reference, with any engine."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from . import params
from .front.records import build_lists
from .front.view import View
from .golden.render import render_golden
from .params import CHANNELS, CORES, RenderConfig
from .progress import Steps
from .scene.metrics import psnr
from .sim.render_stage import build, render_rtl


class Engine(str, Enum):
    """What renders the picture."""

    REFERENCE = "reference"  # float64, vanilla rules
    GOLDEN = "golden"  # bit-true model
    RTL = "rtl"  # verilated rendering stage


@dataclass
class Rendered:
    """A picture (float (H, W, 3), unquantised) and its statistics (what stats.json holds)."""

    image: np.ndarray
    stats: dict[str, Any]


def rtl_stats(rtl, config: RenderConfig) -> dict[str, Any]:
    """Cycles, counters and utilisation of a simulated frame."""
    cores = []
    for k in range(CORES):
        core: dict[str, Any] = {name: int(rtl.core_counter(name)[k]) for name, _ in params.CORE_COUNTERS}
        core["channels"] = [
            {name: int(rtl.channel_counter(name)[k, c]) for name, _ in params.CHANNEL_COUNTERS} for c in range(CHANNELS)
        ]
        cores.append(core)
    cycles = rtl.cycles
    return {
        "cycles": cycles,
        "simulated_cycles_per_second": round(cycles / rtl.seconds) if rtl.seconds else None,
        "vru_utilisation": float(rtl.channel_counter("vru_busy").sum() / (cycles * CORES * CHANNELS)),
        "ctu_utilisation": float(rtl.core_counter("ctu_busy").sum() / (cycles * CORES)),
        "ctu_stall_rate": float(rtl.core_counter("ctu_stalled").sum() / (cycles * CORES)),
        "vrus": CORES * CHANNELS * config.vrus_per_channel,
        "cores": cores,
    }


def render_view(
    view: View,
    *,
    engine: Engine = Engine.GOLDEN,
    config: RenderConfig = RenderConfig(),
    compare: bool = False,
    steps: Steps | None = None,
) -> Rendered:
    """Render a view of a scene.

    compare: also render the float64 reference and report `psnr_db` (None when the pictures are equal).
    """
    steps = steps or Steps()
    scene, camera = view.scene, view.camera
    with steps.step("projecting"):
        projected = view.projected
    stats: dict[str, Any] = {
        "scene": str(scene.path),
        "view": view.number,
        "width": camera.width,
        "height": camera.height,
        "engine": engine.value,
        "form": config.form.name.lower(),
        "precision": config.precision.name.lower(),
        "cat": config.cat.name.lower(),
        "fifo_depth": config.fifo_depth,
        "coords": config.coords.name.lower(),
        "gaussians": len(scene.means),
        "gaussians_left_out": dict(scene.rejected),
        "visible": len(projected.depth),
    }
    with steps.step("building sub-tile lists"):
        lists = build_lists(projected, camera, config)
    stats["tile_pairs"] = lists.tile_pairs
    stats["subtile_pairs"] = len(lists.entry)
    stats["adjusted"] = lists.adjusted
    if engine is Engine.RTL:
        with steps.step("building the simulator (once per configuration)"):
            build(config)
        with steps.bar("simulating the RTL") as report:
            rtl = render_rtl(lists, config, progress=report)
        image = rtl.image(view.background)
        sent = int(rtl.channel_counter("minitiles_sent").sum())
        stats |= {"minitiles_sent": sent, "pixel_pairs": 16 * sent} | rtl_stats(rtl, config)
    elif engine is Engine.GOLDEN:
        with steps.step("rendering with the golden model"):
            frame = render_golden(lists, config)
        image = frame.image(view.background)
        sent = frame.total("minitiles_sent")
        stats |= {
            "minitiles_sent": sent,
            "pixel_pairs": 16 * sent,
            "pairs_blended": frame.total("pairs_blended"),
            "minitiles_tested": frame.total("minitiles_tested"),
            "gaussians_rejected": frame.total("rejected"),
            "pixels_finished": frame.total("pixels_finished"),
            "ctu_cycles": frame.total("test_cycles"),
            "subtiles_fallen": frame.total("fallen"),
        }
    if engine is Engine.REFERENCE or compare:
        with steps.step("rendering the float64 reference"):
            reference = view.reference
    if engine is Engine.REFERENCE:
        image = reference
        stats |= {"minitiles_sent": None, "pixel_pairs": None}
    if compare:
        value = psnr(image, reference)
        stats["psnr_db"] = value if np.isfinite(value) else None
    return Rendered(image, stats)
