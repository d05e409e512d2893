"""`flicker grow`: how many Gaussians, what stays of each, what a picture loses, scenes side by side, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.runner import seed
from scene_samples import random_scene
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from flicker.cli.main import app
from flicker.errors import FlickerError
from flicker.front.projection import project
from flicker.front.reference import render_reference
from flicker.pipeline import packing_of
from flicker.scene.camera import Camera
from flicker.scene.files import load_scene, save_ply
from flicker.scene.gaussians import Scene
from flicker.scene.grow import MOST, grown, joined, with_degree
from flicker.scene.memory import encode_chunks, save_chunks
from flicker.scene.metrics import psnr

CAMERA = Camera(200, 120, 160, 160, np.array([0, 0, -6.0]), np.eye(3))


def covariances(scene: Scene) -> np.ndarray:
    rotation = Rotation.from_quat(scene.quats, scalar_first=True).as_matrix()
    return rotation * scene.scales[:, None].astype(np.float64) ** 2 @ rotation.transpose(0, 2, 1)


@pytest.mark.parametrize("times", [1.0, 1.004, 2.0, 2.5, 8.0])
def test_counts(times: float) -> None:
    scene = random_scene(seed(), 500, 1)
    more = grown(scene, times, seed())
    assert len(more) == round(500 * times) and more.sh.shape == (len(more), 4, 3)
    again, other = grown(scene, times, seed()), grown(scene, times, seed() + 1)
    assert np.array_equal(again.means, more.means) and np.array_equal(other.means, more.means) == (times in (1.0, 2.0, 8.0))


def test_halves_are_the_whole() -> None:
    """Mean and covariance of two halves together, opacity through the middle, all else as it was."""
    scene = random_scene(seed(), 300, 2)
    more = grown(scene, 2)
    a, b = (Scene(*(getattr(more, name)[part] for name in ("means", "scales", "quats", "opacities", "sh"))) for part in (slice(300), slice(300, None)))
    assert np.allclose((a.means + b.means) / 2, scene.means, atol=1e-5)
    apart = (b.means - a.means).astype(np.float64) / 2
    assert np.allclose(covariances(a) + apart[:, :, None] * apart[:, None], covariances(scene), rtol=1e-4, atol=1e-9)
    assert np.array_equal(a.scales, b.scales) and np.array_equal(a.quats, scene.quats) and np.array_equal(b.sh, scene.sh)
    middle = 1 - (1 - a.opacities * np.exp(-0.25 / (2 * 0.75))) ** 2
    assert np.allclose(middle, 0.9775 * scene.opacities, atol=1e-3) and (a.opacities < scene.opacities).all()


def test_of_no_file(tmp_path: Path) -> None:
    """A grown scene is packed as it is, not as the file that it came from has its chunks."""
    save_chunks(encode_chunks(random_scene(seed(), 300, 0)), tmp_path / "a.compressed.ply")
    scene = load_scene(tmp_path / "a.compressed.ply")
    assert len(packing_of(scene, None).packed) == 300
    for more in (grown(scene, 2), joined([scene, scene])):
        assert more.path is None and len(packing_of(more, None).packed) == 600


def test_picture() -> None:
    """Looks much the same: each turn of halves loses little of a picture of Gaussians larger than a pixel."""
    scene = random_scene(seed(), 400, 0)
    before = render_reference(project(scene, CAMERA), CAMERA)
    loss = [psnr(before, render_reference(project(grown(scene, times), CAMERA), CAMERA)) for times in (2, 8)]
    assert loss[0] > 30 and loss[0] > loss[1] > 22


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_degrees(degree: int) -> None:
    """What is there stays or is cut; an image has colours of that degree, and the picture hardly changes where harmonics are added."""
    scene = random_scene(seed(), 1024, 1)
    other = with_degree(scene, degree, seed())
    same = min(scene.sh.shape[1], other.sh.shape[1])
    assert other.sh.shape[1] == (degree + 1) ** 2 and np.array_equal(other.sh[:, :same], scene.sh[:, :same])
    assert (packing_of(other, None).packed.degrees == degree).mean() > 0.75  # but of clusters of few Gaussians
    if degree > 1:
        assert other.path is None and np.array_equal(other.sh, with_degree(scene, degree, seed()).sh)
        assert psnr(*(render_reference(project(s, CAMERA), CAMERA) for s in (scene, other))) > 40


def test_side_by_side() -> None:
    first, second = random_scene(seed(), 400, 0), random_scene(seed() + 1, 300, 2)
    second = replace(second, means=100 * second.means + 7, scales=100 * second.scales)
    both = joined([first, second, first])
    assert len(both) == 1100 and both.sh.shape[1] == 9 and np.array_equal(both.means[:400], first.means)
    assert not both.sh[:400, 1:].any() and np.array_equal(both.sh[400:700], second.sh)
    width = lambda means: np.ptp(np.quantile(means, (0.05, 0.95), axis=0), axis=0).max()  # noqa: E731
    parts = both.means[:400], both.means[400:700], both.means[700:]
    assert [width(part) for part in parts] == pytest.approx([width(first.means)] * 3, rel=1e-4)
    middles = np.array([np.median(part, axis=0) for part in parts]) - np.median(first.means, axis=0)
    assert np.allclose(middles, np.array([0, 1, 2])[:, None] * [width(first.means), 0, 0], atol=1e-4)


def test_command(tmp_path: Path) -> None:
    def flicker(*words: object):
        return CliRunner().invoke(app, [str(word) for word in words])

    save_ply(random_scene(seed(), 50, 0), tmp_path / "a.ply")
    done = flicker("grow", tmp_path / "a.ply", tmp_path / "a.ply", "--times", 3, "-o", tmp_path / "b.ply")
    assert done.exit_code == 0 and "of 300" in done.output and "dB" in done.output and "seed" in done.output
    assert len(load_scene(tmp_path / "b.ply")) == 300
    faint = random_scene(seed(), 50, 1)
    faint.opacities[:20] = 0.003
    save_ply(faint, tmp_path / "faint.ply")
    done = flicker("grow", tmp_path / "faint.ply", "--times", 2, "-o", tmp_path / "c.splat")
    assert done.exit_code == 0 and "60" in done.output and "of 100" in done.output and "opacity below 1/510" in done.output and "lost" in done.output
    assert flicker("grow", tmp_path / "a.ply", "--degree", 2, "-o", tmp_path / "d.ply").exit_code == 0 and load_scene(tmp_path / "d.ply").sh_degree == 2
    done = flicker("grow", tmp_path / "a.ply", "-o", tmp_path / "a.ply")
    assert isinstance(done.exception, FlickerError) and "a.ply is the scene itself" in str(done.exception)


def test_refusals() -> None:
    scene = random_scene(seed(), 50, 0)
    for times in (0.5, 0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(FlickerError, match="expected 1 or more, not"):
            grown(scene, times)
    with pytest.raises(FlickerError, match="expected 0 to 3, not 4"):
        with_degree(scene, 4)
    with pytest.raises(FlickerError, match=f"makes 20,000,000 Gaussians, at most {MOST:,}"):
        grown(scene, 4e5)
    many = replace(scene, means=np.zeros((MOST // 2 + 1, 3)))  # of which but the means are counted
    with pytest.raises(FlickerError, match="16,777,218 Gaussians together"):
        joined([many, many])
