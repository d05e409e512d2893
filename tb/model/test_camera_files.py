"""Camera files of every format: poses against a picture whose left, up and forward are known, sizes, lenses, faults.

The camera stands at (1, 2, 3), looks along x and holds z up, so that y is on its left. Every file below says this in its own convention, written out by hand.
Not covered: what other programs write beyond what their documents say.
"""

from __future__ import annotations

import json
import os
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from flicker.errors import FlickerError, FlickerWarning
from flicker.front.projection import project
from flicker.front.reference import render_reference
from flicker.scene.camera import Camera, camera_files, cameras_text, load_cameras, photos_root
from flicker.scene.colmap import model_file, read_cameras, read_images, read_points
from flicker.scene.files import Scene
from flicker.scene.transforms import SIZE, read_frames

WIDTH, HEIGHT, FOCAL = 64, 48, 60.0
CORNER = {"cx": WIDTH / 2, "cy": HEIGHT / 2}
INRIA = {
    "id": 0, "img_name": "a.png", "width": WIDTH, "height": HEIGHT, "position": [1, 2, 3],
    "rotation": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], "fx": FOCAL, "fy": FOCAL,
}
OPENGL = [[0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]  # columns right, up, back
NERF = {"w": WIDTH, "h": HEIGHT, "fl_x": FOCAL, "frames": [{"file_path": "images/a.png", "transform_matrix": OPENGL}]}
PATH = {
    "render_width": WIDTH, "render_height": HEIGHT, "camera_type": "perspective",
    "camera_path": [{"camera_to_world": [v for row in OPENGL for v in row], "fov": 2 * np.degrees(np.arctan(HEIGHT / 2 / FOCAL)), "aspect": 1.0}],
}
QUATERNION, SHIFT = (0.5, 0.5, -0.5, 0.5), (2.0, 3.0, -1.0)  # world to camera
CAMERAS_TEXT = f"# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 PINHOLE {WIDTH} {HEIGHT} {FOCAL} {FOCAL} {WIDTH / 2} {HEIGHT / 2}\n"
IMAGES_TEXT = f"# Image list\n1 {' '.join(map(str, QUATERNION + SHIFT))} 1 a.png\n1.5 2.5 -1 3.5 4.5 7\n"


def written(path: Path, content: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def colmap_text(folder: Path, cameras: str = CAMERAS_TEXT, images: str = IMAGES_TEXT) -> Path:
    written(folder / "cameras.txt", cameras)
    written(folder / "images.txt", images)
    return folder


def colmap_binary(folder: Path, model: int = 1, parameters: tuple[float, ...] = (FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)) -> Path:
    folder.mkdir(parents=True)
    (folder / "cameras.bin").write_bytes(struct.pack(f"<QiiQQ{len(parameters)}d", 1, 1, model, WIDTH, HEIGHT, *parameters))
    points = struct.pack("<Q2dQ", 1, 1.5, 2.5, 7)
    (folder / "images.bin").write_bytes(struct.pack("<QI7dI", 1, 1, *QUATERNION, *SHIFT, 1) + b"a.png\0" + points)
    return folder


FORMATS: dict[str, Callable[[Path], Path]] = {
    "INRIA": lambda folder: written(folder / "cameras.json", [INRIA]),
    "NeRF": lambda folder: written(folder / "transforms.json", NERF),
    "camera path": lambda folder: written(folder / "walk.json", PATH),
    "COLMAP, text": lambda folder: colmap_text(folder / "text"),
    "COLMAP, binary": lambda folder: colmap_binary(folder / "binary"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_left_up_forward(name: str, tmp_path: Path) -> None:
    """Red lies left of the camera, green above, blue ahead, white behind: so they lie in the picture."""
    camera, = load_cameras(FORMATS[name](tmp_path))
    means = [[6, 3.5, 3], [6, 2, 4.2], [6, 2, 3], [-4, 2, 3]]
    colours = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    scene = Scene(means, np.full((4, 3), 0.1), np.tile([1.0, 0, 0, 0], (4, 1)), np.full(4, 0.9), (colours[:, None] - 0.5) / 0.28209479177387814)
    picture = render_reference(project(scene, camera), camera)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    places = [((picture[..., k] * x).sum() / picture[..., k].sum(), (picture[..., k] * y).sum() / picture[..., k].sum()) for k in range(3)]
    middle = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
    wanted = middle + [[-1.5 * FOCAL / 5, 0], [0, -1.2 * FOCAL / 5], [0, 0]]
    assert np.abs(np.array(places) - wanted).max() < 0.05
    assert np.allclose(camera.position, [1, 2, 3]) and np.allclose(camera.rotation, INRIA["rotation"])
    assert (camera.fx, camera.fy) == (pytest.approx(FOCAL), pytest.approx(FOCAL)) and camera.centred


def test_principal_point_is_read_and_written(tmp_path: Path) -> None:
    """Files count from the corner: half a pixel more than here, in every format; what is written comes back."""
    lens = {"cx": 30.0, "cy": 26.25}
    files = [
        written(tmp_path / "a.json", [INRIA | lens]), written(tmp_path / "b.json", NERF | lens),
        written(tmp_path / "c.json", NERF | {"cx": 1, "frames": [NERF["frames"][0] | lens]}),
        colmap_text(tmp_path / "d", f"1 SIMPLE_PINHOLE {WIDTH} {HEIGHT} {FOCAL} 30 26.25"), colmap_binary(tmp_path / "e", 0, (FOCAL, 30, 26.25)),
    ]
    for file in files:
        camera, = load_cameras(file)
        assert (camera.cx, camera.cy) == (29.5, 25.75), file
    again, = load_cameras(written(tmp_path / "f.json", cameras_text([camera])))
    assert all(np.array_equal(getattr(again, name), getattr(camera, name)) for name in ("cx", "cy", "fx", "width", "position", "rotation"))
    assert "cx" not in cameras_text(load_cameras(written(tmp_path / "g.json", [INRIA | CORNER])))


def test_where_a_folder_keeps_them(tmp_path: Path) -> None:
    """cameras.json, transforms.json, COLMAP's sparse/0 and sparse; any file of a model means the model; photographs lie beside."""
    for place in ("", "sparse", "sparse/0", "colmap/sparse/0"):
        folder = tmp_path / f"data_{place.replace('/', '_')}"
        model = colmap_text(folder / place)
        for given in (folder, model, model / "images.txt", model / "cameras.txt"):
            assert [c.img_name for c in load_cameras(given)] == ["a.png"] and photos_root(given) == folder
        written(folder / "transforms.json", NERF | {"frames": NERF["frames"] * 2})
        assert len(load_cameras(folder)) == 2 and camera_files(folder) == [folder / "transforms.json"] and photos_root(folder) == folder
        assert len(load_cameras(model)) == (1 if place else 2)
        written(folder / "cameras.json", [INRIA] * 3)
        assert len(load_cameras(folder)) == 3
    colmap_binary(tmp_path / "both")
    colmap_text(tmp_path / "both", images="")
    assert len(load_cameras(tmp_path / "both")) == 1
    written(tmp_path / "synthetic" / "transforms_train.json", NERF)
    with pytest.raises(FlickerError, match="synthetic.*transforms_train.json"):
        load_cameras(tmp_path / "synthetic")


def test_colmap_text_in_its_variants(tmp_path: Path) -> None:
    """Empty lines of points, none at all, names with spaces, comments in between; images sorted by name."""
    line = "{} 1 0 0 0 0 0 {} 1 {}\n"
    texts = {
        "empty": line.format(1, 5, "b.png") + "\n" + line.format(2, 6, "a b.png") + "\n",
        "points": line.format(1, 5, "b.png") + "1 2 3 4 5 6\n# here\n" + line.format(2, 6, "a b.png") + "1 2 -1",
        "none": line.format(1, 5, "b.png") + line.format(2, 6, "a b.png"),
    }
    for name, text in texts.items():
        found = load_cameras(colmap_text(tmp_path / name, images="\ufeff# first\n\n" + text))
        assert [(c.img_name, c.position[2]) for c in found] == [("a b.png", -6.0), ("b.png", -5.0)], name
    model = colmap_text(tmp_path / "model")
    written(model / "points3D.txt", "# id x y z r g b error track\n7 1 2 3 255 0 51 0.5 1 0\n8 4 5 6 0 0 0 0.5\n")
    places, colours = read_points(model_file(model, "points3D"))
    assert places.tolist() == [[1, 2, 3], [4, 5, 6]] and colours.tolist() == [[1.0, 0.0, 0.2], [0.0, 0.0, 0.0]]


def test_binary_and_text_agree(tmp_path: Path) -> None:
    text, binary = colmap_text(tmp_path / "t"), colmap_binary(tmp_path / "b")
    assert read_cameras(text / "cameras.txt") == read_cameras(binary / "cameras.bin")
    (a,), (b,) = read_images(text / "images.txt"), read_images(binary / "images.bin")
    assert (a.name, a.camera, a.quat.tolist(), a.shift.tolist()) == (b.name, b.camera, b.quat.tolist(), b.shift.tolist())
    (binary / "points3D.bin").write_bytes(struct.pack("<QQ3d3BdQII", 1, 7, 1.0, 2.0, 3.0, 255, 0, 51, 0.5, 1, 1, 0))
    places, colours = read_points(binary / "points3D.bin")
    assert places.tolist() == [[1, 2, 3]] and colours.tolist() == [[1.0, 0.0, 0.2]]


@pytest.mark.parametrize(("changes", "words"), [
    ({"camera_model": "OPENCV", "k1": 0, "k2": 0.0, "p1": 0, "k3": None}, None), ({"camera_model": "PINHOLE"}, None), ({"camera_model": "SIMPLE_RADIAL"}, None),
    ({"is_fisheye": False, "k4": 0, "distortion_params": [0, 0, 0, 0, 0, 0]}, None),
    ({"camera_model": "OPENCV_FISHEYE", "k1": 0, "k2": 0, "k3": 0, "k4": 0}, "camera_model: OPENCV_FISHEYE"), ({"camera_model": "opencv_fisheye"}, "fisheye"),
    ({"camera_model": "EQUIRECTANGULAR"}, "EQUIRECTANGULAR"), ({"camera_model": "ORTHOGRAPHIC"}, "ORTHOGRAPHIC"),
    ({"camera_model": "FISHEYE624"}, "FISHEYE624"), ({"camera_model": "VR180_L"}, "VR180_L"), ({"camera_model": 3}, "camera_model"),
    ({"is_fisheye": True}, "is_fisheye"),
    ({"latlong": True}, "latlong"), ({"ftheta_p0": 1.0}, "ftheta"), ({"k1": 1e-3}, "k1: 0.001"), ({"k4": -0.5}, "k4: -0.5"), ({"p2": 0.01}, "p2: 0.01"),
    ({"camera_model": "OPENCV", "distortion_params": [0, 0.25, 0, 0]}, r"distortion_params\[1\]: 0.25"), ({"distortion_params": "k"}, "distortion_params"),
])
def test_lens_of_transforms(changes: dict[str, Any], words: str | None, tmp_path: Path) -> None:
    """Only pinholes, said by the whole file or by a frame."""
    for content in (NERF | changes, NERF | {"frames": [NERF["frames"][0] | changes]}):
        path = written(tmp_path / "transforms.json", content)
        if words is None:
            assert len(load_cameras(path)) == 1
        else:
            with pytest.raises(FlickerError, match=rf"transforms.json: frames\[0\]: .*{words}") as caught:
                load_cameras(path)
            assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("model", "parameters", "fine"), [
    ("SIMPLE_RADIAL", "60 32 24 0", True), ("RADIAL", "60 32 24 0 0", True), ("OPENCV", "60 60 32 24 0 0 0 0", True),
    ("FULL_OPENCV", "60 60 32 24 0 0 0 0 0 0 0 0", True), ("FOV", "60 60 32 24 0", True), ("SIMPLE_RADIAL", "60 32 24 0.01", False),
    ("OPENCV", "60 60 32 24 0 0 0 -0.01", False), ("FULL_OPENCV", "60 60 32 24 0 0 0 0 0 0 0 1e-9", False), ("FOV", "60 60 32 24 0.9", False),
    ("OPENCV_FISHEYE", "60 60 32 24 0 0 0 0", False), ("SIMPLE_RADIAL_FISHEYE", "60 32 24 0", False), ("RADIAL_FISHEYE", "60 32 24 0 0", False),
    ("THIN_PRISM_FISHEYE", "60 60 32 24 0 0 0 0 0 0 0 0", False),
])
def test_lens_of_colmap(model: str, parameters: str, fine: bool, tmp_path: Path) -> None:
    folder = colmap_text(tmp_path / "m", f"1 {model} {WIDTH} {HEIGHT} {parameters}\n")
    if fine:
        camera, = load_cameras(folder)
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (60, 60, 31.5, 23.5)
    else:
        with pytest.raises(FlickerError, match="cameras.txt: camera 1: .*only pinholes are drawn"):
            load_cameras(folder)


def test_sizes_that_the_file_does_not_name(tmp_path: Path) -> None:
    """Those of the pictures, of the first that is there, of NeRF's scenes; always with a word. Focal lengths come from the angle at that size."""
    frames = [{"file_path": f"./train/r_{k}", "transform_matrix": OPENGL} for k in range(3)]
    path = written(tmp_path / "transforms_train.json", {"camera_angle_x": 0.8, "frames": frames})
    with pytest.warns(FlickerWarning, match=r"names no size \(w, h\) of 3 of 3 frames: taken as 800x800") as caught:
        cameras = load_cameras(path)
    assert len(caught) == 1 and [(c.width, c.height) for c in cameras] == [SIZE] * 3
    assert cameras[0].fx == cameras[0].fy == pytest.approx(400 / np.tan(0.4)) and [c.img_name for c in cameras] == ["train/r_0", "train/r_1", "train/r_2"]
    (tmp_path / "train").mkdir()
    Image.new("RGB", (40, 20)).save(tmp_path / "train" / "r_1.png")
    with pytest.warns(FlickerWarning) as caught:
        cameras = load_cameras(path)
    assert [(c.width, c.height) for c in cameras] == [(40, 20)] * 3 and cameras[1].fx == pytest.approx(20 / np.tan(0.4))
    assert sorted(str(w.message).split("frames: ")[1] for w in caught) == [f"that of {tmp_path / 'train' / 'r_1.png'}", "those of its pictures"]
    for content in ({"fl_x": 50.0}, {"camera_angle_x": 0.8, "cx": 20}):
        with pytest.raises(FlickerError, match=r"frames\[0\]: w, h: are missing"):
            load_cameras(written(tmp_path / "other.json", content | {"frames": [{"transform_matrix": OPENGL}]}))
    with pytest.raises(FlickerError, match=r"frames\[0\]: h: is missing"):
        load_cameras(written(tmp_path / "other.json", NERF | {"h": None}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_cameras(written(tmp_path / "other.json", NERF))


def test_focal_lengths_of_transforms(tmp_path: Path) -> None:
    """A frame's own values come first; a missing axis is as the other; angles are of whole sides."""
    def focal(**values: Any) -> tuple[float, float]:
        frame, = read_frames(written(tmp_path / "t.json", {"frames": [NERF["frames"][0]]} | values))
        return frame.focal(WIDTH, HEIGHT)

    assert focal(fl_x=50.0) == focal(fl_y=50.0) == (50.0, 50.0) and focal(fl_x=50.0, fl_y=40.0) == (50.0, 40.0)
    assert focal(camera_angle_x=2 * np.arctan(0.5)) == pytest.approx((WIDTH, WIDTH))
    assert focal(camera_angle_y=2 * np.arctan(0.5)) == pytest.approx((HEIGHT, HEIGHT))
    assert focal(camera_angle_x=2 * np.arctan(0.5), camera_angle_y=2 * np.arctan(1.0)) == pytest.approx((WIDTH, HEIGHT / 2))
    assert focal(x_fov=90.0, fl_x=50.0, camera_angle_x=1.0) == pytest.approx((WIDTH / 2, WIDTH / 2))  # instant-ngp's, in degrees, comes first
    assert focal(y_fov=90.0) == pytest.approx((HEIGHT / 2, HEIGHT / 2)) and focal(fl_x=50.0, y_fov=90.0) == pytest.approx((50.0, HEIGHT / 2))
    own, = load_cameras(written(tmp_path / "u.json", NERF | {"frames": [NERF["frames"][0] | {"fl_x": 70, "w": 32}]}))
    assert (own.fx, own.fy, own.width, own.height) == (70, 70, 32, HEIGHT)


@pytest.mark.parametrize(("content", "words"), [
    (NERF | {"frames": 3}, "frames: not a list"), (NERF | {"frames": []}, "no cameras"), (NERF | {"frames": [3]}, r"frames\[0\]: not an object"),
    (NERF | {"frames": [{"file_path": "a"}]}, r"frames\[0\]: transform_matrix: is missing"),
    (NERF | {"frames": [{"transform_matrix": [[1, 2], [3]]}]}, r"frames\[0\]: transform_matrix: not 4x4 numbers"),
    (NERF | {"frames": [{"transform_matrix": (2 * np.eye(4))[:3].tolist()}]}, r"frames\[0\]: transform_matrix: not a rotation"),
    (NERF | {"frames": [{"transform_matrix": np.transpose(OPENGL).tolist()}]}, r"frames\[0\]: transform_matrix: its last row is 1 2 3 1, not 0 0 0 1"),
    (PATH | {"camera_path": [{"camera_to_world": np.transpose(OPENGL).ravel().tolist(), "fov": 50}]},
     r"camera_path\[0\]: camera_to_world: its last row is 1 2 3"),
    ([INRIA | {"k1": 0.1}], "camera 0: k1: 0.1: the lens distorts"),
    ([INRIA | {"camera_model": "OPENCV_FISHEYE"}], "camera 0: camera_model: OPENCV_FISHEYE is no"),
    ([INRIA | {"is_fisheye": True}], "camera 0: is_fisheye: this is no pinhole"), ([INRIA | {"k2": "a"}], "camera 0: k2: not a number"),
    (NERF | {"fl_x": None}, "neither fl_x nor camera_angle_x"), (NERF | {"fl_x": -3}, "fl_x: -3 is not positive"),
    (NERF | {"x_fov": 180}, "x_fov: 180 is not between 0 and 180 degrees"),
    (NERF | {"fl_x": "50"}, "fl_x: not a number"),
    (NERF | {"w": 3.5}, "w: 3.5 is not a whole"), (NERF | {"cx": float("nan")}, "cx: not finite"), (NERF | {"camera_angle_y": 4}, "camera_angle_y: 4 is not"),
    ({"camera_path": 3}, "camera_path: not a list"), (PATH | {"camera_path": []}, "no cameras"), (PATH | {"render_width": None}, "render_width: is missing"),
    (PATH | {"render_height": "a"}, r"camera_path\[0\]: render_height: not a number"),
    (PATH | {"camera_type": "equirectangular"}, "camera_type: equirectangular"),
    (PATH | {"camera_path": [{"fov": 50}]}, r"camera_path\[0\]: camera_to_world: not 16 numbers"),
    (PATH | {"camera_path": [PATH["camera_path"][0] | {"fov": 180}]}, r"camera_path\[0\]: fov: 180"),
    (PATH | {"camera_path": [{k: v for k, v in PATH["camera_path"][0].items() if k != "fov"}]}, r"camera_path\[0\]: fov: is missing"),
    ({"transform": [], "scale": 1}, "not a list of cameras"), ([INRIA | {"cx": "a"}], "camera 0: cx: not a number"),
])
def test_faults_of_json(content: Any, words: str, tmp_path: Path) -> None:
    path = written(tmp_path / "c.json", content)
    with pytest.raises(FlickerError, match=words) as caught:
        load_cameras(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(("cameras", "images", "words"), [
    ("1 PINHOLE 64 48 60 60 32\n", IMAGES_TEXT, "cameras.txt: line 1: 3 parameters, PINHOLE has 4"), ("1 LENS 64 48 1\n", IMAGES_TEXT, "unknown model LENS"),
    (CAMERAS_TEXT + CAMERAS_TEXT, IMAGES_TEXT, "cameras.txt: line 6: camera 1: is there twice"),
    ("1 PINHOLE x 48 60 60 32 24\n", IMAGES_TEXT, "line 1: not a number among 1 x 48"), ("1\n", IMAGES_TEXT, "line 1: not a camera"),
    (CAMERAS_TEXT, "1 1 0 0 0 0 0 0 2 a.png\n\n", "image 'a.png': camera 2 is not in cameras.txt"),
    (CAMERAS_TEXT, "1 2 3\n", "images.txt: line 1: not an image"),
    (CAMERAS_TEXT, "1 0 0 0 0 0 0 0 1 a.png\n\n", "image 'a.png': rotation: not a quaternion"), (CAMERAS_TEXT, "", "no cameras"),
    ("1 PINHOLE 64 48 0 60 32 24\n", IMAGES_TEXT, "fx: 0 is not positive"),
])
def test_faults_of_colmap(cameras: str, images: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(FlickerError, match=words) as caught:
        load_cameras(colmap_text(tmp_path / "m", cameras, images))
    assert str(tmp_path / "m") in str(caught.value) and "\n" not in str(caught.value)


def test_faults_of_binary(tmp_path: Path) -> None:
    good = colmap_binary(tmp_path / "m")
    for name in ("cameras.bin", "images.bin"):
        whole = (good / name).read_bytes()
        for cut, words in ((len(whole) - 5, "truncated"), (3, "truncated"), (len(whole) + 2, "2 bytes after")):
            (good / name).write_bytes((whole + b"..")[:cut])
            with pytest.raises(FlickerError, match=f"{name}: {words}"):
                load_cameras(good)
        (good / name).write_bytes(whole)
    whole = (good / "cameras.bin").read_bytes()
    (good / "cameras.bin").write_bytes(struct.pack("<Q", 2) + 2 * whole[8:])
    with pytest.raises(FlickerError, match="cameras.bin: camera 1: is there twice"):
        load_cameras(good)
    colmap_binary(tmp_path / "n", 99)
    with pytest.raises(FlickerError, match="cameras.bin: camera 1: unknown model 99"):
        load_cameras(tmp_path / "n")
    (tmp_path / "alone").mkdir()
    for given in (tmp_path / "alone", tmp_path / "alone" / "images.txt"):
        with pytest.raises(FlickerError, match="alone"):
            load_cameras(given)


def test_words_in_other_cases(tmp_path: Path) -> None:
    """Names of kinds of cameras, texts for truths."""
    for content in (PATH | {"camera_type": "Perspective"}, NERF | {"camera_model": "Pinhole", "is_fisheye": "False"}, [INRIA | {"fisheye": "false"}]):
        assert len(load_cameras(written(tmp_path / "c.json", content))) == 1


def test_names_that_are_not_known(tmp_path: Path) -> None:
    """Taken for pinholes, and told."""
    for content in ([INRIA | {"lens_model": "phone"}], NERF | {"lens_model": "phone"}):
        with pytest.warns(FlickerWarning, match="c.json: lens_model: phone: not known, taken for a pinhole"):
            assert len(load_cameras(written(tmp_path / "c.json", content))) == 1


def test_crop_of_a_camera_path(tmp_path: Path) -> None:
    with pytest.warns(FlickerWarning, match="crop: is not applied"):
        camera, = load_cameras(written(tmp_path / "p.json", PATH | {"crop": {"crop_center": {"x": 0}}}))
    assert isinstance(camera, Camera)


@pytest.mark.parametrize("name", ["cam_transforms", "cam_path"])
def test_cases(name: str) -> None:
    if "FLICKER_CASES" not in os.environ:
        pytest.skip("FLICKER_CASES names no folder of cases")
    camera, = load_cameras(Path(os.environ["FLICKER_CASES"]) / name / "cameras.json")
    assert (camera.width, camera.height) == (320, 180) and camera.centred
    assert camera.position.tolist() == [0, 0, -6] and np.abs(camera.rotation - np.eye(3)).max() == 0
    assert camera.fy == pytest.approx(300 if name == "cam_transforms" else 90 / np.tan(np.radians(16.5)))
