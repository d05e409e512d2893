"""One configuration on one view: picture, cycles, quality, area, energy. What report and sweeps are made of.

    data = load_view("scene.ply", 0)
    row = evaluate(data, CONFIGURATIONS["flicker"]).row
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..scene import metrics
from ..cost.area import lane_stage_parts, stage_area
from ..scene.camera import Camera, find_cameras, select_view
from ..cost.energy import stage_energy
from ..errors import FlickerError
from .methods import Method, Result, View, get_method, run
from ..perf.work import Work
from ..params import CHANNELS, CORES, FAITHFUL, CatMode, Precision, RenderConfig
from ..perf.lane_stage import LaneStage, simulate_lanes
from ..perf.pixel_stage import simulate_pixels
from ..perf.render_stage import StageCycles, simulate
from ..front.projection import Projected, project
from ..front.reference import render_reference
from ..scene.files import load_scene

CLOCK_HZ = 1e9


@dataclass(frozen=True)
class Configuration:
    """A machine: a method (flicker.explore.methods) on a rendering stage.

    vrus_per_channel, fifo_depth, ctu_fifo_depth: as in RenderConfig. barrier: all cores wait for each other after
    every tile (the cycles are then idealised: no latencies). lanes: the VRUs are lanes of their own (perf.lane_stage). stop: the rest of a
    list is not streamed once all pixels of its sub-tile are finished; idealised, known at once. title: for tables.
    """

    name: str
    method: str
    title: str = ""
    vrus_per_channel: int = 2
    fifo_depth: int = 16
    ctu_fifo_depth: int = 0
    barrier: bool = False
    lanes: LaneStage | None = None
    stop: bool = False

    @property
    def vrus(self) -> int:
        """VRUs of the stage."""
        return CORES * CHANNELS * self.vrus_per_channel

    @property
    def model_only(self) -> bool:
        """No RTL exists."""
        return get_method(self.method).model_only or self.barrier or self.stop


LANES_METHOD = "rows-f8a8-ellipse-acc14"


def _configurations() -> dict[str, Configuration]:
    found = [
        Configuration("vanilla", "vanilla", "vanilla 3DGS, AABB on 16x16 tiles"),
        Configuration("no-ctu-32", "no_ctu", "FLICKER without CTU, 32 VRUs"),
        Configuration("no-ctu-64", "no_ctu", "FLICKER without CTU, 64 VRUs", vrus_per_channel=4),
        Configuration("gscore", "gscore", "GSCore: OBB on 8x8 sub-tiles, 64 VRUs", vrus_per_channel=4),
        Configuration("seele", "seele", "SeeLe: leader pixel of each 2x2 group"),
        Configuration("faithful", "faithful", "FLICKER as in the paper", ctu_fifo_depth=FAITHFUL.ctu_fifo_depth),
        Configuration("faithful-barrier", "faithful", "FLICKER as in the paper, barrier after every tile", barrier=True),
        Configuration("flicker", "flicker", "FLICKER, default configuration"),
        Configuration("flicker-barrier", "flicker", "FLICKER, default, barrier after every tile", barrier=True),
    ]
    for form in ("factored", "conic"):
        for precision in Precision:
            for mode in ("dense", "sparse", "smooth", "spiky", "auto"):
                method = f"flicker-{mode}-{precision.name.lower()}-{form}"
                found.append(Configuration(method, method, f"FLICKER, {mode}, {precision.name.lower()}, {form}"))
    found += [
        Configuration("flicker-stop", "flicker", "FLICKER, default, finished sub-tiles are left at once", stop=True),
        Configuration("flicker-16", "flicker", "FLICKER, default, 16 VRUs", vrus_per_channel=1),
        Configuration("flicker-64", "flicker", "FLICKER, default, 64 VRUs", vrus_per_channel=4),
        Configuration("flicker-fifo-64", "flicker", "FLICKER, default, FIFO depth 64", fifo_depth=64),
        Configuration("exact", "exact", "exact rectangle per mini-tile, FP16 bound"),
        *(Configuration(f"exact-{f}", f"exact-{f}-factored", f"exact rectangle per mini-tile, {f.upper()}") for f in ("e4m3", "e5m2", "e5m3", "e4m4", "q8.8")),
        Configuration("rows-minitile", "rows_minitile-f8a8", "row intervals, mini-tile masks"),
        Configuration("rows", "rows-f8a8", "row intervals, pixel masks"),
        Configuration("rows-ellipse", "rows-f8a8-ellipse", "row intervals, pixel masks, lists by the ellipse"),
        Configuration("rows-ellipse-64", "rows-f8a8-ellipse", "the same, FIFO depth 64", fifo_depth=64),
        Configuration("lanes", LANES_METHOD, "row intervals, independent lanes, fixed-point accumulators", lanes=LaneStage(window=2)),
        Configuration(
            "lanes-deep", LANES_METHOD, "lanes, FIFO depth 40, two elements a cycle", fifo_depth=40, lanes=LaneStage(window=3, width=2),
        ),
        Configuration(
            "lanes-64", LANES_METHOD, "64 lanes, FIFO depth 4", vrus_per_channel=4, fifo_depth=4, lanes=LaneStage(window=2),
        ),
        Configuration("lanes-fp16", "rows-f8a8-ellipse", "lanes, FP16 accumulators and their loop", lanes=LaneStage(window=2, loop=4)),
        *(Configuration(f"lanes-acc{bits}", f"rows-f8a8-ellipse-acc{bits}", f"lanes, accumulators of {bits} fraction bits", lanes=LaneStage(window=2))
          for bits in (10, 12, 16, 20)),
        Configuration("oracle", "oracle", "free exact pixel masks"),
        Configuration("oracle-lanes", "oracle", "free exact pixel masks, stage as in lanes-deep", fifo_depth=40, lanes=LaneStage(window=3, width=2)),
    ]
    return {c.name: c for c in found}


CONFIGURATIONS = _configurations()


def get_configuration(name: str) -> Configuration:
    """A configuration by name; FlickerError, naming close ones, if there is none."""
    if name not in CONFIGURATIONS:
        import difflib

        close = difflib.get_close_matches(name, CONFIGURATIONS, 3, 0.3)
        raise FlickerError(f"configuration '{name}' is unknown; close names: {', '.join(close) or 'none'}")
    return CONFIGURATIONS[name]


@dataclass
class ViewData:
    """A view with what all configurations share. reference: float64 picture (H, W, 3)."""

    scene: str
    view: int
    camera: Camera
    projected: Projected
    reference: np.ndarray
    methods_view: View
    _last: Result | None = field(default=None, repr=False)

    def result(self, method: Method) -> Result:
        """A method's result, kept until another method is asked for."""
        if self._last is None or self._last.method.name != method.name:
            self._last = None  # before the next one takes its memory
            self._last = run(method, self.methods_view)
        return self._last


def load_view(scene: str | Path, view: int = 0, width: int = 1280, height: int = 720, cameras: str | Path | None = None) -> ViewData:
    """Load, project and render the reference. scene: a file, or `demo` for the project's own scene."""
    if str(scene) == "demo":
        from ..scene.demo import demo_cameras, generate

        loaded, found, name = generate(), demo_cameras(), "demo"
    else:
        loaded = load_scene(scene)
        found = find_cameras(loaded, cameras)
        name = Path(scene).name.split(".")[0]
    camera = select_view(found, view).resized(width, height)
    projected = project(loaded, camera)
    return ViewData(name, view, camera, projected, render_reference(projected, camera), View(projected, camera))


@dataclass
class Evaluation:
    """row: numbers by column. stage: None where no cycle model of the stage applies (its cycles are a closed form).
    energy: microjoules by part."""

    configuration: Configuration
    row: dict[str, Any]
    image: np.ndarray
    work: Work
    stage: StageCycles | None
    energy: dict[str, float]


def _per_core(work: Work, cycles: np.ndarray) -> int:
    """Largest sum over the cores' sub-tiles."""
    return int(max(cycles[work.order[a:b]].sum() for a, b in zip(work.core_start, work.core_start[1:])))


def taken_by_subtiles(work: Work) -> np.ndarray:
    """int64 (S,): splats that a sub-tile takes as a whole, until all its pixels are finished."""
    return np.minimum(work.finish().max(axis=1) + 1, np.diff(work.start)).astype(np.int64)


def gscore_cycles(work: Work, vrus: int) -> int:
    """The work unit is the sub-tile: every listed splat takes 64 pixels on a core's VRUs, until all are finished. Idealised."""
    return _per_core(work, taken_by_subtiles(work) * (64 * CORES // vrus))


def barrier_cycles(work: Work, vrus_per_channel: int) -> int:
    """Sum over tiles of the busiest channel or CTU of their four sub-tiles. Idealised: no latencies, perfect buffering inside a tile."""
    sent = (work.visit_masks() & work.unfinished()) != 0
    edges = work.start[:-1]
    counts = np.zeros((work.subtiles, CHANNELS), np.int64)
    test = np.zeros(work.subtiles, np.int64)
    full = np.diff(work.start) > 0
    counts[full] = np.add.reduceat(sent.astype(np.int64), edges[full], axis=0)
    test[full] = np.add.reduceat(work.test_cycles.astype(np.int64), edges[full])
    slowest = np.maximum(counts.max(axis=1) * (16 // vrus_per_channel), test).reshape(work.rows, work.cols)
    padded = np.pad(slowest, ((0, work.rows % 2), (0, work.cols % 2)))
    return int(padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2).max(axis=(1, 3)).sum())


def stage_cycles(configuration: Configuration, work: Work) -> tuple[int, StageCycles | None]:
    """Cycles of the rendering stage and, where the stage is modelled cycle by cycle, its counters."""
    method = get_method(configuration.method)
    config = RenderConfig(
        form=method.form, fifo_depth=configuration.fifo_depth, ctu_fifo_depth=configuration.ctu_fifo_depth,
        vrus_per_channel=configuration.vrus_per_channel,
    )
    if method.config is not None:
        config = config.with_(precision=method.config.precision, cat=method.config.cat)
    if configuration.barrier:
        return barrier_cycles(work, configuration.vrus_per_channel), None
    if method.name.startswith("gscore"):
        return gscore_cycles(work, configuration.vrus), None
    if configuration.lanes is not None:
        stage = simulate_lanes(work, config, configuration.lanes, configuration.vrus // CORES)
    elif work.visit is not None:
        stage = simulate_pixels(work, config)
    else:
        stage = simulate(work, config)
    return stage.cycles, stage


def evaluate(data: ViewData, configuration: Configuration | str) -> Evaluation:
    """Run a configuration on a view."""
    if isinstance(configuration, str):
        configuration = get_configuration(configuration)
    method = get_method(configuration.method)
    result = data.result(method)
    work = result.work.until_finished() if configuration.stop else result.work
    cycles, stage = stage_cycles(configuration, work)
    totals = work.totals()
    tests = method.config is not None and method.config.cat != CatMode.OFF
    precision = method.config.precision if tests else None
    generated = method.family not in ("baseline", "oracle") or method.name.startswith("seele")
    stage_size = {"vrus": configuration.vrus, "fifo_depth": configuration.fifo_depth, "ctu_fifo_depth": configuration.ctu_fifo_depth}
    generator = method.operations if generated and not tests else None
    if configuration.lanes is not None:
        area = sum(lane_stage_parts(configuration.lanes, generator, configuration.vrus, configuration.fifo_depth, method.accumulator).values())
    else:
        area = stage_area(method.form, precision, **stage_size, generator=generator, pixels=method.pixels)
    whole_subtiles = method.name.startswith("gscore")
    energy = stage_energy(
        work, stage, method.form, precision, cycles=cycles, operations=method.operations, **stage_size,
        pairs=64 * int(taken_by_subtiles(work).sum()) if whole_subtiles else None, area=area, lanes=configuration.lanes is not None,
    )
    bound = totals["pixels_contributing"] / configuration.vrus
    # A lane counts its own pixels, a channel of the RTL the cycles in which its VRUs work.
    utilisation = stage.utilisation / (configuration.vrus_per_channel if configuration.lanes else 1) if stage else None
    row = {
        "scene": data.scene, "view": data.view, "config": configuration.name, "title": configuration.title,
        "width": data.camera.width, "height": data.camera.height, "cycles": cycles, "fps": CLOCK_HZ / cycles if cycles else None,
        "bound_cycles": bound, "bound_share": bound / cycles if cycles else None,
        "psnr_db": metrics.psnr(result.image, data.reference), "ssim": metrics.ssim(result.image, data.reference),
        "flip": metrics.flip(result.image, data.reference), "area_ge": area, "energy_uj": sum(energy.values()),
        "vru_utilisation": utilisation, "ctu_stall_rate": stage.stall_rate if stage else None,
        "model_only": configuration.model_only, **totals, **{"energy_uj_" + re.sub(r"\W+", "_", part): value for part, value in energy.items()},
    }
    return Evaluation(configuration, row, result.image, work, stage, energy)
