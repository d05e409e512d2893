"""Errors over time: temporal PSNR and jumps of made errors, summaries, and the warping error beside them.

Not covered: how people see flicker.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import scene_samples as samples

from flicker.front.reference import expected_depth
from flicker.front.view import View
from flicker.scene.camera import Camera, orbit_camera
from flicker.scene.motion import panned
from flicker.scene.temporal import JUMP, Change, TemporalError, summarise
from flicker.scene.warping import flow, seen_by_both, warping_error

SHAPE = (48, 64, 3)


def measured(errors: list[np.ndarray], seed: int = 1) -> list[Change]:
    """Changes of a sequence whose picture moves: the reference is another one in every frame."""
    rng = np.random.default_rng(seed)
    measure = TemporalError()
    return [measure.add(reference + error, reference) for error in errors for reference in [rng.uniform(0.3, 0.7, SHAPE)]]


def test_constant_error_is_no_temporal_error() -> None:
    """However large, and whatever moves in the picture."""
    error = np.random.default_rng(2).normal(0.0, 0.05, SHAPE).clip(-0.2, 0.2)
    changes = measured([error] * 5)
    assert changes[0].change is None and changes[0].temporal_psnr_db is None and changes[0].psnr_db < 30
    for change in changes[1:]:
        assert change.temporal_psnr_db > 300 and change.jumps == 0.0  # rounding of float64
    picture = np.full(SHAPE, 0.5)
    measure = TemporalError()
    assert [measure.add(picture, picture).temporal_psnr_db for _ in range(2)] == [None, math.inf]


def test_independent_noise_gives_3_db_less_than_the_still() -> None:
    rng = np.random.default_rng(3)
    summary = summarise(measured([rng.normal(0.0, 0.01, SHAPE) for _ in range(30)]), 90)
    assert summary.psnr_db == pytest.approx(40.0, abs=0.05)
    assert summary.psnr_db - summary.temporal_psnr_db == pytest.approx(10 * math.log10(2), abs=0.05)


def test_jumps_are_pixels() -> None:
    """A pixel counts once, whichever channels jump; a change of 8/255 is none."""
    errors = [np.zeros(SHAPE) for _ in range(4)]
    errors[1][3, 4] = 9 / 255                 # appears: 1 pixel
    errors[2][3, 4, 1] = -9 / 255             # all channels change: 1 pixel
    errors[2][:2, :5, 0] = 8.5 / 255          # 10 pixels
    errors[2][20, 20] = 7.9 / 255             # none
    errors[3] = errors[2]
    changes = measured(errors)
    pixels = SHAPE[0] * SHAPE[1]
    assert [round(c.jumps * pixels) for c in changes[1:]] == [1, 11, 0] and JUMP == 8 / 255
    assert changes[3].change == pytest.approx(0.0, abs=1e-30)


def test_clamped_as_pictures_are() -> None:
    """What lies outside [0, 1] is nothing that a display shows."""
    measure = TemporalError()
    measure.add(np.full(SHAPE, 1.5), np.ones(SHAPE))
    assert measure.add(np.full(SHAPE, 3.0), np.ones(SHAPE)).temporal_psnr_db == math.inf


def test_worst_frame_and_second() -> None:
    changes = [Change(1e-4), *(Change(1e-4, 1e-5, 0.0) for _ in range(20))]
    changes[4] = Change(1e-4, 1e-3, 0.5)          # one frame
    changes[12] = changes[13] = changes[14] = Change(1e-4, 6e-4, 0.25)
    summary = summarise(changes, 3)
    assert (summary.frames, summary.worst_frame, summary.worst_second) == (21, 4, 12)
    assert summary.worst_frame_db == pytest.approx(30.0) and summary.worst_second_db == pytest.approx(-10 * math.log10(6e-4))
    assert summary.jumps == pytest.approx(1.25 / 20)
    short = summarise(changes[:6], 90)
    assert short.worst_second == 1 and short.worst_second_db == pytest.approx(short.temporal_psnr_db)
    alone = summarise(changes[:1], 90)
    assert alone.temporal_psnr_db is None and alone.worst_frame is None and alone.psnr_db == pytest.approx(40.0)


def test_shapes_must_agree() -> None:
    measure = TemporalError()
    measure.add(np.zeros(SHAPE), np.zeros(SHAPE))
    with pytest.raises(ValueError, match="frames differ in shape"):
        measure.add(np.zeros((8, 8, 3)), np.zeros((8, 8, 3)))
    with pytest.raises(ValueError, match="a frame behind the first"):
        summarise([Change(0.1), Change(0.1)], 90)


# ---- warping ------------------------------------------------------------------------------------


def test_flow_of_a_plane() -> None:
    """A wall at depth 4: sideways by fx / 4 a unit, nearer by the ratio of depths, turned by the pan's angle."""
    camera = Camera(64, 48, 80.0, 80.0, np.zeros(3), np.eye(3))
    wall = np.full((48, 64), 4.0)
    aside = Camera(64, 48, 80.0, 80.0, np.array([0.1, 0.0, 0.0]), np.eye(3))
    assert flow(wall, camera, aside) == pytest.approx(np.stack([np.full((48, 64), -2.0), np.zeros((48, 64))]))
    nearer = Camera(64, 48, 80.0, 80.0, np.array([0.0, 0.0, 2.0]), np.eye(3))
    x = np.arange(64) - 31.5
    assert flow(wall, camera, nearer)[0, 10] == pytest.approx(x)
    turned = panned(camera, 2.0, 2)[1]
    assert flow(wall, camera, turned)[0, 24, 31:33].mean() == pytest.approx(-2.0, abs=0.01)
    wall[5, 5] = np.nan
    assert np.isnan(flow(wall, camera, aside)[:, 5, 5]).all()
    behind = Camera(64, 48, 80.0, 80.0, np.array([0.0, 0.0, 5.0]), np.eye(3))
    assert np.isnan(flow(wall, camera, behind)).all()


def test_hidden_pixels_do_not_count() -> None:
    """A near square that moves over a wall: the wall that it will hide and the pixels that leave the picture are left out."""
    depth = np.full((40, 60), 10.0)
    depth[10:30, 20:35] = 2.0
    camera, aside = (Camera(60, 40, 50.0, 50.0, np.array([x, 0.0, 0.0]), np.eye(3)) for x in (0.0, -0.16))
    later = np.full((40, 60), 10.0)
    later[10:30, 24:39] = 2.0
    both = seen_by_both(flow(depth, camera, aside), flow(later, aside, camera))
    assert both[15:25, 24:32].all() and both[:8, 2:55].all()
    assert not both[12:28, 35:38].any() and not both[:, -1].any()


def test_warping_error_of_a_scene() -> None:
    """A still scene under a pan has little of it; noise in one of the frames has its variance more."""
    scene = samples.random_scene(1, 60, 0)
    scene.scales *= np.float32(6.0)
    cameras = panned(orbit_camera(scene, 0, 8, 64, 48), 0.5, 2)
    views = [View(camera, scene) for camera in cameras]
    depths = [expected_depth(view.projected, view.camera) for view in views]
    there = flow(depths[0], *cameras)
    both = seen_by_both(there, flow(depths[1], cameras[1], cameras[0]))
    assert both.mean() > 0.3
    clean = warping_error(views[0].reference, views[1].reference, there, both)
    noise = np.random.default_rng(1).normal(0.0, 0.05, views[0].reference.shape)
    noisy = warping_error(views[0].reference + noise, views[1].reference, there, both)
    assert clean < 2e-4 and noisy - clean == pytest.approx(0.0025, rel=0.4)
    assert warping_error(views[0].reference, views[1].reference, there, np.zeros_like(both)) is None
