"""Cycles of frames that follow each other, against the time that each has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Timing:
    """Cycles of the frames of a path: middle, 99th of a hundred, longest with its number; late: share of frames that take more than their slot."""

    p50: float
    p99: float
    worst: int
    worst_frame: int
    late: float

    @classmethod
    def of(cls, cycles: Sequence[int], slot: float) -> Timing:
        """cycles: of one frame at least. slot: cycles of a frame's slot."""
        values = np.asarray(cycles)
        return cls(float(np.percentile(values, 50)), float(np.percentile(values, 99)), int(values.max()), int(values.argmax()), float((values > slot).mean()))
