"""Data sets of photographs: lenses, EXIF's orientation, masks, layouts of folders, parallel cameras; what `flicker fit` prints to be typed; what is kept.

Pictures of lenses are made by formulas of this file, from a pattern of directions, and compared with what a pinhole sees of it. A masked fit is compared with
one whose masked pixels are other ones, bit for bit. Commands that are printed are run as they are printed. Not covered: real lenses.
"""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import shutil
import signal
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dataset_samples import HEIGHT, WIDTH, Views, picture_of, pose, scene_of_shots, views_around, write_colmap, write_transforms
from flicker_tb.command import flicker
from PIL import Image

from flicker.budget.goal import FrameCost
from flicker.budget.reduce import Reducer
from flicker.errors import FlickerError, FlickerWarning
from flicker.fit import undistort as undistorting
from flicker.fit.dataset import load_dataset
from flicker.fit.loss import loss_and_slope
from flicker.fit.train import Options, Trainer, _masked
from flicker.report.write import parse_targets
from flicker.scene.camera import Camera, load_cameras, photos_root
from flicker.scene.colmap import read_cameras, read_images, read_points
from flicker.scene.files import load_scene, save_ply
from flicker.scene.image import load_picture, picture_size, save_png
from flicker.scene.metrics import psnr, ssim
from flicker.scene.photos import load_photo

SIZE = 128, 96


@pytest.fixture(scope="module")
def shots() -> Views:
    return views_around()


@pytest.fixture()
def nerf(shots, tmp_path) -> Path:
    write_transforms(tmp_path / "set", shots)
    return tmp_path / "set"


def changed(folder: Path, **more: object) -> Path:
    """A transforms.json with other values; those that are None go."""
    data = json.loads((folder / "transforms.json").read_text()) | more
    (folder / "transforms.json").write_text(json.dumps({key: value for key, value in data.items() if value is not None}))
    return folder


# -- lenses ---------------------------------------------------------------------------------------------------------------------------


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A smooth picture of directions."""
    return np.stack([0.5 + 0.4 * np.sin(7 * x + 2), 0.5 + 0.4 * np.cos(8 * y), 0.5 + 0.4 * np.sin(5 * (x + y))], axis=2)


def fisheye(x, y, *k):
    r = np.hypot(x, y)
    theta = np.arctan(r)
    bent = theta * (1 + sum(c * theta ** (2 * n + 2) for n, c in enumerate(k))) / np.maximum(r, 1e-12)
    return x * bent, y * bent


def thin_prism(x, y, k1, k2, p1, p2, sx, sy):
    u, v = fisheye(x, y)
    s = u * u + v * v
    radial = 1 + k1 * s + k2 * s**2
    return u * radial + 2 * p1 * u * v + p2 * (s + 2 * u * u) + sx * s, v * radial + 2 * p2 * u * v + p1 * (s + 2 * v * v) + sy * s


def rational(x, y, *k):
    s = x * x + y * y
    radial = (1 + k[0] * s + k[1] * s**2) / (1 + k[2] * s + k[3] * s**2)
    return x * radial, y * radial


def fov(x, y, omega):
    r = np.maximum(np.hypot(x, y), 1e-12)
    bent = np.arctan(2 * r * np.tan(omega / 2)) / (r * omega)
    return x * bent, y * bent


def division(x, y, k):
    radial = 2 / (1 + np.sqrt(1 - 4 * k * (x * x + y * y)))
    return x * radial, y * radial


# COLMAP's name and number, coefficients, the parameters behind the principal point in its file, the formula.
LENSES = {
    "fisheye, no coefficients": ("OPENCV_FISHEYE", 5, {}, (0, 0, 0, 0), fisheye),
    "fisheye": ("OPENCV_FISHEYE", 5, {"k1": 0.05, "k2": -0.03}, (0.05, -0.03, 0, 0), lambda x, y: fisheye(x, y, 0.05, -0.03)),
    "simple radial fisheye": ("SIMPLE_RADIAL_FISHEYE", 8, {"k1": -0.06}, (-0.06,), lambda x, y: fisheye(x, y, -0.06)),
    "thin prism": ("THIN_PRISM_FISHEYE", 10, {"k1": 0.04, "k2": 0.02, "p1": 0.005, "p2": -0.004, "sx1": 0.06, "sy1": -0.08},
                   (0.04, 0.02, 0.005, -0.004, 0, 0, 0.06, -0.08), lambda x, y: thin_prism(x, y, 0.04, 0.02, 0.005, -0.004, 0.06, -0.08)),
    "radial": ("RADIAL", 3, {"k1": 0.15, "k2": -0.1}, (0.15, -0.1), lambda x, y: rational(x, y, 0.15, -0.1, 0, 0)),
    "rational": ("FULL_OPENCV", 6, {"k1": 0.1, "k2": 0.05, "k4": 0.15, "k5": -0.05}, (0.1, 0.05, 0, 0, 0, 0.15, -0.05, 0),
                 lambda x, y: rational(x, y, 0.1, 0.05, 0.15, -0.05)),
    "FOV": ("FOV", 7, {"omega": 0.7}, (0.7,), lambda x, y: fov(x, y, 0.7)),
    "division": ("DIVISION", 13, {"k": -0.1}, (-0.1,), lambda x, y: division(x, y, -0.1)),
    "plain fisheye": ("SIMPLE_FISHEYE", 14, {}, (), fisheye),
}


def photograph(formula: Callable, focal: float, centre: tuple[float, float]) -> np.ndarray:
    """What a lens makes of `pattern`: the direction of each pixel by repeated correction."""
    u, v = np.meshgrid((np.arange(SIZE[0]) + 0.5 - centre[0]) / focal, (np.arange(SIZE[1]) + 0.5 - centre[1]) / focal)
    x, y = u.copy(), v.copy()
    for _ in range(50):
        a, b = formula(x, y)
        x, y = x + u - a, y + v - b
    a, b = formula(x, y)
    assert max(np.abs(a - u).max(), np.abs(b - v).max()) < 1e-9
    return pattern(x, y)


def seen_by_pinhole(camera: Camera) -> np.ndarray:
    x, y = (np.arange(n) + 0.5 - n / 2 for n in (camera.width, camera.height))
    return pattern(*np.meshgrid(x / camera.fx, y / camera.fy))


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("colmap", [False, True])
def test_lens(shots, tmp_path, name: str, colmap: bool) -> None:
    """Each model, of a transforms.json and of COLMAP: the photographs of the fit are those of a pinhole; the lens matters."""
    model, number, coefficients, parameters, formula = LENSES[name]
    centre = SIZE[0] / 2 + 2, SIZE[1] / 2 - 1
    focal = 100.0
    picture = photograph(formula, focal, centre)
    if colmap:
        names = {"SIMPLE_RADIAL_FISHEYE": (focal,), "RADIAL": (focal,), "SIMPLE_FISHEYE": (focal,)}
        write_colmap(tmp_path, shots[:3], number, lens=(*names.get(model, (focal, focal)), *centre, *parameters), size=SIZE, pictures=[picture] * 3)
    else:
        write_transforms(tmp_path, [(camera, picture) for camera, _ in shots[:3]], camera_angle_x=None, camera_model=model, w=SIZE[0], h=SIZE[1], fl_x=focal,
                         cx=centre[0], cy=centre[1], **coefficients)
        changed(tmp_path)
    data = load_dataset(tmp_path)
    assert f"3 of 3 photographs are undistorted ({model}" in data.notes[-1]
    for shot in data.shots:
        assert 0.8 * SIZE[0] < shot.camera.width <= SIZE[0] and (shot.camera.fx, shot.camera.fy) == pytest.approx((focal, focal))
        assert psnr(shot.load(), seen_by_pinhole(shot.camera)) > 45
    width, height = data.tests[0].camera.width, data.tests[0].camera.height
    assert psnr(picture[:height, :width], seen_by_pinhole(data.tests[0].camera)) < 40
    half = load_dataset(tmp_path, 64).tests[0]
    assert half.camera.width == 64 and psnr(half.load(), seen_by_pinhole(half.camera)) > 40


def test_lenses_of_no_effect(shots, tmp_path, nerf) -> None:
    """A radial model whose coefficients are 0 is a pinhole, in COLMAP, too; so is one that moves no pixel by half of one."""
    for number, parameters in ((2, (0,)), (3, (0, 0)), (4, (0, 0, 0, 0)), (6, (0,) * 8), (7, (0,)), (12, (0,)), (13, (0,)), (4, (1e-4, 0, 0, 0))):
        focal = (80.0,) if number in (2, 3, 12) else (80.0, 80.0)
        data = load_dataset(write_colmap(tmp_path / "c", shots[:3], number, lens=(*focal, WIDTH, HEIGHT, *parameters)))
        assert not data.notes and all(shot.lens is None for shot in data.shots) and data.tests[0].camera.fx == 40.0
    for model in ("PINHOLE", "simple_radial", "OPENCV", "FULL_OPENCV", "PERSPECTIVE"):
        data = load_dataset(changed(nerf, camera_model=model, k1=0.0, k2=0, p1=0.0, is_fisheye=False, distortion_params=[0, 0.0, 0, 0, 0, 0]))
        assert not data.notes and all(shot.lens is None for shot in data.shots)


@pytest.mark.parametrize(("more", "message"), [
    ({"camera_model": "EQUIRECTANGULAR"}, "camera_model: EQUIRECTANGULAR is not one of those that can be undistorted: DIVISION, FISHEYE, FOV"),
    ({"camera_model": "EQUIRECTANGULAR", "is_fisheye": True}, "camera_model: EQUIRECTANGULAR is not one of"),
    ({"camera_model": "FISHEYE624"}, "camera_model: FISHEYE624 is not one of"), ({"camera_model": "VR180_L"}, "camera_model: VR180_L is not one of"),
    ({"camera_model": 5}, "camera_model: not a text"), ({"camera_model": "OPENCV", "k5": 0.1}, "k5: 0.1: camera_model OPENCV has no such coefficient"),
    ({"k6": 0.1}, "k6: 0.1: of which camera_model?"), ({"equirectangular": True}, "equirectangular: pictures of this projection"),
    ({"ftheta_p0": 1.0}, "ftheta_p0: pictures of this projection"), ({"distortion_params": [0.1]}, "distortion_params: not read"),
    ({"k1": -3.0}, "its lens leaves less than 50%"),  # folds
])
def test_lenses_that_are_refused(nerf, more: dict, message: str) -> None:
    """By name, in one line, by fit and undistort alike."""
    changed(nerf, **more)
    with pytest.raises(FlickerError, match=re.escape(f"{nerf}/transforms.json: frames[0]: {message}")) as caught:
        load_dataset(nerf)
    done = flicker("undistort", nerf, "-o", nerf / "flat")
    assert (done.returncode, done.stderr) == (2, f"flicker: {caught.value}\n") and not (nerf / "flat").exists()


def test_undistort_of_fisheye(shots, tmp_path) -> None:
    """The command takes out what it returned unchanged; the result says nothing of a lens any more. `is_fisheye` is one by instant-ngp's name."""
    picture = photograph(fisheye, 100.0, (64.0, 48.0))
    write_transforms(tmp_path / "a", [(camera, picture) for camera, _ in shots[:3]], camera_angle_x=None, fl_x=100.0, is_fisheye=True, aabb_scale=2)
    done = flicker("undistort", changed(tmp_path / "a"), "-o", tmp_path / "b")
    assert done.returncode == 0 and "3 photographs (OPENCV_FISHEYE)" in done.stdout, done.stderr
    stored = json.loads((tmp_path / "b" / "transforms.json").read_text())
    assert set(stored) == {"aabb_scale", "frames"}
    data = load_dataset(tmp_path / "b")
    assert not data.notes and psnr(data.tests[0].load(), seen_by_pinhole(data.tests[0].camera)) > 45


@pytest.mark.parametrize(("more", "message"), [
    ({"camera_type": "fisheye"}, "camera_type: fisheye: not read: a lens is wanted as camera_model"), ({"lens_model": "EQUIRECTANGULAR"}, "lens_model: EQUI"),
    ({"camera_model": "OPENCV", "projection": "Spherical"}, "projection: Spherical: not read"),
    ({"distortion": [0.1, 0, 0, 0]}, "distortion: not read: coefficients are wanted by their names"), ({"distortion": {"k1": 0.1}}, "distortion: not read"),
    ({"distortion_coefficients": [0, 0, 1e-3]}, "distortion_coefficients: not read"), ({"is_fisheye": "perhaps"}, "is_fisheye: 'perhaps' is neither true nor"),
    ({"equirectangular": "True"}, "equirectangular: "), ({"is_fisheye": ["false"]}, "is_fisheye: neither true nor false"),
])
def test_lenses_by_keys_of_other_tools(nerf, more: dict, message: str) -> None:
    """What they say is not passed over: fit and cameras alike refuse it, naming the field; so is a flag that is neither true nor false."""
    changed(nerf, **more)
    for read in (load_dataset, load_cameras):
        with pytest.raises(FlickerError, match=re.escape(f"{nerf}/transforms.json: frames[0]: {message}")):
            read(nerf)


def test_words_that_mean_a_pinhole(nerf) -> None:
    """Flags as texts that are false, other tools' names of a pinhole, no distortion in any form; a name that is not known is told, once. "true" is true."""
    plain = load_dataset(nerf)
    for more in (
        {"is_fisheye": "false", "fisheye": "0", "latlong": "False", "orthographic": ""}, {"camera_type": "perspective", "lens_model": "PINHOLE"},
        {"distortion": None, "distortion_coeffs": [0, 0.0, 0, 0], "dist_coeffs": {"k1": 0}, "distortion_model": "none"},
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            data = load_dataset(changed(nerf, **more))
        assert not data.notes and all(a.camera.fx == b.camera.fx and b.lens is None for a, b in zip(plain.shots, data.shots))
    for more, message in (({"camera_type": "phone"}, "camera_type: phone: not known, taken for a pinhole"),
                          ({"rolling_shutter": [0, 0, 1, 0], "camera_type": None, "camera_model": ""}, "rolling_shutter: not used")):
        with pytest.warns(FlickerWarning, match=f"transforms.json: {message}") as caught:
            load_dataset(changed(nerf, **more))
            load_cameras(nerf)
        assert len([warning for warning in caught if message in str(warning.message)]) == 2
    changed(nerf, rolling_shutter=None)
    assert load_dataset(changed(nerf, camera_type="fisheye", is_fisheye="true", camera_model="FISHEYE")).tests[0].lens.model == "FISHEYE"
    assert load_dataset(changed(nerf, camera_type=None, camera_model=None)).tests[0].lens.model == "OPENCV_FISHEYE"


def test_crop_of_a_fisheye(shots, tmp_path) -> None:
    """Pixels outside of the circle do not count, by the camera's pixels; undistort writes it as masks. Of another lens it is told and not used."""
    picture = photograph(fisheye, 100.0, (64.0, 48.0))
    write_transforms(tmp_path / "a", [(camera, picture) for camera, _ in shots[:3]], camera_angle_x=None, fl_x=200.0, w=256, h=192, is_fisheye=True,
                     fisheye_crop_radius=80.0)
    shot = load_dataset(changed(tmp_path / "a")).tests[0]
    counted, (height, width) = shot.counted(), (shot.camera.height, shot.camera.width)
    y, x = np.mgrid[:height, :width] + 0.5
    far = 100.0 * np.arctan(np.hypot(x - width / 2, y - height / 2) / 100.0)  # from the middle of the photograph, where the pixel comes from
    assert counted[far < 38].all() and not counted[far > 42].any() and 0.2 < counted.mean() < 0.9
    data = load_dataset(tmp_path / "a")
    assert data.notes[-1] == "3 of 3 photographs have a fisheye_crop_radius: pixels outside of the circle do not count"
    assert Trainer(data, Options(2, 40, 0)).masked == pytest.approx(1 - counted.mean())
    undistorting.undistort(tmp_path / "a", tmp_path / "b")
    assert np.array_equal(load_dataset(tmp_path / "b").tests[0].counted(), counted)
    assert set(json.loads((tmp_path / "b" / "transforms.json").read_text())) == {"frames"}
    data = load_dataset(changed(tmp_path / "a", is_fisheye="false"))
    assert data.notes == ["fisheye_crop_radius: not used: the camera_model is no fisheye"] and data.tests[0].counted() is None
    with pytest.raises(FlickerError, match=r"frames\[0\]: fisheye_crop_radius: -1 is not positive"):
        load_dataset(changed(tmp_path / "a", fisheye_crop_radius=-1))


# -- EXIF -----------------------------------------------------------------------------------------------------------------------------


TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT, 3: Image.Transpose.ROTATE_180, 4: Image.Transpose.FLIP_TOP_BOTTOM, 5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_90, 7: Image.Transpose.TRANSVERSE, 8: Image.Transpose.ROTATE_270,
}  # what makes the stored picture of an upright one


def store_turned(path: Path, orientation: int) -> None:
    with Image.open(path) as picture:
        lying = picture.transpose(TURNS[orientation]) if orientation in TURNS else picture.copy()
    exif = Image.Exif()
    exif[274] = orientation
    lying.save(path, exif=exif)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif(nerf, shots, orientation: int) -> None:
    """All orientations, with and without the camera's size; `flicker report` reads them alike."""
    for picture in (nerf / "images").iterdir():
        store_turned(picture, orientation)
    for more in ({}, {"w": WIDTH, "h": HEIGHT}):
        data = load_dataset(changed(nerf, **more))
        assert data.notes == ([] if orientation == 1 else ["17 of 17 photographs are turned upright, as EXIF says"])
        assert psnr(data.tests[1].load(), shots[8][1]) > 50
    assert psnr(load_photo(nerf / "images" / "r_8.png", (WIDTH, HEIGHT)), shots[8][1]) > 50


def test_exif_of_the_stored_shape(nerf, shots) -> None:
    """A camera that has the shape of the stored pixels, and not of those that are turned, is of the stored ones."""
    for picture in (nerf / "images").iterdir():
        with Image.open(picture) as stored:
            exif = Image.Exif()
            exif[274] = 6
            stored.save(picture, exif=exif)
    data = load_dataset(changed(nerf, w=2 * WIDTH, h=2 * HEIGHT))
    assert "17 of 17 photographs are taken as they are stored" in data.notes[0]
    assert psnr(data.tests[1].load(), shots[8][1]) > 50 and psnr(load_photo(nerf / "images" / "r_8.png", (WIDTH, HEIGHT)), shots[8][1]) > 50


@pytest.mark.parametrize(("size", "orientation", "turned"), [((96, 80), 3, False), ((80, 96), 6, False), ((96, 80), 6, True), ((88, 88), 6, None)])
def test_exif_of_colmap(shots, tmp_path, monkeypatch, size: tuple[int, int], orientation: int, turned: bool | None) -> None:
    """COLMAP reads pixels as they are stored: so they are used where the camera has their shape, half a turn too; turned where it has only that of the turned
    ones; refused where it has neither. What a fit prints to measure it finds the same pixels."""
    views = shots[:4]
    write_colmap(tmp_path / "set", views, 0, lens=(80.0, size[0] / 2, size[1] / 2), size=size)
    pictures = sorted((tmp_path / "set" / "images").iterdir())
    for picture in pictures:
        store_turned(picture, orientation)
    if turned is None:
        with pytest.raises(FlickerError, match=r"shot.00.png is 48x40, not of the shape of the camera's 88x88, as it is stored or as EXIF turns it"):
            load_dataset(tmp_path / "set")
        return
    data = load_dataset(tmp_path / "set")
    shot, picture = data.tests[0], views[0][1]
    wanted = picture if turned else picture[::-1, ::-1] if orientation == 3 else np.rot90(picture)
    assert psnr(shot.load(), wanted) > 50 and all(shot.turned is turned for shot in data.shots)
    assert f"4 of 4 photographs are {'turned upright' if turned else 'taken as they are stored'}" in data.notes[0]
    if orientation != 3:
        return
    monkeypatch.chdir(tmp_path)
    done = flicker("fit", "set", "-o", "a.ply", "--iterations", 2, "--gaussians", 40, "--degree", 0)
    words = last_command(done.stdout)
    target, = parse_targets(words[2], None, words[4])
    assert psnr(load_photo(target.photo, target.size), wanted) > 45


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".webp", ".tif"])
def test_exif_of_each_format(tmp_path, suffix: str) -> None:
    """Size and pixels are those of the upright picture, or of the stored one where the camera has its shape; Pillow turns a TIFF by itself."""
    rows, columns = np.mgrid[0:24, 0:32]
    upright = np.stack([rows * 6, columns * 6, rows + columns], axis=2).astype(np.uint8)
    for orientation in range(1, 9):
        path = tmp_path / f"{orientation}{suffix}"
        picture = Image.fromarray(upright)
        lying = picture.transpose(TURNS[orientation]) if orientation in TURNS else picture
        exif = Image.Exif()
        exif[274] = orientation
        lying.save(path, exif=exif, **({"lossless": True} if suffix == ".webp" else {"quality": 98} if suffix == ".jpg" else {}))
        assert psnr(load_picture(path, shape=lying.size, stored=True), np.asarray(lying) / 255.0) > 35
        for shape in (None, (32.0, 24.0), lying.size):
            wanted = np.asarray(lying) if shape == (24, 32) else upright
            assert picture_size(path, shape) == wanted.shape[1::-1] and psnr(load_picture(path, shape=shape), wanted / 255.0) > 35


# -- masks ----------------------------------------------------------------------------------------------------------------------------


def mask_of(k: int) -> np.ndarray:
    """bool (H, W): True counts."""
    counted = np.ones((HEIGHT, WIDTH), np.bool_)
    counted[8:24, 4 + k : 20 + k] = False
    return counted


def with_masks(folder: Path, shots: Views, hidden: float, scale: int = 255) -> Path:
    """A data set whose masked pixels have the grey `hidden`."""
    data = write_transforms(folder, [(camera, np.where(mask_of(k)[..., None], picture, hidden)) for k, (camera, picture) in enumerate(shots)])
    (folder / "masks").mkdir()
    for k, frame in enumerate(data["frames"]):
        Image.fromarray(mask_of(k).astype(np.uint8) * scale).save(folder / "masks" / f"{k}.png")
        frame["mask_path"] = f"masks/{k}.png"
    (folder / "transforms.json").write_text(json.dumps(data))
    return folder


def test_masked_pixels_do_not_count(shots, tmp_path) -> None:
    """Neither in the start, nor in the loss, nor in the PSNR: pictures that differ there alone give the same fit, bit for bit. White counts, of 0 and 1
    the 1."""
    options = Options(iterations=8, gaussians=200, degree=0, exposure=True)
    results = []
    for hidden, scale in ((0.0, 255), (1.0, 1)):
        trainer = Trainer(load_dataset(with_masks(tmp_path / str(scale), shots, hidden, scale)), options)
        assert trainer.masked == pytest.approx(256 / (WIDTH * HEIGHT))
        trainer.run()
        results.append((trainer.parameters.values.tobytes(), trainer.measure(), str(trainer.quality(trainer.scene()))))
    assert results[0] == results[1]
    shot = load_dataset(tmp_path / "1").tests[1]
    assert np.array_equal(shot.counted(), mask_of(8))
    half = load_dataset(tmp_path / "1", WIDTH // 2).tests[1]
    assert np.array_equal(half.counted(), mask_of(8).reshape(HEIGHT // 2, 2, WIDTH // 2, 2).all(axis=(1, 3)))
    picture, other = shots[8][1].astype(np.float32), np.clip(shots[8][1] * 0.9, 0, 1).astype(np.float32)
    assert ssim(np.where(mask_of(8)[..., None], picture, 0.3), other, mask_of(8)) == ssim(picture, other, mask_of(8)) < 1
    done = flicker("undistort", tmp_path / "1", "-o", tmp_path / "flat")
    assert "17 of them have a mask" in done.stdout and np.array_equal(load_dataset(tmp_path / "flat").tests[1].counted(), mask_of(8))


def test_slope_of_a_masked_loss() -> None:
    """None where pixels do not count, elsewhere that of the loss of both pictures with black there, by central differences."""
    rng, counted = np.random.default_rng(3), mask_of(3)
    image, photo = rng.random((2, HEIGHT, WIDTH, 3))
    photo[~counted] = 0.0
    loss, slope = _masked(loss_and_slope, image, photo, counted)
    assert loss == loss_and_slope(image * counted[..., None], photo)[0] and (slope[~counted] == 0).all()
    for at in ((7, 9, 1), (16, 24, 0), (30, 30, 2)):
        step = np.zeros_like(image)
        step[at] = 1e-5
        ends = [_masked(loss_and_slope, image + sign * step, photo, counted)[0] for sign in (1, -1)]
        assert slope[at] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-10)


def test_masks_that_are_not_there(shots, tmp_path) -> None:
    """A missing one, one of another shape, a folder of masks that nothing names."""
    folder = with_masks(tmp_path, shots, 0.0)
    (folder / "masks" / "5.png").unlink()
    done = flicker("fit", folder, "-o", tmp_path / "a.ply")
    assert done.returncode == 2 and re.fullmatch(r"flicker: .*transforms.json: frames\[5\]: mask_path: no picture .*masks/5.png\n", done.stderr)
    Image.new("L", (10, 10)).save(folder / "masks" / "5.png")
    with pytest.raises(FlickerError, match=r"frames\[5\]: mask .*5.png is 10x10, not of the shape of its picture's 48x40"):
        load_dataset(folder)
    write_transforms(folder, shots)
    assert "masks: not used" in load_dataset(folder).notes[0]


def test_photographs_of_which_no_pixel_counts(shots, tmp_path, monkeypatch) -> None:
    """All photographs to fit to: the masks are named; those for testing: a line says why there is no PSNR; one place is enough to begin."""
    folder = with_masks(tmp_path / "set", shots[:4], 0.0)
    options = ("--iterations", 2, "--gaussians", 40, "--degree", 0)
    for hidden, words in (((0,), "1 of 4 photographs are masked wholly"), ((0, 1, 2, 3), "masks: no pixel of the photographs to fit to counts: those")):
        for k in hidden:
            Image.new("L", (WIDTH, HEIGHT)).save(folder / "masks" / f"{k}.png")
        done = flicker("fit", folder, "-o", tmp_path / "a.ply", *options)
        assert (done.returncode, words in done.stdout + done.stderr) == (2 if len(hidden) == 4 else 0, True), done.stderr
    monkeypatch.setattr("flicker.fit.start._boxed", lambda *a: np.zeros((1, 3)))
    assert Trainer(load_dataset(with_masks(tmp_path / "one", shots[:3], 0.0)), Options(2, 4, 0)).first == 1


@pytest.mark.parametrize("form", ["{0}.png.png", "{0}.png"])
def test_masks_of_colmap(shots, tmp_path, form: str) -> None:
    """`masks/NAME.png`, or by the stem; photographs without one count wholly."""
    write_colmap(tmp_path, shots)
    (tmp_path / "masks").mkdir()
    for k in (0, 3):
        Image.fromarray(mask_of(k).astype(np.uint8) * 255).save(tmp_path / "masks" / form.format(f"shot.{k:02}"))
    data = load_dataset(tmp_path)
    assert data.notes == ["2 of 17 photographs have a mask: black pixels do not count"]
    assert np.array_equal(data.tests[0].counted(), mask_of(0)) and data.tests[1].counted() is None


# -- layouts --------------------------------------------------------------------------------------------------------------------------


def as_text(model: Path) -> None:
    """A COLMAP model as text."""
    lines = [f"{k} {c.model} {c.width} {c.height} {' '.join(map(repr, c.parameters.values()))}" for k, c in read_cameras(model / "cameras.bin").items()]
    (model / "cameras.txt").write_text("# Cameras\n" + "\n".join(lines) + "\n")
    images = [f"{n + 1} {' '.join(repr(float(v)) for v in (*i.quat, *i.shift))} {i.camera} {i.name}\n" for n, i in enumerate(read_images(model / "images.bin"))]
    (model / "images.txt").write_text("# Images\n" + "\n".join(images) + "\n")
    points, colours = read_points(model / "points3D.bin")
    rows = [f"{n} {' '.join(map(repr, map(float, p)))} {' '.join(map(str, np.rint(255 * c).astype(int)))} 0.5" for n, (p, c) in enumerate(zip(points, colours))]
    (model / "points3D.txt").write_text("\n".join(rows) + "\n")
    for name in ("cameras", "images", "points3D"):
        (model / f"{name}.bin").unlink()


@pytest.mark.parametrize("layout", ["text", "sparse", "images_4", "input", "other", "suffix"])
def test_layouts_of_colmap(shots, tmp_path, layout: str) -> None:
    """The same data set in each layout: a model as text, in sparse/ without 0; pictures in other folders, or with other suffixes."""
    plain = load_dataset(write_colmap(tmp_path / "plain", shots))
    folder = tmp_path / layout
    shutil.copytree(tmp_path / "plain", folder)
    note, images = [], None
    if layout == "text":
        as_text(folder / "sparse" / "0")
    elif layout == "sparse":
        for file in (folder / "sparse" / "0").iterdir():
            file.rename(folder / "sparse" / file.name)
        (folder / "sparse" / "0").rmdir()
    elif layout == "suffix":
        for picture in list((folder / "images").iterdir()):
            Image.open(picture).save(picture.with_suffix(".webp"), lossless=True)
            picture.unlink()
    else:
        (folder / "images").rename(folder / layout)
        note = [f"photographs of {folder / layout}"]
        if layout == "other":
            with pytest.raises(FlickerError, match="none of the folders images, .*: name that of the pictures by --images"):
                load_dataset(folder)
            images = "other"
    data = load_dataset(folder, None, images)
    assert data.notes == note and len(data.points) == 50
    for a, b in zip(plain.shots, data.shots):
        assert np.allclose(a.camera.position, b.camera.position) and np.allclose(a.camera.rotation, b.camera.rotation) and a.camera.fx == b.camera.fx
        assert np.array_equal(a.load(), b.load()) and a.camera.name == b.camera.name


@pytest.mark.parametrize(("model", "root"), [("sparse/1", ""), ("dense/sparse", "dense"), ("dense/0/sparse", "dense/0")])
def test_other_places_of_colmap(shots, tmp_path, model: str, root: str) -> None:
    """A model of another number where there is no 0, those of COLMAP's dense folders with the pictures beside them: found, and said."""
    plain = write_colmap(tmp_path / "plain", shots[:4])
    folder = tmp_path / "set"
    shutil.copytree(plain / "sparse" / "0", folder / model)
    shutil.copytree(plain / "images", folder / root / "images")
    for given in (folder, folder / model):
        data = load_dataset(given)
        assert len(data.shots) == 4 and len(data.points) == 50 and data.shots[0].path.parent == folder / root / "images"
        assert f"the model of {folder / model}" in data.notes
        assert photos_root(given) == folder / root and len(load_cameras(given)) == 4


def test_several_models_of_colmap(shots, tmp_path) -> None:
    """The first is taken, the others are named; each by its folder. A model elsewhere is named in the error."""
    folder = write_colmap(tmp_path / "set", shots[:4])
    for n in (1, 10):
        shutil.copytree(folder / "sparse" / "0", folder / "sparse" / str(n))
    others = [str(folder / "sparse" / str(n)) for n in (0, 1, 10)]
    assert load_dataset(folder).notes == [f"{others[1]}, {others[2]}: not used; a model is taken by the name of its folder"]
    data = load_dataset(folder / "sparse" / "10")
    assert data.notes == [f"the model of {others[2]}", f"{others[0]}, {others[1]}: not used; a model is taken by the name of its folder",
                          f"photographs of {folder / 'images'}"]
    shutil.rmtree(folder / "sparse" / "0")
    assert load_dataset(folder).notes[0] == f"the model of {others[1]}"
    (folder / "sparse").rename(folder / "distorted")
    for read in (load_dataset, load_cameras):
        with pytest.raises(FlickerError, match=re.escape(f"{folder / 'distorted' / '1'} holds a model: give that folder")):
            read(folder)


def test_nerf_synthetic(shots, tmp_path) -> None:
    """transforms_train.json and transforms_test.json: the test photographs are the set's own; a picture of both is told; without them every eighth."""
    write_transforms(tmp_path, shots[:9], "transforms_train.json", "train")
    write_transforms(tmp_path, shots[9:12], "transforms_val.json", "val")
    write_transforms(tmp_path, shots[12:], "transforms_test.json", "test")
    data = load_dataset(tmp_path)
    assert (len(data.fitted), len(data.tests), data.notes) == (9, 5, ["the photographs of transforms_test.json are for testing"])
    assert [shot.camera.img_name for shot in data.tests][:2] == ["test/r_0.png", "test/r_1.png"] and psnr(data.tests[4].load(), shots[16][1]) > 50
    write_transforms(tmp_path, shots[:2], "transforms_test.json", "train")
    assert "2 of them are in transforms_train.json, too" in load_dataset(tmp_path).notes[1]
    (tmp_path / "transforms_test.json").unlink()
    assert load_dataset(tmp_path).notes == ["the photographs of transforms_val.json are for testing"]
    (tmp_path / "transforms_val.json").unlink()
    data = load_dataset(tmp_path)
    assert (len(data.fitted), len(data.tests)) == (7, 2) and "every 8th" in data.notes[0]


def test_lists_of_nerfstudio(nerf, tmp_path) -> None:
    """Which photographs are fitted to and which are for testing, by nerfstudio's lists; without one of them what is in no list is fitted to; names that no
    frame has are refused. undistort keeps them."""
    def split(**lists: list[str] | None) -> tuple[list[int], list[int], list[str]]:
        data = load_dataset(changed(nerf, **lists))
        return *([int(s.path.stem[2:]) for s in shots] for shots in (data.fitted, data.tests)), data.notes

    def names(*numbers: int) -> list[str]:
        return [f"images/r_{k}" for k in numbers]

    every = list(range(17))
    assert split(train_filenames=names(5, 3, 1), test_filenames=["./images/r_2.png", "images\\r_4"], val_filenames=names(6)) == (
        [1, 3, 5], [2, 4], ["the photographs of test_filenames are for testing",
                            "12 of 17 photographs are not used: they are not in train_filenames nor test_filenames"])
    undistorting.undistort(nerf, tmp_path / "flat")
    flat = load_dataset(tmp_path / "flat")
    assert [[s.path.name for s in shots] for shots in (flat.fitted, flat.tests)] == [["r_1.png", "r_3.png", "r_5.png"], ["r_2.png", "r_4.png"]]
    assert split(train_filenames=None, test_filenames=[], val_filenames=names(6, 7)) == (
        [k for k in every if k not in (6, 7)], [6, 7], ["the photographs of val_filenames are for testing"])
    fitted, tests, notes = split(train_filenames=names(*range(9)), val_filenames=None)
    assert (fitted, tests) == ([1, 2, 3, 4, 5, 6, 7], [0, 8]) and notes == ["8 of 17 photographs are not used: they are not in train_filenames"]
    assert "1 of them are fitted to, too" in split(train_filenames=names(1, 2), val_filenames=names(2))[2][1]
    for lists, message in (
        ({"val_filenames": ["images/r_1", "r_2"]}, "val_filenames[1]: 'r_2' is the file_path of no frame"),
        ({"val_filenames": "r_1"}, "val_filenames: not a list"),
        ({"val_filenames": names(1), "train_filenames": names(2)}, "1 photographs to fit and 1 for testing, at least 2 and 1 are needed"),
    ):
        with pytest.raises(FlickerError, match=re.escape(message)):
            split(**lists)


def test_points_of_a_transforms_json(nerf, tmp_path) -> None:
    """The PLY that `ply_file_path` names is what the fit starts from, and goes with an undistorted set; one that is not there is told, a cut one refused."""
    points = np.random.default_rng(1).uniform(-1, 1, (30, 3)).astype(np.float32)
    rows = np.zeros(30, np.dtype([("p", "<f4", 3), ("c", "u1", 3)]))
    rows["p"], rows["c"] = points, (255, 0, 51)
    head = "".join(f"property {kind} {name}\n" for kind, axes in (("float", "xyz"), ("uchar", ("red", "green", "blue"))) for name in axes)
    ply = f"ply\nformat binary_little_endian 1.0\nelement vertex 30\n{head}end_header\n".encode() + rows.tobytes()
    (nerf / "points.ply").write_bytes(ply)
    undistorting.undistort(changed(nerf, ply_file_path="points.ply"), tmp_path / "flat")
    for folder in (nerf, tmp_path / "flat"):
        data = load_dataset(folder)
        assert np.array_equal(data.points, points) and data.colours[7].tolist() == [1.0, 0.0, 0.2] and data.points_of == "points.ply"
    assert Trainer(data, Options(2, 100, 0)).first == 30
    (nerf / "points.ply").write_bytes(ply[:-3])
    with pytest.raises(FlickerError, match="points.ply"):
        load_dataset(nerf)
    (nerf / "points.ply").unlink()
    data = load_dataset(nerf)
    assert data.points is None and data.notes == [f"ply_file_path: {nerf}/points.ply: is not there, the start is without its points"]


def test_images_of_a_transforms_json(nerf, shots) -> None:
    """--images: the same names in another folder."""
    (nerf / "small").mkdir()
    for k, (_, picture) in enumerate(shots):
        save_png(nerf / "small" / f"r_{k}.png", 1 - picture)
    data = load_dataset(nerf, None, "small")
    assert psnr(data.tests[1].load(), 1 - shots[8][1]) > 50 and data.tests[1].camera.img_name == "r_8.png"
    with pytest.raises(FlickerError, match="--images: nowhere: no such folder"):
        load_dataset(nerf, None, "nowhere")


def test_paths_of_windows(shots, tmp_path) -> None:
    """Pictures and masks whose paths have backslashes."""
    folder = with_masks(tmp_path, shots[:3], 0.0)
    data = json.loads((folder / "transforms.json").read_text())
    for frame in data["frames"]:
        frame |= {key: frame[key].replace("/", "\\") for key in ("file_path", "mask_path")}
    (folder / "transforms.json").write_text(json.dumps(data))
    assert [(shot.path.name, shot.mask.name, shot.camera.img_name) for shot in load_dataset(folder).tests] == [("r_0.png", "0.png", "r_0.png")]
    assert load_cameras(folder / "transforms.json")[1].width == WIDTH


def test_numbers_that_are_no_camera(shots, tmp_path, nerf) -> None:
    """Of COLMAP and of a transforms.json, each by its name; a camera larger than any picture here is one whose pictures are small."""
    for lens, size, message in (
        ((0.0, 48, 40), (96, 80), "fx: 0 is not positive"), ((math.nan, 48, 40), (96, 80), "fx: nan is not positive"),
        ((80.0, math.inf, 40), (96, 80), "cx: inf is not finite"), ((80.0, 48, 40), (0, 0), "width: 0 is not positive"),
    ):
        write_colmap(tmp_path / "c", shots[:3], 0, lens=lens, size=size)
        store_turned(tmp_path / "c" / "images" / "shot.00.png", 3)
        with pytest.raises(FlickerError, match=re.escape(f"images.bin: image 0 (shot.00.png): {message}")):
            load_dataset(tmp_path / "c")
    huge = load_dataset(write_colmap(tmp_path / "c", shots[:3], 0, lens=(80_000.0, 48_000, 40_000), size=(96_000, 80_000))).tests[0].camera
    assert (huge.width, huge.height, huge.fx, huge.fy) == (WIDTH, HEIGHT, 40.0, 40.0)
    assert load_dataset(changed(nerf, w=48_000, h=40_000)).tests[0].camera.width == WIDTH


def test_undistort_of_folders(shots, tmp_path) -> None:
    """Pictures of one name in two folders stay in theirs; a file without frames is refused."""
    data = write_transforms(tmp_path / "a", shots[:4])
    for k, frame in enumerate(data["frames"]):
        frame["file_path"] = f"images/cam {k % 2}/{k // 2}.png"
        (tmp_path / "a" / frame["file_path"]).parent.mkdir(exist_ok=True)
        (tmp_path / "a" / "images" / f"r_{k}.png").rename(tmp_path / "a" / frame["file_path"])
    (tmp_path / "a" / "transforms.json").write_text(json.dumps(data))
    assert flicker("undistort", tmp_path / "a", "-o", tmp_path / "b").returncode == 0
    for before, after in zip(load_dataset(tmp_path / "a").shots, load_dataset(tmp_path / "b").shots):
        assert before.camera.img_name == after.camera.img_name and np.array_equal(before.load(), after.load())
    done = flicker("undistort", changed(tmp_path / "a", frames=[]), "-o", tmp_path / "c")
    assert (done.returncode, done.stderr) == (2, f"flicker: {tmp_path}/a/transforms.json: frames: none\n") and not (tmp_path / "c").exists()


def test_undistort_of_other_sets(shots, tmp_path) -> None:
    """Of COLMAP, and of NeRF's synthetic scenes: what to do instead; of nothing."""
    write_colmap(tmp_path / "a", shots[:3])
    write_transforms(tmp_path / "b", shots[:3], "transforms_train.json")
    for name, message in (("a", "a: a COLMAP model, no transforms.json: COLMAP undistorts its own (image_undistorter)"),
                          ("b", "b: no transforms.json; give one of its files: transforms_train.json"), ("c", "c: no such file or folder")):
        with pytest.raises(FlickerError, match=re.escape(f"{tmp_path}/{message}")):
            undistorting.undistort(tmp_path / name, tmp_path / "out")


def test_kinds_of_pictures(tmp_path) -> None:
    """Grey, palettes, transparency, CMYK: what Pillow makes of them over the background."""
    rgba = np.zeros((4, 4, 4), np.uint8)
    rgba[:2] = (255, 128, 0, 128)
    wanted = rgba[..., :3] / 255 * rgba[..., 3:] / 255 + (1 - rgba[..., 3:] / 255) * np.array((0.0, 1.0, 0.5))
    Image.fromarray(rgba).save(tmp_path / "a.png")
    assert np.abs(load_picture(tmp_path / "a.png", (0.0, 1.0, 0.5)) - wanted).max() < 1e-12
    for mode in ("1", "L", "P", "CMYK"):
        Image.new("RGB", (4, 4), (255, 255, 255)).convert(mode).save(tmp_path / "b.tif")
        assert np.array_equal(load_picture(tmp_path / "b.tif"), np.ones((4, 4, 3)))
    Image.fromarray(np.array([[0, 255], [128, 0]], np.uint8)).convert("LA").save(tmp_path / "c.png")
    assert load_picture(tmp_path / "c.png")[1, 0] == pytest.approx(np.full(3, 128 / 255))


# -- the start ------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [3, 5])
def test_parallel_cameras(tmp_path, count: int) -> None:
    """Cameras in a row that look the same way have no point that they look at: the start is where their pictures agree, and the fit learns."""
    scene = scene_of_shots()
    middle, wide = np.median(scene.means, axis=0), float(scene.means.std())
    cameras = [Camera(WIDTH, HEIGHT, 60.0, 60.0, middle + (0.5 * wide * (k - count / 2), 0.0, -7.0 * wide), np.eye(3)) for k in range(count)]
    views = [(camera, picture_of(scene, camera)) for camera in cameras]
    write_transforms(tmp_path, views, camera_angle_x=None, fl_x=60.0)
    trainer = Trainer(load_dataset(changed(tmp_path)), Options(iterations=30, gaussians=600, degree=0))
    depth = (trainer.parameters.means[:, 2] - cameras[0].position[2]) / wide
    assert trainer.first >= 60 and 5.0 < np.median(depth) < 9.0
    before = trainer.measure()
    trainer.run()
    assert trainer.measure() > before + 1


# -- what is printed to be typed ------------------------------------------------------------------------------------------------------


def last_command(text: str) -> list[str]:
    """The words of the last line that is a command."""
    return shlex.split([line for line in text.splitlines() if line.startswith("flicker ")][-1])


@pytest.mark.parametrize("kind", ["test", "lens", "names"])
def test_printed_report(shots, tmp_path, monkeypatch, kind: str) -> None:
    """The command that a fit prints finds the test photographs: in a folder of the data set, undistorted, in folders that are not one. As it is printed, from
    the same folder, whose name needs quotes."""
    folder = tmp_path / "my [set]"
    if kind == "test":
        write_transforms(folder, shots[:4], "transforms_train.json", "train")
        write_transforms(folder, shots[4:6], "transforms_test.json", "test")
    elif kind == "lens":
        write_transforms(folder, shots[:4], k1=0.2)
    else:
        data = write_transforms(folder, shots[:10])
        data["frames"][8]["file_path"] = "../elsewhere/far.png"
        (tmp_path / "elsewhere").mkdir()
        shutil.copy(folder / "images" / "r_8.png", tmp_path / "elsewhere" / "far.png")
        (folder / "transforms.json").write_text(json.dumps(data))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    done = flicker("fit", folder.name, "-o", "out/a b.ply", "--iterations", 2, "--gaussians", 40, "--degree", 0)
    assert done.returncode == 0, done.stderr
    words = last_command(done.stdout)
    tests = load_dataset(folder).tests
    assert words[:2] == ["flicker", "report"] and words[3] == "--photos"
    targets = parse_targets(words[2], None, words[4])
    assert len(targets) == len(tests)
    for target, shot in zip(targets, tests):
        assert target.photo is not None
        assert psnr(load_photo(target.photo, target.size), shot.load()) > 45
    assert [camera.img_name for camera in load_cameras(tmp_path / "out" / "cameras.json")] == [shot.camera.img_name for shot in tests]


@pytest.mark.slow
def test_printed_report_as_typed(shots, tmp_path, monkeypatch) -> None:
    """The whole report of it."""
    write_transforms(tmp_path / "set", shots[:4], "transforms_train.json", "train")
    write_transforms(tmp_path / "set", shots[4:5], "transforms_test.json", "test")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    done = flicker("fit", "set", "-o", "out/a.ply", "--iterations", 2, "--gaussians", 40, "--degree", 0)
    done = flicker(*last_command(done.stdout)[1:], "--out", tmp_path / "report", "--store", tmp_path / "store")
    assert done.returncode == 0 and (tmp_path / "report" / "index.html").exists(), done.stderr


# -- what is kept ---------------------------------------------------------------------------------------------------------------------


def interrupt_after(monkeypatch, kind: type, method: str, calls: int) -> None:
    """Ctrl-C in the middle of that call."""
    original, count = getattr(kind, method), [0]

    def step(self, *a):
        count[0] += 1
        if count[0] == calls:
            os.kill(os.getpid(), signal.SIGINT)
        return original(self, *a)

    monkeypatch.setattr(kind, method, step)


@pytest.fixture()
def ctrl_c():
    """Python's own handler, whatever started the tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_interrupted_fit(nerf, tmp_path, monkeypatch) -> None:
    """Ctrl-C keeps the state between two steps and says how to go on; typed as it is said, that gives the file of a run without interruption."""
    monkeypatch.chdir(tmp_path)
    options = ("--iterations", 8, "--gaussians", 40, "--degree", 0, "--size", 24)
    (tmp_path / "whole").mkdir()
    (tmp_path / "two words").mkdir()
    assert flicker("fit", "set", "-o", "whole/a.ply", *options).returncode == 0
    with monkeypatch.context() as patch:
        interrupt_after(patch, Trainer, "step", 4)
        done = flicker("fit", "set", "-o", "two words/a.ply", *options)
    kept = tmp_path / "two words" / "a.ply.checkpoint.npz"
    assert done.returncode == 130 and kept.exists() and not (tmp_path / "two words" / "a.ply").exists()
    line, = done.stderr.splitlines()
    assert line.startswith("flicker: interrupted: two words/a.ply.checkpoint.npz keeps the state after 4 of 8 iterations; to go on: flicker fit set ")
    done = flicker(*shlex.split(line.partition("to go on: ")[2])[1:])
    assert done.returncode == 0 and "continues after 4 iterations" in done.stdout, done.stderr
    assert (tmp_path / "two words" / "a.ply").read_bytes() == (tmp_path / "whole" / "a.ply").read_bytes()
    assert sorted(p.name for p in (tmp_path / "two words").iterdir()) == ["a.ply", "cameras.json"]
    kept.touch()
    assert "is overwritten; --resume continues it" in flicker("fit", "set", "-o", "two words/a.ply", *options).stdout and not kept.exists()


@pytest.mark.usefixtures("ctrl_c")
def test_interrupted_budget(tmp_path, monkeypatch) -> None:
    """Likewise, in the tuning and in a step that is not divided, where what is kept is the step before."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("flicker.budget.reduce.chip_cost", lambda *a, **k: FrameCost(1.0, 1.0, 1.0, 0.0, 1))  # takes seconds, and decides nothing here
    save_ply(scene_of_shots(), tmp_path / "set.ply")
    options = ("--keep", 0.5, "--count", 6, "--size", "16x12", "--frame", "16x12", "--rounds", 1, "--steps", 0, "--last", 10, "--refit", 0, "--degrees", 0)
    with monkeypatch.context() as patch:  # equal pictures have no number of decibels, and JSON no infinity
        patch.setattr("flicker.budget.views.reference_psnr", lambda *a: [math.inf, 30.0])
        assert flicker("budget", "set.ply", "-o", "whole.ply", *options, "--json", "whole.json").returncode == 0
    told = json.loads(Path("whole.json").read_text(), parse_constant=lambda word: pytest.fail(word))
    assert told["held_out_db"] == told["held_out_db_at_frame"] == [None, 30.0]
    for name, (method, calls, what) in {"a.ply": ("_tune", 7, "last next"), "b.ply": ("_remove", 1, "remove next")}.items():
        with monkeypatch.context() as patch:
            interrupt_after(patch, Reducer, method, calls)
            done = flicker("budget", "set.ply", "-o", name, *options)
        line, = done.stderr.splitlines()
        assert done.returncode == 130 and re.match(rf"flicker: interrupted: {name}.checkpoint.npz keeps the state after \d steps of the table, {what};", line)
        assert (tmp_path / f"{name}.checkpoint.npz").exists() and not (tmp_path / name).exists()
        if name == "a.ply":
            done = flicker(*shlex.split(line.partition("to go on: ")[2])[1:])
            assert done.returncode == 0 and (tmp_path / name).read_bytes() == (tmp_path / "whole.ply").read_bytes(), done.stderr
            assert not (tmp_path / f"{name}.checkpoint.npz").exists()


def test_full_disk(nerf, tmp_path, monkeypatch) -> None:
    """File and reason in one line; nothing half-written, of undistort not even the folder."""
    def full(path, *a, **k):
        Path(path if isinstance(path, Path) else path.name).write_bytes(b"some")
        raise OSError(28, "No space left on device")

    original = undistorting.save_png
    monkeypatch.setattr(undistorting, "save_png", lambda path, picture: (full if "r_3" in str(path) else original)(path, picture))
    before = sorted(tmp_path.rglob("*"))
    done = flicker("undistort", nerf, "-o", tmp_path / "new" / "flat")
    assert (done.returncode, done.stderr) == (2, f"flicker: {tmp_path}/new/flat: cannot be written (No space left on device)\n")
    monkeypatch.setattr(undistorting, "save_png", lambda *a: (_ for _ in ()).throw(KeyboardInterrupt))
    assert flicker("undistort", nerf, "-o", tmp_path / "new" / "flat").returncode == 130
    monkeypatch.setattr("flicker.fit.train.SAVE_EVERY", 3)
    monkeypatch.setattr("flicker.fit.train.np.savez", full)
    done = flicker("fit", nerf, "-o", tmp_path / "a.ply", "--iterations", 5, "--gaussians", 50, "--degree", 0)
    assert (done.returncode, done.stderr) == (2, f"flicker: {tmp_path}/a.ply.checkpoint.npz: cannot be written (No space left on device)\n")
    assert sorted(tmp_path.rglob("*")) == before


# -- inputs that failed ---------------------------------------------------------------------------------------------------------------


CASES = {
    "fit_colmap_images4": r"starts from 1,530 points of COLMAP photographs of .*images_4", "fit_colmap_no0": "11 photographs to fit, 2 for testing",
    "fit_colmap_txt": "starts from 1,530 points of COLMAP", "fit_exif": "12 of 12 photographs are turned upright, as EXIF says",
    "fit_fisheye0": r"12 of 12 photographs are undistorted \(OPENCV_FISHEYE", "fit_mask": r"frames\[0\]: mask_path: no picture .*masks/a.png",
    "fit_nerfsynth": "photographs of transforms_test.json are for testing", "fit_parallel3": "2 photographs to fit, 1 for testing",
}


@pytest.mark.parametrize("name", CASES)
def test_cases(name: str, tmp_path) -> None:
    """What the command says to each; a mask that is missing is the one that is refused."""
    if "FLICKER_CASES" not in os.environ:
        pytest.skip("FLICKER_CASES names no folder of cases")
    done = flicker("fit", Path(os.environ["FLICKER_CASES"]) / name, "-o", tmp_path / "a.ply", "--size", 50, "--iterations", 2, "--gaussians", 100)
    assert done.returncode == (2 if name == "fit_mask" else 0), done.stderr
    assert re.search(CASES[name], " ".join((done.stdout + done.stderr).split()))
    assert (tmp_path / "a.ply").exists() == (name != "fit_mask") and (name == "fit_mask" or len(load_scene(tmp_path / "a.ply")))


def test_pose_of_a_written_frame(nerf, tmp_path, shots) -> None:
    """undistort writes the poses that it has read."""
    assert flicker("undistort", nerf, "-o", tmp_path / "flat").returncode == 0
    frames = json.loads((tmp_path / "flat" / "transforms.json").read_text())["frames"]
    for frame, (camera, _) in zip(frames, shots):
        assert np.allclose(frame["transform_matrix"], pose(camera), atol=1e-12) and math.isfinite(frame["fl_x"])
