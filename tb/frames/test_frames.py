"""Whole frames: the verilated rendering stage (`flk_render_stage` in `flk_render_sim_top`) equals the golden model, pixel for pixel and count for count, and without stalls the cycle
model, in cycles and every counter.

State space: the demo scene in every mode, in the two builds that matter most (default, faithful), with random idle and back-pressure;
channels of one and of four VRUs, each at another FIFO depth;
one view of each real scene at 320x180 when FLICKER_SCENES names their folder. The other builds are covered by unit tests, and the
remaining forms and precisions on a small frame here. Not covered: pictures above 1280x720.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from flicker.explore.configurations import rtl_configuration, run
from flicker.front.projection import project
from flicker.front.records import build_lists
from flicker.front.view import View, load_view
from flicker.golden.render import render_golden
from flicker.params import (
    CHANNEL_COUNTERS,
    CHANNELS,
    CORE_COUNTERS,
    CORES,
    FAITHFUL,
    CatMode,
    Form,
    Precision,
    RenderConfig,
)
from flicker.scene.demo import demo_cameras, generate
from flicker.scene.real import REAL_VIEWS, real_scenes
from flicker.sim.render_stage import render_rtl

DEFAULT = RenderConfig()


@cache
def demo(width: int, height: int):
    """Demo scene projected for its first camera."""
    camera = demo_cameras()[0].resized(width, height)
    return project(generate(), camera), camera


def compare(projected, camera, config: RenderConfig, **stalls):
    """Render with both engines and compare everything that does not depend on timing."""
    lists = build_lists(projected, camera, config)
    golden = render_golden(lists, config)
    rtl = render_rtl(lists, config, **stalls)
    wrong = np.argwhere((golden.pixels != rtl.pixels).any(axis=2))
    assert not len(wrong), f"{len(wrong)} pixels differ, first: sub-tile {wrong[0][0]} pixel {wrong[0][1]}: " \
        f"golden {golden.pixels[tuple(wrong[0])]}, RTL {rtl.pixels[tuple(wrong[0])]}"
    core = {name: int(rtl.core_counter(name).sum()) for name in (
        "subtiles", "gaussians_in", "gaussians_rejected", "minitiles_tested", "minitiles_delivered", "minitiles_filtered", "ctu_busy")}
    channel = {name: int(rtl.channel_counter(name).sum()) for name in ("minitiles_sent", "minitiles_discarded", "pixels_finished", "vru_busy")}
    assert core["subtiles"] == lists.cols * lists.rows
    assert core["gaussians_in"] == len(lists.entry) == golden.total("gaussians")
    assert core["gaussians_rejected"] == golden.total("rejected")
    assert core["minitiles_tested"] == golden.total("minitiles_tested")
    assert core["ctu_busy"] == golden.total("test_cycles") + core["subtiles"]
    assert channel["minitiles_sent"] == golden.total("minitiles_sent")
    assert channel["pixels_finished"] == golden.total("pixels_finished")
    # Everything that the test passed is accounted for; what was sent is rendered or discarded.
    assert core["minitiles_tested"] == core["minitiles_delivered"] + core["minitiles_filtered"]
    assert channel["minitiles_sent"] <= core["minitiles_delivered"]
    assert core["minitiles_delivered"] - channel["minitiles_discarded"] <= channel["vru_busy"] / config.pixels_per_vru <= core["minitiles_delivered"]
    assert golden.total("pairs_blended") > 0
    assert rtl.counters.shape[0] == CORES and (rtl.core_counter("cycles") == rtl.cycles).all()
    if not stalls:
        compare_cycles(projected, camera, config, rtl)
    return golden, rtl


def compare_cycles(projected, camera, config: RenderConfig, rtl) -> None:
    """The cycle model gives the same cycles and every counter the same value."""
    configuration = rtl_configuration(config)
    _, model = configuration.simulate(run(configuration, View(camera, projected=projected)).work)
    names = [name for name, _ in CORE_COUNTERS] + [f"channel {c} {name}" for c in range(CHANNELS) for name, _ in CHANNEL_COUNTERS]
    wrong = [
        f"core {k} {names[i]}: RTL {rtl.counters[k, i]}, model {model.counters[k, i]}"
        for k, i in np.argwhere(rtl.counters != model.counters)
    ]
    assert rtl.cycles == model.cycles and not wrong, f"{rtl.cycles} cycles, model {model.cycles}; " + "; ".join(wrong[:8])


def random_splats(seed: int, count: int, size: int):
    """Splats of the demo scene thrown anywhere on a small picture, in random order of depth, many of them opaque."""
    projected, camera = demo(160, 90)
    rng = np.random.default_rng(seed)
    picked = rng.integers(0, len(projected.depth), count)
    fields = {f.name: getattr(projected, f.name)[picked] for f in dataclasses.fields(projected)}
    fields["mean"] = rng.uniform(-8, size + 8, (count, 2))
    fields["opacity"] = rng.choice([0.02, 0.3, 0.99, 1.0], count)
    return type(projected)(**fields), camera.resized(size, size)


@pytest.mark.parametrize("cat", list(CatMode), ids=lambda m: m.name.lower())
@pytest.mark.parametrize("base", [DEFAULT, FAITHFUL], ids=["default", "faithful"])
def test_demo_modes(base, cat):
    """Every mode on a small frame of the demo scene, with stalls; one seed per mode."""
    projected, camera = demo(160, 90)
    compare(projected, camera, base.with_(cat=cat), seed=int(cat) + 1, idle=0.2, stall=0.3)


@pytest.mark.parametrize("cat", list(CatMode), ids=lambda m: m.name.lower())
@pytest.mark.parametrize("base", [DEFAULT, FAITHFUL], ids=["default", "faithful"])
def test_cycle_model(base, cat):
    """Every mode without stalls, cycle for cycle: a small frame, and random streams with few and with thousands of splats per sub-tile."""
    compare(*demo(96, 54), base.with_(cat=cat))
    compare(*random_splats(int(cat), 200, 64), base.with_(cat=cat))
    compare(*random_splats(10 + int(cat), 4000, 24), base.with_(cat=cat))


@pytest.mark.parametrize("form,precision", [(Form.FACTORED, Precision.FP16), (Form.CONIC, Precision.FP8), (Form.FACTORED, Precision.MIXED)])
def test_demo_formats(form, precision):
    """Builds of the other precisions, one of each form."""
    projected, camera = demo(160, 90)
    compare(projected, camera, RenderConfig(form=form, precision=precision))


@pytest.mark.parametrize("fifo_depth", [1, 128])
def test_fifo_depth(fifo_depth):
    """Shallowest and deepest feature FIFO: the same picture, and the cycles of the model."""
    compare(*demo(96, 54), DEFAULT.with_(fifo_depth=fifo_depth))
    compare(*random_splats(fifo_depth, 4000, 24), DEFAULT.with_(fifo_depth=fifo_depth))
    compare(*demo(96, 54), DEFAULT.with_(fifo_depth=fifo_depth), stall=0.1)


@pytest.mark.parametrize("vrus,fifo_depth", [(1, 16), (4, 7)])
def test_vrus_per_channel(vrus, fifo_depth):
    """Other numbers of VRUs: cycles of the model, and the picture of two VRUs except where the automatic mode looks at them."""
    config = DEFAULT.with_(vrus_per_channel=vrus, fifo_depth=fifo_depth)
    for cat in (CatMode.SMOOTH, CatMode.OFF, CatMode.AUTO):
        compare(*demo(96, 54), config.with_(cat=cat))
        compare(*random_splats(30 + int(cat), 4000, 24), config.with_(cat=cat))
    golden, _ = compare(*demo(96, 54), config, idle=0.2, stall=0.3)
    assert (golden.pixels == render_golden(golden.lists, DEFAULT).pixels).all()


def test_demo_full():
    """The demo picture at its own size."""
    projected, camera = demo(640, 360)
    golden, rtl = compare(projected, camera, DEFAULT)
    assert golden.image().std() > 0.05  # not a flat picture


def test_stalls_do_not_change_the_picture():
    """Automatic mode under different stall patterns: same pixels, same decisions, other cycle counts."""
    projected, camera = demo(160, 90)
    config = DEFAULT.with_(cat=CatMode.AUTO)
    frames = [compare(projected, camera, config, seed=s, idle=i, stall=o)[1] for s, i, o in ((1, 0, 0), (2, 0.5, 0), (3, 0, 0.8))]
    assert len({f.cycles for f in frames}) == len(frames)
    for f in frames[1:]:
        assert (f.pixels == frames[0].pixels).all()


@pytest.mark.parametrize("real_view", REAL_VIEWS, ids=lambda v: v.folder)
def test_real_scene(real_view):
    """One view of each real scene at 320x180."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    view = load_view(real_view.path(scenes), real_view.number, (320, 180))
    compare(view.projected, view.camera, DEFAULT)
