"""Lanes in the log domain: `flk_lane_stage` (docs/reference/lane_stage.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...cost.area import part
from ...cost.energy import lane_energy
from ...cost.synth.units import lane_config
from ...front.records import SubtileLists
from ...golden.lanes.lists import RecordLists
from ...golden.lanes.render import finish_positions, render_lanes
from ...params import CORES, SUBTILE_PIXELS, Form, RenderConfig
from ...perf.lanes import LaneCycles, LaneWork, simulate_lanes
from ...perf.work import Work
from ..machine import MaskGenerator, Masks, RenderingStage
from .channels import FIXED_PLACES


@dataclass
class LaneMasks(Masks):
    """Masks with what the lanes draw: the lists' records of 16 bytes; passes: uint64 (E,), pixels that pass the lane's own test."""

    records: RecordLists | None = None
    passes: np.ndarray | None = None


def pixel_masks(visit: np.ndarray) -> np.ndarray:
    """uint64 (E,), bit 16 m + i, of masks by mini-tile, uint16 (E, 4)."""
    return np.ascontiguousarray(visit).view(np.uint64).ravel()


@dataclass(frozen=True)
class LogLanes(RenderingStage):
    """Fields as in `RenderConfig`; cycles of the cycle model that equals the RTL."""

    lanes: int = 32
    in_width: int = 2
    slots: int = 20
    fifo_depth: int = 16
    form = Form.FACTORED
    lists_of_rtl: ClassVar[tuple[str, ...]] = ("subtile", "ellipse", "squares")
    assumed: ClassVar[tuple[str, ...]] = (
        FIXED_PLACES, "empty sub-tiles not streamed", "a finished sub-tile leaves its list, as late as in the RTL", "records of the float64 projection",
    )

    @property
    def vrus(self) -> int:
        return self.lanes

    @property
    def config(self) -> RenderConfig:
        return RenderConfig(stage="lanes", lanes=self.lanes, in_width=self.in_width, slots=self.slots, fifo_depth=self.fifo_depth)

    def rtl(self) -> dict | None:
        return {"lanes": self.lanes, "in_width": self.in_width, "slots": self.slots, "fifo_depth": self.fifo_depth}

    def draw(self, lists: SubtileLists, order: np.ndarray, masks: Masks) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bit for bit (`golden.lanes`), of masks that bring records."""
        if not isinstance(masks, LaneMasks) or masks.records is None or masks.passes is None or masks.visit is None:
            raise ValueError("lanes in the log domain need the masks of their own generator")
        finish, contributing = finish_positions(masks.records, pixel_masks(masks.visit), masks.passes)
        return render_lanes(masks.records).pixels, contributing.view(np.uint16).reshape(-1, 4), finish.astype(np.int32)

    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, LaneCycles]:
        contributing = np.ascontiguousarray(work.contributing).view(np.uint64).ravel()
        lane_work = LaneWork(
            work.cols, work.rows, np.asarray(work.start, np.int64), pixel_masks(work.visit_masks()), contributing, work.pixel_finish.astype(np.int64),
            int(np.bitwise_count(contributing).sum(dtype=np.int64)),
        )
        stage = simulate_lanes(lane_work, self.config, leave=True, empty=False)
        return stage.cycles, stage

    def area_parts(self, generator: MaskGenerator) -> dict[str, float]:
        pixels = f"{SUBTILE_PIXELS * CORES // self.lanes} pixels"
        parts = {
            "lanes": self.lanes * part("lane", pixels).ge, "queues": self.lanes * part("lane_queue", pixels).ge,
            "setup and masks": CORES * self.in_width * generator.area(), "counters": CORES * part("lane_counters", "default").ge,
        }
        return parts | {"store, dispatch, output": part("lane_stage", lane_config(self.config)).ge - sum(parts.values())}

    def energy(self, work: Work, cycles: int, counters: object, generator: MaskGenerator) -> dict[str, float]:
        if not isinstance(counters, LaneCycles):
            raise ValueError("this stage needs the counters of its cycle model")
        return lane_energy(counters, self.config, lane_config(self.config), work.subtiles, sum(self.area_parts(generator).values()))
