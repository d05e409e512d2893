"""FLICKER's rendering stage: channels whose VRUs draw whole mini-tiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...cost.area import RECORD_BITS, stage_parts
from ...cost.energy import stage_energy
from ...params import CHANNELS, CORES, VRUS_PER_CHANNEL, Form, RenderConfig
from ...perf.render_stage import StageCycles, simulate
from ...perf.work import Work
from ..machine import MaskGenerator, RenderingStage

FIXED_PLACES = "core k takes sub-tile k of every tile, tiles row by row"  # `assumed`


def count(values: np.ndarray) -> int:
    """Sum as a Python integer."""
    return int(values.sum(dtype=np.int64))


def modelled(counters: StageCycles | None) -> StageCycles:
    """The counters of a stage that has a cycle model."""
    if counters is None:
        raise ValueError("this stage needs the counters of its cycle model")
    return counters


@dataclass(frozen=True)
class Channels(RenderingStage):
    """The RTL's: four cores of four channels, each with a feature FIFO and `vrus_per_channel` VRUs; cycles of its cycle model."""

    form: Form = Form.FACTORED
    fifo_depth: int = 16
    vrus_per_channel: int = VRUS_PER_CHANNEL
    assumed: ClassVar[tuple[str, ...]] = (FIXED_PLACES,)

    @property
    def vrus(self) -> int:
        return CORES * CHANNELS * self.vrus_per_channel

    def rtl(self) -> dict | None:
        return {"fifo_depth": self.fifo_depth, "vrus_per_channel": self.vrus_per_channel}

    def render_config(self, generator: MaskGenerator) -> RenderConfig:
        """What the cycle models need to know; a generator without RTL counts as one with the default CTU's latency."""
        fields = {"fifo_depth": self.fifo_depth, "vrus_per_channel": self.vrus_per_channel}
        return RenderConfig(**({"form": self.form} | (generator.rtl() or {}) | fields))

    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, StageCycles | None]:
        stage = simulate(work, self.render_config(generator))
        return stage.cycles, stage

    def area_parts(self, generator: MaskGenerator) -> dict[str, float]:
        return stage_parts(self.form, generator.area(), fifo_depth=self.fifo_depth, vrus=self.vrus, pixels=generator.pixels)

    def pairs(self, work: Work, counters: StageCycles | None) -> int:
        """Pixel-Gaussian pairs that the VRUs work on: what the channels issued."""
        return count(modelled(counters).channel("vru_busy")) * self.vrus_per_channel

    def pushed(self, work: Work, counters: StageCycles | None) -> int:
        """Records written into feature FIFOs."""
        return count(modelled(counters).core("minitiles_delivered"))

    def energy(self, work: Work, cycles: int, counters: StageCycles | None, generator: MaskGenerator) -> dict[str, float]:
        return stage_energy(
            cycles=cycles, subtiles=work.subtiles, form=self.form, vrus=self.vrus, pairs=self.pairs(work, counters), pushed=self.pushed(work, counters),
            fifos=CORES * CHANNELS, fifo_depth=self.fifo_depth, fifo_bits=RECORD_BITS + (16 if generator.pixels else 0),
            masks_pj=generator.energy_pj(work, count(work.test_cycles)), masks_clock_free=generator.clock_free(), area=sum(self.area_parts(generator).values()),
        )


def barrier_cycles(work: Work, vrus_per_channel: int) -> int:
    """Sum over tiles of the busiest channel or generator of their four sub-tiles. Idealised: no latencies, perfect buffering inside a tile."""
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


@dataclass(frozen=True)
class Barrier(Channels):
    """All cores wait for each other after every tile."""

    idealised = True
    assumed: ClassVar[tuple[str, ...]] = (FIXED_PLACES, "perfect buffering inside a tile, no latencies")

    def rtl(self) -> None:
        return None

    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, None]:
        return barrier_cycles(work, self.vrus_per_channel), None

    def pairs(self, work: Work, counters: StageCycles | None) -> int:
        return 16 * self.pushed(work, counters)

    def pushed(self, work: Work, counters: StageCycles | None) -> int:
        return count((work.visit_masks() & work.unfinished()) != 0)
