"""Machines in whole frames: the same chip around the rendering stage of each configuration.

`chip_estimates` is the chip that exists as RTL: both halves by the models that are held to it (`preprocessing`, `rendering`; docs/chip.md has them beside it).
`estimate` is a frame of `ChipConfig`, with whatever stage, lists and memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import FlickerError
from ..explore.configurations import get_configuration
from ..explore.evaluate import draw
from ..explore.machine import Configuration, subtile_cycles
from ..explore.stages.lanes import Lanes
from ..explore.stages.subtile import SubtileVrus
from ..front.lists import obb_masks
from ..front.view import View
from ..golden.front.frame import FrontFrame, ListKind, run_front
from ..golden.front.memory import front_memory
from ..golden.front.record import RecordKind
from ..golden.front.setup import MEAN_FRACTION
from ..params import TILE, Form, RenderConfig
from ..perf.render_stage import StageCycles
from ..pipeline import packed_scene
from ..scene.packed import PackedFormat
from . import preprocessing, rendering
from .dram import DramConfig
from .execute import SchemeResult
from .frame import DEFAULT_CHIP, ChipConfig, FrameEstimate, Prepared, frame_estimate
from .whole import whole_frame

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


def stage_of(configuration: Configuration) -> RenderConfig:
    """The chip's rendering stage that does what a configuration does. GSCore's is the one without a test and with its VRUs: a channel of four VRUs takes a
    splat of its sub-tile in four cycles, as all channels together do there. FlickerError for a configuration that the chip cannot have."""
    if isinstance(configuration.stage, SubtileVrus):
        return RenderConfig(**(configuration.generator.rtl() or {}), vrus_per_channel=configuration.stage.vrus_per_channel)
    if configuration.render_config is None:
        raise FlickerError(f"{configuration.name}: no RTL of its rendering stage, so no chip")
    return configuration.render_config


def has_chip(configuration: Configuration, memory: str) -> bool:
    """Whether `chip_estimates` has the configuration with a scene in this format."""
    known = isinstance(configuration.stage, SubtileVrus) or configuration.render_config is not None
    return known and memory == FRONTS[configuration.form][0].value


def by_oriented_boxes(frame: FrontFrame) -> FrontFrame:
    """The same frame with GSCore's lists: only sub-tiles that a splat's oriented box meets; entries of none are left out."""
    if frame.kind is not RecordKind.CONIC32:
        raise FlickerError("lists by oriented boxes: records in conic form only")
    splats = frame.splats()
    half_a, b, half_c = splats.shape.T
    over = 4.0 * half_a * half_c - b * b
    with np.errstate(divide="ignore", invalid="ignore"):
        cov = np.stack([2.0 * half_c, -b, 2.0 * half_a], axis=1) / over[:, None]
    cov[~(over > 0.0)] = (1.0, 0.0, 1.0)  # rounded to no ellipse: listed by its box
    cols = -(-frame.camera.width // TILE)
    mask = obb_masks(
        splats.mean / (1 << MEAN_FRACTION), cov, frame.entry_splat, frame.entry_tile, frame.entry_mask, cols, frame.camera.width, frame.camera.height,
    )
    kept = mask != 0
    return replace(frame, entry_splat=frame.entry_splat[kept], entry_tile=frame.entry_tile[kept], entry_mask=mask[kept])


@dataclass(eq=False)
class _Fronts:
    """Front ends of a view that several machines share, the last one kept."""

    view: View
    _key: tuple | None = None
    _found: tuple[preprocessing.Preprocessing, rendering.TileLists] | None = None

    def of(self, form: Form, oriented: bool, dram: DramConfig) -> tuple[preprocessing.Preprocessing, rendering.TileLists]:
        if self._found is None or self._key != (form, oriented):
            format_, lists = FRONTS[form]
            frame = run_front(packed_scene(self.view, format_), self.view.camera, lists, RecordKind.of(form))
            frame = by_oriented_boxes(frame) if oriented else frame
            image = front_memory(frame)
            self._key, self._found = (form, oriented), (preprocessing.estimate(frame, image, dram), rendering.TileLists.of(frame, image))
        return self._found


def chip_estimates(view: View, names: Sequence[str]) -> dict[str, dict]:
    """Cycles, bytes and the bottleneck of configurations in whole frames, by name; front ends by the form of the stage (`FRONTS`), lists of GSCore by oriented
    boxes. FlickerError for one that the chip cannot have."""
    dram, fronts = DramConfig(), _Fronts(view)
    facts = {}
    for name in names:
        configuration = get_configuration(name)
        front, tables = fronts.of(configuration.form, configuration.lists == "obb", dram)
        frame = whole_frame(front, rendering.estimate(tables, stage_of(configuration), dram), dram)
        facts[name] = {
            "front_cycles": frame.front.cycles, "render_cycles": frame.back.cycles, "interval_cycles": frame.interval, "latency_cycles": frame.latency,
            "bottleneck": frame.bottleneck, "dram_bytes": sum(frame.bytes.values()), "dram_cycles": frame.dram_cycles,
        }
    return facts
