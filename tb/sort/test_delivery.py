"""Delivery: every core gets the records of the entries with its bit, in order, tile by tile; none twice, none more after it is finished than were on their way.

State space: lists of 0 to 300 entries, masks of all kinds, cores of different pace, idle and back-pressure patterns, memory with and without pauses; cores
that finish with their sub-tiles at random, none or all of them; latency; clear at any time. Parameter space: the default; with SLOW=1
also two units, short queues and a small cache; two elements a cycle for a core; one core for all sub-tiles and one unit, two cores; records of 32 bytes;
`sim.delivery`.
"""

from __future__ import annotations

import numpy as np
import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test, seed

from flicker.chip.dram import DramConfig
from flicker.golden.delivery import RecordCache, wanted_until
from flicker.sim.delivery import deliver

SMALL = {"Units": 2, "Queue": 8, "Banks": 2, "Sets": 2, "Ways": 2, "Depth": 8, "Places": 4}
WIDE = {"InWidth": 2, "Queue": 32}
ONE = SMALL | {"Units": 1, "Cores": 1, "InWidth": 2}
OTHERS = ({"RecordBits": 256}, SMALL | {"InWidth": 2}, SMALL | {"Cores": 1}, SMALL | {"Cores": 2}, WIDE | {"Cores": 2}, SMALL, WIDE, ONE)


@pytest.mark.parametrize("parameters", [{}, *(pytest.param(p, marks=pytest.mark.slow) for p in OTHERS)])
def test_delivery(parameters: dict[str, int]) -> None:
    tests = [] if parameters in ({}, WIDE) else ["tiles", "finishing", "ends_alone", "all_finished", "latency", "clear"]
    build_and_test("flk_delivery", "cocotb_delivery", parameters=parameters, tests=tests, config=parameters)


@pytest.mark.slow
def test_ends_of_the_product() -> None:
    """Ends are counted as far as the product's own queues let them come."""
    build_and_test("flk_delivery", "cocotb_delivery", tests=["ends_alone"])


def test_illegal_parameters() -> None:
    refused("flk_delivery", {"Queue": 12}, "Queue must be a multiple of 8, at least 8")
    refused("flk_delivery", {"InWidth": 3}, "InWidth must be 1 or 2")
    refused("flk_delivery", {"Cores": 3}, "Cores must be 1, 2 or 4")
    refused("flk_delivery", {"Units": 3}, "Units must be 1, 2 or 4")


@pytest.mark.slow
def test_alone() -> None:
    """`sim.delivery`: whole lists read the lines that the golden cache reads; cores that finish take what they need, and less is read."""
    rng = np.random.default_rng(seed())
    lengths = rng.integers(0, 600, 40)
    start = np.concatenate([[0], np.cumsum(lengths)])
    record, mask = rng.integers(0, 4000, start[-1]), rng.integers(0, 16, start[-1])
    border, tile = rng.integers(0, 16, (40, 2)) * rng.integers(0, 2, (40, 2)), np.repeat(np.arange(40), lengths)
    whole = deliver(start, record, mask, borders=border, seed=seed())
    cache = RecordCache()
    assert whole.lines == sum(cache.lookup(int(r), int(t), wanted_until(int(m), border[t]))[1] for r, m, t in zip(record, mask, tile) if m)
    given = np.array([(mask >> s & 1).sum() for s in range(4)])
    assert whole.given == tuple(given) and whole.cycles >= max(given)
    most = np.add.reduceat(np.stack([mask >> s & 1 for s in range(4)], axis=1), start[:-1][lengths > 0])
    finished = np.zeros((40, 4), np.int64)
    finished[lengths > 0] = most // 3
    until = deliver(start, record, mask, finished, timing=DramConfig().timing, seed=seed())
    assert until.lines < whole.lines and (np.array(until.given) >= finished.sum(axis=0)).all() and (np.array(until.given) < given).all()
    with pytest.raises(ValueError, match="finished"):
        deliver(start, record, mask, finished[:-1])
