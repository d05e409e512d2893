"""Model of VRUs that visit single pixels, and closed forms of `flicker.evaluate`, against the cycle model and by hand.

The cycle model of the RTL itself is compared with the RTL in tb/frames.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flicker.demo_scene import demo_cameras, generate
from flicker.evaluate import barrier_cycles, gscore_cycles
from flicker.methods.registry import View, run
from flicker.methods.work import Work
from flicker.params import CatMode, RenderConfig, vru_stages
from flicker.perf.pixel_stage import GENERATOR_LATENCY, simulate_pixels
from flicker.perf.render_stage import simulate
from flicker.projection import project

OFF = RenderConfig(cat=CatMode.OFF)


@pytest.fixture(scope="module")
def view() -> View:
    camera = demo_cameras()[0].resized(96, 54)
    projected = project(generate(), camera)
    return View(replace(projected, opacity=np.minimum(projected.opacity, 0.02)), camera)  # nothing finishes early


def one_splat(pixels: list[int]) -> Work:
    """One 8x8 sub-tile with one splat that visits and blends the given pixels of mini-tile 0."""
    bits = np.zeros((1, 4), np.uint16)
    bits[0, 0] = sum(1 << p for p in pixels)
    return Work(
        1, 1, np.zeros(1, np.int64), np.array([0, 1, 1, 1, 1]), np.array([0, 1]), np.zeros(1, np.int32), np.ones(1, np.uint8),
        np.zeros(1, np.uint16), np.ones(1, np.uint8), bits, bits, np.full((1, 64), 1, np.int32), np.zeros(1, bool),
    )


def test_whole_minitiles(view: View) -> None:
    """Visiting all pixels, halves to each VRU, takes what the RTL's VRUs take."""
    work = run("no_ctu", view).work
    model = simulate(work, OFF)
    pixels = simulate_pixels(work, OFF, split="halves", loop=1)
    assert (pixels.channel("vru_busy") == model.channel("vru_busy")).all() and model.channel("vru_busy").sum() > 10_000
    assert pixels.cycles == pytest.approx(model.cycles, rel=0.01)


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
    work = run("rows-f8a8", view).work
    cycles = [simulate_pixels(work, OFF, loop=loop).cycles for loop in (1, 4, 8)]
    assert cycles[0] < cycles[1] < cycles[2]
    assert cycles[0] > work.totals()["pixels_visited"] / 32


def test_closed_forms(view: View) -> None:
    """GSCore: 64 pixels a splat on the core's VRUs. Barrier: the busiest channel of a tile, so never less than its share of the work."""
    work = run("gscore", view).work
    per_core = [work.start[s + 1] - work.start[s] for s in range(work.subtiles)]
    want = max(sum(4 * per_core[s] for s in work.order[a:b]) for a, b in zip(work.core_start, work.core_start[1:]))
    assert gscore_cycles(work, 64) == want > 0 and gscore_cycles(work, 32) == 2 * want
    flicker = run("flicker", view).work
    assert barrier_cycles(flicker, 2) >= flicker.totals()["minitiles_sent"] * 8 / 16
    assert barrier_cycles(flicker, 4) < barrier_cycles(flicker, 2)
