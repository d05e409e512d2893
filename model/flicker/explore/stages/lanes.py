"""Independent lanes of FP16 units with scattered pixels: a model (`flicker.perf.lane_stage`), no RTL exists. Those in the log domain: `log_lanes`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...cost.area import RECORD_BITS, lane_stage_parts
from ...cost.energy import stage_energy
from ...params import CORES, Form, RenderConfig
from ...perf.lane_stage import LaneStage, simulate_lanes
from ...perf.render_stage import StageCycles
from ...perf.work import Work
from ..machine import MaskGenerator, RenderingStage
from .channels import count, modelled


@dataclass(frozen=True)
class Lanes(RenderingStage):
    """lanes: of all cores. window, width, loop: as in `LaneStage`. accumulator: fraction bits of colour accumulators, 0: FP16."""

    lanes: int = 32
    fifo_depth: int = 16
    window: int = 1
    width: int = 1
    loop: int = 2
    accumulator: int = 0
    form = Form.FACTORED
    assumed: ClassVar[tuple[str, ...]] = (
        "sub-tiles of a tile dealt out to the cores in turn, so that none has a fixed place; empty ones not streamed",
        "the rest of a finished sub-tile's list is left (early exit), known as late as in the RTL",
    )

    @property
    def vrus(self) -> int:
        return self.lanes

    @property
    def stage(self) -> LaneStage:
        """What the cycle model takes."""
        return LaneStage(window=self.window, width=self.width, loop=self.loop)

    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, StageCycles]:
        stage = simulate_lanes(work, RenderConfig(form=self.form, fifo_depth=self.fifo_depth), self.stage, self.lanes // CORES)
        return stage.cycles, stage

    def area_parts(self, generator: MaskGenerator) -> dict[str, float]:
        return lane_stage_parts(self.stage, generator.area(), self.lanes, self.fifo_depth, self.accumulator)

    def energy(self, work: Work, cycles: int, counters: StageCycles | None, generator: MaskGenerator) -> dict[str, float]:
        counters = modelled(counters)
        return stage_energy(
            cycles=cycles, subtiles=work.subtiles, form=self.form, vrus=self.lanes, pairs=count(counters.channel("vru_busy")),
            pushed=count(counters.core("minitiles_delivered")), fifos=self.lanes, fifo_depth=self.fifo_depth,
            fifo_bits=RECORD_BITS + 64 * CORES // self.lanes, masks_pj=generator.energy_pj(work, count(counters.core("gaussians_in"))),
            masks_clock_free=generator.clock_free(), area=sum(self.area_parts(generator).values()),
        )

    def utilisation(self, counters: StageCycles) -> float:
        """A lane counts its own pixels, a channel the cycles in which its VRUs work."""
        return counters.utilisation * 16 / self.lanes
