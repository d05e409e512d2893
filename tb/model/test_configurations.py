"""Configurations and their mask generators: equal to the golden model where it has the same mode, against plain restatements elsewhere, and
proved masks without a miss.

Rationale: a proof can have a hole, so every generator that claims it never misses is run on splats made to break it: axis ratios up to
10,000, means up to 5,000 pixels away, opacities at 1/255, records of random bits, the demo scene, and real scenes where
FLICKER_SCENES names them. Not covered: cycles (they are not in this layer).
"""

from __future__ import annotations

import math
import random
from dataclasses import replace
from fractions import Fraction

import numba
import numpy as np
import pytest
from flicker_tb import splats
from flicker_tb.bench import rounds
from flicker_tb.runner import seed

from flicker.arithmetic.formats import E4M3, E5M2, FP16
from flicker.arithmetic.numbers import DOWN, E4M4, E5M3, E5M6, FORMATS, NEAREST, UP, numbers, quantise
from flicker.arithmetic.thresholds import radii, thresholds
from flicker.cost.area import part
from flicker.cost.operations import Op
from flicker.cost.synth.units import lane_config
from flicker.errors import FlickerError
from flicker.explore.configurations import CONFIGURATIONS, get_configuration, run
from flicker.explore.generators.contribution import Untested
from flicker.explore.generators.exact import exact_masks, margins
from flicker.explore.generators.rows import RowFormat, inverse_radius, root_table, row_masks
from flicker.front.records import SubtileLists
from flicker.front.reference import render_reference
from flicker.front.view import View, load_view
from flicker.golden.lanes.lists import float_lists
from flicker.golden.lanes.render import lane_masks, render_lanes
from flicker.golden.masked import ACCUMULATOR_INT_BITS, accumulate, missed_pixels, pixel_tests
from flicker.golden.render import render_golden
from flicker.golden.vru import ALPHA_MIN, PAIR_FIELDS, alpha_of, pair
from flicker.params import LANE_COUNTERS, Form
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.scene.demo import demo_cameras, generate
from flicker.scene.metrics import psnr
from flicker.scene.real import REAL_VIEWS, real_scenes

# One configuration of every pair of generator and stage, so that a new one is among them.
KINDS = list({(type(c.generator), type(c.stage), c.generator.pixels): c.name for c in reversed(CONFIGURATIONS.values())}.values())
# Lanes are exact by their own arithmetic, not by the VRU's: test_equals_golden_lanes.
PROVED = [c.name for c in CONFIGURATIONS.values() if c.generator.exact and not c.generator.free and not c.stop and c.family != "lanes"]


# By default one with every mode of the contribution test, every precision in the paper's form, and without a test.
MODES = ("no-ctu-32", "faithful", "flicker", *(f"flicker-{mode}-fixed-factored" for mode in ("dense", "sparse", "spiky", "auto")),
         *(f"flicker-smooth-{precision}-conic" for precision in ("fp16", "mixed", "fp8")))
MASKS = ("exact", "exact-fp16-bound", "exact-e4m3-conic-scaled-bound", "rows-ellipse", "rows-minitile", "lanes", "pixels")


def usual(names: list[str], few: tuple[str, ...]) -> list:
    """Parameters; those that are not among the few are slow."""
    assert set(few) <= set(names)
    return [pytest.param(name, marks=[pytest.mark.slow] * (name not in few)) for name in names]


@pytest.fixture(scope="module")
def demo() -> View:
    """The demo scene, small."""
    camera = demo_cameras()[0].resized(160, 88)
    return View(camera, generate())


def alive(work) -> np.ndarray:
    """uint16 (E, 4): pixels unfinished before each element."""
    count = np.diff(work.start)
    subtile = np.repeat(np.arange(work.subtiles), count)
    place = np.arange(work.elements) - np.repeat(work.start[:-1], count)
    bits = place[:, None] <= work.pixel_finish[subtile]
    return (bits.reshape(-1, 4, 16) * (1 << np.arange(16))).sum(axis=2).astype(np.uint16)


# ---- thresholds, number systems ----------------------------------------------------------------


@numba.njit
def largest_passing(opacities, weights, base2, largest):
    """Largest weight whose alpha passes, by opacity (-1: none); weights ascend."""
    for k in range(len(opacities)):
        for e in weights:
            if alpha_of(e, opacities[k], base2)[1] >= ALPHA_MIN:
                largest[k] = e


@pytest.mark.parametrize("form", list(Form))
def test_alpha_test_is_below_threshold(form):
    """All opacities in [0, 1] and all weights: where the VRU's alpha test passes, the weight is below the threshold."""
    weights = FP16.decode(np.arange(0x4C00, dtype=np.uint16)).astype(np.float32)  # up to 16; above, g = 0
    opacities = FP16.decode(np.arange(0x3C01, dtype=np.uint16)).astype(np.float32)
    largest = np.full(len(opacities), -1.0)
    largest_passing(opacities, weights, form == Form.FACTORED, largest)
    t, rho = thresholds(form)[: len(largest)], radii(form)[: len(largest)]
    passes = largest >= 0
    assert passes.sum() > 8000 and (largest[passes] < t[passes]).all()
    assert (np.sqrt(largest[passes]) * (1 + 3.1 * 2.0**-11) + 2.0**-11 <= rho[passes]).all()
    assert (t[passes] - largest[passes] < 0.02).all()  # nor is the threshold much too high
    assert t[0] < 0 and rho[0] == 0


def test_quantise():
    """Nearest as in `formats`; directed roundings are neighbours that enclose the number; fixed point by definition."""
    rng = np.random.default_rng(seed())
    x = np.concatenate([rng.normal(size=4000) * np.exp(rng.uniform(-25, 12, 4000)), [0.0, 448.0, 1e6, -1e6, 2.0**-10, 5 * 2.0**-11]])
    for fmt, name in ((FP16, "fp16"), (E4M3, "e4m3"), (E5M2, "e5m2"), (E5M3, "e5m3"), (E4M4, "e4m4"), (E5M6, "e5m6")):
        c = FORMATS[name][:3]
        near = np.array([quantise(v, *c, NEAREST) for v in x])
        assert np.array_equal(near, np.clip(fmt.round(x), -fmt.max_finite, fmt.max_finite))
        low, high = (np.array([quantise(v, *c, d) for v in x]) for d in (DOWN, UP))
        assert (low <= x).all() and (x <= high).all()
        inside = np.abs(x) < fmt.max_finite
        assert (np.abs(near - x) == np.minimum(x - low, high - x))[inside].all()
        assert np.isinf(high[x > fmt.max_finite]).all() and (low[x > fmt.max_finite] == fmt.max_finite).all()
    for v in x[np.abs(x) < 200]:
        assert quantise(v, *FORMATS["q8.4"][:3], NEAREST) == np.rint(v * 16) / 16
    with pytest.raises(FlickerError, match="unknown number format 'e9m9'"):
        numbers("e9m9")


# ---- the registry and the work -----------------------------------------------------------------


def test_lists_that_end_as_the_reference(demo):
    """Behind `squares` lanes differ from float64 by their rounding alone; behind `ellipse` some pixels lack a splat's rest beyond 3 sigma."""
    images = {name: run(name, demo) for name in ("log-lanes", "log-lanes-squares")}
    worst = {name: 255 * np.abs(result.image - demo.reference).max() for name, result in images.items()}
    assert worst["log-lanes-squares"] < 1.5 and worst["log-lanes"] > 8
    ours, wider = (len(result.lists.entry) for result in images.values())
    assert ours < wider < 1.05 * ours


@pytest.mark.parametrize("name", [c.name for c in CONFIGURATIONS.values() if c.render_config and c.render_config.by_lanes])
def test_equals_golden_lanes(name, demo):
    """Lanes in the log domain: the golden model's pixels and counts, and the cycles and counters of the model that equals the RTL."""
    result = run(name, demo)
    config = result.configuration.render_config
    records = float_lists(demo.projected, result.lists)
    frame = render_lanes(records)
    assert np.array_equal(result.image, frame.image())
    work = result.work
    assert int(np.bitwise_count(work.contributing).sum()) == frame.total("blended") + frame.total("pixels_finished")
    assert int((work.pixel_finish < np.diff(work.start)[:, None]).sum()) == frame.total("pixels_finished") > 0
    visited = work.visit_masks() & work.unfinished()
    assert int(np.bitwise_count(visited).sum()) == frame.total("visited") and not (work.contributing & ~visited).any()
    assert np.array_equal(work.mask, ((work.visit_masks() != 0) << np.arange(4)).sum(axis=1))
    cycles, counters = result.configuration.simulate(work)
    model = simulate_lanes(lane_work(records), config, leave=True, empty=False)
    counted = [name != "skipped" for name, _ in LANE_COUNTERS]  # of pixels that are visited when finished, the work does not say whether they would pass
    assert cycles == model.cycles and np.array_equal(counters.counters[:, counted], model.counters[:, counted])
    mask, passes = lane_masks(records)
    assert not (passes & ~mask).any() and result.configuration.generator.exact
    assert 0 < counters.utilisation < 1 and 0 <= counters.stall_rate < 1
    energy = result.configuration.energy(work, cycles, counters)
    assert min(energy.values()) > 0 and abs(result.configuration.area() - part("lane_stage", lane_config(config)).ge) < 1


def test_lanes_that_take_more(demo):
    """Cores that take and dispatch more in a cycle than the RTL: the same pairs in fewer cycles, no more splats to the lanes in a cycle than allowed."""
    work = lane_work(float_lists(demo.projected, demo.lists(Form.FACTORED, "ellipse")))
    config = CONFIGURATIONS["log-lanes"].render_config.with_(slots=64, fifo_depth=64)
    built, two, four = (simulate_lanes(work, config, in_width=n, dispatch=d) for n, d in ((2, 1), (2, 2), (4, 4)))
    assert built.cycles > two.cycles > four.cycles
    for found, most in ((built, 1), (two, 2), (four, 4)):
        assert [found.total(name) for name in ("gaussians_in", "blended", "pixels_finished")] == [
            built.total(name) for name in ("gaussians_in", "blended", "pixels_finished")]
        assert found.total("dispatched") <= most * 4 * found.cycles


@pytest.mark.parametrize("name", usual([c.name for c in CONFIGURATIONS.values() if c.render_config and not c.render_config.by_lanes], MODES))
def test_equals_golden(name, demo):
    """Configurations that the RTL has: the golden model's pixels, counts and automatic mode."""
    result = run(name, demo)
    frame = render_golden(result.lists, result.configuration.render_config)
    assert np.array_equal(result.image, frame.image())
    work = result.work
    assert int(work.test_cycles.sum()) == frame.total("test_cycles")
    assert int(np.bitwise_count(work.mask).sum()) == frame.total("minitiles_tested")
    assert np.array_equal(work.fallen, frame.counts[:, 7] != 0)
    sent = ((work.mask[:, None] >> np.arange(4)) & 1).astype(bool) & (work.unfinished() != 0)
    assert int(sent.sum()) == frame.total("minitiles_sent")
    assert int(np.bitwise_count(work.contributing).sum()) == frame.total("pairs_blended") + frame.total("pixels_finished")
    ended = (work.pixel_finish < np.diff(work.start)[:, None]).sum()
    assert int(ended) == frame.total("pixels_finished")


def test_work_is_consistent(demo):
    """Contributing pixels are visited and unfinished; finish positions are those of the last pixel; oracles visit what contributes."""
    assert len(KINDS) >= 9
    for name in dict.fromkeys(("vanilla", "flicker", "faithful", *KINDS[:: rounds(3, 1)])):
        result = run(name, demo)
        work = result.work
        assert np.array_equal(work.unfinished(), alive(work))
        totals = work.totals()
        assert totals["pixels_contributing"] <= totals["pixels_visited"] <= 16 * totals["minitiles_sent"] <= 16 * totals["minitiles_masked"]
        assert work.start[-1] == work.elements == len(work.mask) and work.order.size == work.subtiles
        assert ((work.contributing & ~(work.visit_masks() & work.unfinished())) == 0).all()
        assert np.array_equal(work.finish(), work.pixel_finish.reshape(-1, 4, 16).max(axis=2))
        assert np.isfinite(result.image).all()
        if work.visit is not None:
            assert np.array_equal((work.visit != 0) @ (1 << np.arange(4)), work.mask)
        assert totals["pixels_visited"] <= work.vru_slots("checkerboard") and work.vru_slots("halves") <= 16 * totals["minitiles_sent"]
    off = run("no-ctu-32", demo)
    exact = run("oracle", demo)
    exact.work.visit[:], exact.work.pixel_finish[:] = 0, 1 << 30
    exact.work.visit[0, 0] = 0b0000_0000_0011_0111  # columns 0, 1, 2 of row 0 and 0, 1 of row 1: five in a half, three and two in the checkerboard
    assert exact.work.vru_slots("halves") == 10 and exact.work.vru_slots("checkerboard") == 6
    exact = run("oracle", demo)
    assert np.array_equal(exact.work.visit, exact.work.contributing)
    assert np.array_equal(exact.work.contributing, off.work.contributing) and np.array_equal(exact.image, off.image)
    assert off.work.contributing.any() and (off.work.finish() < np.diff(off.work.start)[:, None]).any()


def test_until_finished(demo):
    """What is left out is visited by nobody; nothing else changes."""
    work = run("flicker", demo).work
    short = work.until_finished()
    assert 0 < short.elements < work.elements
    for name in ("minitiles_sent", "pixels_visited", "pixels_contributing"):
        assert short.totals()[name] == work.totals()[name]
    assert np.array_equal(short.unfinished()[short.start[0] : short.start[1]], work.unfinished()[: short.start[1]])
    left = work.unfinished().any(axis=1).sum()
    assert short.elements == left


def test_names():
    """Every configuration has a name of its own; a wrong name is one line with close ones."""
    assert all(name == c.name for name, c in CONFIGURATIONS.items())
    with pytest.raises(FlickerError, match="configuration 'flicker-smoth-mixed-conic' is unknown; close names: flicker-smooth-mixed-conic"):
        get_configuration("flicker-smoth-mixed-conic")


def test_operations():
    """Mask generators state their operations; the counts of the exact rectangle are those of the design brief."""
    for c in CONFIGURATIONS.values():
        if c.family in ("flicker", "exact", "rows"):
            operations = c.generator.operations
            assert operations.per_element and all(o.count > 0 and o.format for o in operations.per_element)
            assert {"per", "op", "format", "count"} <= set(next(iter(operations.rows())))
    assert get_configuration("exact-fp16").generator.operations.count(Op.MUL) == 36
    assert get_configuration("flicker-sparse-fp16-factored").generator.operations.count(Op.MUL) == 24


@pytest.mark.parametrize("fraction", [10, 14, 20])
def test_accumulate(fraction):
    """Fixed-point accumulators: the FP16 product rounded half up to the last place, saturating, against rational arithmetic."""
    rng = np.random.default_rng(seed())
    unit = Fraction(1, 2**fraction)
    top = 2**ACCUMULATOR_INT_BITS - unit
    for _ in range(2000):
        w = np.float16(rng.random() * 2.0 ** -int(rng.integers(0, 14)))
        colour = np.float16(rng.choice([rng.random(), rng.random() * 40, 0.0]) * rng.choice([1, -1]))
        before = int(rng.integers(0, 2 ** (fraction + ACCUMULATOR_INT_BITS))) * unit
        product = Fraction(float(np.float16(abs(np.float32(w) * np.float32(colour)))))
        want = min(before + math.floor(product / unit + Fraction(1, 2)) * unit, top)
        assert Fraction(float(accumulate(np.float32(float(before)), np.float32(w), np.float32(colour), fraction))) == want


def test_accumulators(demo):
    """Colours alone change: the same pairs contribute, and pictures come nearer to the reference the more bits there are."""
    plain = run("rows-ellipse", demo)
    reference = render_reference(demo.projected, demo.camera)
    found = {}
    for bits in (10, 14, 20):
        result = run(f"rows-ellipse-acc{bits}", demo)
        assert np.array_equal(result.work.contributing, plain.work.contributing)
        assert np.array_equal(result.work.pixel_finish, plain.work.pixel_finish)
        found[bits] = psnr(result.image, reference)
    assert found[10] < psnr(plain.image, reference) < found[14] and found[20] > found[10]


# ---- lists and rivals --------------------------------------------------------------------------


def test_tile_lists(demo):
    """Vanilla: a splat is in the lists of all four sub-tiles of exactly the tiles that its circle's square touches."""
    p, camera = demo.projected, demo.camera
    lists = demo.lists(Form.FACTORED, "tile")
    tiles = 0
    for ty in range(-(-camera.height // 16)):
        for tx in range(-(-camera.width // 16)):
            x, y = p.mean.T
            r = p.circle
            # The INRIA rasterizer's getRect, integer division written out; means far left of the picture clip to tile 0.
            first = [np.clip(np.trunc((v - r) / 16), 0, None) for v in (x, y)]
            past = [np.trunc(np.maximum(v + r + 15, 0) / 16) for v in (x, y)]
            want = np.flatnonzero((first[0] <= tx) & (tx < past[0]) & (first[1] <= ty) & (ty < past[1]))
            tiles += len(want)
            for s in [(2 * ty + j) * lists.cols + 2 * tx + i for j in (0, 1) for i in (0, 1) if 2 * ty + j < lists.rows and 2 * tx + i < lists.cols]:
                assert np.array_equal(lists.entry[lists.start[s] : lists.start[s + 1]], want)
    assert lists.tile_pairs == tiles


def test_obb_lists(demo):
    """GSCore: what is dropped is elongated and has no point of its oriented box in the sub-tile; what is kept and elongated nearly has one."""
    p = demo.projected
    all_lists, lists = demo.lists(Form.FACTORED), demo.lists(Form.FACTORED, "obb")
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), -1).reshape(-1, 2)
    rng = np.random.default_rng(seed())
    dropped = kept = 0
    for s in rng.permutation(all_lists.cols * all_lists.rows)[:60]:
        entries = all_lists.entry[all_lists.start[s] : all_lists.start[s + 1]]
        left = set(lists.entry[lists.start[s] : lists.start[s + 1]].tolist())
        assert left <= set(entries.tolist())
        x0, y0 = 8 * (s % lists.cols), 8 * (s // lists.cols)
        for i in rng.permutation(entries)[:40]:
            xx, xy, yy = p.cov2d[i]
            values, axes = np.linalg.eigh([[xx, xy], [xy, yy]])
            if values[1] < 3.99 * values[0]:
                assert i in left
                continue
            points = p.mean[i] + (grid * 3 * np.sqrt(values)) @ axes.T
            gap = 3 * np.sqrt(values[1]) / 20  # distance of neighbouring points
            near = np.maximum(np.abs(points - (x0 + 3.5, y0 + 3.5)) - 3.5, 0).max(axis=1).min()
            if i in left:
                kept += values[1] > 4.01 * values[0]
                assert near <= gap
            else:
                dropped += 1
                assert near > 0
    assert dropped > 20 and kept > 20


def test_reach_lists(demo):
    """Lists by reach lose no pair: same picture, same contributing pixels in total, shorter lists."""
    off = run("no-ctu-32", demo)
    length = off.work.elements
    for kind in ("reach", "ellipse"):
        shorter = run(f"rows-{kind}", demo)
        assert np.array_equal(shorter.image, off.image) and shorter.work.elements < length
        assert np.bitwise_count(shorter.work.contributing).sum() == np.bitwise_count(off.work.contributing).sum()
        length = shorter.work.elements


@pytest.mark.parametrize("form", list(Form))
def test_seele_leaders(form, demo):
    """A group's four pixels are visited exactly when the VRU, asked on its own, would blend or finish at the top-left one."""
    lists = demo.lists(form)
    work = run("seele" if form == Form.FACTORED else "seele-conic", demo).work
    rng = np.random.default_rng(seed())
    visited = 0
    for n in rng.permutation(work.elements)[:200]:
        f = lists.features(n).view(np.float16).astype(np.float32)
        for m in range(4):
            want = 0
            for g in range(4):
                x, y = 4 * (m % 2) + 2 * (g % 2), 4 * (m // 2) + 2 * (g // 2)
                state = np.array([1, 0, 0, 0], np.float32)
                if pair(x, y, f, int(form), state, np.zeros(len(PAIR_FIELDS), np.float32)):
                    want |= sum(1 << (4 * (2 * (g // 2) + j) + 2 * (g % 2) + i) for j in (0, 1) for i in (0, 1))
            assert work.visit[n, m] == want
            visited += want != 0
    assert visited > 20


# ---- masks that never miss ---------------------------------------------------------------------


def hard_conics(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mean (n, 2), conic (n, 3), opacity) made to break masks: thin, slanted, far, faint, small, huge; dilated by 0.3."""
    short = np.sqrt(0.3) * np.exp(rng.uniform(0, 3, n) * (rng.random(n) < 0.5))
    ratio = np.exp(rng.uniform(0, math.log(10000), n))
    long = np.minimum(short * ratio, 20000.0)
    angle = rng.uniform(0, math.pi, n)
    axis = rng.random(n) < 0.3
    angle[axis] = np.round(angle[axis] / (math.pi / 4)) * math.pi / 4 + rng.normal(0, 1e-3, axis.sum())
    c, s = np.cos(angle), np.sin(angle)
    i0, i1 = 1 / long**2, 1 / short**2
    conic = np.stack([c * c * i0 + s * s * i1, c * s * (i0 - i1), s * s * i0 + c * c * i1], 1)
    # Along the axis anywhere up to 3 sigma (at most 5,000 pixels), across it near the edge of what contributes.
    along = rng.uniform(-3, 3, n) * np.minimum(long, 5000 / 3)
    across = rng.normal(0, 1.8, n) * short
    mean = 3.5 + rng.uniform(-4, 4, (n, 2)) + np.stack([along * c - across * s, along * s + across * c], 1)
    kind = rng.integers(0, 4, n)
    opacity = np.choose(kind, [rng.random(n), rng.uniform(0.99, 1, n), rng.uniform(1, 1.1, n) / 255, np.exp(rng.uniform(-5.6, 0, n))])
    return mean, conic, opacity


def records(form: Form, mean, conic, opacity, per_subtile: int = 64) -> SubtileLists:
    """Lists of sub-tiles in a row with these splats, means relative to their sub-tile."""
    n = len(mean)
    if form == Form.FACTORED:
        k = 0.5 / math.log(2)
        l0 = np.sqrt(conic[:, 0] * k)
        l1 = conic[:, 1] * k / l0
        det = conic[:, 0] * conic[:, 2] - conic[:, 1] ** 2
        shape = np.stack([l0, l1, np.sqrt(np.maximum(det, 0) / conic[:, 0] * k)], 1)
    else:
        shape = conic * (0.5, 1, 0.5)
    gauss = np.zeros((n, 9), np.uint16)
    gauss[:, 2:5] = shape.astype(np.float16).view(np.uint16)
    gauss[:, 5] = opacity.astype(np.float16).view(np.uint16)
    count = -(-n // per_subtile)
    return SubtileLists(
        8 * count, 8, form, gauss, np.zeros(n, bool), np.minimum(np.arange(count + 1) * per_subtile, n), np.arange(n, dtype=np.int32),
        np.clip(mean, -65504, 65504).astype(np.float16).view(np.uint16), count, 1, 0,
    )


def proved_masks(lists: SubtileLists, conic: np.ndarray):
    """(name, mask, visit) of every generator with a proof."""
    with np.errstate(all="ignore"):
        slopes = np.clip(np.nan_to_num(conic[:, 1:2] / conic[:, 2::-2]), -65504, 65504).astype(np.float16).astype(np.float64)
    if lists.form == Form.FACTORED:
        for fmt in (RowFormat(8, 8), RowFormat(5, 3), RowFormat(6, 6), RowFormat(7, 5), RowFormat(10, 10), RowFormat(12, 12)):
            yield f"rows {fmt}", *row_masks(lists, fmt)
    for name, system in FORMATS.items():
        if not name.startswith("q"):
            for scaled in (False, True):
                yield f"exact {name} scaled={scaled}", exact_masks(lists, slopes, system, True, scaled)[0], None
    yield "pixels", *pixel_tests(lists)


@pytest.mark.parametrize("form", list(Form))
def test_no_miss_on_hard_splats(form):
    """80,000 hard splats: no generator with a proof loses a pixel that the VRU's alpha test passes; the unproved FP16 one does."""
    rng = np.random.default_rng(seed())
    mean, conic, opacity = hard_conics(rng, 80_000)
    lists = records(form, mean, conic, opacity)
    nothing = np.zeros(len(mean), np.uint8)
    contributing = np.bitwise_count(missed_pixels(lists, nothing, None)).sum()
    assert contributing > 300_000
    for name, mask, visit in proved_masks(lists, conic):
        assert not missed_pixels(lists, mask, visit).any(), name
    slopes = np.clip(conic[:, 1:2] / conic[:, 2::-2], -65504, 65504).astype(np.float16).astype(np.float64)
    assert missed_pixels(lists, exact_masks(lists, slopes, FORMATS["fp16"], False)[0], None).any()
    assert missed_pixels(lists, exact_masks(lists, slopes, FORMATS["e4m3"], False)[0], None).any()


@pytest.mark.parametrize("form", list(Form))
def test_no_miss_on_odd_records(form):
    """Records that no projection makes: special values, infinities, NaN, random bits. The row intervals keep their promise even here."""
    rng = random.Random(seed())
    made = [splats.mixed(rng, form).features for _ in range(3000)] + [splats.special(rng, form).features for _ in range(6000)]
    features = np.array(made, np.uint16)
    lists = records(form, np.zeros((len(features), 2)), np.ones((len(features), 3)), np.ones(len(features)))
    lists.gauss[:] = features
    lists.mean[:] = features[:, :2]
    checked = [("pixels", *pixel_tests(lists))]
    if form == Form.FACTORED:
        checked += [("rows", *row_masks(lists, RowFormat(f, f))) for f in (5, 8, 12)]
    for name, mask, visit in checked:
        assert not missed_pixels(lists, mask, visit).any(), name


@pytest.mark.parametrize("name", usual(PROVED, MASKS))
def test_no_miss_in_demo(name, demo):
    """Proved masks give the picture of the test switched off on VRUs with the same accumulators."""
    result = run(name, demo)
    assert not missed_pixels(result.lists, result.work.mask, result.work.visit).any()
    tested = result.configuration
    untested = replace(tested, lists="subtile", generator=Untested(tested.form))
    assert np.array_equal(result.image, run(untested, demo).image)


def test_rows_are_tight(demo):
    """With 8 fraction bits the row intervals visit at most 6 % more pixels than contribute, and coarser ones more."""
    visited = []
    for name in ("oracle", "rows-f10a10", "rows", "rows-f7a5", "rows-f6a6"):
        work = run(name, demo).work
        visited.append(int(np.bitwise_count(work.visit & work.unfinished()).sum()))
    assert visited == sorted(visited)
    assert visited[2] < 1.06 * visited[0] and visited[4] < 1.2 * visited[0]


def test_constants():
    """The table of k never exceeds 1 / rho; the root table is monotone and no lower than the root; margins grow as formats shrink."""
    k, rho = inverse_radius(), radii(Form.FACTORED)
    assert (k * rho <= 1).all() and (k[rho > 0.8] * rho[rho > 0.8] > 0.97).all()
    for fmt in (RowFormat(6, 6), RowFormat(8, 6), RowFormat(8, 8)):
        table = root_table(fmt)
        v = (np.arange(len(table)) << (fmt.fraction - fmt.address)) / 2.0**fmt.fraction
        assert (np.diff(table) <= 0).all() and (table / 2.0**fmt.fraction >= np.sqrt(np.maximum(1 - v * v, 0))).all()
    assert margins(Form.FACTORED, FORMATS["fp16"])[0] <= 2.0**-7 < margins(Form.FACTORED, FORMATS["e4m3"])[0]
    with pytest.raises(FlickerError, match="rows: fraction must be 4 to 12"):
        RowFormat(3, 3)


@pytest.mark.parametrize("real_view", [pytest.param(view, id=view.folder, marks=[pytest.mark.slow] * (view.folder != "stpeter")) for view in REAL_VIEWS])
def test_real_scenes(real_view):
    """Real views at 480x270: no miss with the recommended masks, and the picture is at least as good as the goal says."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES is not set")
    real = load_view(real_view.path(scenes), real_view.number, (480, 270))
    off = run("no-ctu-32", real)
    for name in ("rows", "rows-ellipse", "rows-f6a6", "exact-fp16-bound"):
        result = run(name, real)
        assert np.array_equal(result.image, off.image), name
        assert not missed_pixels(result.lists, result.work.mask, result.work.visit).any(), name
    assert psnr(off.image, real.reference) > 58
