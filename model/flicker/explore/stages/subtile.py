"""GSCore's stage: all VRUs of a core work on one splat of one sub-tile. Idealised: its cycles are a closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...params import CORES
from ...perf.render_stage import StageCycles
from ...perf.work import Work
from ..machine import MaskGenerator
from .channels import FIXED_PLACES, Channels, count


def taken_by_subtiles(work: Work) -> np.ndarray:
    """int64 (S,): splats that a sub-tile takes as a whole, until all its pixels are finished."""
    return np.minimum(work.finish().max(axis=1) + 1, np.diff(work.start)).astype(np.int64)


def gscore_cycles(work: Work, vrus: int) -> int:
    """Every listed splat takes 64 pixels on a core's VRUs, until all are finished; the largest sum over the cores' sub-tiles."""
    cycles = taken_by_subtiles(work) * (64 * CORES // vrus)
    return int(max(cycles[work.order[a:b]].sum() for a, b in zip(work.core_start, work.core_start[1:])))


@dataclass(frozen=True)
class SubtileVrus(Channels):
    """The work unit is the sub-tile. Area and FIFOs as of our channels."""

    idealised = True
    assumed: ClassVar[tuple[str, ...]] = (
        FIXED_PLACES, "a finished sub-tile's list is left at once (early exit)", "its own intersection test and sorting are not in the area",
    )

    def rtl(self) -> None:
        return None

    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, None]:
        return gscore_cycles(work, self.vrus), None

    def pairs(self, work: Work, counters: StageCycles | None) -> int:
        return 64 * int(taken_by_subtiles(work).sum())

    def pushed(self, work: Work, counters: StageCycles | None) -> int:
        return count((work.visit_masks() & work.unfinished()) != 0)
