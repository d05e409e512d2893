"""Chip model: culls lose nothing, DRAM follows its timing, a frame adds up; command and tables.

Random scenes, seeded by FLICKER_SEED; small enough for seconds. Not covered: whether the assumptions of `constants` are good ones.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from chip_samples import camera, turned_camera
from flicker_tb.runner import seed
from scene_samples import random_scene
from typer.testing import CliRunner

from flicker import markdown
from flicker.chip import constants
from flicker.chip.compare import estimate
from flicker.chip.cull import cull
from flicker.chip.dram import MASKED_WRITE, READ, WRITE, DramConfig, Refresh, Stream, behind_port, interleave, port_config, simulate
from flicker.chip.execute import run_scheme
from flicker.chip.frame import ChipConfig, frame_estimate, prepare
from flicker.chip.lists import collect
from flicker.chip.preprocessing import LANES, WAITING, Beats, UnitCycles, phases
from flicker.chip.schemes import RECOMMENDED, SCHEMES, Grain
from flicker.cli.main import app
from flicker.errors import FlickerError
from flicker.explore.configurations import get_configuration, run
from flicker.explore.machine import subtile_cycles
from flicker.front.projection import project
from flicker.front.reference import render_reference
from flicker.front.view import View
from flicker.scene.clusters import build_clusters, morton_order
from flicker.scene.files import save_ply
from flicker.scene.memory import MemoryFormat, layout, through_memory
from flicker.sim.memory import Dram

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
        if k % 4 == 0:  # the principal point off the middle
            view = replace(view, cx=rng.uniform(-300, 300), cy=rng.uniform(-300, 300))
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


# ---- DRAM --------------------------------------------------------------------------------------

ONE = DramConfig(channels=1, refresh=Refresh.NONE)
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
    turn = simulate(np.arange(4), np.array([READ, WRITE, READ, WRITE]), replace(d, window=1, write_places=0))
    to_write = d.rl + d.tdqsck + d.burst_clocks + 1 - d.wl
    to_read = d.wl + d.burst_clocks + d.twtr + 1
    assert turn.clocks == d.trcd + 2 * to_write + to_read + d.wl + d.burst_clocks


def test_dram_gathers_writes():
    """Reads and writes of one page in turn: 32 of each between two turns of the bus, from three quarters of the places for writes to one."""
    d = ONE
    assert (d.window, d.write_places) == (32, 64)
    drains = 5
    n = 16 + 32 * drains  # 16 reads fill the places to 48; 32 writes and 32 reads by turns; the last 16 writes
    kinds = np.tile([READ, WRITE], n)
    to_write = d.rl + d.tdqsck + d.burst_clocks + 1 - d.wl
    to_read = d.wl + d.burst_clocks + d.twtr + 1
    turns = drains + 1 + drains
    r = simulate(np.arange(2 * n) % PAGE, kinds, d)
    assert r.clocks == d.trcd + (2 * n - 1 - turns) * d.tccd + (drains + 1) * to_write + drains * to_read + d.wl + d.burst_clocks
    few = simulate(np.arange(40) % PAGE, np.tile([READ, WRITE], 20), d)  # no read waits any more: writes move
    assert few.clocks == d.trcd + 38 * d.tccd + to_write + d.wl + d.burst_clocks
    dram = Dram(d.timing)  # a gathered write has been told once it has a place
    writes = [dram.push(0, 32 * (k % PAGE), WRITE) for k in range(d.write_places + 3)]
    assert [dram.done(k) for k in writes] == [0] * d.write_places + [None] * 3
    dram.advance(d.trcd + 1)
    assert [dram.done(k) for k in writes[-3:]] == [d.trcd, None, None]
    dram.push(d.trcd + 1, 0, READ)
    dram.advance(1 << 40)
    assert [dram.done(k) for k in writes[-3:]] == [d.trcd + k * d.tccd for k in range(3)]
    # The read came among 66 writes and waits until 16 are left.
    assert dram.counts().clocks == d.trcd + (len(writes) - 16 - 1) * d.tccd + to_read + to_write + 15 * d.tccd + d.wl + d.burst_clocks
    with pytest.raises(FlickerError, match="write_places"):
        DramConfig(write_places=-1)


def test_dram_refresh_and_channels():
    d = replace(ONE, refresh=Refresh.ALL_BANKS)
    n = 40 * PAGE
    r = simulate(np.arange(n), config=d)
    lost = r.clocks - simulate(np.arange(n), config=ONE).clocks
    assert r.refreshes == r.clocks // d.trefi
    assert r.refreshes * d.trfc <= lost <= r.refreshes * (d.trfc + d.trp_all + d.trcd + d.tras)
    full = DramConfig(refresh=Refresh.NONE)
    assert simulate(np.arange(8 * n), config=full).clocks == simulate(np.arange(n), config=ONE).clocks


def test_dram_refresh_of_banks():
    """A bank that all reads are of is the last of its round, and stops them for tRFCpb; where others have work, the bus hardly waits."""
    d = replace(ONE, refresh=Refresh.PER_BANK)
    n = 20_000
    r = simulate(np.zeros(n, np.int64), config=d)
    stop = d.trtp + d.trp + d.trfc_bank + d.trcd - d.tccd  # the row is closed, and opened behind the refresh
    column, rounds = d.trcd, 0
    for _ in range(n - 1):
        column += d.tccd
        if column >= (rounds + 1) * d.banks * (d.trefi // d.banks):
            column += stop
            rounds += 1
    assert rounds > 20 and r.clocks == column + d.rl + d.burst_clocks
    assert r.activates == 1 + rounds and r.refreshes == column // (d.trefi // d.banks)
    stream = np.arange(40 * PAGE)
    free, all_banks, per_bank = (simulate(stream, config=replace(d, refresh=refresh)) for refresh in Refresh)
    assert per_bank.clocks - free.clocks < (all_banks.clocks - free.clocks) / 4
    assert per_bank.refreshes == (per_bank.clocks - d.rl - d.burst_clocks) // (d.trefi // d.banks)
    spread = np.arange(4000) * PAGE  # every activate takes a place in tRRD's order, and so does every refresh
    limit = simulate(spread, config=ONE)
    slowed = simulate(spread, config=d)
    assert slowed.clocks >= limit.clocks + (slowed.refreshes - 1) * min(d.trrd, d.tfaw // 4)


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


def dram_streams() -> dict[str, tuple[np.ndarray, np.ndarray | int, DramConfig]]:
    """Bursts, kinds and memory by name; always the same. One queue for both kinds of bursts."""
    rng = np.random.default_rng(2025)
    runs = np.concatenate([first + np.arange(size) for first, size in zip(rng.integers(0, 1 << 20, 300), rng.integers(1, 40, 300))])
    some = rng.integers(0, 1 << 12, 5000)
    kinds = rng.integers(0, 3, 5000)
    streams = {
        "scattered reads": (rng.integers(0, 1 << 24, 5000), READ, DramConfig()),
        "runs": (runs, np.repeat(rng.integers(0, 3, len(runs) // 50 + 1), 50)[: len(runs)], DramConfig()),
        "all kinds": (some, kinds, DramConfig()),
        "masked writes": (some, MASKED_WRITE, DramConfig(window=8)),
        "one channel": (some, kinds, ONE),
        "refresh": (rows_of_bank(400), READ, replace(ONE, refresh=Refresh.ALL_BANKS)),
        "narrow window": (runs, READ, DramConfig(window=1)),
        "four banks": (some, kinds, DramConfig(banks=4, interleave_bytes=256, tfaw=100)),
    }
    return {name: (burst, kind, replace(config, write_places=0)) for name, (burst, kind, config) in streams.items()}


# Clocks, activates, refreshes: what the model's first implementation (numba) gave, which the engine in C++ replaced.
DRAM_RESULTS = {
    "scattered reads": (12_163, 4_997, 8),
    "runs": (8_419, 2_027, 8),
    "all kinds": (5_581, 64, 0),
    "masked writes": (5_323, 64, 0),
    "one channel": (65_076, 3_417, 0),
    "refresh": (41_486, 400, 6),
    "narrow window": (20_129, 1_992, 24),
    "four banks": (7_434, 666, 6),
}


def spent(config: DramConfig, burst: np.ndarray, kind: np.ndarray | int = READ) -> dict[str, int]:
    """What a channel's clocks go to, all bursts at hand."""
    dram = Dram(config.timing)
    for b, k in zip(burst, np.broadcast_to(kind, burst.shape)):
        dram.push(0, int(b) * config.burst_bytes, int(k))
    dram.advance(1 << 40)
    return dram.counts().spent


def test_what_clocks_go_to():
    """In closed forms; and every clock up to the last column command once."""
    d = ONE
    nothing = dict.fromkeys(("data", "idle", "turning", "refreshing", "rows"), 0)
    assert spent(d, np.arange(PAGE)) == nothing | {"data": PAGE * d.tccd, "rows": d.trcd}
    to_write, to_read = d.rl + d.tdqsck + d.burst_clocks + 1 - d.wl, d.wl + d.burst_clocks + d.twtr + 1
    turns = spent(replace(d, window=1, write_places=0), np.arange(4), np.array([READ, WRITE, READ, WRITE]))
    assert turns == nothing | {"data": 4 * d.tccd, "rows": d.trcd, "turning": 2 * to_write + to_read - 3 * d.tccd}
    dram = Dram(d.timing)
    dram.push(0, 0, READ)
    dram.advance(5000)
    dram.push(5000, 32, READ)
    dram.advance(1 << 40)
    assert dram.counts().spent == nothing | {"data": 2 * d.tccd, "rows": d.trcd, "idle": 5000 - d.trcd - d.tccd}
    whole = replace(d, refresh=Refresh.ALL_BANKS)
    stopped, refreshes = spent(whole, np.arange(40 * PAGE)), simulate(np.arange(40 * PAGE), config=whole).refreshes
    assert refreshes * d.trfc <= stopped["refreshing"] <= refreshes * (d.trfc + d.trp_all + d.tras) and stopped["idle"] == 0
    rng = np.random.default_rng(seed())
    for config in (d, whole, replace(whole, write_places=0), replace(d, refresh=Refresh.PER_BANK)):
        burst = rng.integers(0, 1 << 16, 4000)
        clocks = spent(config, burst)
        assert sum(clocks.values()) == simulate(burst, config=config).clocks - d.rl - d.burst_clocks + d.tccd
        assert clocks["data"] == 4000 * d.tccd and clocks["turning"] == 0 and clocks["rows"] > 0
        mixed = spent(config, burst, rng.choice([READ, WRITE, MASKED_WRITE], 4000))
        assert mixed["turning"] > 0 and mixed["data"] == clocks["data"]


def test_dram_results_are_kept():
    for name, (burst, kind, config) in dram_streams().items():
        r = simulate(burst, kind, config)
        assert (r.clocks, r.activates, r.refreshes) == DRAM_RESULTS[name], name
        assert r.row_hits == len(burst) - r.activates


def test_dram_as_time_goes_on():
    """Bursts that all come at clock 0 take as long as in a list; what comes later has its data in bounds, and the bus carries one burst at a time."""
    streams = dram_streams()
    streams["refresh of banks"] = (streams["all kinds"][0], streams["all kinds"][1], DramConfig(channels=1, refresh=Refresh.PER_BANK, write_places=0))
    streams["gathered"] = (streams["runs"][0], WRITE, DramConfig())  # of both kinds a list may hold one back for the other's places
    for name, (burst, kind, config) in streams.items():
        kinds = np.broadcast_to(kind, burst.shape)
        r = simulate(burst, kind, config)
        dram = Dram(config.timing)
        numbers = [dram.push(0, int(b) * config.burst_bytes, int(k)) for b, k in zip(burst, kinds)]
        for clock in range(0, 100_000, 997):
            dram.advance(clock)
            assert all(done is None or done < clock + config.rl + config.burst_clocks for done in map(dram.done, numbers[::100]))
        dram.advance(1 << 40)
        counts = dram.counts()
        assert (counts.clocks, counts.activates, counts.refreshes) == (r.clocks, r.activates, r.refreshes), name
        assert name == "gathered" or max(map(dram.done, numbers)) == counts.clocks

    rng = np.random.default_rng(seed())
    d = replace(ONE, refresh=Refresh.ALL_BANKS)
    first = d.trcd + d.rl + d.burst_clocks
    for gap in (4, 40, 400):
        dram, clock, pushed = Dram(d.timing), 0, []
        for address in rng.integers(0, 1 << 24, 1000):
            clock += int(rng.integers(0, 2 * gap))
            dram.advance(clock)
            pushed.append((clock, dram.push(clock, int(address), READ)))
        dram.advance(1 << 40)
        took = np.array([dram.done(number) - clock for clock, number in pushed])
        ends = np.sort([dram.done(number) for _, number in pushed])
        assert (np.diff(ends) >= d.tccd).all()
        assert took.min() >= d.rl + d.burst_clocks
        if gap == 400:
            assert np.median(took) <= first + d.trp and took.max() < first + d.trp_all + d.trfc + d.tras + 3 * d.trp
        assert dram.counts().bursts == 1000
    with pytest.raises(ValueError, match="already"):
        dram.push(0, 0, READ)
    for wait in (1, d.trp_all + d.trfc - 1, d.trp_all + d.trfc + 5):  # refresh goes on while nothing waits
        dram = Dram(d.timing)
        clock = 3 * d.trefi + wait
        number = dram.push(clock, 0, READ)
        dram.advance(1 << 40)
        assert dram.done(number) == max(clock, 3 * d.trefi + d.trp_all + d.trfc) + first and dram.counts().refreshes == 3


def test_idle_latency():
    """The time of a lone read at a port is what the constants say."""
    d = DramConfig()
    assert d.idle_cycles(32) == -(-(29 + 28 + 8) * 10 // 16) and d.idle_cycles() == -(-(29 + 28 + 8 + 8) * 10 // 16)
    assert port_config().latency + d.idle_cycles() == constants.DRAM_LATENCY_CYCLES
    assert port_config(data_bits=128).latency + d.idle_cycles(16) == constants.DRAM_LATENCY_CYCLES
    assert port_config(latency=3, id_bits=2).latency == 3


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
    e = frame_estimate(p, 12_345, chip)
    size = layout(form, 4)
    by_name = {q.name: q for q in e.purposes}
    result = run_scheme(p.splats, chip.scheme, p.needed)
    if chip.as_built:
        built = p.preprocessing(form, chip.dram)
        assert {n: by_name[n].moved_bytes for n in built.bytes} == built.bytes and e.dram_cycles[0] == built.dram
        back = sum(q.moved_bytes for q in e.purposes if q.phase == "rendering")
        assert e.bytes == sum(built.bytes.values()) + back and sum(e.dram_cycles) >= e.bytes / 51.2
        return
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
    base = ChipConfig()
    slow = frame_estimate(p, 10**7, base)
    assert slow.bottleneck == "render" and slow.interval_cycles == 10**7 and slow.fps == 100
    fp16 = replace(base, memory=MemoryFormat.FP16)
    assert slow.bytes < frame_estimate(p, 0, fp16).bytes
    near = prepare(View(camera(distance=0), p.view.scene), 16)  # half of the scene is behind the camera
    two_step = replace(fp16, cluster_size=16)
    one_step = replace(two_step, two_step=False)
    no_cull = replace(one_step, cull_shape="none")
    sizes = [frame_estimate(near, 0, chip).bytes for chip in (two_step, one_step, no_cull)]
    assert sizes[0] < sizes[1] < sizes[2]
    flicker = get_configuration("flicker")
    work = run(flicker, p.view).work
    cycles, counters = flicker.simulate(work)
    e = estimate(p, flicker, base)
    found = {s.name: s.cycles for s in e.stages}
    assert found["render"] == cycles and subtile_cycles(work, counters).sum() > 0
    assert found["render, broadcast"] >= 0.9 * cycles  # without the pipeline's latency
    with pytest.raises(FlickerError, match="clusters of 256"):
        frame_estimate(p, 0, replace(fp16, cluster_size=64))
    with pytest.raises(FlickerError, match="cluster_size"):
        ChipConfig(cluster_size=64)


def test_preprocessing_by_phases():
    """Three phases of full queues and a rest: the longer of units and DRAM in each."""
    step = WAITING * LANES
    went = np.concatenate([np.linspace(0, 99, step), np.linspace(100, 1099, step), np.linspace(1100, 1199, step), [1200.0] * 3]).astype(np.int64)
    units = UnitCycles(np.arange(len(went), dtype=float), went, 1300)
    table = Beats("table", np.zeros(20, np.int64), np.zeros(20), False)
    even = Beats("geometry", np.zeros(300, np.int64), np.repeat(np.arange(3) * step, 100).astype(float), False)
    assert phases(units, [table, even], 0) == units.all
    # A cycle a beat: the first phase's 120 are more than its 100 cycles, the third's 100 are not.
    assert phases(units, [table, even], 320) == 120 + 1000 + 100 + 100
    assert phases(units, [table, even], 32_000) == 32_000 + 100
    assert phases(units, [table, replace(even, due=even.due + step)], 320) == 100 + 1000 + 100 + 100


def test_narrow_port():
    """Reads and writes side by side; refresh of all banks at once takes a part of the time, the DRAM's own, that of one bank none."""
    for read, written in ((1600, 0), (0, 1600), (1600, 1599)):
        assert DramConfig(port_bits=128, refresh=Refresh.PER_BANK).port_cycles(read, written) == 100
    d = DramConfig(port_bits=128)
    assert d.port_cycles(16 * d.trefi - 16 * d.trfc, 0) == d.trefi


def test_bursts_behind_a_narrow_port():
    """Reads alone, writes alone and both take the port's rate or what those that wait for each other add; few under way wait for the memory."""
    narrow = DramConfig(port_bits=128, refresh=Refresh.NONE)
    assert narrow.narrow_port and DramConfig(port_bits=256).narrow_port and not DramConfig().narrow_port
    reads, writes = (Stream.span("", 0, 64_000, kind) for kind in (READ, WRITE))
    alone = [behind_port(s, narrow, 64, 64) for s in (reads, writes)]
    least = 64_000 // 16
    assert all(least < cycles < least + 100 for cycles in alone)
    order = interleave([reads, replace(writes, burst=writes.burst + 10_000)], 64)
    both = Stream("both", *order, 128_000)
    free, tied, few = (behind_port(both, narrow, *limits) for limits in ((64, 2000), (64, 1), (2, 2000)))
    assert least < free < 1.1 * least and 1.6 * least < tied < 2.3 * least and few > 2 * free
    assert behind_port(both, DramConfig(port_bits=256, refresh=Refresh.NONE), 64, 2000) > simulate(*order, DramConfig(refresh=Refresh.NONE)).cycles
    assert behind_port(replace(reads, burst=reads.burst[:0], kind=reads.kind[:0]), narrow, 1, 1) == 0
    with pytest.raises(ValueError, match="at least 1"):
        behind_port(reads, narrow, 0, 1)
    with pytest.raises(ValueError, match="differ in shape"):
        behind_port(replace(reads, kind=reads.kind[1:]), narrow, 64, 64)


def test_recommended_scheme_fits_the_feature_buffers():
    cols, rows = 160, 90
    scheme = SCHEMES[RECOMMENDED]
    assert scheme.grain == Grain.TILE
    splats = collect(project(random_scene(seed(), 500, 0), camera(cols * 8, rows * 8, focal=900)), camera(cols * 8, rows * 8, focal=900))
    assert sum(run_scheme(splats, scheme).on_chip.values()) <= constants.FEATURE_BUFFER_BYTES


def test_scene_through_memory_looks_the_same(prepared):
    """Order of magnitude only: a field in the wrong place would leave no picture."""
    p = prepared
    reference = render_reference(p.view.projected, p.view.camera)
    for form in MemoryFormat:
        other = render_reference(project(through_memory(p.view.scene, form, 64), p.view.camera), p.view.camera)
        assert 0 < np.abs(other - reference).mean() < 0.02


# ---- command and tables ------------------------------------------------------------------------


def test_command(tmp_path):
    path = tmp_path / "scene.ply"
    save_ply(random_scene(seed(), 300, 1), path)
    options = ["--size", "64x48", "--schemes", "--keys", "--formats", "--constants", "--out", str(tmp_path / "a.json")]
    done = CliRunner().invoke(app, ["chip", str(path), *options])
    assert done.exit_code == 0, done.output
    for text in ("linked-tile", "bottleneck", "hand out records", "fp16-local", "exists as RTL"):
        assert text in done.output
    written = json.loads((tmp_path / "a.json").read_text())
    assert written["interval_cycles"] > 0 and written["rtl"]["interval_cycles"] >= written["rtl"]["dram_cycles"] > 0
    for config, memory, has in (("faithful", "chunk", False), ("faithful", "fp16", True), ("gscore", "chunk", True), ("lanes", "chunk", False)):
        done = CliRunner().invoke(app, ["chip", str(path), "--size", "64x48", "--config", config, "--memory", memory])
        assert done.exit_code == 0 and ("exists as RTL" in done.output) == has, done.output
    for wrong, text in ((["--scheme", "x"], "--scheme"), (["--memory", "x"], "--memory"), (["--refresh", "x"], "--refresh"), (["--view", "9"], "view 9")):
        failed = CliRunner().invoke(app, ["chip", str(path), *wrong])
        assert isinstance(failed.exception, FlickerError) and text in str(failed.exception)


def test_tables():
    assert markdown.table(("a", "b"), [("1", "2")], numbers=True) == "| a | b |\n| --- | ---: |\n| 1 | 2 |"
