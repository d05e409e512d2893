"""Whole frames through the lanes in the log domain: the verilated stage equals the golden model in every pixel, and without stalls the cycle model in
cycles and every counter. The default build has its assertions.

State space: the demo scene, random splats of many opacities, thousands to a sub-tile, hard families of the stability suite, random bits for records; lists
read to their end and left, empty ones streamed and not; random idle and back-pressure; frames aborted at random times. Builds: 32 lanes; with SLOW=1 one core
of 8 for all sub-tiles, 64 and 128 lanes, one core of 4, two cores, and one element a cycle with the smallest store and queues. Real scenes at 320x180
when FLICKER_SCENES names their folder (one of them; with SLOW=1 all four, and view 0 of flowers at 1280x720).
Not covered: frames that follow each other without a pause.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from zlib import crc32

import numpy as np
import pytest
from flicker_tb.elaboration import refused

from flicker.explore.stability import FAMILIES
from flicker.front.lists import subtile_lists
from flicker.front.view import View, load_view
from flicker.golden.lanes.lists import RecordLists, float_lists
from flicker.golden.lanes.render import LaneFrame, render_lanes
from flicker.params import SUBTILE, Form, RenderConfig
from flicker.perf.lanes import LaneWork, lane_work, simulate_lanes
from flicker.scene.real import REAL_VIEWS, real_scenes
from flicker.sim.render_stage import RtlFrame, render_rtl

DEFAULT = RenderConfig(stage="lanes")
SMALL = DEFAULT.with_(in_width=1, slots=2, fifo_depth=2)
ONE_CORE = DEFAULT.with_(cores=1, lanes=8)
BUILDS = {
    "small": SMALL, "64 lanes": DEFAULT.with_(lanes=64), "128 lanes": DEFAULT.with_(lanes=128), "one core of 4": DEFAULT.with_(cores=1, lanes=4),
    "two cores of 4": DEFAULT.with_(cores=2, lanes=8, in_width=1), "two cores of 32": DEFAULT.with_(cores=2, lanes=64),
}
SLOW = pytest.mark.slow  # each is a build of its own, a minute or more
FEEDS = ({}, {"leave": True}, {"leave": True, "empty": False})


class Scene:
    """Lists with what the models say of them."""

    def __init__(self, lists: RecordLists) -> None:
        self.lists = lists

    @property
    def golden(self) -> LaneFrame:
        return self._golden(self)

    @property
    def work(self) -> LaneWork:
        return self._work(self)

    @staticmethod
    @cache
    def _golden(scene: Scene) -> LaneFrame:
        return render_lanes(scene.lists)

    @staticmethod
    @cache
    def _work(scene: Scene) -> LaneWork:
        return lane_work(scene.lists)


def records_of(view: View) -> Scene:
    return Scene(float_lists(view.projected, view.lists(Form.FACTORED, "ellipse")))


@cache
def demo(width: int, height: int) -> Scene:
    """Demo scene from its first camera."""
    return records_of(load_view("demo", 0, (width, height)))


@cache
def random_splats(seed: int, count: int, size: int) -> Scene:
    """Splats of the demo scene thrown anywhere on a small picture, in random order of depth, many of them opaque."""
    view = load_view("demo", 0, (160, 90))
    rng = np.random.default_rng(seed)
    picked = rng.integers(0, len(view.projected.depth), count)
    fields = {f.name: getattr(view.projected, f.name)[picked] for f in dataclasses.fields(view.projected)}
    fields["mean"] = rng.uniform(-8, size + 8, (count, 2))
    fields["opacity"] = rng.choice([1 / 255, 0.02, 0.3, 0.99, 1.0], count)
    thrown = View(view.camera.resized(size, size), projected=type(view.projected)(**fields))
    return Scene(float_lists(thrown.projected, subtile_lists(thrown.projected, thrown.camera, Form.FACTORED)))


@cache
def random_bits(seed: int, count: int, tiles: int) -> Scene:
    """Records of random bits, every sub-tile with lists of its own; some with means, shapes and opacities that matter there."""
    rng = np.random.default_rng(seed)
    records = rng.integers(-(1 << 63), 1 << 63, (count, 2), np.int64)
    side = 2 * tiles
    near = rng.random(count) < 0.8
    x, y = (rng.integers(0, 8 * side * 128, count) for _ in range(2))  # 1/128 pixel, exponent 0
    shape = [rng.integers(26, 32, count) << 9 | rng.integers(0, 512, count) for _ in range(3)]
    low = x | y << 23 | shape[0] << 46 | (shape[1] & 15) << 60
    high = shape[1] >> 4 | rng.integers(0, 2, count) << 10 | shape[2] << 11 | rng.integers(0, 256, count) << 25 | rng.integers(0, 1 << 31, count) << 33
    records[near] = np.stack([low, high], 1)[near]
    lengths = rng.integers(0, 2 * count // side, side * side) * (rng.random(side * side) < 0.8)
    start = np.concatenate([[0], np.cumsum(lengths)])
    entry = rng.integers(0, count, start[-1]).astype(np.int32)
    return Scene(RecordLists(SUBTILE * side, SUBTILE * side, records, start, entry, side, side, 0))


def compare(scene: Scene, config: RenderConfig, checks: bool | None = None, **options) -> RtlFrame:
    """Render with both engines. checks: with assertions, by default in the default build only."""
    golden = scene.golden
    rtl = render_rtl(scene.lists, config, checks=config == DEFAULT if checks is None else checks, **options)
    wrong = np.argwhere((golden.pixels != rtl.pixels).any(axis=2))
    assert not len(wrong), f"{len(wrong)} pixels differ, first: sub-tile {wrong[0][0]} pixel {wrong[0][1]}: " \
        f"golden {golden.pixels[tuple(wrong[0])]}, RTL {rtl.pixels[tuple(wrong[0])]}"
    for name in ("blended", "pixels_finished"):
        assert rtl.core_counter(name).sum() == golden.total(name), name
    assert rtl.core_counter("skipped").sum() >= golden.total("skipped")
    assert golden.total("blended") > 0 and (rtl.core_counter("cycles") == rtl.cycles).all()
    if not options.keys() - {"leave", "empty", "aborts"}:
        feed = {name: options[name] for name in ("leave", "empty") if name in options}
        model = simulate_lanes(scene.work, config, **feed)
        differ = [
            f"core {k} {rtl.names[i]}: RTL {rtl.counters[k, i]}, model {model.counters[k, i]}"
            for k, i in np.argwhere(rtl.counters != model.counters)
        ]
        assert rtl.cycles == model.cycles and not differ, f"{rtl.cycles} cycles, model {model.cycles}; " + "; ".join(differ[:8])
    return rtl


def test_demo():
    """The demo picture with all its splats, however its lists are fed: less is streamed each time, and never more cycles are taken."""
    frames = [compare(demo(160, 90), DEFAULT, **feed) for feed in FEEDS]
    taken = [int(f.core_counter("gaussians_in").sum()) for f in frames]
    assert taken[0] == len(demo(160, 90).lists.entry) > taken[1] == taken[2]
    assert frames[0].cycles > frames[1].cycles >= frames[2].cycles


@SLOW
def test_demo_full():
    """The demo picture at 320x180."""
    rtl = compare(demo(320, 180), DEFAULT, leave=True, empty=False)
    assert rtl.image().std() > 0.05  # not a flat picture
    assert {name for name in rtl.names if not rtl.core_counter(name).any()} <= {"gaussians_rejected", "bank_waits"}  # counters have counted


@pytest.mark.parametrize("seed", range(1, 4))
def test_stalls(seed):
    """Random idle and back-pressure: the same picture."""
    for scene in (demo(96, 54), random_splats(seed, 400, 32), random_bits(seed, 200, 2)):
        compare(scene, DEFAULT, seed=seed, idle=(0, 0.2, 0.7)[seed - 1], stall=(0.8, 0.3, 0)[seed - 1], leave=seed > 1, empty=seed > 2)


def test_random():
    """Random splats, few and thousands to a sub-tile, and random bits for records, cycle for cycle."""
    seen = dict.fromkeys(("gaussians_rejected", "dropped", "no_slot", "no_room", "bank_waits"), 0)
    for scene in (random_splats(1, 200, 64), random_splats(2, 4000, 24), random_bits(3, 300, 3)):
        for feed in FEEDS:
            rtl = compare(scene, DEFAULT, **feed)
            seen = {name: count + rtl.core_counter(name).sum() for name, count in seen.items()}
    assert min(seen.values()) > 0, seen
    assert random_bits(3, 300, 3).golden.total("empty") > 100


@pytest.mark.parametrize("family", ["thin", "far_mean", "faint", "opaque", "layers", "screen"])
def test_hard_inputs(family):
    """First and last step of hard families of the stability suite."""
    for value in (FAMILIES[family].values[0], FAMILIES[family].values[-1]):
        case = FAMILIES[family].make(value, np.random.default_rng([1, crc32(family.encode())]))
        view = View(case.camera, projected=case.projected)
        compare(Scene(float_lists(view.projected, view.lists(Form.FACTORED))), DEFAULT, leave=True)


def test_aborted_frames():
    """clear_i at random times and for random lengths; the frame after it is right in pixels, cycles and counters, as if it were the first."""
    scene = random_splats(3, 400, 32)
    end = compare(scene, DEFAULT).cycles
    for seed in range(1, 9):
        rng = np.random.default_rng(seed)
        # The first cycles, in which the pipelines fill, as often as the rest.
        aborts = [(int(rng.integers(0, 60) if rng.random() < 0.5 else rng.integers(0, end)), int(rng.integers(1, 4))) for _ in range(3)]
        stalls = {"idle": 0.2, "stall": 0.3, "seed": seed} if seed % 2 else {}
        compare(scene, DEFAULT, aborts=aborts, **stalls)


@SLOW
def test_one_core():
    """A core that is shared by four sub-tiles: the same picture, and cycles of the model; pictures that are no whole tiles."""
    for scene in (demo(96, 54), random_splats(2, 4000, 24), random_bits(3, 300, 3)):
        for feed in FEEDS:
            rtl = compare(scene, ONE_CORE, checks=True, **feed)
            assert len(rtl.counters) == 1
    compare(demo(96, 54), ONE_CORE, checks=True, idle=0.2, stall=0.3, leave=True)
    compare(random_splats(3, 400, 32), ONE_CORE, checks=True, aborts=[(20, 1), (300, 3)])


@pytest.mark.parametrize(("module", "parameters", "message"), [
    ("flk_lane_stage", {"Cores": 3}, "Cores must be 1, 2 or 4"), ("flk_lane_stage", {"Cores": 2, "Lanes": 128}, "Lanes must be 4, 8, 16 or 32 times Cores"),
    ("flk_stage", {"Stage": 0, "Cores": 1}, "channels have 4 cores, so Cores must be 4"),
])
def test_illegal_cores(module, parameters, message):
    refused(module, parameters, message)


@SLOW
@pytest.mark.parametrize("config", [pytest.param(config, id=name) for name, config in BUILDS.items()])
def test_builds(config):
    """Other numbers of cores and lanes, and the smallest store: the same picture, and cycles of the model."""
    for scene in (demo(96, 54), random_splats(1, 200, 64), random_splats(2, 4000, 24), random_bits(3, 300, 3)):
        for feed in FEEDS:
            compare(scene, config, **feed)
    compare(demo(96, 54), config, idle=0.2, stall=0.3)
    compare(random_splats(3, 400, 32), config, aborts=[(20, 1), (300, 3)])


@SLOW
@pytest.mark.parametrize("config", [pytest.param(config, id=name) for name, config in BUILDS.items()])
def test_assertions(config):
    """The other builds with their assertions."""
    compare(demo(96, 54), config, checks=True, idle=0.2, stall=0.3)
    compare(random_splats(3, 400, 32), config, checks=True, aborts=[(20, 1), (300, 3)])


# One of them every time: many layers.
@pytest.mark.parametrize("real_view", [pytest.param(v, id=v.folder, marks=() if v.folder == "flowers" else SLOW) for v in REAL_VIEWS])
def test_real_scene(real_view):
    """One view of each real scene at 320x180."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    compare(records_of(load_view(real_view.path(scenes), real_view.number, (320, 180))), DEFAULT, leave=True, empty=False)


@SLOW
def test_full_size():
    """View 0 of flowers at 1280x720."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    compare(records_of(load_view(REAL_VIEWS[0].path(scenes), REAL_VIEWS[0].number, (1280, 720))), DEFAULT, leave=True, empty=False)
