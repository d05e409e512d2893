"""From a scene and a camera to a picture, its statistics and its distance from the reference, with any engine."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from enum import Enum
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from . import params
from .errors import FlickerError, FlickerWarning
from .front.records import SubtileLists, bin_splats, build_lists
from .front.reference import render_with_transmittance
from .front.view import View
from .golden.front.blend import blend_records
from .golden.front.frame import FrontFrame, ListKind, run_front
from .golden.front.record import RecordKind
from .golden.front.reuse import Reuse
from .golden.lanes.formats import FORMATS as LANE_FORMATS
from .golden.lanes.lists import RecordLists, float_lists, front_lists
from .golden.lanes.render import COUNTS as LANE_COUNTS
from .golden.lanes.render import LaneFrame, render_lanes
from .golden.render import coverage, render_golden
from .params import CHANNELS, CORES, Coords, RenderConfig
from .progress import Steps
from .scene.files import scene_kind
from .scene.gaussians import Scene
from .scene.metrics import psnr
from .scene.packed import PackedFormat, PackedScene, load_packed
from .scene.packing import Packing, pack, pack_file
from .scene.steps import measure_steps
from .sim.preprocessing import build as build_front
from .sim.preprocessing import front_frame
from .sim.render_stage import RtlFrame, build, render_rtl


class Engine(str, Enum):
    """What renders the picture.

    REFERENCE: float64, vanilla rules. GOLDEN: bit-true model. RTL: verilated rendering stage. CHIP_GOLDEN: bit-true model of the whole chip. CHIP: verilated
    chip, from a packed scene in memory to a frame buffer in memory.
    """

    REFERENCE = "reference"
    GOLDEN = "golden"
    RTL = "rtl"
    CHIP_GOLDEN = "chip-golden"
    CHIP = "chip"

    @property
    def whole(self) -> bool:
        """The engine has a front end of its own."""
        return self in (Engine.CHIP_GOLDEN, Engine.CHIP)


class Front(str, Enum):
    """What makes records and lists of a scene. FLOAT: float64 on the host. GOLDEN: bit-true model of the front end. RTL: verilated front end."""

    FLOAT = "float"
    GOLDEN = "golden"
    RTL = "rtl"


@dataclass(frozen=True)
class FrontOptions:
    """What the front end reads and writes; not for `Front.FLOAT`.

    format: of the scene in memory; None: that of a packed scene, else chunk. lists: what lists a splat in a tile. rechunk: make clusters anew of a file that
    brings its own.
    """

    format: PackedFormat | None = None
    lists: ListKind = ListKind.ELLIPSE
    rechunk: bool = False


@dataclass
class Rendered:
    """A picture (float (H, W, 3), unquantised) and its statistics (what stats.json holds). alpha: float (H, W), what the Gaussians cover of each pixel, by the
    same engine; None: was not asked for."""

    image: np.ndarray
    stats: dict[str, Any]
    alpha: np.ndarray | None = None


def rtl_stats(rtl: RtlFrame, config: RenderConfig) -> dict[str, Any]:
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


def lane_rtl_stats(rtl: RtlFrame, config: RenderConfig) -> dict[str, Any]:
    """`rtl_stats` of the lanes: a visit is useful when it is blended or finishes its pixel."""
    count = {name: int(rtl.core_counter(name).sum()) for name in rtl.names}
    slots = rtl.cycles * config.lanes
    return {
        "pixel_pairs": count["visits"], "pairs_blended": count["blended"], "pixels_finished": count["pixels_finished"],
        "cycles": rtl.cycles,
        "simulated_cycles_per_second": round(rtl.cycles / rtl.seconds) if rtl.seconds else None,
        "lane_utilisation": (count["blended"] + count["pixels_finished"]) / slots,
        "lanes": {
            "lanes": config.lanes, "visited": count["visits"], "skipped": count["skipped"], "blended": count["blended"],
            "waiting": {"no entry": count["starved"] / slots, "bank taken": count["bank_waits"] / slots},
        },
        "cores": [{name: int(rtl.core_counter(name)[k]) for name in rtl.names} for k in range(config.cores)],
    }


def packing_of(scene: Scene, form: PackedFormat | None, steps: Steps | None = None, rechunk: bool = False) -> Packing:
    """The memory image of a scene: the file itself if it is one, else made now; a file that comes in chunks keeps them. What is kept has every Gaussian of the
    file, those too that `load_scene` leaves out. rechunk: keep nothing, make clusters anew."""
    path = scene.path
    if path is None or rechunk:
        return pack(scene, form or PackedFormat.CHUNK, steps=steps)
    if scene_kind(path) == "image":
        packed = load_packed(path)
        if form not in (None, packed.format):
            raise FlickerError(f"{path}: is packed as {packed.format.value}, not {form.value if form else ''}")
        return Packing(packed, np.arange(len(packed)), brought=True)
    return pack_file(path, form or PackedFormat.CHUNK, steps=steps)


# The last image of each scene that is still in use.
_PACKED: WeakKeyDictionary[Scene, tuple[tuple[PackedFormat | None, bool], Packing]] = WeakKeyDictionary()


def _kept_packing(scene: Scene, form: PackedFormat | None, rechunk: bool) -> Packing:
    """`packing_of`, kept for the next view of the same scene."""
    kept = _PACKED.get(scene)
    if kept is None or kept[0] != (form, rechunk):
        kept = _PACKED[scene] = ((form, rechunk), packing_of(scene, form, rechunk=rechunk))
    return kept[1]


def packed_scene(view: View, form: PackedFormat | None, rechunk: bool = False) -> PackedScene:
    """`packing_of` a view's scene, kept for the next view of the same scene."""
    return _kept_packing(view.scene, form, rechunk).packed


def packed_for_picture(view: View, options: FrontOptions) -> tuple[PackedScene, dict[str, Any]]:
    """`packed_scene` of a view that is to be drawn, and statistics of what its number formats cost there. FlickerWarning where that is a loss to be seen: steps
    of positions that are `coarse`."""
    packing = _kept_packing(view.scene, options.format, options.rechunk)
    packed, where = packing.packed, view.scene.path or view.name or "scene"
    found = measure_steps(packed, [view.camera])
    if found.coarse:
        warnings.warn(FlickerWarning(f"{where}: {found.warning(packing.brought)}"), stacklevel=2)
    return packed, {"position_steps": found.as_dict()}


def golden_front(view: View, packed: PackedScene, lists: ListKind, kind: RecordKind, reuse: Reuse | None = None) -> FrontFrame:
    """`run_front` of a view and its packed scene, kept by the view: the picture and what it costs need the same. reuse: of the first call alone."""
    return view.keep(("front", packed.format, lists, kind), lambda: run_front(packed, view.camera, lists, kind, order=view.order, reuse=reuse))


def bit_true_front(view: View, config: RenderConfig, front: Front, options: FrontOptions, steps: Steps) -> tuple[FrontFrame, dict[str, Any]]:
    """Records and lists of a view by the golden model of the front end or by its RTL, and statistics of packing and of the RTL; 16-byte records for the
    factored form, 32-byte ones for the conic."""
    if config.coords is Coords.ABSOLUTE:
        raise FlickerError("coords absolute: for --front float only; records hold means in 1/128 pixel")
    kind = RecordKind.of(config.form)
    with steps.step("packing the scene"):
        packed, stats = packed_for_picture(view, options)
    if front is Front.GOLDEN:
        with steps.step("preprocessing with the golden model"):
            return golden_front(view, packed, options.lists, kind), stats
    units = {"lanes": config.preproc_lanes, "writers": config.list_writers, "interval": config.preproc_interval}
    with steps.step("building the front end's simulator (once for each form and size)"):
        build_front(kind, **units)
    with steps.step("preprocessing with the RTL"):
        frame, rtl = front_frame(packed, view.camera, options.lists, kind, view.order, **units)
    return frame, stats | {"front_cycles": rtl.cycles, "front_beats": {k: int(c.read_beats + c.write_beats) for k, c in rtl.traffic.items()}}


def _float_lists(view: View, config: RenderConfig, steps: Steps) -> tuple[SubtileLists, dict[str, Any]]:
    """Lists of the float64 front end and its statistics."""
    with steps.step("projecting"):
        projected = view.projected
    with steps.step("building sub-tile lists"):
        lists = build_lists(projected, view.camera, config)
    return lists, {"visible": len(projected.depth), "adjusted": lists.adjusted}


def golden_lists(front: FrontFrame, steps: Steps) -> tuple[SubtileLists, dict[str, Any]]:
    """Lists of a bit-true front end and its statistics."""
    with steps.step("building sub-tile lists"):
        lists = front.subtile_lists()
    return lists, front_stats(front)


def lane_lists(front: FrontFrame, steps: Steps) -> tuple[RecordLists, dict[str, Any]]:
    """`golden_lists` for the lanes, which take the records as they are."""
    with steps.step("building sub-tile lists"):
        lists = front_lists(front)
    return lists, front_stats(front)


def front_stats(front: FrontFrame) -> dict[str, Any]:
    """Statistics of a bit-true front end."""
    return {
        "visible": front.outcomes["listed"], "adjusted": dict(front.adjusted), "format": front.packed.format.value, "records": front.kind.value,
        "clusters": len(front.packed.table), "clusters_kept": front.clusters_kept, "outcomes": front.outcomes, "list_entries": len(front.entry_tile),
    }


def basic_stats(view: View, engine: Engine, front: Front, config: RenderConfig) -> dict[str, Any]:
    """What was rendered, and how."""
    return {
        "scene": view.name if view.scene.path is None else str(view.scene.path),
        "view": view.number,
        "cameras": view.cameras_from,
        "width": view.camera.width,
        "height": view.camera.height,
        "engine": engine.value,
        "front": front.value,
        "stage": config.stage,
        "form": config.form.name.lower(),
        **({"formats": LANE_FORMATS.name} if config.by_lanes else {
            "precision": config.precision.name.lower(), "cat": config.cat.name.lower(), "fifo_depth": config.fifo_depth,
        }),
        "coords": config.coords.name.lower(),
        "order": view.order.value,
        "gaussians": len(view.scene.means),
        "gaussians_left_out": dict(view.scene.rejected),
    }


def lane_stats(frame: LaneFrame, config: RenderConfig) -> dict[str, Any]:
    """Counts of a frame by lanes, which do not depend on timing. least_cycles: what so many lanes take at least, one pixel each a cycle."""
    counts = {name: frame.total(name) for name in LANE_COUNTS}
    return {
        "pixel_pairs": counts["visited"], "pairs_blended": counts["blended"], "pixels_finished": counts["pixels_finished"],
        "lanes": {"lanes": config.lanes, **counts, "least_cycles": -(-counts["visited"] // config.lanes)},
    }


def compared(view: View, image: np.ndarray, steps: Steps) -> dict[str, float | None]:
    """Distance from the float64 reference; None when the pictures are equal."""
    with steps.step("rendering the float64 reference"):
        value = psnr(image, view.reference)
    return {"psnr_db": value if np.isfinite(value) else None}


def render_view(
    view: View,
    *,
    engine: Engine = Engine.GOLDEN,
    config: RenderConfig = RenderConfig(),
    front: Front = Front.FLOAT,
    options: FrontOptions = FrontOptions(),
    compare: bool = False,
    alpha: bool = False,
    steps: Steps | None = None,
) -> Rendered:
    """Render a view of a scene.

    front, options: who preprocesses, and how. With a bit-true front end the engine `reference` blends its records in float64. Engines of the whole chip:
    `chip.run.render_on_chip`.
    compare: also render the float64 reference and report `psnr_db` (None when the pictures are equal). alpha: also give what covers the pixels.
    """
    steps = steps or Steps()
    camera = view.camera
    if config.by_lanes:
        return _by_lanes(view, engine, config, front, options, compare, alpha, steps)
    if front is not Front.FLOAT:
        frame_in, simulated = bit_true_front(view, config, front, options, steps)
        lists, more = golden_lists(frame_in, steps)
        more |= simulated
    else:
        lists, more = _float_lists(view, config, steps)
    stats = basic_stats(view, engine, front, config) | {"tile_pairs": lists.tile_pairs, "subtile_pairs": len(lists.entry)} | more
    covered = None
    if engine is Engine.RTL:
        with steps.step("building the simulator (once per configuration)"):
            build(config)
        with steps.bar("simulating the RTL") as report:
            rtl = render_rtl(lists, config, progress=report)
        image = rtl.image(view.background)
        covered = coverage(lists, rtl.pixels)
        sent = int(rtl.channel_counter("minitiles_sent").sum())
        stats |= {"minitiles_sent": sent, "pixel_pairs": 16 * sent} | rtl_stats(rtl, config)
    elif engine is Engine.GOLDEN:
        with steps.step("rendering with the golden model"):
            frame = render_golden(lists, config)
        image = frame.image(view.background)
        covered = coverage(lists, frame.pixels)
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
    if engine is Engine.REFERENCE:
        if front is not Front.FLOAT:
            with steps.step("blending the records in float64"):
                records = (frame_in.splats(), config.form, lists.start, lists.entry, camera.width, camera.height)
                image = blend_records(*records, view.background)
                if alpha:
                    covered = 1.0 - (blend_records(*records, (1.0, 1.0, 1.0)) - blend_records(*records))[..., 0]
        else:
            with steps.step("rendering the float64 reference"):
                image = view.reference
                if alpha:
                    covered = 1.0 - render_with_transmittance(view.projected, camera)[1]
        stats |= {"minitiles_sent": None, "pixel_pairs": None}
    if compare:
        stats |= compared(view, image, steps)
    return Rendered(image, stats, covered if alpha else None)


def _by_lanes(view: View, engine: Engine, config: RenderConfig, front: Front, options: FrontOptions, compare: bool, alpha: bool, steps: Steps) -> Rendered:
    """`render_view` for the stage `lanes`. With `Front.FLOAT` every field of a record is the float64 projection's, rounded once. The RTL
    is fed as a chip feeds a stage that says when a sub-tile is finished: it leaves its list then, and one with an empty list is not streamed."""
    if engine is Engine.REFERENCE:
        raise FlickerError("stage lanes: not for engine reference, which has no stage")
    camera = view.camera
    if front is not Front.FLOAT:
        frame_in, simulated = bit_true_front(view, config, front, options, steps)
        lists, more = lane_lists(frame_in, steps)
        more |= simulated
    else:
        with steps.step("projecting"):
            projected = view.projected
        with steps.step("building sub-tile lists"):
            lists = float_lists(projected, bin_splats(projected, camera))
        more = {"visible": len(projected.depth), "adjusted": lists.adjusted}
    stats = basic_stats(view, engine, front, config) | {"tile_pairs": lists.tile_pairs, "subtile_pairs": len(lists.entry)} | more
    frame: LaneFrame | RtlFrame
    if engine is Engine.RTL:
        with steps.step("building the simulator (once per configuration)"):
            build(config)
        with steps.bar("simulating the RTL") as report:
            frame = render_rtl(lists, config, leave=True, empty=False, progress=report)
        stats |= lane_rtl_stats(frame, config)
    else:
        with steps.step("rendering with the golden lanes"):
            frame = render_lanes(lists)
        stats |= lane_stats(frame, config)
    image = frame.image(view.background)
    if compare:
        stats |= compared(view, image, steps)
    return Rendered(image, stats, coverage(lists, frame.pixels) if alpha else None)
