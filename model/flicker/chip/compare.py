"""Machines in whole frames: the same front end, lists and memory around the rendering stage of each configuration."""

from __future__ import annotations

from collections.abc import Sequence

from ..explore.configurations import get_configuration
from ..explore.evaluate import draw
from ..explore.machine import Configuration, subtile_cycles
from ..explore.stages.lanes import Lanes
from ..front.view import View
from ..perf.render_stage import StageCycles
from .execute import SchemeResult, run_scheme
from .frame import DEFAULT_CHIP, ChipConfig, FrameEstimate, Prepared, frame_estimate, prepare


def estimate(prepared: Prepared, configuration: Configuration, chip: ChipConfig = DEFAULT_CHIP, scheme_result: SchemeResult | None = None) -> FrameEstimate:
    """A frame with a configuration's rendering stage, by its cycle model."""
    work = draw(prepared.view, configuration).work
    cycles, counters = configuration.simulate(work)
    own_places = None  # the exploration's lanes deal sub-tiles out otherwise; those in the log domain say nothing of single ones
    if isinstance(counters, StageCycles) and not isinstance(configuration.stage, Lanes):
        own_places = subtile_cycles(work, counters)
    return frame_estimate(prepared, cycles, chip, scheme_result, own_places)


def chip_estimates(view: View, names: Sequence[str]) -> dict[str, dict]:
    """Cycles, bytes and the bottleneck of configurations in whole frames, by name. Every core has records as soon as it wants them."""
    chip = ChipConfig()
    prepared = prepare(view)
    result = run_scheme(prepared.splats, chip.scheme, prepared.needed if chip.early_stop else None)
    facts = {}
    for name in names:
        configuration = get_configuration(name)
        cycles, _ = configuration.simulate(draw(prepared.view, configuration).work)
        frame = frame_estimate(prepared, cycles, chip, result)
        facts[name] = {
            "render_cycles": cycles, "interval_cycles": frame.interval_cycles,
            "latency_cycles": frame.latency_cycles, "bottleneck": frame.bottleneck, "dram_bytes": frame.bytes, "dram_cycles": sum(frame.dram_cycles),
        }
    return facts
