"""Golden model of the contribution test unit as a stream."""

from __future__ import annotations

from collections import Counter

import numpy as np

from flicker.golden.cat import SCRATCH, is_dense, splat_mask
from flicker.params import (
    AUTO_DECAY_SHIFT,
    AUTO_SENT_BITS,
    AUTO_TEST_BITS,
    PIXELS_PER_VRU,
    CatMode,
    Form,
    Precision,
)
from flicker_tb import splats


def values(features: splats.Features) -> np.ndarray:
    """float32 (9,): the numbers of a record."""
    return np.array(features, np.uint16).view(np.float16).astype(np.float32)


class CtuModel:
    """Contribution test unit: stream elements in, elements with masks out.

    ``counts`` has splats, tokens, rejected, tested (mask bits) and batches; ``decisions`` whether each finished sub-tile fell to
    sparse sampling, ``fallen`` the same for the one in progress. vru_cycles: that a splat takes in a channel.
    """

    def __init__(self, form: Form, precision: Precision, mode: CatMode, vru_cycles: int = PIXELS_PER_VRU) -> None:
        self.form, self.precision, self.mode, self.vru_cycles = form, precision, mode, vru_cycles
        self.counts: Counter[str] = Counter()
        self.decisions: list[bool] = []
        self.fallen = False
        self._next_fallen = False  # of the next sub-tile: rests on all but the one in progress
        self.test_cycles = 0  # of the sub-tile in progress in the base mode
        self.sent = [0] * 4
        self.test_avg = self.sent_avg = 0
        self._scratch = np.zeros(SCRATCH, np.float32)

    def mask(self, splat: splats.Splat) -> int:
        """Mini-tile mask of a splat now; counts its batches."""
        if self.mode == CatMode.OFF:
            self.counts["batches"] += 1
            return 15
        dense = bool(is_dense(CatMode.SPARSE if self.fallen else self.mode, splat.spiky))
        self.counts["batches"] += 2 if dense else 1
        numbers = values(splat.features)[:6]
        return int(splat_mask(*numbers, dense, int(self.form), int(self.precision), self._scratch))

    def take(self, element: int) -> list[tuple[int, int]]:
        """Outputs (feature_elem_t, mask) of a splat_elem_t."""
        word = element & (splats.FEATURE_EOS - 1)
        if element & splats.SPLAT_EOS:
            self.counts["tokens"] += 1
            self._end()
            return [(word | splats.FEATURE_EOS, 15)]
        splat = splats.Splat(splats.unpack(word), bool(element & splats.SPIKY))
        mask = self.mask(splat)
        self.counts["splats"] += 1
        self.counts["tested"] += mask.bit_count()
        self.counts["rejected"] += mask == 0
        step = 1 if splat.spiky else 2
        self.test_cycles = min(self.test_cycles + step, (1 << AUTO_TEST_BITS) - 1)
        for m in range(4):
            self.sent[m] = min(self.sent[m] + (mask >> m & 1), (1 << AUTO_SENT_BITS) - 1)
        return [(word, mask)] if mask else []

    def _end(self) -> None:
        """End of a sub-tile."""
        self.decisions.append(self.fallen)
        if self.mode == CatMode.AUTO:
            self.fallen = self._next_fallen
        self.test_avg += self.test_cycles - (self.test_avg >> AUTO_DECAY_SHIFT)
        self.sent_avg += self.vru_cycles * max(self.sent) - (self.sent_avg >> AUTO_DECAY_SHIFT)
        self._next_fallen = self.test_avg > self.sent_avg
        self.test_cycles, self.sent = 0, [0] * 4
