"""Sorting and lists of the chip model: every scheme ends with the lists of the golden model, broadcast lies between its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flicker_tb.runner import seed

from flicker.chip import constants
from flicker.chip.delivery import broadcast_cycles, consumed
from flicker.chip.dram import MASKED_WRITE, WRITE
from flicker.chip.execute import run_scheme
from flicker.chip.lists import collect
from flicker.chip.quality import key_quality, resorted
from flicker.chip.schemes import RECOMMENDED, SCHEMES, Grain, Method, Scheme
from flicker.chip.sorting import network_latency, quantised_key, sort_lists, unit_cycles
from flicker.errors import FlickerError
from flicker.front.records import build_lists
from flicker.params import RenderConfig

# ---- sorting -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("lanes", "ways", "capacity"), [(16, 16, 2048), (4, 2, 64), (2, 3, 5), (8, 4, 8)])
def test_sorting_unit_sorts_stably(lanes, ways, capacity):
    rng = np.random.default_rng(seed())
    count = np.r_[0, 1, 2, lanes, lanes + 1, capacity, capacity + 1, 3 * capacity + 2, rng.integers(0, 200, 20)]
    start = np.r_[0, np.cumsum(count)]
    key = rng.integers(0, 40, start[-1]).astype(np.uint32)
    key[::7] = 0xFFFFFFFF
    record = np.concatenate([rng.permutation(n) for n in count])
    done = sort_lists(start, key, record, lanes=lanes, ways=ways, capacity=capacity)
    for s, n in enumerate(count):
        part = slice(start[s], start[s + 1])
        assert np.array_equal(done.record[part], record[part][np.lexsort([record[part], key[part]])])
        assert done.reads[s] == -(-n // capacity)
    first = sort_lists(start, key, record, np.minimum(count, 3), lanes, ways, capacity)
    for s, n in enumerate(count):
        assert np.array_equal(first.record[start[s] : start[s] + min(n, 3)], done.record[start[s] : start[s] + min(n, 3)])
        assert np.array_equal(np.sort(first.record[start[s] : start[s + 1]]), np.sort(record[start[s] : start[s + 1]]))
        assert first.reads[s] == min(n, 1) and first.busy[s] <= done.busy[s]


def test_sorting_unit_cycles():
    assert [network_latency(n) for n in (2, 4, 8, 16, 32)] == [1, 3, 6, 10, 15]  # docs/reference/bitonic_sorter.md
    assert [network_latency(n, 3) for n in (2, 4, 8, 16, 32)] == [1, 1, 2, 4, 5]
    # One pass up to 16 x 16 entries, two beyond; four levels of the tree drain after each.
    assert [unit_cycles(n, 16, 16) for n in (0, 1, 16, 256, 257)] == [0, 5, 20, 260, 2 * 261]


def test_depth_keys():
    depth = np.sort(np.exp(np.random.default_rng(seed()).uniform(-1, 8, 5000)).astype(np.float32))
    for kind in ("float32", "linear", "log", "fp16"):
        for bits in (8, 16, 24):
            key = quantised_key(depth, bits, kind).astype(np.int64)
            assert (np.diff(key) >= 0).all() and (kind == "fp16" or key.max() < 1 << bits)
    assert (np.diff(quantised_key(depth, 31).astype(np.int64)) == np.diff(depth.view(np.int32))).all()
    assert len(np.unique(quantised_key(depth, 12, "linear"))) <= 4096 < len(np.unique(quantised_key(depth, 24, "log")))
    with pytest.raises(FlickerError, match="bits"):
        quantised_key(depth, 0)


def test_full_keys_change_nothing(prepared):
    key = quantised_key(prepared.view.projected.depth, 31)
    assert np.array_equal(resorted(prepared.view.projected, key).index, prepared.view.projected.index)
    full, coarse = (db for _, _, db in key_quality(prepared.view.projected, prepared.view.camera, [("float32", 31), ("float32", 8)]))
    assert np.isinf(full) and coarse < 40


# ---- lists -------------------------------------------------------------------------------------

SMALL = [replace(s, combiner_sets=4, combiner_ways=1, sort_capacity=32, record_cache_bytes=0) for s in SCHEMES.values()]


@pytest.mark.parametrize("early", [False, True])
@pytest.mark.parametrize("scheme", [*SCHEMES.values(), *SMALL], ids=lambda s: f"{s.name}-{s.sort_capacity}")
def test_schemes_end_with_the_lists_of_the_golden_model(prepared, scheme, early):
    p = prepared
    result = run_scheme(p.splats, scheme, p.needed if early else None, ahead=4)
    assert np.array_equal(result.start, p.lists.start)
    assert np.array_equal(p.splats.projected[result.record], p.lists.entry)
    assert len(p.lists.entry) > 3000
    moved = {s.name: s for s in result.streams}
    if scheme.method is Method.LINKED and result.longest <= scheme.sort_capacity:
        assert moved["list read"].moved_bytes == moved["list write"].moved_bytes
    assert moved["record read"].moved_bytes == result.missed * constants.RECORD_BYTES
    assert result.missed <= result.fetched and (scheme.record_cache_bytes or result.missed == result.fetched)
    used = result.entries * scheme.entry_bits // 8
    assert moved["list write"].used_bytes == used <= moved["list write"].moved_bytes
    assert result.early_stop > 0 if early else result.early_stop == 0


def test_short_keys_make_the_lists_that_they_say(prepared):
    p = prepared
    result = run_scheme(p.splats, replace(SCHEMES[RECOMMENDED], key_bits=10))
    short = resorted(p.view.projected, quantised_key(p.view.projected.depth, 10, "linear"))
    lists = build_lists(short, p.view.camera, RenderConfig())
    assert np.array_equal(p.view.projected.index[p.splats.projected[result.record]], short.index[lists.entry])
    assert not np.array_equal(p.splats.projected[result.record], p.lists.entry)
    assert result.scheme.entry_bits == 10 + 24 + 4


def test_counting_fills_lines_when_the_buffer_is_large(prepared):
    scheme = replace(SCHEMES["counting-tile"], combiner_sets=4096)
    result = run_scheme(prepared.splats, scheme)
    write = next(s for s in result.streams if s.name == "list write")
    box = prepared.splats.box
    tiles = np.zeros((5, 6), int)
    for x0, x1, y0, y1 in box:
        tiles[y0 // 2 : (y1 - 1) // 2 + 1, x0 // 2 : (x1 - 1) // 2 + 1] += 1
    assert result.entries == tiles.sum() == prepared.lists.tile_pairs
    assert len(write.burst) == (-(-tiles // scheme.per_line)).sum() == len(np.unique(write.burst))
    assert (write.kind == WRITE).all()
    scattered = run_scheme(prepared.splats, replace(scheme, combiner_sets=1, combiner_ways=1))
    again = next(s for s in scattered.streams if s.name == "list write")
    # One line: a burst ends with the list's turn or with the line, and is masked unless it began with the line.
    fill, last, kinds = {}, None, []
    for x0, x1, y0, y1 in box:
        for tile in ((y, x) for y in range(y0 // 2, (y1 - 1) // 2 + 1) for x in range(x0 // 2, (x1 - 1) // 2 + 1)):
            slot = fill.get(tile, 0) % scheme.per_line
            if tile != last or slot == 0:
                kinds.append(WRITE if slot == 0 else MASKED_WRITE)
            fill[tile] = fill.get(tile, 0) + 1
            last = tile
    assert again.kind.tolist() == kinds and MASKED_WRITE in kinds and WRITE in kinds


def test_needed_entries_finish_their_pixels(prepared):
    """`consumed` against a plain loop over pixels, for some sub-tiles; opaque ones must be among them."""
    projected, lists = prepared.view.projected, prepared.lists
    stopped = 0
    opaque = replace(projected, opacity=np.full_like(projected.opacity, 0.95))
    for p in (projected, opaque):
        needed = consumed(p, lists)
        for s in range(0, len(needed), 5):
            y, x = np.mgrid[:8, :8]
            x, y = x + s % lists.cols * 8, y + s // lists.cols * 8
            inside = (x < lists.width) & (y < lists.height)
            t, open_ = np.ones((8, 8)), inside.copy()
            count = 0
            for i in lists.entry[lists.start[s] : lists.start[s + 1]]:
                if not open_.any():
                    break
                count += 1
                dx, dy = x - p.mean[i, 0], y - p.mean[i, 1]
                a, b, c = p.conic[i]
                e = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
                alpha = np.where(e >= 0, np.minimum(0.99, p.opacity[i] * np.exp(-e)), 0)
                hit = open_ & (alpha >= 1 / 255)
                done = hit & (t * (1 - alpha) < 1e-4)
                open_ &= ~done
                t = np.where(hit & ~done, t * (1 - alpha), t)
            assert needed[s] == count
            stopped += count < lists.start[s + 1] - lists.start[s]
    assert stopped > 5


def test_early_stop_fetches_what_is_needed(prepared):
    p = prepared
    whole, half = (run_scheme(p.splats, SCHEMES[RECOMMENDED], n, ahead=0) for n in (None, np.diff(p.lists.start) // 2))
    wanted = 0
    grid = np.arange(p.lists.rows * p.lists.cols).reshape(p.lists.rows, p.lists.cols)
    for y in range(0, p.lists.rows, 2):
        for x in range(0, p.lists.cols, 2):
            lists = [p.lists.entry[p.lists.start[s] : p.lists.start[s] + (p.lists.start[s + 1] - p.lists.start[s]) // 2]
                     for s in grid[y : y + 2, x : x + 2].ravel()]
            wanted += len(np.unique(np.concatenate(lists)))
    assert half.fetched == wanted < whole.fetched == p.lists.tile_pairs


def test_tight_boxes_change_no_picture(prepared):
    p = prepared
    tight = collect(p.view.projected, p.view.camera, tight=True)
    assert len(tight) <= len(p.splats)
    radii = np.minimum(p.view.projected.radii, (np.sqrt(2 * np.log(np.maximum(p.view.projected.opacity * 255, 1)))[:, None] * (1 + 1e-9)
                                           * np.sqrt(p.view.projected.cov2d[:, ::2])))
    lists = build_lists(replace(p.view.projected, radii=radii), p.view.camera, RenderConfig())
    widths = (tight.box[:, 1] - tight.box[:, 0]) * (tight.box[:, 3] - tight.box[:, 2])
    assert widths.sum() == len(lists.entry) < len(p.lists.entry)
    same = consumed(p.view.projected, lists)
    # What a list lost never contributes: the entry that finishes a sub-tile is the same.
    last = [lst.entry[lst.start[:-1] + n - 1][n < np.diff(lst.start)] for lst, n in ((p.lists, p.needed), (lists, same))]
    assert np.isin(last[1], last[0]).all()


def test_broadcast_between_barrier_free_and_lockstep(prepared):
    p = prepared
    n = p.lists.rows * p.lists.cols
    cycles = np.random.default_rng(seed()).integers(200, 2000, n) * (np.diff(p.lists.start) > 0)
    grid = cycles.reshape(p.lists.rows, p.lists.cols)
    alone = max(grid[k // 2 :: 2, k % 2 :: 2].sum() for k in range(4))
    got = [broadcast_cycles(p.splats, p.needed, cycles, depth) for depth in (1, 16, 256, 100_000)]
    assert sorted(got, reverse=True) == got
    assert alone <= got[-1] <= alone * 1.02 < got[0]
    with pytest.raises(FlickerError, match="depth"):
        broadcast_cycles(p.splats, p.needed, cycles, 0)


def test_scheme_arguments_are_checked():
    with pytest.raises(FlickerError, match="combiner_ways"):
        Scheme(Method.LINKED, Grain.TILE, combiner_ways=0)
    with pytest.raises(FlickerError, match="record_cache_bytes"):
        Scheme(Method.LINKED, Grain.TILE, record_cache_bytes=5)
