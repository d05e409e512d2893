"""Whole frames: the verilated rendering stage equals the golden model, pixel for pixel and count for count, and without stalls the cycle model, in
cycles and every counter. The default design is built with its assertions, which make a build take three times as long (with SLOW=1 also the two others
that matter most, faithful and without CTU; an assertion that fails: test_plugs.py); the harness also changes mode_i inside every frame and checks idle_o.

State space: every third splat of the demo scene in every mode of the default build and in the paper's of `faithful` (with SLOW=1 in every mode of both), with
random idle and back-pressure; frames aborted at random times. With SLOW=1: all of the demo scene at 320x180 and 640x360; channels of one and of four VRUs,
each at another FIFO depth; the stage without a contribution test (mask generator `all`); a view of each real scene at 320x180 when FLICKER_SCENES names their
folder, and view 0 of flowers at 1280x720; builds of the remaining precisions, one of each form, on a small frame, and of FIFOs of 1 and 128 places (FP8 and
one place in one build).
Not covered: pictures above 1280x720; frames that follow each other without a pause.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from flicker.errors import FlickerError
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
NO_CTU = RenderConfig(cat=CatMode.OFF, mask_generator="all")
SHALLOW = RenderConfig(form=Form.CONIC, precision=Precision.FP8, fifo_depth=1)  # tb/model/test_cli.py takes this build, too
SLOW = pytest.mark.slow


def modes(base: RenderConfig, *usual: CatMode) -> list:
    """A parameter for every mode; those that are not usual are slow."""
    name = "faithful" if base is FAITHFUL else "default"
    return [pytest.param(base, cat, id=f"{name}-{cat.name.lower()}", marks=[SLOW] * (cat not in usual)) for cat in CatMode]


@cache
def demo(width: int, height: int):
    """Demo scene projected for its first camera."""
    camera = demo_cameras()[0].resized(width, height)
    return project(generate(), camera), camera


def some(width: int, height: int):
    """Every third splat of it: a small picture has as many splats as a large one, and they are what a frame takes its time for."""
    projected, camera = demo(width, height)
    return type(projected)(**{f.name: getattr(projected, f.name)[::3] for f in dataclasses.fields(projected)}), camera


def compare(projected, camera, config: RenderConfig, checks: bool | None = None, **stalls):
    """Render with both engines and compare everything that does not depend on timing. checks: with assertions, by default in the default build only."""
    lists = build_lists(projected, camera, config)
    golden = render_golden(lists, config)
    if checks is None:
        checks = config.rtl_parameters() == DEFAULT.rtl_parameters()
    rtl = render_rtl(lists, config, checks=checks, **stalls)
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
    if not stalls or stalls.keys() == {"aborts"}:
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


@pytest.mark.parametrize(("base", "cat"), modes(DEFAULT, *CatMode) + modes(FAITHFUL, FAITHFUL.cat))
def test_demo_modes(base, cat):
    """Every mode on a small frame of the demo scene, with stalls; one seed per mode."""
    compare(*some(160, 90), base.with_(cat=cat), seed=int(cat) + 1, idle=0.2, stall=0.3)


@pytest.mark.parametrize(("base", "cat"), modes(DEFAULT, DEFAULT.cat, CatMode.AUTO) + modes(FAITHFUL, FAITHFUL.cat))
def test_cycle_model(base, cat):
    """Every mode without stalls, cycle for cycle: a small frame, and random streams with few and with thousands of splats per sub-tile."""
    compare(*some(96, 54), base.with_(cat=cat))
    compare(*random_splats(int(cat), 200, 64), base.with_(cat=cat))
    compare(*random_splats(10 + int(cat), 4000, 24), base.with_(cat=cat))


@SLOW
@pytest.mark.parametrize("config", [
    SHALLOW, RenderConfig(precision=Precision.FP16), RenderConfig(precision=Precision.MIXED),
], ids=lambda c: f"{c.precision.name.lower()}-{c.form.name.lower()}")
def test_demo_formats(config):
    """Builds of the other precisions, one of each form."""
    compare(*some(160, 90), config)


@SLOW
@pytest.mark.parametrize("config", [SHALLOW, *(DEFAULT.with_(fifo_depth=n) for n in (1, 128))], ids=lambda c: str(c.fifo_depth))
def test_fifo_depth(config):
    """Shallowest and deepest feature FIFO: the same picture, and the cycles of the model."""
    compare(*some(96, 54), config)
    compare(*random_splats(config.fifo_depth, 4000, 24), config)
    compare(*some(96, 54), config, stall=0.1)


@SLOW
@pytest.mark.parametrize("vrus,fifo_depth", [(4, 7), (1, 16)])
def test_vrus_per_channel(vrus, fifo_depth):
    """Other numbers of VRUs: cycles of the model, and the picture of two VRUs except where the automatic mode looks at them."""
    config = DEFAULT.with_(vrus_per_channel=vrus, fifo_depth=fifo_depth)
    for cat in (CatMode.SMOOTH, CatMode.OFF, CatMode.AUTO):
        compare(*demo(96, 54), config.with_(cat=cat))
        compare(*random_splats(30 + int(cat), 4000, 24), config.with_(cat=cat))
    golden, _ = compare(*demo(96, 54), config, idle=0.2, stall=0.3)
    assert (golden.pixels == render_golden(golden.lists, DEFAULT).pixels).all()


@SLOW
@pytest.mark.parametrize("vrus", [2, 4])
def test_no_ctu(vrus):
    """Mask generator `all`: the picture of the test switched off, cycles and counters of the model; other latencies than the CTU's."""
    config = RenderConfig(cat=CatMode.OFF, mask_generator="all", vrus_per_channel=vrus)
    for scene in (some(96, 54), random_splats(3, 200, 64), random_splats(17, 4000, 24)):
        golden, rtl = compare(*scene, config)
        assert (rtl.core_counter("minitiles_tested") == CHANNELS * rtl.core_counter("gaussians_in")).all()
    compare(*some(96, 54), config, idle=0.2, stall=0.3)
    with pytest.raises(FlickerError, match="cat must be off with mask_generator all"):
        config.with_(cat=CatMode.SMOOTH)


@pytest.mark.parametrize("base", [
    pytest.param(DEFAULT.with_(cat=CatMode.AUTO), id="default"), pytest.param(FAITHFUL, id="faithful"), pytest.param(NO_CTU, id="no ctu", marks=SLOW),
])
def test_aborted_frames(base):
    """clear_i at random times and for random lengths; the frame after it is right in pixels, cycles and counters, as if it were the first."""
    scene = random_splats(3, 400, 32)
    end = compare(*scene, base)[1].cycles
    for seed in range(1, 9):
        rng = np.random.default_rng(seed)
        # The first cycles, in which the pipelines fill, as often as the rest.
        aborts = [(int(rng.integers(0, 60) if rng.random() < 0.5 else rng.integers(0, end)), int(rng.integers(1, 4))) for _ in range(3)]
        stalls = {"idle": 0.2, "stall": 0.3} if seed % 2 else {}
        compare(*scene, base, aborts=aborts, **({"seed": seed} | stalls if stalls else {}))


@SLOW
@pytest.mark.parametrize("base", [FAITHFUL.with_(cat=CatMode.AUTO), NO_CTU], ids=["faithful", "no ctu"])
def test_assertions(base):
    """The other builds that matter most, with their assertions."""
    compare(*demo(160, 90), base, checks=True, idle=0.2, stall=0.3)
    compare(*random_splats(3, 400, 32), base, checks=True, aborts=[(20, 1), (300, 3)])


@SLOW
@pytest.mark.parametrize("width,height", [(320, 180), (640, 360)])
def test_demo_full(width, height):
    """The demo picture with all its splats, small and at its own size."""
    golden, rtl = compare(*demo(width, height), DEFAULT)
    assert golden.image().std() > 0.05  # not a flat picture


@SLOW
def test_stalls_do_not_change_the_picture():
    """Automatic mode under different stall patterns: same pixels, same decisions, other cycle counts."""
    projected, camera = some(160, 90)
    config = DEFAULT.with_(cat=CatMode.AUTO)
    frames = [compare(projected, camera, config, seed=s, idle=i, stall=o)[1] for s, i, o in ((1, 0, 0), (2, 0.5, 0), (3, 0, 0.8))]
    assert len({f.cycles for f in frames}) == len(frames)
    for f in frames[1:]:
        assert (f.pixels == frames[0].pixels).all()


@SLOW
@pytest.mark.parametrize("real_view", [pytest.param(v, id=v.folder) for v in REAL_VIEWS])
def test_real_scene(real_view):
    """One view of each real scene at 320x180."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    view = load_view(real_view.path(scenes), real_view.number, (320, 180))
    compare(view.projected, view.camera, DEFAULT)


@pytest.mark.slow
def test_full_size():
    """View 0 of flowers at 1280x720."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    view = load_view(REAL_VIEWS[0].path(scenes), REAL_VIEWS[0].number, (1280, 720))
    compare(view.projected, view.camera, DEFAULT)
