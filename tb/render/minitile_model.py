"""What channel and core tests share: golden pixels of the mini-tiles of one sub-tile, and event counting."""

from __future__ import annotations

from collections import Counter

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb import splats

from flicker import layout
from flicker.golden.render import minitile
from flicker.params import Form


class SubtileModel:
    """Golden state of a sub-tile; mini-tiles take splats in program order."""

    def __init__(self, form: Form) -> None:
        self.form = int(form)
        self._scratch = [np.empty(s, np.float32) for s in ((2, 4), (2, 4), (16,))]
        self.clear()

    def clear(self) -> None:
        """Start of a sub-tile."""
        self.state = np.zeros((4, 64), np.float32)
        self.state[0] = 1.0
        self.done = np.zeros(64, bool)

    def finished(self, m: int) -> bool:
        """All pixels of mini-tile m are finished."""
        return bool(self.done[16 * m : 16 * m + 16].all())

    def take(self, m: int, features: splats.Features) -> int:
        """Blend a splat into mini-tile m; returns the pixels that it finished."""
        f = np.array(features, np.uint16).view(np.float16).astype(np.float32)
        return int(minitile(f, m, self.form, self.state, self.done, *self._scratch)[1])

    def pixels(self, m: int) -> list[tuple[int, ...]]:
        """(T, red, green, blue) bit patterns of the 16 pixels."""
        bits = self.state.astype(np.float16).view(np.uint16)[:, 16 * m : 16 * m + 16]
        return [tuple(map(int, p)) for p in bits.T]


def pixel_of(word: int) -> tuple[int, ...]:
    """(T, red, green, blue) in the low bits of an output element."""
    return tuple(word >> place.at & (1 << place.bits) - 1 for place in layout.fields("pixel").values())


class EventCounter:
    """Sums the fields of an event struct over all cycles out of reset; fields are (name, bits), most significant first."""

    def __init__(self, dut, port, fields: tuple[tuple[str, int], ...], base: int = 0) -> None:
        self.total: Counter[str] = Counter()
        self._dut, self._port, self._fields, self._base = dut, port, fields, base
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        edge = RisingEdge(self._dut.clk_i)
        while True:
            await edge
            if self._dut.rst_ni.value != 1:
                continue
            word = int(self._port.value) >> self._base
            for name, bits in reversed(self._fields):
                self.total[name] += word & ((1 << bits) - 1)
                word >>= bits


def event_fields(record: str) -> tuple[tuple[str, int], ...]:
    """Names and bits of an event struct's fields, most significant first."""
    return tuple((name, place.bits) for name, place in layout.fields(record).items())


CHANNEL_EVENTS, DISPATCH_EVENTS, GENERATOR_EVENTS = map(event_fields, ("channel_events", "dispatch_events", "generator_events"))


def lists(rng, form: Form, lengths) -> list[list[splats.Splat]]:
    """Random lists of the given lengths; every third one begins with splats that finish its pixels."""
    made = []
    for n, length in enumerate(lengths):
        kinds = [splats.mixed] * length
        if n % 3 == 2:
            kinds[: min(8, length)] = [splats.opaque] * min(8, length)
        made.append([kind(rng, form) for kind in kinds])
    return made
