"""Golden model of lists that a sorting unit does not hold, against its simple statement; bounds on bytes and cycles of every order of keys."""

from __future__ import annotations

import numpy as np
import pytest

from flicker.chip.long_lists import ORDERS, make_list
from flicker.errors import FlickerError
from flicker.golden.lists import LINE_ENTRIES, MASK_BITS, SHORT_ENTRIES, line_entries
from flicker.golden.long_lists import LongList, batch_entries, chain_runs, exchanged, pack_lines, run_lines, sort_long
from flicker.golden.sorting import CAPACITY
from flicker.perf.long_lists import merge_cycles


def check(entries: np.ndarray, found: LongList) -> None:
    np.testing.assert_array_equal(found.order, np.sort(entries))  # distinct in the upper 48 bits
    assert all(len(r) == found.capacity for r in found.runs[:-1]) and sum(map(len, found.runs)) == len(entries)
    whole = [(f.run, f.line) for b in found.batches for f in b.fed if f.whole]
    assert len(set(whole)) == len(whole) == found.lines  # each line is used up once
    for k, batch in enumerate(found.batches):
        given = sum(int(np.diff(found.starts[f.run])[f.line]) for f in batch.fed)
        assert given <= max(batch_entries(len(found.chains), found.capacity), SHORT_ENTRIES * (len(found.chains) + 1)) and len(batch.chunk) <= given
        assert batch.bound == (found.batches[k - 1].limit if k else -1)
    assert [b.limit < 0 for b in found.batches] == [False] * (len(found.batches) - 1) + [True]
    for chain in found.chains:
        keys = np.concatenate([found.runs[r] for r in chain])
        assert (np.diff(keys.astype(np.int64)) > 0).all()
    assert sorted(r for chain in found.chains for r in chain) == list(range(len(found.runs)))


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("n", [2049, 3259, 2 * CAPACITY, 2 * CAPACITY + 1, 20_000, 100_000])
def test_order(n: int, order: str) -> None:
    entries = make_list(np.random.default_rng(n), n, order)
    check(entries, sort_long(entries))


@pytest.mark.parametrize("capacity", [512, 1024])
def test_small_units(capacity: int) -> None:
    rng = np.random.default_rng(capacity)
    for order in ORDERS:
        for n in (capacity + 1, 2 * capacity, 3 * capacity + 17):
            entries = make_list(rng, n, order)
            check(entries, sort_long(entries, capacity))


def test_chains() -> None:
    """Runs apart become one chain, whatever the order of the list; runs that overlap do not."""
    for order, most in (("sorted", 1), ("backwards", 1), ("equal, in order", 1), ("equal", 2)):  # runs of equal keys share chunks
        assert len(sort_long(make_list(np.random.default_rng(1), 20_000, order)).chains) <= most, order
    runs = [np.array([a << MASK_BITS, b << MASK_BITS], np.uint64) for a, b in ((10, 20), (15, 25), (30, 40), (1, 5), (26, 28), (41, 42))]
    assert chain_runs(runs) == [[3, 0, 2, 5], [1, 4]]


@pytest.mark.parametrize("order", ["random", "equal", "clumps"])
def test_lines(order: str) -> None:
    """What is written back: lines of the layout of lists with key and record exchanged, a line's last entry in its first place; as many in each as fit."""
    entries = make_list(np.random.default_rng(2), CAPACITY + 5, order)
    found = sort_long(entries)
    memory = found.memory()
    assert memory.shape == (found.lines, 8) and found.places[-1] == run_lines() and found.places[0] == 0
    words = [int.from_bytes(line.tobytes(), "little") for line in memory]
    back: list[int] = []
    for word in words:
        line = exchanged(np.array(line_entries(word, word >> 472), np.uint64))
        assert word & (1 << 52) - 1 == int(exchanged(line[:1])[0]) and (np.diff(line.astype(np.int64)) < 0).all()
        back += line[::-1].tolist()
    assert back == [*np.sort(entries[:CAPACITY]).tolist(), *np.sort(entries[CAPACITY:]).tolist()]
    counts = [word >> 472 for word in words]
    assert all(9 <= n <= 15 for n in counts[:-2]) and counts[-1] == 5
    assert max(counts) == (9 if order == "random" else 15)
    assert pack_lines(entries[:0]).shape == (0, 8)


def test_refused() -> None:
    for entries, capacity, text in ((np.zeros(5), 2048, "holds"), (np.arange(9000), 128, "more than 64 runs"), (np.full(2049, 1 << 52), 2048, "52 bits")):
        with pytest.raises(FlickerError, match=text):
            sort_long(entries.astype(np.uint64), capacity)


@pytest.mark.parametrize("order", ORDERS)
def test_targets(order: str) -> None:
    """A tile of n entries: at most 3 n + 2,000 cycles and four times the bytes of one writing in plain lines."""
    for n in (2049, 2600, 4097, 16_000, 32_768, 100_000):
        found = sort_long(make_list(np.random.default_rng(n), n, order))
        assert merge_cycles(found).total <= 3 * n + 2000, n
        written = -(-n // LINE_ENTRIES)
        assert 2 * written + 2 * found.lines <= 4 * written + 2 * len(found.runs), n
