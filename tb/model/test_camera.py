"""Cameras: cameras.json, faults in it, resizing, orbit cameras, the choice of cameras of a scene."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene_samples as samples

from flicker.errors import FlickerError
from flicker.front.projection import project
from flicker.front.reference import render_with_transmittance
from flicker.scene.camera import (
    DEFAULT_UP,
    ORBIT_VIEWS,
    UP_AXES,
    Camera,
    camera_count,
    cameras_beside,
    find_cameras,
    load_cameras,
    orbit_camera,
    select_view,
)
from flicker.scene.files import Scene, load_scene, save_ply

SEED = int(os.environ.get("FLICKER_SEED", "1"))


def entry(**changes: Any) -> dict[str, Any]:
    good = {
        "id": 0, "img_name": "front", "width": 640, "height": 360, "position": [1.0, 2, 3.5],
        "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]], "fx": 500.0, "fy": 510,
    }
    return {k: v for k, v in (good | changes).items() if v is not ...}


def written(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "cameras.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_load(tmp_path: Path) -> None:
    first, second = load_cameras(written(tmp_path, [entry(), entry(img_name=..., width=1.0, height=16384)]))
    assert (first.name, first.width, first.height, first.fx, first.fy) == ("front", 640, 360, 500.0, 510.0)
    assert first.position.dtype == np.float64 and first.position.tolist() == [1.0, 2.0, 3.5]
    assert first.rotation.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert (second.name, second.width, second.height) == ("1", 1, 16384)


@pytest.mark.parametrize(("changes", "words"), [
    *[({key: ...}, f"'{key}' is missing") for key in ("width", "height", "fx", "fy", "position", "rotation")],
    ({"width": 0}, "width: 0"), ({"width": -3}, "width: -3"), ({"height": 16385}, "height: 16385"),
    ({"width": 10.5}, "width: 10.5"), ({"width": "640"}, "width: not a number"), ({"width": None}, "width: not"),
    ({"width": True}, "width: not a number"), ({"width": 10**400}, "width: not a number"),
    ({"height": float("nan")}, "height: not finite"),
    ({"fx": 0}, "fx: 0 is not positive"), ({"fy": -500.0}, "fy: -500 is not positive"), ({"fx": float("inf")}, "fx: not finite"),
    ({"fy": 1e200}, "fy: beyond"), ({"fx": [500]}, "fx: not a number"), ({"fx": {}}, "fx: not"),
    ({"position": [1, 2]}, "position: not 3 numbers"), ({"position": [1, 2, "x"]}, "position: not 3 numbers"),
    ({"position": [1, 2, float("nan")]}, "position: not finite"), ({"position": [[1], 2, 3]}, "position: not 3 numbers"),
    ({"position": 5}, "position: not 3 numbers"), ({"position": [1e300, 0, 0]}, "position: beyond"),
    ({"rotation": np.zeros((3, 3)).tolist()}, "rotation: not a rotation"), ({"rotation": [1, 0, 0]}, "rotation: not 3x3 numbers"),
    ({"rotation": (2 * np.eye(3)).tolist()}, "rotation: not a rotation"),
    ({"rotation": [[1e29] * 3] * 3}, "rotation: not a rotation"),
    ({"rotation": np.diag([1, 1, -1]).tolist()}, "rotation: not a rotation"),
    ({"rotation": [[1, 0, 0.1], [0, 1, 0], [0, 0, 1]]}, "rotation: not a rotation"),
])
def test_faults_name_camera_and_field(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    path = written(tmp_path, [entry(), entry(**changes)])
    with pytest.raises(FlickerError) as caught:
        load_cameras(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: camera 1: ") and words in message and "\n" not in message


@pytest.mark.parametrize(("content", "words"), [
    ("", "not JSON"), ("{", "not JSON"), ("[1, 2", "not JSON"), ("[" * 100_000, "not JSON"),
    ("{}", "not a list"), ("3", "not a list"), ("null", "not a list"), ("[]", "no cameras"), ("[3]", "camera 0: not an object"),
])
def test_faults_of_the_file(content: str, words: str, tmp_path: Path) -> None:
    path = written(tmp_path, content)
    with pytest.raises(FlickerError, match=words) as caught:
        load_cameras(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(FlickerError, match="No such file"):
        load_cameras(tmp_path / "cameras.json")
    with pytest.raises(FlickerError, match="directory"):
        load_cameras(tmp_path)
    (tmp_path / "b.json").write_bytes(b"\xff\xfe\x00[")
    with pytest.raises(FlickerError, match="not JSON"):
        load_cameras(tmp_path / "b.json")


def test_resized() -> None:
    """The vertical field of view and the pixels' shape stay; `scaled` takes each axis by its own factor."""
    camera = Camera(640, 360, 500.0, 510.0, np.zeros(3), np.eye(3), "a", cx=329.5, cy=169.5)
    small = camera.resized(320, 90)
    assert (small.width, small.height, small.fx, small.fy, small.name) == (320, 90, 125.0, 127.5, "a")
    assert (small.cx, small.cy) == (159.5 + 2.5, 44.5 - 2.5)
    other = camera.scaled(320, 90)
    assert (other.width, other.height, other.fx, other.fy, other.cx, other.cy) == (320, 90, 250.0, 127.5, 159.5 + 5.0, 44.5 - 2.5)
    assert camera.width == 640
    middle = Camera(640, 360, 500.0, 510.0, np.zeros(3), np.eye(3))
    assert (middle.cx, middle.cy, middle.resized(31, 17).cx, middle.resized(31, 17).cy) == (319.5, 179.5, 15.0, 8.0)
    for width, height, field in ((0, 10, "width"), (10, -1, "height"), (16385, 10, "width"), (10, 10**12, "height")):
        with pytest.raises(FlickerError, match=field):
            camera.resized(width, height)
    assert camera.resized(16384, 1).height == 1


def test_select_view() -> None:
    cameras = [Camera(8, 8, 5.0, 5.0, np.zeros(3), np.eye(3), str(k)) for k in range(3)]
    assert [select_view(cameras, k).name for k in range(3)] == ["0", "1", "2"]
    for n in (-1, 3, 10**9):
        with pytest.raises(FlickerError, match=f"view {n}.*3 cameras"):
            select_view(cameras, n)
    with pytest.raises(FlickerError, match="^view 1: there is one camera, 0$"):
        select_view(cameras[:1], 1)


@pytest.mark.parametrize("shape", [(1, 1, 1), (0.1, 5, 0.1), (30, 0.2, 30), (0.01, 0.01, 0.01)])
def test_orbit_shows_the_scene(shape: tuple[float, float, float]) -> None:
    """All of the scene in the picture, filling a good part of it, whatever floats around it."""
    scene = samples.random_scene(SEED, count=2000, degree=0)
    means = scene.means * shape + np.float32([3, -7, 11])
    scales = scene.scales * 0.2 * min(shape)
    rng = np.random.default_rng(SEED)
    floaters = Scene(
        np.vstack([means, rng.normal(size=(25, 3)) * 1000]), np.vstack([scales, np.full((25, 3), 0.01)]),
        np.vstack([scene.quats, scene.quats[:25]]), np.append(scene.opacities, np.full(25, 0.3)),
        np.vstack([scene.sh, scene.sh[:25]]),
    )
    views = [orbit_camera(floaters, view, 5, 160, 90) for view in range(5)]
    assert len({tuple(c.position) for c in views}) == 5
    for camera in views:
        projected = project(floaters, camera)
        body = projected.index < 2000
        assert body.sum() == 2000
        x, y = projected.mean[body].T
        assert x.min() > -1 and x.max() < 160 and y.min() > -1 and y.max() < 90
        assert max(np.ptp(x) / 160, np.ptp(y) / 90) > 0.45
        assert camera.rotation[1, 1] > 0.9 and camera.position[1] < means[:, 1].mean()  # y down: upright, from above


def test_orbit_of_a_lone_gaussian() -> None:
    scene = Scene([[5, 5, 5]], [[0.1, 0.2, 0.1]], [[1, 0, 0, 0]], [0.9], np.ones((1, 1, 3)))
    camera = orbit_camera(scene, width=64, height=64)
    _, transmittance = render_with_transmittance(project(scene, camera), camera)
    assert transmittance.min() < 0.3 and transmittance[0].min() > 0.9


def test_find_cameras(tmp_path: Path) -> None:
    save_ply(samples.random_scene(SEED), tmp_path / "a.ply")
    scene = load_scene(tmp_path / "a.ply")
    assert [c.name for c in find_cameras(scene)] == [f"orbit_{k}" for k in range(8)]
    assert camera_count(scene.path) == camera_count(scene.path, up="z") == camera_count(None) == 8
    written(tmp_path, [entry(img_name="beside")])
    assert [c.name for c in find_cameras(scene)] == ["beside"] and camera_count(scene.path) == 1
    given = tmp_path / "given.json"
    given.write_text(json.dumps([entry(img_name="given")] * 2))
    assert [c.name for c in find_cameras(scene, given)] == ["given"] * 2 and camera_count(scene.path, given) == 2
    with pytest.raises(FlickerError, match="none.json"):
        find_cameras(scene, tmp_path / "none.json")


def test_cameras_of_a_sog_folder(tmp_path: Path) -> None:
    """Its own cameras.json comes before the one beside the folder, however the scene is given."""
    folder = tmp_path / "robot"
    folder.mkdir()
    for name, data in samples.sog_files(samples.random_scene(SEED, count=20)).items():
        (folder / name).write_bytes(data)
    given = (folder, folder / "meta.json")
    for path in given:
        assert cameras_beside(path) is None and len(find_cameras(load_scene(path))) == ORBIT_VIEWS
    written(tmp_path, [entry(img_name="beside")])
    for path in given:
        assert [c.name for c in find_cameras(load_scene(path))] == ["beside"]
    written(folder, [entry(img_name="inside")])
    for path in given:
        assert cameras_beside(path) == folder / "cameras.json"
        assert [c.name for c in find_cameras(load_scene(path))] == ["inside"]


@pytest.mark.parametrize("up", UP_AXES)
def test_up(up: str) -> None:
    """A scene turned so that another axis points up looks the same as before from the orbit, all around."""
    axis = np.eye(3)["xyz".index(up[-1])] * (-1 if up[0] == "-" else 1)
    right = np.eye(3)[1 if up[-1] == "x" else 0]
    turn = np.stack([right, -axis, np.cross(right, -axis)], axis=1)  # from x right, y down, z forward
    assert np.linalg.det(turn) == 1
    count = 401  # its quantiles are the same samples from either end
    means = np.random.default_rng(SEED).uniform(-1, 1, (count, 3)) * [2, 1, 0.5] + [3, -7, 11]
    balls = (np.full((count, 3), 0.01), np.tile([1.0, 0, 0, 0], (count, 1)), np.full(count, 0.5), np.zeros((count, 1, 3)))
    before, after = find_cameras(Scene(means, *balls)), find_cameras(Scene(means @ turn.T, *balls), up=up)
    assert len(before) == len(after) == ORBIT_VIEWS
    for a, b in zip(before, after, strict=True):
        assert -b.rotation[:, 1] @ axis > 0.9 and b.position @ axis > (means @ turn.T @ axis).mean()  # upright, from above
        seen, wanted = (project(Scene(m, *balls), c) for m, c in ((means @ turn.T, b), (means, a)))
        assert len(seen.index) == len(wanted.index) == count
        assert np.abs(seen.mean[np.argsort(seen.index)] - wanted.mean[np.argsort(wanted.index)]).max() < 1e-2


def test_up_turns_only_the_orbit(tmp_path: Path) -> None:
    scene = samples.random_scene(SEED)
    default, same = find_cameras(scene), find_cameras(scene, up=DEFAULT_UP)
    assert all(np.array_equal(a.rotation, b.rotation) and np.array_equal(a.position, b.position) for a, b in zip(default, same, strict=True))
    for bad in ("q", "", "-", "+z", "Z", "zz", "y "):
        with pytest.raises(FlickerError, match="up: .*is not one of x, y, z, -x, -y, -z"):
            find_cameras(scene, up=bad)
    save_ply(scene, tmp_path / "a.ply")
    scene = load_scene(tmp_path / "a.ply")
    path = written(tmp_path, [entry()])
    for cameras in (None, path):
        with pytest.raises(FlickerError, match="up: z: .*cameras.json"):
            find_cameras(scene, cameras, up="z")
        with pytest.raises(FlickerError, match="up: z: .*cameras.json"):
            camera_count(scene.path, cameras, up="z")
