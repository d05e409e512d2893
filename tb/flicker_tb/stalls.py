"""Idle and back-pressure generators: endless iterators of "stall in this cycle?".

``make`` names the patterns that a test sweeps over; sources and sinks take the iterator.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator


def never() -> Iterator[bool]:
    """No stall: full rate."""
    return itertools.repeat(False)


def probability(stall: float, rng: random.Random) -> Iterator[bool]:
    """Each cycle stalls on its own with probability ``stall``."""
    draw = rng.random
    while True:
        yield draw() < stall


def bursts(mean_stall: float, mean_run: float, rng: random.Random) -> Iterator[bool]:
    """Runs of stalls and of free cycles, geometric lengths of the given means in cycles."""
    while True:
        for mean, stall in ((mean_run, False), (mean_stall, True)):
            length = 1
            while rng.random() >= 1 / mean:
                length += 1
            yield from itertools.repeat(stall, length)


def every(period: int) -> Iterator[bool]:
    """One free cycle in ``period``."""
    return itertools.cycle([False] + [True] * (period - 1))


PATTERNS = ("never", "half", "rare", "heavy", "bursts", "alternate")


def make(pattern: str, rng: random.Random) -> Iterator[bool]:
    """Generator by name, one of PATTERNS."""
    match pattern:
        case "never":
            return never()
        case "half":
            return probability(0.5, rng)
        case "rare":
            return probability(0.05, rng)
        case "heavy":
            return probability(0.9, rng)
        case "bursts":
            return bursts(20, 20, rng)
        case "alternate":
            return every(2)
    raise ValueError(f"unknown stall pattern {pattern!r}")
