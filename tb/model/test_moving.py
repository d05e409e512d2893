"""Families that move: motions, speeds, what must not flicker, the command.

Not covered: all configurations at all speeds (`make docs PART=stability_moving`).
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.command import flicker

from flicker.errors import FlickerError
from flicker.explore.stability.families import DEPTH, SIZE, _camera
from flicker.explore.stability.moving import MACHINES, MOVING, SPEEDS, MovingPoint, moving_table, run_moving
from flicker.front.projection import project


@pytest.mark.parametrize("family", MOVING.values(), ids=lambda family: family.name)
def test_speed_is_pixels_a_frame(family) -> None:
    """A point `DEPTH` ahead of the middle moves by the speed, but for who goes forward; the same seed gives the same scene, which is seen in every frame."""
    speed, camera = 0.25, _camera()
    cameras = family.path(camera, speed, 9)
    ahead = [c.rotation.T @ (np.array([0.0, 0.0, DEPTH]) - c.position) for c in cameras]
    x = np.array([c.fx * p[0] / p[2] for c, p in zip(cameras, ahead)])
    if family.name == "through":
        assert np.diff([p[2] for p in ahead]) == pytest.approx(-speed * DEPTH / SIZE)
    else:
        assert np.diff(x) == pytest.approx(-speed, rel=0.01) and x[4] == pytest.approx(0.0, abs=1e-9)
    scenes = [family.scene(np.random.default_rng(5), camera) for _ in range(2)]
    assert (scenes[0].means == scenes[1].means).all()
    assert all(project(scenes[0], c).n_visible > 10 for c in family.path(camera, SPEEDS[-1], 9))


def test_what_flickers() -> None:
    """Leader pixels do, thin Gaussians at a pixel a frame, small ones always; lanes, no test and records of 16 bytes do not; the table says at which speed."""
    points = run_moving(["thin_moved", "small_moved"], ["flicker-sparse-fixed-factored", "no-ctu-32", "log-lanes", "front-fp16-local-16"], (1 / 64, 1.0))
    by = {(p.family, p.speed, p.configuration): p for p in points}
    assert len(by) == len(points) == 16
    for p in points:
        assert p.broken == (p.configuration.startswith("flicker") and (p.family == "small_moved" or p.speed == 1.0)), p
        assert p.configuration != "log-lanes" or p.temporal_psnr_db >= 60.0 and p.jumps == 0.0
    heads, _, *rows = moving_table(points).splitlines()
    assert heads.startswith("| configuration | thin_moved | small_moved |") and rows[0].startswith("| `flicker-sparse-fixed-factored` | 1 (")
    assert all("| - (" in row for row in rows[1:])


def test_broken() -> None:
    point = MovingPoint("moved", 1.0, "x", 50.0, 41.0, 0.0005)
    assert not point.broken
    for psnr, jumps in ((39.9, 0.0), (50.0, 0.002), (math.nan, 0.0)):
        assert MovingPoint("moved", 1.0, "x", 50.0, psnr, jumps).broken
    with pytest.raises(FlickerError, match="unknown family 'x'"):
        run_moving(["x"])
    with pytest.raises(FlickerError, match="configuration 'x' is unknown"):
        run_moving(["moved"], ["x"])


def test_command(tmp_path: Path) -> None:
    done = flicker("stability", "--moving", "--quick", "--family", "swap", "--config", "log-lanes", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    found = list(csv.DictReader((tmp_path / "moving.csv").open()))
    assert [(row["family"], float(row["speed"]), row["broken"]) for row in found] == [("swap", 0.25, "0"), ("swap", 4.0, "0")]
    assert "log-lanes" in done.stdout and "| swap |" in (tmp_path / "moving.md").read_text()
    done = flicker("stability", "--moving", "--list")
    assert all(name in done.stdout for name in (*MOVING, *MACHINES))
    done = flicker("stability", "--moving", "--front", "--out", tmp_path)
    assert done.returncode == 2 and done.stderr == "flicker: --moving: has front ends of its own, so it cannot be combined with --front\n"
