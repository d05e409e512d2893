"""Camera paths: made motions, keyframes joined by splines, what cannot be a path.

Not covered: how natural a made walk or shake is.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import periodogram
from scipy.spatial.transform import Rotation

from flicker.errors import FlickerError
from flicker.scene.camera import Camera, cameras_text, load_cameras
from flicker.scene.motion import BOB_M, CORNER_HZ, FIXATION_M, STEPS_HZ, SWAY_M, TURN_RMS, dollied, orbited, panned, shaken, speeds, walked
from flicker.scene.trajectory import check_path, joined

UP = np.array([0.0, -1.0, 0.0])


def camera(**fields) -> Camera:
    return replace(Camera(640, 360, 500.0, 500.0, np.array([1.0, 2.0, 3.0]), np.eye(3), cx=310.0), **fields)


def angles(cameras: list[Camera]) -> np.ndarray:
    """Rotation vectors from the first camera, degrees."""
    turns = Rotation.from_matrix(np.array([c.rotation for c in cameras]))
    return np.degrees((turns[0].inv() * turns).as_rotvec())


# ---- made ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("made", [
    lambda c: panned(c, 0.25, 30), lambda c: orbited(c, np.array([1.0, 2.0, 7.0]), UP, 360, 30), lambda c: dollied(c, 0.5, 30, 30),
    lambda c: walked(c, UP, 1.0, 30, 30), lambda c: shaken(c, 1.0, 30, 30),
])
def test_paths_begin_at_their_camera(made) -> None:
    start = camera()
    path = made(start)
    assert len(path) == 30 and path[0].position == pytest.approx(start.position, abs=1e-12) and path[0].rotation == pytest.approx(start.rotation, abs=1e-12)
    for each in path:
        assert (each.width, each.height, each.fx, each.fy, each.cx, each.cy) == (640, 360, 500.0, 500.0, 310.0, start.cy)


def test_pan_moves_the_middle_by_pixels() -> None:
    """To the right by atan(pixels / fx) a frame, on the spot."""
    path = panned(camera(), 0.25, 9)
    far = path[0].position + 1000.0 * path[0].rotation[:, 2]
    x, _, z = path[1].rotation.T @ (far - path[1].position)
    assert 500.0 * x / z == pytest.approx(-0.25) and angles(path)[8] == pytest.approx([0.0, 8 * math.degrees(math.atan(0.25 / 500)), 0.0])
    assert speeds(path, 90)[0] == 0.0


def test_orbit_looks_at_its_centre() -> None:
    centre = np.array([1.0, 2.0, 7.0])
    path = orbited(camera(), centre, UP, 360, 8)
    for each in path:
        assert each.rotation.T @ (centre - each.position) == pytest.approx([0.0, 0.0, 4.0], abs=1e-9) and each.position[1] == 2.0
    assert path[1].position[0] > 1.0 and path[4].position == pytest.approx([1.0, 2.0, 11.0])  # to the right; then opposite


def test_walk_is_a_walk() -> None:
    """A second at 1.4 m/s, level although the camera looks down; the point of fixation stays where it is in the picture."""
    tilted = camera(rotation=Rotation.from_euler("x", -20, degrees=True).as_matrix())
    path = walked(tilted, UP, 2.0, 90, 91)
    moved = np.array([c.position for c in path]) - path[0].position
    assert moved[-1] == pytest.approx([0.0, 0.0, 2.8], abs=1e-9)
    assert moved[:, 1].min() == pytest.approx(-2 * 2 * BOB_M, rel=1e-2) and np.abs(moved[:, 0]).max() == pytest.approx(2 * SWAY_M, rel=1e-2)
    level = walked(camera(), UP, 1.0, 90, 91)
    for n in (10, 25, 40, 70):
        ahead = level[0].position + (1.4 * n / 90 + FIXATION_M) * np.array([0.0, 0.0, 1.0])
        x, y, z = level[n].rotation.T @ (ahead - level[n].position)
        assert abs(x / z) < 1e-3 and abs(y / z) < 1e-3
    pitch, yaw, _ = angles(walked(camera(), UP, 1.0, 90, 901)).T
    for values, frequency in ((pitch, STEPS_HZ), (yaw, STEPS_HZ / 2)):
        at, power = periodogram(values, 90)
        assert at[np.argmax(power)] == pytest.approx(frequency, abs=0.1)
    assert speeds(path, 90)[1] < 90.0  # Grossman et al.


def test_shake_has_its_spectrum() -> None:
    """Root mean squares of velocities, flat below the corner, a sixteenth at twice the corner; same seed, same head, at any rate of frames."""
    path = shaken(camera(), 1.0, 90, 90 * 120, seed=3)
    turn = angles(path)
    velocity = np.diff(turn, axis=0) * 90
    assert np.sqrt((velocity**2).mean(axis=0)) == pytest.approx(TURN_RMS, rel=0.15)
    at, power = periodogram(velocity[:, 1], 90)
    band = lambda low, high: power[(at >= low) & (at < high)].mean()  # noqa: E731
    assert band(0.3, 1.0) / band(1.0, 1.8) == pytest.approx(1.0, abs=0.6)
    assert band(2 * CORNER_HZ - 0.6, 2 * CORNER_HZ + 0.6) / band(0.3, 1.8) == pytest.approx(1 / 17, rel=0.8)
    assert band(15.0, 45.0) < 1e-4 * band(0.3, 1.8)
    slow = shaken(camera(), 1.0, 30, 30, seed=3)
    assert np.array([c.position for c in slow]) == pytest.approx(np.array([c.position for c in path[: 90 : 3]]))
    assert np.abs(angles(shaken(camera(), 1.0, 90, 90, seed=4)) - turn[:90]).max() > 0.1
    assert np.abs(angles(shaken(camera(), 1.0, 90, 90, seed=3, strength=0.0))).max() == 0.0


# ---- keyframes ----------------------------------------------------------------------------------


def keyframes() -> list[Camera]:
    turns = Rotation.from_euler("yxz", [[0, 0, 0], [40, 10, 0], [90, -5, 20], [170, 0, 0]], degrees=True).as_matrix()
    return [camera(position=np.array([k, k % 2, k * k], float), rotation=turn) for k, turn in enumerate(turns)]


def test_splines_pass_through_keyframes() -> None:
    """Smooth in between: neither place nor angle makes a corner."""
    path = joined(keyframes(), 3 * 30 + 1)
    for k, key in enumerate(keyframes()):
        assert path[30 * k].position == pytest.approx(key.position) and path[30 * k].rotation == pytest.approx(key.rotation)
    places = np.array([c.position for c in path])
    assert np.abs(np.diff(places, 2, axis=0)).max() < 0.01  # a polyline has 0.07 at the corners
    turns = Rotation.from_matrix([c.rotation for c in path])
    rates = (turns[:-1].inv() * turns[1:]).magnitude()
    assert np.abs(np.diff(rates)).max() < 0.005
    line = joined(keyframes()[:2], 5)
    assert np.array([c.position for c in line])[:, 0] == pytest.approx([0, 0.25, 0.5, 0.75, 1])


def test_times_of_keyframes_count() -> None:
    timed = [replace(key, timestamp=t) for key, t in zip(keyframes(), (10.0, 11.0, 13.0, 16.0))]
    path = joined(timed, 61)
    assert path[10].position == pytest.approx(timed[1].position) and path[30].position == pytest.approx(timed[2].position) and path[0].timestamp is None
    with pytest.raises(FlickerError, match="one at least"):
        joined(timed, 0)


@pytest.mark.parametrize(("change", "said"), [
    ({"width": 320}, "camera 2: width: 320 pixels, 640 before: a path has one size, which --size gives"),
    ({"height": 240, "cy": camera().cy}, "camera 2: height: 240 pixels, 360 before: a path has one size, which --size gives"),
    ({"fx": 510.0}, "camera 2: fx: 510 pixels, 500 before: a path has one lens"),
    ({"cx": 312.0}, "camera 2: cx: 312 pixels, 310 before: a path has one lens"),
    ({"timestamp": 2.0}, "camera 1: timestamp: is missing, others have one"),
])
def test_lens_and_size_stay(change: dict, said: str) -> None:
    cameras = keyframes()
    check_path(cameras, "cameras.json")
    cameras[2] = replace(cameras[2], **change)
    with pytest.raises(FlickerError) as caught:
        check_path(cameras, "cameras.json")
    assert str(caught.value) == f"cameras.json: {said}"


def test_times_rise(tmp_path: Path) -> None:
    """Times of a file, as it is read; a date is none, NaN is refused by the reader."""
    timed = [replace(key, timestamp=t) for key, t in zip(keyframes(), (0.0, 1.0, 1.0, 2.0))]
    file = tmp_path / "cameras.json"
    file.write_text(cameras_text(timed))
    loaded = load_cameras(file)
    assert [c.timestamp for c in loaded] == [0.0, 1.0, 1.0, 2.0]
    with pytest.raises(FlickerError, match=r"a.json: camera 2: timestamp: 1 s is not after 1 s, that of the one before"):
        check_path(loaded, "a.json")
    data = json.loads(file.read_text())
    for value, said in ((math.nan, "camera 1: timestamp: not finite"), (1e40, "camera 1: timestamp: beyond 1e+30")):
        file.write_text(json.dumps([data[0], data[1] | {"timestamp": value}]))
        with pytest.raises(FlickerError, match=said.replace("+", r"\+")):
            load_cameras(file)
    file.write_text(json.dumps([entry | {"timestamp": "2026-11-28"} for entry in data]))
    check_path(load_cameras(file), "a.json")
    with pytest.raises(FlickerError, match="a.json: one camera: a path needs two at least, or a motion"):
        check_path(loaded[:1], "a.json")


def test_times_of_transforms(tmp_path: Path) -> None:
    frames = [{"transform_matrix": np.eye(4).tolist(), "timestamp": t} for t in (0.5, 0.7)]
    (tmp_path / "transforms.json").write_text(json.dumps({"w": 64, "h": 48, "fl_x": 50.0, "frames": frames}))
    assert [c.timestamp for c in load_cameras(tmp_path / "transforms.json")] == [0.5, 0.7]


@pytest.mark.parametrize("quaternion", ["0 0 0 0", "nan 0 0 1"])
def test_quaternion_that_is_none(quaternion: str, tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 64 48 50 50 32 24\n")
    (tmp_path / "images.txt").write_text(f"1 1 0 0 0 0 0 0 1 a.png\n\n2 {quaternion} 0 0 1 1 b.png\n\n")
    with pytest.raises(FlickerError, match=r"images.txt: image 'b.png': rotation: not a quaternion"):
        load_cameras(tmp_path)
