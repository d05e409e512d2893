"""Machines in whole frames: the same chip around the rendering stage of each configuration.

`chip_estimates` is the chip that exists as RTL: both halves by the models that are held to it (`preprocessing`, `rendering`; docs/results/chip.md has
them beside it).
`estimate` is a frame of `ChipConfig`, with whatever stage, lists and memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import FlickerError
from ..explore.configurations import get_configuration
from ..explore.evaluate import draw
from ..explore.machine import Configuration, subtile_cycles
from ..explore.stages.lanes import Lanes
from ..explore.stages.subtile import SubtileVrus
from ..front.lists import obb_masks
from ..front.records import LOG2E
from ..front.view import View
from ..golden.front.frame import FrontFrame, ListKind, run_front
from ..golden.front.record import RecordKind
from ..golden.front.setup import MEAN_FRACTION
from ..params import TILE, Coords, Form, RenderConfig
from ..perf.render_stage import StageCycles
from ..pipeline import Engine, Front, FrontOptions, golden_front, packed_scene
from ..scene.packed import PackedFormat
from . import preprocessing
from .dram import DramConfig
from .drawing import Drawing
from .execute import SchemeResult
from .frame import DEFAULT_CHIP, ChipConfig, FrameEstimate, Prepared, frame_estimate
from .tile_lists import TileLists
from .whole import first_half, whole_frame

# The front end by form of the stage: what the scene is packed in, and how splats are listed (the command line's defaults with and without --faithful).
FRONTS = {Form.FACTORED: (PackedFormat.CHUNK, ListKind.ELLIPSE), Form.CONIC: (PackedFormat.FP16, ListKind.BOX)}


def estimate(prepared: Prepared, configuration: Configuration, chip: ChipConfig = DEFAULT_CHIP, scheme_result: SchemeResult | None = None) -> FrameEstimate:
    """A frame with a configuration's rendering stage, by its cycle model."""
    work = draw(prepared.view, configuration).work
    cycles, counters = configuration.simulate(work)
    own_places = None  # the exploration's lanes deal sub-tiles out otherwise; those in the log domain say nothing of single ones
    if isinstance(counters, StageCycles) and not isinstance(configuration.stage, Lanes):
        own_places = subtile_cycles(work, counters)
    return frame_estimate(prepared, cycles, chip, scheme_result, own_places)


def chip_stage(configuration: Configuration) -> RenderConfig | None:
    """The chip's rendering stage that does what a configuration does; None where the chip cannot have it. GSCore's is the one without a test and with its
    VRUs: a channel of four VRUs takes a splat of its sub-tile in four cycles, as all channels together do there."""
    if isinstance(configuration.stage, SubtileVrus):
        return RenderConfig(**(configuration.generator.rtl() or {}), vrus_per_channel=configuration.stage.vrus_per_channel)
    return configuration.render_config


def by_oriented_boxes(frame: FrontFrame) -> FrontFrame:
    """The same frame with GSCore's lists: only sub-tiles that a splat's oriented box meets; entries of none are left out."""
    splats = frame.splats()
    s0, s1, s2 = splats.shape.T
    # Inverse of the covariance: E = dx^2 a / 2 + b dx dy + dy^2 c / 2, or u^2 + v^2 = E log2(e) (docs/reference/number_formats.md).
    a, b, c = (2.0 * s0, s1, 2.0 * s2) if frame.kind is RecordKind.CONIC32 else 2.0 / LOG2E * np.stack([s0 * s0, s0 * s1, s1 * s1 + s2 * s2])
    over = a * c - b * b
    with np.errstate(divide="ignore", invalid="ignore"):
        cov = np.stack([c, -b, a], axis=1) / over[:, None]
    cov[~(over > 0.0)] = (1.0, 0.0, 1.0)  # rounded to no ellipse: listed by its box
    cols = -(-frame.camera.width // TILE)
    mask = obb_masks(
        splats.mean / (1 << MEAN_FRACTION), cov, frame.entry_splat, frame.entry_tile, frame.entry_mask, cols, frame.camera.width, frame.camera.height,
    )
    kept = mask != 0
    return replace(frame, entry_splat=frame.entry_splat[kept], entry_tile=frame.entry_tile[kept], entry_mask=mask[kept])


def frame_cost(view: View, drawing: Drawing) -> dict[str, int]:
    """What a frame takes on the chip around the stage of a drawing: `cycles` from frame to frame while the front end works on the next one, `latency_cycles`
    of a frame alone, `front_cycles`, `render_cycles`, and bytes by purpose, `bytes_geometry` and so on. The front end is the drawing's, of one in float64
    that of `FRONTS`. FlickerError for what no chip can have."""
    config = drawing.config
    if config.coords is Coords.ABSOLUTE:
        raise FlickerError("coords absolute: the chip has no such records, so no cycles")
    if drawing.engine is Engine.REFERENCE:
        raise FlickerError("engine reference: is no machine, so it has no cycles")
    options = drawing.options
    if not drawing.engine.whole and drawing.front is Front.FLOAT:
        options = FrontOptions(*FRONTS[config.form])
    packed, dram = packed_scene(view, options.format, options.rechunk), replace(drawing.dram, port_bits=config.port_bits)
    first, tables = first_half(golden_front(view, packed, options.lists, RecordKind.of(config.form)), config, dram)
    found = whole_frame(first, tables, config, dram)
    return {
        "cycles": found.interval, "latency_cycles": found.latency, "front_cycles": found.front.cycles, "render_cycles": found.back.cycles,
        **{f"bytes_{purpose}": count for purpose, count in found.bytes.items()},
    }


def own_sorter(configuration: Configuration) -> bool:
    """Whether a configuration is a rival, whose lists an ideal sorter sorts: GSCore, and stages of channels without a contribution test."""
    stage = chip_stage(configuration)
    return isinstance(configuration.stage, SubtileVrus) or (stage is not None and not stage.by_lanes and stage.mask_generator == "all")


def chip_estimates(view: View, names: Sequence[str], memories: str = "default", dram: DramConfig | None = None) -> dict[str, dict]:
    """Cycles, bytes and the bottleneck of configurations in whole frames, by name; front ends by the form of the stage (`FRONTS`), lists of GSCore by oriented
    boxes. Rivals (`own_sorter`) have an ideal sorter, which costs the bytes of one reading and no time. memories: `RenderConfig.memories`. FlickerError for one
    that the chip cannot have."""
    dram = dram or DramConfig()
    fronts: dict[tuple[Form, bool, bool], tuple[preprocessing.Preprocessing, TileLists]] = {}
    facts = {}
    for name in names:
        configuration = get_configuration(name)
        stage = chip_stage(configuration)
        if stage is None:
            raise FlickerError(f"{name}: no RTL of its rendering stage, so no chip")
        key = configuration.form, configuration.lists == "obb", own_sorter(configuration)
        if key not in fronts:
            format_, lists = FRONTS[configuration.form]
            front = run_front(packed_scene(view, format_), view.camera, lists, RecordKind.of(configuration.form), order=view.order)
            front = by_oriented_boxes(front) if key[1] else front
            fronts[key] = first_half(front, stage.with_(memories=memories), dram, not key[2])
        first, tables = fronts[key]
        frame = whole_frame(first, tables, stage.with_(memories=memories), dram)
        facts[name] = {
            "front_cycles": frame.front.cycles, "render_cycles": frame.back.cycles, "interval_cycles": frame.interval, "latency_cycles": frame.latency,
            "bottleneck": frame.bottleneck, "dram_bytes": sum(frame.bytes.values()), "dram_cycles": frame.dram_cycles,
        }
    return facts
