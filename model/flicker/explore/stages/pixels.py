"""Channels whose VRUs visit single pixels: a model (`flicker.perf.pixel_stage`), no RTL exists."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...perf.pixel_stage import simulate_pixels
from ...perf.render_stage import StageCycles
from ...perf.work import Work
from ..machine import MaskGenerator
from .channels import Channels, count


@dataclass(frozen=True)
class PixelChannels(Channels):
    """FIFOs hold pixel masks, each VRU chooses its next pixel. accumulator: fraction bits of colour accumulators, 0: FP16."""

    accumulator: int = 0

    def rtl(self) -> None:
        return None

    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, StageCycles]:
        stage = simulate_pixels(work, self.render_config(generator))
        return stage.cycles, stage

    def pairs(self, work: Work, counters: StageCycles | None) -> int:
        return count(np.bitwise_count(work.visit_masks() & work.unfinished()))
