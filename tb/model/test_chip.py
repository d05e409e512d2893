"""Chip model: every scheme ends with the lists of the golden model, culls lose nothing, bits survive memory, DRAM follows its timing.

Random scenes, seeded by FLICKER_SEED; small enough for seconds. Not covered: whether the assumptions of `constants` are good ones.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import gsply
import numpy as np
import pytest
import typer
from flicker_tb.runner import seed
from scene_samples import as_gsply, random_scene
from typer.testing import CliRunner

from flicker.camera import Camera
from flicker.chip import constants, tables
from flicker.chip.clusters import build_clusters, cull, morton_order
from flicker.chip.command import app
from flicker.chip.dram import MASKED_WRITE, READ, WRITE, DramConfig, Stream, interleave, simulate
from flicker.chip.frame import ChipConfig, frame_estimate, prepare, render_bound, subtile_bound
from flicker.chip.lists import RECOMMENDED, SCHEMES, Grain, Method, Scheme, broadcast_cycles, collect, consumed, run_scheme
from flicker.chip.memory import (
    MemoryFormat, decode_chunks, decode_fp16, encode_chunks, encode_fp16, layout, load_chunks, save_chunks, through_memory,
)
from flicker.chip.quality import key_quality, resorted
from flicker.chip.sorting import network_latency, quantised_key, sort_lists, unit_cycles
from flicker.errors import FlickerError
from flicker.golden.records import build_lists
from flicker.golden.render import render_golden
from flicker.params import RenderConfig
from flicker.projection import project
from flicker.reference import render_reference
from flicker.scene import Scene, load_scene, save_ply


def camera(width: int = 96, height: int = 72, distance: float = 3.0, focal: float = 80.0) -> Camera:
    """Looking along +z at the origin."""
    return Camera(width, height, focal, focal, np.array([0.0, 0.0, -distance]), np.eye(3))


def turned_camera(rng: np.random.Generator, width: int, height: int) -> Camera:
    """Any direction, near or inside the unit cube."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 2] *= np.sign(np.linalg.det(q))
    return Camera(width, height, *rng.uniform(20, 200, 2), rng.uniform(-2, 2, 3), q)


@pytest.fixture(scope="module")
def prepared():
    """A view of 2,000 random Gaussians, a few of them twice (equal depths), a few large or opaque."""
    scene = random_scene(seed(), 2000, 1)
    scene.scales[:20] *= 6
    scene.scales[20:90], scene.opacities[20:90] = 0.3, 0.99
    twice = np.r_[np.arange(2000), np.arange(100)]
    scene = Scene(scene.means[twice], scene.scales[twice], scene.quats[twice], scene.opacities[twice], scene.sh[twice])
    return prepare(scene, camera(), RenderConfig())


# ---- constants ---------------------------------------------------------------------------------


def test_every_constant_has_a_source():
    names = {n for n in vars(constants) if n.isupper() and not n.startswith("_") and n != "SOURCES"}
    assert names == set(constants.SOURCES) and all(constants.SOURCES.values())
    assert DramConfig().bytes_per_second == constants.DRAM_BYTES_PER_SECOND
    assert DramConfig().burst_bytes == constants.LINE_BYTES


# ---- clusters ----------------------------------------------------------------------------------


def test_morton_order_of_a_cube():
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    shuffled = np.random.default_rng(seed()).permutation(8)
    assert np.array_equal(corners[shuffled][morton_order(corners[shuffled])], corners)


@pytest.mark.parametrize("size", [1, 7, 64])
def test_cull_loses_no_visible_gaussian(size):
    """Random cameras in and around the scene; sizes from tiny to larger than the scene; pictures that end within a tile."""
    rng = np.random.default_rng(seed() + size)
    dropped = invisible = 0
    for k in range(40):
        scene = random_scene(seed() + k, 400, 0)
        scene.scales *= np.exp(rng.uniform(-1, 4, (400, 1))).astype(np.float32) if k % 2 else 1
        view = turned_camera(rng, int(rng.integers(1, 130)), int(rng.integers(1, 130)))
        scene, clusters = build_clusters(scene, size)
        visible = project(scene, view).index
        for shape in ("box", "sphere"):
            kept = clusters.members(cull(clusters, view, shape))
            assert np.isin(visible, kept).all()
            dropped += 400 - len(kept)
            invisible += 400 - len(visible)
    assert dropped > (0.5 if size == 1 else 0.2) * invisible > 0


def test_cluster_bounds_hold_their_members():
    scene, clusters = build_clusters(random_scene(seed(), 333, 0), 50)
    assert len(clusters) == 7 and clusters.start[-1] == 333
    for k in range(len(clusters)):
        part = slice(clusters.start[k], clusters.start[k + 1])
        means = scene.means[part].astype(np.float64)
        assert (means >= clusters.low[k]).all() and (means <= clusters.high[k]).all()
        assert (np.linalg.norm(means - clusters.centre[k], axis=1) <= clusters.radius[k]).all()
        assert scene.scales[part].max() == clusters.sigma[k]
    with pytest.raises(FlickerError, match="shape"):
        cull(clusters, camera(), "cone")


# ---- memory formats ----------------------------------------------------------------------------


def test_fp16_is_rounded_once():
    scene, _ = build_clusters(random_scene(seed(), 300, 2), 64)
    scene.means[:] += 100  # far from the origin, where FP16 is coarse
    plain, local = (encode_fp16(scene, 64, local) for local in (False, True))
    size = layout(MemoryFormat.FP16, 9)
    assert plain.geometry.nbytes + plain.colour.nbytes == 300 * (size.geometry + size.colour)
    assert np.array_equal(plain.geometry[:, :3].view(np.float16), scene.means.astype(np.float16))
    assert np.array_equal(plain.colour[:, 1:].view(np.float16), scene.sh.reshape(300, -1).astype(np.float16))
    error = [np.abs(decode_fp16(data).means - scene.means).max() for data in (plain, local)]
    assert error[0] > 0.02 and error[1] < 0.001
    assert plain.clamped == 0 and encode_fp16(replace(scene, means=scene.means * 1e4)).clamped > 0


def test_chunks_round_to_the_nearest_code():
    scene, _ = build_clusters(random_scene(seed(), 700, 2), 256)
    data = encode_chunks(scene)
    back = decode_chunks(data)
    steps = np.array([2047, 1023, 2047])
    chunk = np.arange(700) // 256
    for values, other, column in ((scene.means, back.means, 0), (np.log(scene.scales), np.log(back.scales), 6)):
        step = (data.bounds[:, column + 3 : column + 6] - data.bounds[:, column : column + 3]) / steps
        assert (np.abs(values.astype(float) - other) <= step[chunk] * 0.5 + 1e-6).all()
    assert np.abs(scene.opacities - back.opacities).max() <= 0.5 / 255 + 1e-6
    assert np.abs(scene.sh[:, 1:] - back.sh[:, 1:]).max() <= 0.5 / 32 + 1e-6
    along = np.abs((scene.quats * back.quats).sum(axis=1))
    assert along.min() > 1 - 3e-6  # half a step of 1/1023 * sqrt(2) in three components
    again = encode_chunks(back, bounds=data.bounds)
    assert np.array_equal(again.packed[:, [0, 2, 3]], data.packed[:, [0, 2, 3]]) and np.array_equal(again.sh, data.sh)
    assert (again.packed[:, 1] == data.packed[:, 1]).mean() > 0.99  # the two largest components may tie


def test_scaled_sh_codes(tmp_path):
    scene, _ = build_clusters(random_scene(seed(), 700, 2), 256)
    scene.sh[256:512, 1:] = 0  # a chunk without any
    scene.sh[300, 0] = 5
    data = encode_chunks(scene, scaled_sh=True)
    back = decode_chunks(data)
    largest = np.repeat([np.abs(scene.sh[k : k + 256, 1:]).max() for k in (0, 256, 512)], 256)[:700]
    assert (np.abs(back.sh[:, 1:] - scene.sh[:, 1:]).max(axis=(1, 2)) <= largest / 254 + 1e-6).all()
    assert (back.sh[256:512, 1:] == 0).all() and data.sh.min() >= 1
    assert np.array_equal(decode_chunks(encode_chunks(scene)).means, back.means)
    with pytest.raises(FlickerError, match="scaled"):
        save_chunks(data, tmp_path / "a.ply")


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_chunks_in_a_file_are_what_gsply_reads(tmp_path, degree):
    scene, _ = build_clusters(random_scene(seed(), 600, degree), 256)
    data = encode_chunks(scene)
    save_chunks(data, tmp_path / "a.compressed.ply")
    theirs, ours = load_scene(tmp_path / "a.compressed.ply"), decode_chunks(data)
    for name, tolerance in (("means", 1e-6), ("scales", 1e-6), ("quats", 1e-6), ("opacities", 6e-5), ("sh", 1e-5)):
        assert np.abs(getattr(theirs, name) - getattr(ours, name)).max() < tolerance, name
    bits = load_chunks(tmp_path / "a.compressed.ply")
    assert all(np.array_equal(getattr(bits, n), getattr(data, n)) for n in ("bounds", "packed", "sh"))
    assert data.bounds.nbytes + data.packed.nbytes + data.sh.nbytes == layout(MemoryFormat.CHUNK, (degree + 1) ** 2).total(600, 3)
    (tmp_path / "b.ply").write_bytes((tmp_path / "a.compressed.ply").read_bytes()[:-1])
    with pytest.raises(FlickerError, match="b.ply"):
        load_chunks(tmp_path / "b.ply")


def test_chunks_equal_gsplys_writer(tmp_path):
    """gsply computes in float32: a value on the edge of a code may fall one code lower or higher."""
    scene, _ = build_clusters(random_scene(seed(), 2000, 1), 256)
    gsply.plywrite(tmp_path / "a.ply", as_gsply(scene), compressed=True)
    (written,) = tmp_path.glob("*.ply")
    theirs, ours = load_chunks(written), encode_chunks(scene)
    assert np.allclose(theirs.bounds, ours.bounds, atol=1e-6)
    for column, widths in ((0, (11, 10, 11)), (1, (2, 10, 10, 10)), (2, (11, 10, 11)), (3, (8, 8, 8, 8))):
        shift = 32
        for width in widths:
            shift -= width
            a, b = ((d.packed[:, column].astype(np.int64) >> shift) & ((1 << width) - 1) for d in (theirs, ours))
            assert np.abs(a - b).max() <= 1 and (a == b).mean() > 0.98, (column, shift)
    assert (theirs.sh == ours.sh).all()


def test_own_decoder_on_a_file_of_playcanvas():
    folder = os.environ.get("FLICKER_SCENES")
    if not folder:
        pytest.skip("FLICKER_SCENES names no folder of scenes")
    path = Path(folder) / "flowers" / "flowers.compressed.ply"
    data, theirs = load_chunks(path), load_scene(path)
    ours = decode_chunks(data)
    for name, tolerance in (("means", 1e-6), ("scales", 1e-6), ("quats", 1e-6), ("opacities", 6e-5), ("sh", 1e-5)):
        assert np.abs(getattr(theirs, name) - getattr(ours, name)).max() < tolerance, name
    again = encode_chunks(ours, bounds=data.bounds)
    assert np.array_equal(again.packed[:, [0, 2, 3]], data.packed[:, [0, 2, 3]]) and np.array_equal(again.sh, data.sh)


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
    assert [network_latency(n) for n in (2, 4, 8, 16, 32)] == [1, 3, 6, 10, 15]  # docs/bitonic_sorter.md
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
    key = quantised_key(prepared.projected.depth, 31)
    assert np.array_equal(resorted(prepared.projected, key).index, prepared.projected.index)
    full, coarse = (db for _, _, db in key_quality(prepared.projected, prepared.camera, [("float32", 31), ("float32", 8)]))
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
    short = resorted(p.projected, quantised_key(p.projected.depth, 10, "linear"))
    lists = build_lists(short, p.camera, RenderConfig())
    assert np.array_equal(p.projected.index[p.splats.projected[result.record]], short.index[lists.entry])
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
    projected, lists = prepared.projected, prepared.lists
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
    tight = collect(p.projected, p.camera, tight=True)
    assert len(tight) <= len(p.splats)
    radii = np.minimum(p.projected.radii, (np.sqrt(2 * np.log(np.maximum(p.projected.opacity * 255, 1)))[:, None] * (1 + 1e-9)
                                           * np.sqrt(p.projected.cov2d[:, ::2])))
    lists = build_lists(replace(p.projected, radii=radii), p.camera, RenderConfig())
    widths = (tight.box[:, 1] - tight.box[:, 0]) * (tight.box[:, 3] - tight.box[:, 2])
    assert widths.sum() == len(lists.entry) < len(p.lists.entry)
    same = consumed(p.projected, lists)
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


# ---- DRAM --------------------------------------------------------------------------------------

ONE = DramConfig(channels=1, refresh=False)
PAGE = ONE.page_bytes // ONE.burst_bytes
BANK = PAGE * ONE.banks  # bursts between rows of a bank


def rows_of_bank(count: int, bank: int = 0) -> np.ndarray:
    """Bursts in successive rows of one bank (the address map exclusive-ors bank and row)."""
    row = np.arange(count)
    return row * BANK + (bank ^ row % ONE.banks) * PAGE


def test_dram_closed_forms():
    d = ONE
    tail = d.rl + d.burst_clocks
    assert simulate(np.arange(0), config=d).clocks == 0
    assert simulate(np.arange(1), config=d).clocks == d.trcd + tail
    one_page = simulate(np.arange(PAGE), config=d)
    assert one_page.clocks == d.trcd + (PAGE - 1) * d.tccd + tail and one_page.activates == 1
    stream = simulate(np.arange(20 * PAGE), config=d)  # the next row opens while the last one is read
    assert stream.clocks == d.trcd + (20 * PAGE - 1) * d.tccd + tail and stream.activates == 20
    same = simulate(rows_of_bank(10), config=d)
    assert same.clocks == 9 * (d.tras + d.trp) + d.trcd + tail
    spread = simulate(np.arange(40) * PAGE, config=d)  # a row each, banks in turn: tRRD, and tFAW = 4 tRRD
    assert spread.clocks == 39 * max(d.trrd, d.tfaw // 4) + d.trcd + tail
    slow = simulate(np.arange(40) * PAGE, config=replace(d, tfaw=100))
    assert slow.clocks == 9 * 100 + 3 * d.trrd + d.trcd + tail
    written = simulate(np.arange(PAGE), WRITE, d)
    assert written.clocks == d.trcd + (PAGE - 1) * d.tccd + d.wl + d.burst_clocks
    masked = simulate(np.arange(PAGE), MASKED_WRITE, d)
    assert masked.clocks == d.trcd + (PAGE - 1) * d.tccd_masked + d.wl + d.burst_clocks
    turn = simulate(np.arange(4), np.array([READ, WRITE, READ, WRITE]), replace(d, window=1))
    to_write = d.rl + d.tdqsck + d.burst_clocks + 1 - d.wl
    to_read = d.wl + d.burst_clocks + d.twtr + 1
    assert turn.clocks == d.trcd + 2 * to_write + to_read + d.wl + d.burst_clocks


def test_dram_refresh_and_channels():
    d = replace(ONE, refresh=True)
    n = 40 * PAGE
    r = simulate(np.arange(n), config=d)
    lost = r.clocks - simulate(np.arange(n), config=ONE).clocks
    assert r.refreshes == r.clocks // d.trefi
    assert r.refreshes * d.trfc <= lost <= r.refreshes * (d.trfc + d.trp_all + d.trcd + d.tras)
    full = DramConfig(refresh=False)
    assert simulate(np.arange(8 * n), config=full).clocks == simulate(np.arange(n), config=ONE).clocks


def test_dram_bounds():
    rng = np.random.default_rng(seed())
    for d in (DramConfig(), DramConfig(window=4), DramConfig(interleave_bytes=256)):
        bursts = rng.integers(0, 1 << 24, 20_000)
        gather = simulate(bursts, config=d)
        assert gather.efficiency <= d.burst_clocks / d.trrd  # a row each, at best one every tRRD
        stream = simulate(np.arange(20_000), config=d)
        assert gather.efficiency < stream.efficiency <= 1 - d.trfc / d.trefi + 0.02
        assert gather.bytes == 20_000 * 32 and gather.activates > 0.9 * 20_000
    assert simulate(bursts, config=DramConfig(window=4)).clocks > simulate(bursts).clocks
    with pytest.raises(FlickerError, match="banks"):
        DramConfig(banks=6)
    with pytest.raises(FlickerError, match="negative"):
        simulate(np.array([-1]))


def test_streams_and_interleaving():
    a = Stream.items("a", 64, 20, np.array([0, 1, 5]), READ)  # bytes 64-84, 84-104, 164-184
    assert a.burst.tolist() == [2, 3, 5] and a.used_bytes == 60 and a.moved_bytes == 96
    b = Stream.ranges("b", np.array([1600, 100]), np.array([65, 0]), WRITE)
    assert b.burst.tolist() == [50, 51, 52]
    c = Stream.span("c", 3200, 3201, WRITE)
    assert c.burst[0] == 100 and len(c.burst) == 101 and c.used_bytes == 3201
    burst, kind = interleave([a, b, c], 2)
    assert sorted(burst.tolist()) == sorted(a.burst.tolist() + b.burst.tolist() + c.burst.tolist())
    assert (kind == WRITE).sum() == 104
    for s in (a, b, c):  # order within a stream is kept
        assert [x for x in burst.tolist() if x in s.burst] == s.burst.tolist()
    assert len(interleave([])[0]) == 0


# ---- frame -------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", list(MemoryFormat))
@pytest.mark.parametrize("name", list(SCHEMES))
def test_frame_adds_up(prepared, form, name):
    p = prepared
    chip = ChipConfig(memory=form, scheme=SCHEMES[name])
    e = frame_estimate(p.scene, p.camera, RenderConfig(), 12_345, chip, p)
    size = layout(form, 4)
    by_name = {q.name: q for q in e.purposes}
    result = run_scheme(p.splats, chip.scheme, p.needed)
    assert by_name["geometry"].used_bytes == e.counts["geometry read"] * size.geometry
    assert by_name["opacity and colour"].used_bytes == e.counts["records"] * size.colour
    assert by_name["record write"].moved_bytes == len(p.splats) * 32
    assert by_name["pixel write"].used_bytes == 96 * 72 * 4
    parameters = ("cluster headers", "geometry", "opacity and colour", "record write", "pixel write")
    assert e.bytes == result.bytes() + sum(by_name[n].moved_bytes for n in parameters)
    assert all(q.used_bytes <= q.moved_bytes or q.name == "opacity and colour" for q in e.purposes)
    assert e.interval_cycles >= max(sum(e.dram_cycles), *(s.cycles for s in e.stages))
    assert e.interval_cycles <= e.latency_cycles + sum(e.dram_cycles)
    assert sum(e.dram_cycles) >= e.bytes / 51.2
    assert e.counts["records"] <= e.counts["visible"] <= e.counts["geometry read"] <= e.counts["Gaussians"]


def test_frame_bottleneck_and_choices(prepared):
    p = prepared
    config = RenderConfig()
    base = ChipConfig()
    slow = frame_estimate(p.scene, p.camera, config, 10**7, base, p)
    assert slow.bottleneck == "render" and slow.interval_cycles == 10**7 and slow.fps == 100
    fp16 = replace(base, memory=MemoryFormat.FP16)
    assert slow.bytes < frame_estimate(p.scene, p.camera, config, 0, fp16, p).bytes
    near = prepare(p.scene, camera(distance=0), config, 16)  # half of the scene is behind the camera
    two_step = replace(fp16, cluster_size=16)
    one_step = replace(two_step, two_step=False)
    no_cull = replace(one_step, cull_shape="none")
    sizes = [frame_estimate(near.scene, near.camera, config, 0, chip, near).bytes for chip in (two_step, one_step, no_cull)]
    assert sizes[0] < sizes[1] < sizes[2]
    golden = render_golden(p.lists, config)
    sub = subtile_bound(p.lists, config, golden)
    bound = render_bound(p.lists, config, golden)
    e = frame_estimate(p.scene, p.camera, config, bound, base, p, subtile_cycles=sub)
    assert next(s.cycles for s in e.stages if s.name == "render, broadcast") >= bound
    with pytest.raises(FlickerError, match="clusters of 256"):
        frame_estimate(p.scene, p.camera, config, 0, replace(fp16, cluster_size=64), p)
    with pytest.raises(FlickerError, match="cluster_size"):
        ChipConfig(cluster_size=64)


def test_recommended_scheme_fits_the_feature_buffers():
    cols, rows = 160, 90
    scheme = SCHEMES[RECOMMENDED]
    assert scheme.grain == Grain.TILE
    splats = collect(project(random_scene(seed(), 500, 0), camera(cols * 8, rows * 8, focal=900)), camera(cols * 8, rows * 8, focal=900))
    assert sum(run_scheme(splats, scheme).on_chip.values()) <= constants.FEATURE_BUFFER_BYTES


def test_scene_through_memory_looks_the_same(prepared):
    """Order of magnitude only: a field in the wrong place would leave no picture."""
    p = prepared
    reference = render_reference(p.projected, p.camera)
    for form in MemoryFormat:
        other = render_reference(project(through_memory(p.scene, form, 64), p.camera), p.camera)
        assert 0 < np.abs(other - reference).mean() < 0.02


# ---- command and tables ------------------------------------------------------------------------


def test_command(tmp_path):
    path = tmp_path / "scene.ply"
    save_ply(random_scene(seed(), 300, 1), path)
    options = ["--size", "64x48", "--schemes", "--keys", "--formats", "--constants", "--out", str(tmp_path / "a.json")]
    done = CliRunner().invoke(app, [str(path), *options])
    assert done.exit_code == 0, done.output
    for text in ("linked-tile", "bottleneck", "hand out records", "fp16-local"):
        assert text in done.output
    assert '"interval_cycles"' in (tmp_path / "a.json").read_text()
    for wrong, text in ((["--scheme", "x"], "--scheme"), (["--memory", "x"], "--memory"), (["--view", "9"], "view 9")):
        failed = CliRunner().invoke(app, [str(path), *wrong])
        assert isinstance(failed.exception, FlickerError) and text in str(failed.exception)


def test_command_mounts_under_its_name(tmp_path):
    main = typer.Typer()
    main.command("other")(lambda: None)
    main.add_typer(app)
    assert "SCENE" in CliRunner().invoke(main, ["chip", "--help"]).output.upper()


def test_tables_fill_their_places():
    text = "a\n<!-- one -->\nold\n<!-- end -->\nb\n"
    assert tables.fill(text, {"one": "new"}) == "a\n<!-- one -->\nnew\n<!-- end -->\nb\n"
    with pytest.raises(FlickerError, match="two"):
        tables.fill("<!-- two -->\n<!-- end -->", {})
    assert tables.markdown(("a", "b"), [("1", "2")]) == "| a | b |\n| --- | ---: |\n| 1 | 2 |"


def test_scheme_arguments_are_checked():
    with pytest.raises(FlickerError, match="combiner_ways"):
        Scheme(Method.LINKED, Grain.TILE, combiner_ways=0)
    with pytest.raises(FlickerError, match="record_cache_bytes"):
        Scheme(Method.LINKED, Grain.TILE, record_cache_bytes=5)
