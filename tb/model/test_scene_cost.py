"""Cost of a scene: what each Gaussian gives and takes, findings, the command.

Covered: sums over Gaussians against pictures (blended weight against transmittance, visits against the map of visits, entries and bytes against the chip
model's), numbers in the file's order, scenes that come in chunks or packed, one scene for each finding. The cycles themselves are the chip model's:
tb/model/test_chip_rendering.py. Not covered: that what is called never seen is never seen from elsewhere.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.command import flicker
from flicker_tb.runner import seed

from flicker.chip.scene_cost import ENTRY_BYTES, SH_PEAK, SceneCost, scene_cost
from flicker.errors import FlickerError
from flicker.front.projection import colours
from flicker.front.view import View
from flicker.golden.front.blend import blend_records
from flicker.golden.front.frame import run_front
from flicker.params import Form
from flicker.pipeline import packed_scene
from flicker.scene.camera import Camera
from flicker.scene.files import Scene, load_scene
from flicker.scene.memory import decode_chunks, encode_chunks, save_chunks
from flicker.scene.packed import PackedFormat
from flicker.scene.packing import pack


def camera(x: float = 0.0) -> Camera:
    return Camera(96, 64, 90.0, 90.0, np.array([x, 0.0, 0.0]), np.eye(3))


def some(count: int = 400, degree: int = 1) -> Scene:
    rng = np.random.default_rng([seed(), 5])
    return Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, count)), rng.uniform(1.0, 6.0, count)], axis=1), scales=rng.uniform(0.01, 0.1, (count, 3)),
        quats=rng.normal(size=(count, 4)), opacities=rng.uniform(0.01, 1.0, count), sh=rng.normal(scale=0.3, size=(count, (degree + 1) ** 2, 3)),
    )


def named(cost: SceneCost) -> dict[str, int]:
    return {finding.name: finding.gaussians for finding in cost.findings()}


def with_more(scene: Scene, **fields) -> Scene:
    """A scene with further Gaussians behind its own."""
    values = {name: np.concatenate([getattr(scene, name), np.asarray(fields[name], np.float64)]) for name in ("means", "scales", "quats", "opacities", "sh")}
    return Scene(**values)


def test_sums() -> None:
    """Blended weight is what the picture lacks in transmittance; visits are those of the map; entries, bytes and cycles those of front end and chip model."""
    scene = some()
    cost = scene_cost(scene, [camera(), camera(0.5)])
    for view in cost.views:
        front = run_front(cost.packing.packed, view.camera)
        lists = front.subtile_lists()
        splats = dataclasses.replace(front.splats(), rgb=np.zeros((len(front.number), 3)))
        left = blend_records(splats, Form.FACTORED, lists.start, lists.entry, 96, 64, (1.0, 1.0, 1.0))[..., 0]
        assert view.weight.sum() == pytest.approx((1.0 - left).sum(), rel=1e-9)
        assert view.visits.sum() == view.visited.sum() > 0  # the picture ends with a sub-tile
        assert view.entries.sum() == len(lists.entry) and view.tiles.sum() == len(front.entry_tile)
        assert view.recorded.sum() == len(front.number) and (view.recorded <= view.fetched).all()
        assert (view.weight[~view.recorded] == 0).all() and (view.peak <= np.minimum(view.weight, 0.99) + 1e-12).all()
        assert view.bytes["geometry"] > 0 and view.interval == max(view.cycles.values()) > 0
        # A record names the Gaussian it was made of.
        depth = (scene.means - view.camera.position)[:, 2]
        assert (np.diff(depth[cost.packing.order[front.gaussian]][np.argsort(front.key)]) > -0.01).all()  # codes of 11 bits
    total = sum(view.tiles.sum() for view in cost.views) / 2
    assert cost.moved.sum() >= 2 * ENTRY_BYTES * total


def test_never_seen() -> None:
    """Behind a wall of opaque Gaussians; the wall is seen, what is behind it is named by its number in the file."""
    wall = np.array([[0.2 * x, 0.2 * y, 1.0] for x in range(-8, 9) for y in range(-6, 7)])
    n = len(wall)
    front = Scene(
        means=np.repeat(wall, 3, axis=0), scales=np.full((3 * n, 3), 0.2), quats=np.tile([1.0, 0, 0, 0], (3 * n, 1)), opacities=np.full(3 * n, 0.999),
        sh=np.full((3 * n, 1, 3), 0.5),
    )
    both = with_more(front, means=[[0.0, 0.0, 5.0]], scales=[[0.1] * 3], quats=[[1.0, 0, 0, 0]], opacities=[0.9], sh=np.full((1, 1, 3), 0.5))
    cost = scene_cost(both, [camera()])
    view = cost.views[0]
    assert view.recorded[-1] and view.entries[-1] > 0 and view.peak[-1] == 0 and view.visits[-1] == 0
    assert "never seen" in named(cost) and cost.peak[:-1].max() > 0.1
    assert "never seen" not in named(scene_cost(Scene(*(getattr(both, f)[-1:] for f in ("means", "scales", "quats", "opacities", "sh"))), [camera()]))


def test_enormous_and_dearest() -> None:
    """A thin veil over everything costs most for what it gives, and lies in every tile."""
    veil = {"means": [[0.0, 0.0, 3.0]], "scales": [[9.0, 9.0, 9.0]], "quats": [[1.0, 0, 0, 0]], "opacities": [0.006], "sh": np.zeros((1, 4, 3))}
    cost = scene_cost(with_more(some(), **veil), [camera()])
    assert cost.views[0].tiles[400] == 24 and named(cost)["enormous"] >= 1
    assert cost.dearest(1)[0]["gaussian"] == 400


def test_silent_coefficients() -> None:
    """Coefficients too small to see are counted; the bound on what they add holds in every direction and is reached."""
    scene = some(degree=3)
    scene.sh[:100, 1:] *= 1e-4
    cost = scene_cost(scene, [camera()])
    assert named(cost)["SH says nothing"] == 100
    direction = np.random.default_rng(seed()).normal(size=(20_000, 3))
    for k, peak in enumerate(SH_PEAK, 1):
        sh = np.zeros((len(direction), 16, 3))
        sh[:, k] = 0.5
        rgb = np.empty((len(direction), 3))
        colours(direction, sh, np.arange(len(direction)), np.zeros(3), rgb)
        assert 0.98 * peak < 2 * np.abs(rgb - 0.5).max() <= peak * (1 + 1e-6), k


def test_left_out_and_wide() -> None:
    """Too faint for any pixel; a cluster of Gaussians all over space, of which a view needs a few."""
    rng = np.random.default_rng(seed())
    far = rng.uniform(-500, 500, (250, 3))
    faint = np.where(np.arange(250) < 20, 0.001, 0.5)
    cost = scene_cost(Scene(
        means=far, scales=np.full((250, 3), 0.05), quats=np.tile([1.0, 0, 0, 0], (250, 1)), opacities=faint, sh=np.full((250, 1, 3), 0.5)), [camera()])
    found = named(cost)
    assert found["left out"] == 20 and found["wide clusters"] == 230
    assert not cost.views[0].recorded[:20].any()


def test_kept_chunks(tmp_path: Path) -> None:
    """A compressed PLY keeps its chunks and a packed scene stays as it is, in the format that it has; numbers are those of the file, also of Gaussians
    behind others that loading leaves out."""
    chunks = encode_chunks(some(600))  # not in Morton order
    means = decode_chunks(chunks).means
    chunks.bounds[0, 17] = 3e38  # blue: some are beyond float32
    path = tmp_path / "a.compressed.ply"
    save_chunks(chunks, path)
    scene = load_scene(path)
    assert 0 < sum(scene.rejected.values()) == 600 - len(scene) < 256
    cost = scene_cost(scene, [camera()])
    assert cost.packing.kept_chunks and cost.packing.packed.image() == packed_scene(View(camera(), scene), None).image() != pack(scene).packed.image()
    assert len(cost.scene) == len(cost.peak) == 600 and np.allclose(cost.scene.means, means, atol=1e-5)
    assert np.corrcoef(cost.views[0].weight, scene_cost(some(600), [camera()]).views[0].weight)[0, 1] > 0.95
    image = tmp_path / "a.flk"
    image.write_bytes(pack(some(600), PackedFormat.FP16_LOCAL).packed.image())
    found = scene_cost(load_scene(image), [camera()])
    assert found.packing.packed.image() == image.read_bytes() and found.packing.packed.format is PackedFormat.FP16_LOCAL
    assert found.views[0].weight.sum() == pytest.approx(cost.views[0].weight.sum(), rel=0.01)
    with pytest.raises(FlickerError, match="is packed as fp16-local, not chunk"):
        scene_cost(load_scene(image), [camera()], form=PackedFormat.CHUNK)


def test_command(tmp_path: Path) -> None:
    done = flicker("cost", "demo", "--views", "2", "--size", "96x54", "--json", str(tmp_path / "a.json"), "--out", str(tmp_path / "a.png"))
    assert done.returncode == 0 and "dearest" in done.stdout, done.stdout
    told = json.loads((tmp_path / "a.json").read_text())
    assert len(told["views"]) == len(told["numbers"]) == 2 and told["views"][0]["size"] == [96, 54] and (tmp_path / "a.png").stat().st_size > 1000
    for wrong, text in ((["--view", "99"], "view 99"), (["--json", str(tmp_path)], "--json"), (["--size", "ab"], "--size")):
        done = flicker("cost", "demo", *wrong)
        assert done.returncode == 2 and text in done.stderr and done.stderr.count("\n") == 1, done.stderr
