"""Golden model of the sorting unit against its simple statement, and the cycle model's shape."""

from __future__ import annotations

import numpy as np
import pytest

from flicker.errors import FlickerError
from flicker.golden.sorting import CAPACITY, sort_list
from flicker.perf import sorting as perf


def entries(rng: np.random.Generator, n: int, kind: str) -> np.ndarray:
    records = rng.permutation(1 << 16)[:n].astype(np.uint64)
    keys = {"random": rng.integers(1 << 24, size=n), "few": rng.integers(3, size=n), "ascending": np.arange(n), "descending": np.arange(n)[::-1]}[kind]
    return keys.astype(np.uint64) << np.uint64(28) | records << np.uint64(4) | rng.integers(16, size=n).astype(np.uint64)


@pytest.mark.parametrize("kind", ["random", "few", "ascending", "descending"])
@pytest.mark.parametrize("n", [0, 1, 15, 16, 17, 2047, 2048])
def test_order(n: int, kind: str) -> None:
    words = entries(np.random.default_rng(n), n, kind)
    result = sort_list(words)
    np.testing.assert_array_equal(result.order >> np.uint64(4), np.sort(words >> np.uint64(4)))
    np.testing.assert_array_equal(np.sort(result.order), np.sort(words))
    assert all(len(run) == 16 and (np.diff(run.astype(np.int64)) > 0).all() for run in result.runs(16)[:-1])


def test_refused() -> None:
    with pytest.raises(FlickerError, match="52 bits"):
        sort_list(np.array([1 << 52], np.uint64))
    with pytest.raises(FlickerError, match="2049 entries, more than 2048"):
        sort_list(np.arange(CAPACITY + 1).astype(np.uint64))


def test_cycles() -> None:
    alone = [perf.unit_cycles(n) for n in range(CAPACITY + 1)]
    assert alone[0] == 10 and alone[256] == 789 and alone[CAPACITY] == 4119
    assert perf.back_to_back([261] * 4) >= 3 * perf.list_cycles(261)
