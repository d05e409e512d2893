"""Scenes with a few Gaussians far away: clusters, steps of positions, depth keys, warnings.

Pictures of families with flyaways are in test_stability.py; guitar with flyaways is here, where the scenes are (SLOW). Not covered: the RTL, whose pictures are
those of the golden model for any image.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.runner import seed
from scene_samples import random_scene
from typer.testing import CliRunner

from flicker.cli.main import app
from flicker.errors import FlickerWarning
from flicker.front.view import View
from flicker.golden.front.frame import run_front
from flicker.pipeline import FrontOptions, packed_for_picture, packing_of
from flicker.scene.camera import Camera, load_cameras
from flicker.scene.clusters import _curve, cluster_order, flyaways, morton_order
from flicker.scene.files import load_scene
from flicker.scene.gaussians import Scene
from flicker.scene.memory import encode_chunks, save_chunks
from flicker.scene.packed import PackedFormat, decode
from flicker.scene.packing import Recipe, pack, pack_file
from flicker.scene.real import real_scenes
from flicker.scene.steps import COARSE, PositionSteps, measure_steps, position_steps

CAMERA = Camera(320, 320, 400, 400, np.array([0, 0, -3.0]), np.eye(3))


def plain_morton(means: np.ndarray) -> np.ndarray:
    """Order along a Morton curve in the box of all, 21 bits an axis, bit by bit."""
    means = means.astype(np.float64)
    low, extent = means.min(axis=0), np.ptp(means, axis=0)
    cells = np.minimum((means - low) / extent * 2**21, 2**21 - 1).astype(int)
    codes = [sum((int(c) >> bit & 1) << 3 * bit + axis for axis, c in enumerate(cell) for bit in range(21)) for cell in cells]
    return np.argsort(np.array(codes, np.uint64), kind="stable")


def scene_with(far: np.ndarray, count: int = 3000) -> Scene:
    """A cube of Gaussians of about 2 units, and some at `far` (n, 3)."""
    scene = random_scene(seed(), count, 0)
    more = random_scene(seed() + 1, len(far), 0) if len(far) else None
    if more is None:
        return scene
    return Scene(*(np.concatenate([a, b]) for a, b in zip(
        (scene.means, scene.scales, scene.quats, scene.opacities, scene.sh), (far, more.scales, more.quats, more.opacities, more.sh))))


def directions(n: int) -> np.ndarray:
    way = np.random.default_rng(seed()).normal(size=(n, 3))
    return way / np.linalg.norm(way, axis=1, keepdims=True)


def test_order_without_flyaways_is_mortons() -> None:
    """In runs of 256, whatever the tail within `FAR` widths."""
    means = np.random.default_rng(seed()).normal(size=(700, 3)) * (1, 3, 0.2)
    means[0] *= 4
    order, start, near = cluster_order(means, 256)
    assert near == 700 and np.array_equal(order, plain_morton(means)) and start.tolist() == [0, 256, 512]
    assert not flyaways(means).any()


LOG = np.exp(np.random.default_rng(3).uniform(np.log(10), np.log(1e7), 400))[:, None]
FARS = {
    "six": 1e7 * directions(6), "one": np.array([[3e6, -1e5, 7.0]]), "on an axis": np.array([[0, d, 0] for d in (50.0, 1e3, 1e5, -2e6, 1e7)]),
    "many, evenly in log distance": LOG * directions(400), "the most float32 says": np.array([[3e38, -3e38, 3e38]]) / 4,
}


@pytest.mark.parametrize("far", FARS.values(), ids=FARS)
@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_flyaways_have_clusters_of_their_own(far: np.ndarray, form: PackedFormat) -> None:
    """However many: all others are packed as without them, bit for bit, and the far ones are seen where they are."""
    scene, alone = scene_with(far), scene_with(far[:0])
    with_, without = pack(scene, form), pack(alone, form)
    n = int((with_.order < len(alone)).sum())
    assert n == len(without.order) and np.array_equal(with_.order[:n], without.order)
    assert np.array_equal(decode(with_.packed).means[:n], decode(without.packed).means)
    assert np.array_equal(with_.packed.headers[: len(without.packed.table)], without.packed.headers)
    # Far ones: error against distance, as an angle from the middle.
    k = with_.order[n:]
    limit = 65504 if form is PackedFormat.FP16_LOCAL else np.inf
    away = np.linalg.norm(scene.means[k].astype(np.float64), axis=1)
    moved = np.abs(decode(with_.packed).means[n:].astype(np.float64) - scene.means[k]).max(axis=1)
    assert (moved / away).max() < 5e-4 and set(with_.clamped) <= {"scale below FP16"} | ({"mean beyond FP16"} if limit == np.inf else set())
    assert flyaways(scene.means)[: len(alone)].sum() == 0 and flyaways(scene.means).sum() >= 0.5 * len(far)


def test_two_scenes_far_apart() -> None:
    """Each is cut into clusters as if it were alone, with half of the Gaussians each and with others."""
    one = random_scene(seed(), 2000, 0)
    for share in (1000, 1500, 700):
        scene = replace(one, means=one.means.copy())
        scene.means[share:] += (1e5, 0, 0)
        for form in (PackedFormat.CHUNK, PackedFormat.FP16_LOCAL):
            packed = pack(scene, form, Recipe(cuts=0)).packed
            error = np.abs(decode(packed).means[:, 0] - scene.means[pack(scene, form, Recipe(cuts=0)).order][:, 0])
            assert error.max() < 0.009, (share, form)  # half a step of float32 at 1e5 is 0.004
            assert (packed.table["high"] - packed.table["low"]).max() < 3


def test_all_at_one_place() -> None:
    """No cell is cut for ever; the order stays."""
    assert np.array_equal(morton_order(np.ones((1000, 3))), np.arange(1000))
    means = np.ones((1000, 3))
    means[7] = 5
    order, start, near = cluster_order(means, 256)
    assert sorted(order) == list(range(1000)) and near == 1000
    assert len(pack(replace(random_scene(seed(), 1000, 0), means=means)).packed) == 1000


def test_crowded_cells_are_told_apart() -> None:
    """A cube of 2^-30 of the box has a curve of its own."""
    rng = np.random.default_rng(seed())
    inner = rng.random((500, 3)) * 2.0**-30
    means = np.concatenate([inner, [[1, 1, 1]]])
    order = _curve(means, means)
    assert np.array_equal(order[:500], plain_morton(inner)) and order[500] == 500


def test_steps_are_those_of_the_codes() -> None:
    """Half a step is the most that a decoded position is off, and some are nearly that; exact ends have none."""
    scene = random_scene(seed(), 2000, 0)
    for form in PackedFormat:
        packing = pack(scene, form)
        error = np.abs(decode(packing.packed).means.astype(np.float64) - scene.means[packing.order]).max(axis=1)
        steps = position_steps(packing.packed)
        assert (error <= 0.5 * steps + 1e-6).all() and (error > 0.3 * steps).mean() > 0.2, form
    pair = pack(replace(scene_with(np.empty((0, 3)), 2), means=[[0, 0, 0], [1, 2, 3]])).packed
    assert position_steps(pair).tolist() == [0, 0]


def test_measured_in_pixels() -> None:
    """One Gaussian between two others: its step, seen at its depth."""
    scene = random_scene(seed(), 3, 0)
    scene = replace(scene, means=[[-1, 0, 0], [0.3, 0, 0], [1, 0, 0]], scales=np.full((3, 3), 0.03), opacities=np.full(3, 0.9))
    found = measure_steps(pack(scene, recipe=Recipe(cuts=0)).packed, [CAMERA])
    step = 2 / 2047
    assert found.seen == 3 and found.largest == pytest.approx(step) and found.largest_px == pytest.approx(step * 400 / 3, rel=1e-3)
    assert found.relative == pytest.approx(step * 400 / 3 / np.hypot(0.03 * 400 / 3, np.sqrt(0.3)), rel=0.01)
    away = Camera(320, 320, 400, 400, np.array([0, 0, 3.0]), np.eye(3))  # looks away
    assert measure_steps(pack(scene).packed, [away]) == PositionSteps(found.mean, found.largest, 1, 0, 0.0, 0.0, 0.0, PackedFormat.CHUNK)


def own_chunks(path: Path) -> Scene:
    """A compressed PLY whose chunks hold Gaussians from all over the scene, and one far away in each."""
    scene = scene_with(np.zeros((0, 3)), 1024)
    scene.scales[:] = 0.02
    scene.means[::256] = 40 * directions(4)
    save_chunks(encode_chunks(scene), path)
    return scene


def test_chunks_of_a_file_are_kept_measured_and_made_anew(tmp_path: Path) -> None:
    """A picture of them warns; `rechunk` makes clusters anew, which are fine; so does the command."""
    path = tmp_path / "a.compressed.ply"
    own_chunks(path)
    view = View(CAMERA, load_scene(path))
    with pytest.warns(FlickerWarning, match=r"a.compressed.ply: positions are packed in steps of .*--rechunk makes the clusters anew"):
        packed, stats = packed_for_picture(view, FrontOptions())
    assert len(packed.table) == 4 and stats["position_steps"]["relative"] > COARSE
    with warnings.catch_warnings():
        warnings.simplefilter("error", FlickerWarning)
        packed, stats = packed_for_picture(view, FrontOptions(rechunk=True))
    assert len(packed.table) > 4 and stats["position_steps"]["relative"] < 0.5 * COARSE
    assert packing_of(view.scene, None, rechunk=True).packed.image() == pack_file(path, rechunk=True).packed.image() != pack_file(path).packed.image()
    for words, warned in ((), True), (("--rechunk",), False):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            result = CliRunner().invoke(app, ["pack", str(path), "-o", str(tmp_path / "a.flk"), *words])
        assert result.exit_code == 0 and "steps of positions" in result.output and "pixels, in 8 views" in result.output
        assert any("positions are packed" in str(w.message) for w in said) == warned
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result = CliRunner().invoke(app, ["pack", "--info", str(tmp_path / "a.flk")])
    assert "steps of positions" in result.output and not any("positions" in str(w.message) for w in said)


def test_depth_keys_of_flyaways() -> None:
    """A flyaway in the picture leaves the keys of all others as they are."""
    near, seen = scene_with(np.empty((0, 3))), scene_with(np.array([[0, 0, 1e6]]))
    keys = []
    for scene in (near, seen):
        packed, stats = packed_for_picture(View(CAMERA, scene), FrontOptions())
        front = run_front(packed, CAMERA)
        assert "position_steps" in stats
        keys.append(np.sort(front.key[front.key < 20 << 19]))
    assert len(keys[0]) > 1000 and np.array_equal(*keys)


@pytest.mark.skipif(real_scenes() is None, reason="FLICKER_SCENES names no folder of scenes")
@pytest.mark.slow
@pytest.mark.parametrize(("count", "nearest", "farthest"), [(6, 1e5, 1e5), (6, 1e7, 1e7), (2000, 10, 1e7)])
def test_guitar_with_flyaways(count: int, nearest: float, farthest: float) -> None:
    """The whole chip's picture is the one without them, whether they are in it or not."""
    from flicker.chip.run import render_on_chip
    from flicker.params import RECOMMENDED
    from flicker.pipeline import Engine

    place = real_scenes() / "guitar"
    scene = load_scene(place / "guitar.ply")
    far = np.geomspace(nearest, farthest, count)[:, None] * directions(count)
    rest = (np.concatenate([values, values[:count]]) for values in (scene.scales, scene.quats, scene.opacities, scene.sh))
    more = Scene(np.concatenate([scene.means, far]), *rest)
    result = render_on_chip(View(load_cameras(place / "cameras.json")[0], more), Engine.CHIP_GOLDEN, config=RECOMMENDED, compare=True)
    assert result.stats["psnr_db"] >= 58
