"""Chips of many sizes, `flk_top` with lanes: sets of parameters chosen pairwise over the legal space, each a frame equal to the golden model's.

State space: two pictures of a small scene with SH codes of every width, with DRAM timing. Parameter space: every pair of values of two parameters of `VALUES`
is in one of the `SETS` sets, which FLICKER_SEED chooses and the first test prints; by default that of the default chip, with SLOW=1 all. Not
covered: channels (tb/frames/test_chip_frames.py), speed (docs/results/chips.md).
"""

from __future__ import annotations

import random
from itertools import combinations

import numpy as np
import pytest
from flicker_tb.runner import seed

from flicker.chip.dram import DramConfig
from flicker.chips import chip_of
from flicker.golden.chip import render_chip
from flicker.golden.frame_buffer import PixelFormat
from flicker.golden.front.frame import run_front
from flicker.golden.front.reuse import ColourStore, Reuse
from flicker.golden.lanes.lists import front_lists
from flicker.params import CHIP_MEMORIES, CORE_COUNTS, LANES_PER_CORE, PORT_WIDTHS, PREPROC_INTERVALS, UNIT_COUNTS, RenderConfig
from flicker.scene.camera import Camera
from flicker.scene.gaussians import Scene
from flicker.scene.packed import SH_BITS
from flicker.scene.packing import Recipe, pack
from flicker.sim.chip import ChipSession
from flicker.sim.half import MemoryOptions

SETS = 40
CANDIDATES = 40  # of which the one with most pairs that are new is taken
VALUES = {
    "cores": CORE_COUNTS, "lanes": LANES_PER_CORE, "delivered": (1, 2), "in_width": (1, 2), "slots": (8, 20), "fifo_depth": (4, 16),
    "memories": tuple(CHIP_MEMORIES), "port_bits": PORT_WIDTHS, "sort_units": UNIT_COUNTS, "list_writers": UNIT_COUNTS, "preproc_lanes": UNIT_COUNTS,
    "preproc_interval": PREPROC_INTERVALS, "colour_store": (False, True),
}
LIMIT = 1_000_000  # cycles


def pairs(values: dict) -> set:
    """Pairs of parameters with their values."""
    return set(combinations(sorted(values.items()), 2))


def config_of(values: dict) -> RenderConfig:
    """lanes: of a core."""
    return RenderConfig(stage="lanes", **{**values, "lanes": values["cores"] * values["lanes"]})


def values_of(config: RenderConfig) -> dict:
    return {name: getattr(config, name) for name in VALUES} | {"lanes": config.lanes // config.cores}


def chosen() -> list[dict]:
    """The sets: that of `tiny` and the default, then by greed."""
    rng = random.Random(seed())
    found = [values_of(chip_of("tiny").config), values_of(RenderConfig(stage="lanes"))]
    covered = set().union(*map(pairs, found))
    while len(found) < SETS:
        candidates = [{name: rng.choice(values) for name, values in VALUES.items()} for _ in range(CANDIDATES)]
        best = max(candidates, key=lambda values: len(pairs(values) - covered))
        covered |= pairs(best)
        found.append(best)
    return found


def test_every_pair_is_there() -> None:
    sets = chosen()
    print(f"seed {seed()}: {len(sets)} sets")
    due = {((a, x), (b, y)) for a, b in combinations(sorted(VALUES), 2) for x in VALUES[a] for y in VALUES[b]}
    assert len(sets) == SETS and due <= set().union(*map(pairs, sets))


@pytest.mark.parametrize("number", [pytest.param(k, marks=[pytest.mark.slow] * (k != 1)) for k in range(SETS)])
def test_set(number: int) -> None:
    """Two pictures, the second of no whole number of tiles and in FP16; and where colours can be kept, the first one of what it has kept."""
    config = config_of(chosen()[number])
    print(f"seed {seed()}, set {number}: {chosen()[number]}")
    rng, count = np.random.default_rng(seed()), 256 * len(SH_BITS)
    scene = Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, count)), rng.uniform(1.0, 6.0, count)], axis=1), scales=rng.uniform(0.01, 0.1, (count, 3)),
        quats=rng.normal(size=(count, 4)), opacities=rng.uniform(0.01, 1.0, count), sh=rng.normal(scale=0.3, size=(count, 9, 3)),
    )
    packed = pack(scene, recipe=Recipe(cuts=0, sh_bits=lambda scene, start: np.resize(SH_BITS, len(start)))).packed
    with ChipSession(packed, config, seed=seed(), memory=MemoryOptions(DramConfig(port_bits=config.port_bits).timing)) as chip:
        device = chip.device
        assert (device.cores, device.lanes, device.sort_units, device.list_writers, device.preproc_lanes, device.preproc_interval) == (
            config.cores, config.lanes, config.sort_units, config.list_writers, config.preproc_lanes, config.preproc_interval,
        )
        for camera, format_ in (
            (Camera(96, 54, 80.0, 80.0, np.zeros(3), np.eye(3)), PixelFormat.RGB8),
            (Camera(41, 23, 40.0, 40.0, np.array([0.3, 0.0, 0.0]), np.eye(3)), PixelFormat.RGBA16F),
        ):
            done = chip.render(camera, format_, limit=LIMIT)
            want = render_chip(front_lists(run_front(packed, camera)), config, format_)
            assert done.error == 0 and np.array_equal(done.buffer, want.buffer)
            assert np.ptp(want.buffer) > 0
        assert device.colour_store == config.colour_store
        if not config.colour_store:
            return
        store, kept, view = chip.store(0.0), ColourStore(packed), Camera(96, 54, 80.0, 80.0, np.zeros(3), np.eye(3))
        place = chip.place(view)
        for _ in range(2):
            frame = chip.frame(view, place, store=store)
            chip.start(frame)
            done = chip.finish(frame, LIMIT)
            front = run_front(packed, view, reuse=Reuse(kept, 0.0))
            assert done.error == 0 and np.array_equal(done.buffer, render_chip(front_lists(front), config, PixelFormat.RGB8).buffer)
            assert done.front["store_beats"] == front.reused.read_beats and np.array_equal(chip.read(store.address, store.bytes), kept.image())
        assert front.reused.stored.all()
