"""Models of VRUs that visit single pixels and of lanes, and closed forms of `flicker.explore.stages`, against the cycle model and by hand.

The cycle model of the RTL itself is compared with the RTL in tb/frames.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flicker.errors import FlickerError
from flicker.explore.configurations import run
from flicker.explore.stages.channels import barrier_cycles
from flicker.explore.stages.subtile import gscore_cycles
from flicker.front.projection import project
from flicker.front.view import View
from flicker.params import CatMode, RenderConfig, vru_stages
from flicker.perf.lane_stage import LaneStage, lane_of_pixel, simulate_lanes
from flicker.perf.pixel_stage import GENERATOR_LATENCY, simulate_pixels
from flicker.perf.render_stage import simulate
from flicker.perf.work import Work
from flicker.scene.demo import demo_cameras, generate

OFF = RenderConfig(cat=CatMode.OFF)


@pytest.fixture(scope="module")
def view() -> View:
    camera = demo_cameras()[0].resized(96, 54)
    projected = project(generate(), camera)
    return View(camera, projected=replace(projected, opacity=np.minimum(projected.opacity, 0.02)))  # nothing finishes early


def one_splat(pixels: list[int], times: int = 1) -> Work:
    """One 8x8 sub-tile with a splat, so many times, that visits and blends the given pixels of mini-tile 0."""
    bits = np.zeros((times, 4), np.uint16)
    bits[:, 0] = sum(1 << p for p in pixels)
    return Work(
        1, 1, np.zeros(1, np.int64), np.array([0, 1, 1, 1, 1]), np.array([0, times]), np.zeros(times, np.int32), np.ones(times, np.uint8),
        np.zeros(times, np.uint16), np.ones(times, np.uint8), bits, bits, np.full((1, 64), times, np.int32), np.zeros(1, bool),
    )


def test_whole_minitiles(view: View) -> None:
    """Visiting all pixels, halves to each VRU, takes what the RTL's VRUs take."""
    work = run("no-ctu-32", view).work
    model = simulate(work, OFF)
    pixels = simulate_pixels(work, OFF, split="halves", loop=1)
    assert (pixels.channel("vru_busy") == model.channel("vru_busy")).all() and model.channel("vru_busy").sum() > 10_000
    assert pixels.cycles == pytest.approx(model.cycles, rel=0.01)


def test_vrus_per_channel(view: View) -> None:
    """Nothing finishes: VRUs of half the pixels take half the cycles of each splat. Other counts than the RTL's are refused."""
    work = run("no-ctu-32", view).work
    stages = {n: simulate(work, OFF.with_(vrus_per_channel=n)) for n in (1, 2, 4)}
    for n, stage in stages.items():
        assert (n * stage.channel("vru_busy") == stages[1].channel("vru_busy")).all()
    assert stages[1].cycles > stages[2].cycles > stages[4].cycles
    for n in (0, 3, 8):
        with pytest.raises(FlickerError, match=f"vrus_per_channel must be 1, 2 or 4, not {n}"):
            OFF.with_(vrus_per_channel=n)
    with pytest.raises(ValueError, match="two VRUs per channel"):
        simulate_pixels(run("rows", view).work, OFF.with_(vrus_per_channel=4))


@pytest.mark.parametrize(("pixels", "busy"), [([], 0), ([0], 1), ([0, 2], 2), ([0, 1], 1), (list(range(16)), 8)])
def test_one_splat(pixels: list[int], busy: int) -> None:
    """Checkerboard: pixels 0 and 2 belong to one VRU, 0 and 1 to both. The token follows the splat through generator and VRUs."""
    result = simulate_pixels(one_splat(pixels), OFF)
    assert result.channel("vru_busy")[0].tolist() == [busy, 0, 0, 0]
    # Splat, token at once behind it; FIFO; VRU; 16 pixels of each of four channels.
    token = 1 + GENERATOR_LATENCY + 1
    assert token + vru_stages(OFF.form)[1] + 64 <= result.cycles <= token + vru_stages(OFF.form)[1] + 64 + busy + 2
    assert result.subtile_end[0] == result.cycles - 1


def test_loop_and_bound(view: View) -> None:
    """The same pixel at once again waits for the loop; no stage is faster than its work."""
    work = run("rows", view).work
    cycles = [simulate_pixels(work, OFF, loop=loop).cycles for loop in (1, 4, 8)]
    assert cycles[0] < cycles[1] < cycles[2]
    assert cycles[0] > work.totals()["pixels_visited"] / 32


# ---- lanes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("lanes", [8, 16])
def test_lanes_share_evenly(lanes: int) -> None:
    """Every lane has as many pixels; small blocks, wherever they lie, have all their pixels in different lanes."""
    lane = np.empty((8, 8), int)
    for p, number in enumerate(lane_of_pixel(lanes)):
        lane[p // 32 * 4 + p % 16 // 4, p // 16 % 2 * 4 + p % 4] = number
    assert (np.bincount(lane.ravel()) == 64 // lanes).all()
    blocks = [(1, 8), (8, 1), (2, 3), (3, 2), (2, 2)] if lanes == 8 else [(4, 4), (1, 4), (4, 1)]
    for height, width in blocks:
        for y in range(9 - height):
            for x in range(9 - width):
                block = lane[y : y + height, x : x + width]
                assert len(np.unique(block)) == block.size, (height, width, y, x)


@pytest.mark.parametrize(("pixels", "times", "stage", "last"), [
    ([0], 1, LaneStage(), 0),
    (list(range(16)), 1, LaneStage(), 2),  # a 4x4 block has one lane three times
    ([0], 10, LaneStage(loop=2), 18),  # one pixel again and again: a visit every two cycles
    ([0], 10, LaneStage(loop=1), 9),
    ([0], 10, LaneStage(loop=4, window=3), 36),  # a window does not change the order at a pixel
    ([0], 10, LaneStage(loop=1, width=2), 9),  # the generator is not what it waits for
])
def test_one_splat_on_lanes(pixels: list[int], times: int, stage: LaneStage, last: int) -> None:
    """By hand: generator, FIFO, visits, token, pipeline, then a lane's eight pixels.

    last: cycle of the last visit, counted from the first. The token is in the FIFO one cycle after the last splat at the latest and
    leaves when the entry before it has.
    """
    result = simulate_lanes(one_splat(pixels, times), OFF, replace(stage, ports=8))
    assert result.channel("vru_busy")[0].sum() == len(pixels) * times and result.channel("vru_busy")[1:].sum() == 0
    first = stage.latency + 1
    token = first + max(last, -(-times // stage.width) - 1) + 1
    assert result.cycles == token + vru_stages(OFF.form)[1] + 1 + 8
    assert result.subtile_end[0] == result.cycles - 1


def test_lanes_do_all_work(view: View) -> None:
    """Nothing finishes here, so every set pixel is visited once, whatever the options; no stage is faster than its busiest part; what should help does."""
    work = run("rows", view).work
    want = work.totals()["pixels_visited"]
    cycles = {}
    for name, depth, stage in (
        ("loop 4", 16, LaneStage(loop=4)), ("plain", 16, LaneStage()), ("window", 16, LaneStage(window=3)), ("deep", 64, LaneStage(window=3)),
        ("wide", 64, LaneStage(window=3, width=2)), ("shallow", 1, LaneStage()),
    ):
        result = simulate_lanes(work, OFF.with_(fifo_depth=depth), stage)
        assert result.channel("vru_busy").sum() == want and result.channel("minitiles_discarded").sum() == 0
        assert result.core("gaussians_in").sum() == work.elements
        cycles[name] = result.cycles
    assert cycles["loop 4"] > cycles["plain"] > cycles["window"] > cycles["deep"] > cycles["wide"] > want / 32
    assert cycles["shallow"] > cycles["plain"]
    twice = simulate_lanes(work, OFF, LaneStage(), lanes=16)
    assert twice.channel("vru_busy").sum() == want and twice.cycles < cycles["plain"]


def test_finished_subtiles_are_left() -> None:
    """A sub-tile whose 64 pixels are finished takes no more splats; pixels known to be finished are not visited."""
    times = 500
    work = one_splat(list(range(16)), times)
    work.visit[:] = 0xFFFF
    work.contributing[:] = 0xFFFF
    work.pixel_finish[:] = 9
    result = simulate_lanes(work, OFF)
    assert result.core("gaussians_in")[0] < 100 < times
    assert 64 * 10 <= result.channel("vru_busy").sum() < 64 * 20
    assert result.channel("pixels_finished").sum() == 64


def test_closed_forms(view: View) -> None:
    """GSCore: 64 pixels a splat on the core's VRUs. Barrier: the busiest channel of a tile, so never less than its share of the work."""
    work = run("gscore", view).work
    per_core = [work.start[s + 1] - work.start[s] for s in range(work.subtiles)]
    want = max(sum(4 * per_core[s] for s in work.order[a:b]) for a, b in zip(work.core_start, work.core_start[1:]))
    assert gscore_cycles(work, 64) == want > 0 and gscore_cycles(work, 32) == 2 * want
    flicker = run("flicker", view).work
    assert barrier_cycles(flicker, 2) >= flicker.totals()["minitiles_sent"] * 8 / 16
    assert barrier_cycles(flicker, 4) < barrier_cycles(flicker, 2)
