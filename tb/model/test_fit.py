"""Fitting: pictures and derivatives of the differentiable renderer, loss, data sets, training, the command.

The picture is compared with the reference renderer, with the masks of a contribution test with the bit-true machine; derivatives with central differences in
float64, of every parameter, on scenes in which alpha meets the clamp, the skip and the end of a pixel. Data sets are made of renderings of a small scene. Not
covered: how good fits of real photographs become
(docs/decisions/017-fit-few-long-steps.md has figures of lego).
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
import scene_samples as samples
from dataset_samples import HEIGHT, WIDTH, Views, pose, scene_of_shots, views_around, write_colmap, write_transforms
from flicker_tb.command import flicker
from flicker_tb.runner import seed
from PIL import Image

from flicker.errors import FlickerError
from flicker.explore.configurations import run
from flicker.explore.machine import Configuration
from flicker.fit.dataset import load_dataset
from flicker.fit.loss import log_error_slope, loss_and_slope
from flicker.fit.parameters import LOGIT, MEAN, QUAT, SCALE, SH, Parameters
from flicker.fit.render import Gradient, backward, render
from flicker.fit.through import through
from flicker.fit.train import Options, Trainer, affine_fit
from flicker.front.projection import project
from flicker.front.reference import render_with_transmittance
from flicker.front.view import View
from flicker.scene.camera import Camera, load_cameras
from flicker.scene.files import load_scene
from flicker.scene.image import save_png
from flicker.scene.metrics import psnr, ssim

BACKGROUND = (0.3, 0.1, 0.6)


def look(width: int = 45, height: int = 37, focal: float = 40.0, z: float = -3.0) -> Camera:
    turn = np.array([[math.cos(0.1), 0, math.sin(0.1)], [0, 1, 0], [-math.sin(0.1), 0, math.cos(0.1)]])
    return Camera(width, height, focal, 1.1 * focal, np.array([0.1, -0.2, z]), turn)


def busy(count: int = 60, degree: int = 3) -> Parameters:
    """Gaussians that cover each other: some above the clamp of alpha, some hardly above 1/255, some beside the picture, colours below 0."""
    scene = samples.random_scene(seed() + 7, count, degree)
    scene.scales *= np.float32(4.0)
    scene.scales[:, 0] *= np.float32(0.3)
    scene.means[:8] *= np.float32(3.0)
    found = Parameters.of(scene)
    found.values[8:20, LOGIT] = 6.0  # opacity 0.998: clamped in the middle
    found.values[20:26, LOGIT] = -5.4  # 1.15 / 255
    found.values[:, QUAT:LOGIT] *= np.random.default_rng(seed()).uniform(0.5, 2.0, (count, 1)).astype(np.float32)
    return found


# -- pictures and derivatives ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("antialiased", [False, True])
def test_picture_is_the_reference(antialiased: bool) -> None:
    """Picture and transmittance, but for the rounding of scales and opacities to the scene's float32."""
    found, camera = busy(), replace(look(), cx=19.0, cy=20.5) if antialiased else look()
    found.antialiased = antialiased
    found.values[30:, SCALE:QUAT] -= 2.0 * antialiased  # small ones, which it shows on
    frame = render(found, camera, BACKGROUND)
    image, left = render_with_transmittance(project(found.scene(), camera), camera, BACKGROUND)
    assert left.min() < (0.01 if antialiased else 1e-3) and left.max() > 0.5
    assert np.abs(frame.image - image).max() < 2e-5 and np.abs(frame.transmittance - left).max() < 2e-5
    assert not frame.bad.any() and frame.used.sum() > 50


@pytest.mark.parametrize("name", ["faithful", "flicker-sparse-fixed-factored", "flicker-auto-mixed-factored", "vanilla"])
def test_picture_is_the_machine(name: str) -> None:
    """With masks the picture is that of the bit-true machine but for FP16 in its VRUs; vanilla's masks let everything through."""
    found, camera = busy(), look()
    masked, whole = (render(found, camera, BACKGROUND, machine) for machine in (through(name), None))
    drawn = run(name, View(camera, found.scene(), background=BACKGROUND)).image
    away = psnr(masked.image, drawn)
    assert away > 50
    if name == "vanilla":
        assert np.array_equal(masked.image, whole.image)
    else:
        assert psnr(whole.image, drawn) < away - 10 and not masked.used.all()


def difference(
    parameters: Parameters, camera: Camera, weight: np.ndarray, i: int, column: int, machine: Configuration | None,
) -> tuple[float, float]:
    """dL/d values[i, column] by Richardson's extrapolation of central differences, for L = sum(weight * image); and how far two step sizes disagree."""
    def slope(step: float) -> float:
        results, places = [], []
        for sign in (1, -1):
            moved = parameters.like(parameters.values.copy())
            moved.values[i, column] += np.float32(sign * step)
            places.append(float(moved.values[i, column]))
            results.append(float((weight * render(moved, camera, BACKGROUND, machine).image).sum()))
        return (results[0] - results[1]) / (places[0] - places[1])

    coarse, middle, fine = slope(2e-3), slope(1e-3), slope(5e-4)
    first, second = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
    return second, abs(second - first)


def whole(gradient: Gradient, count: int) -> np.ndarray:
    """Derivatives in the parameters of all Gaussians: 0 of those that are not in the picture."""
    found = np.zeros((count, gradient.values.shape[1]), np.float32)
    found[gradient.index] = gradient.values
    return found


@pytest.mark.parametrize(("degree", "z", "name", "antialiased"), [
    (3, -3.0, None, False), (1, -1.3, None, False), (0, -3.0, "flicker-sparse-fixed-factored", False), (0, -3.0, None, True),
])
def test_derivatives(degree: int, z: float, name: str | None, antialiased: bool) -> None:
    """Parameters of every Gaussian that the view shows, to 1e-4, where the two step sizes say that no rule switches between them.

    All of a Gaussian's, but of harmonics every sixth, and through a machine every second, others in the next Gaussian: a picture takes as long as a thousand
    of its derivatives. With SLOW=1 all.
    """
    few = os.environ.get("SLOW") != "1"
    parameters, camera = busy(18, degree), look(31, 23, 28.0, z)
    if antialiased:
        parameters.antialiased, camera = True, replace(camera, cx=11.25, cy=14.0)
        parameters.values[:, SCALE:QUAT] -= 1.5
    weight = np.random.default_rng(seed()).normal(size=(23, 31, 3))
    machine = None if name is None else through(name)
    frame = render(parameters, camera, BACKGROUND, machine)
    found = whole(backward(frame, weight), len(parameters))
    checked = np.zeros(parameters.values.shape[1], int)
    largest = np.abs(found).max(axis=0)
    clamped = 0
    asked = np.zeros(parameters.values.shape[1], int)
    for number, i in enumerate(frame.index):
        clamped += int(parameters.values[i, LOGIT] == 6.0)
        for column in range(parameters.values.shape[1]):
            if few and (number + column) % (6 if column >= SH + 3 else 2 if name else 1):
                continue
            asked[column] += 1
            wanted, doubt = difference(parameters, camera, weight, int(i), column, machine)
            scale = max(abs(wanted), 1e-3 * largest[column], 1e-6)
            if doubt < 2e-5 * scale:
                assert abs(found[i, column] - wanted) < 1e-4 * scale, (i, column, found[i, column], wanted)
                checked[column] += 1
    assert clamped >= 3 and (asked >= len(frame.index) // 6).all() and (checked >= np.maximum(1, asked // 3)).all(), (asked, checked)


def test_rules_near() -> None:
    """One Gaussian over one pixel's centre: just below and above the clamp, just above and below 1/255; one that ends the pixel."""
    camera = Camera(1, 1, 10.0, 10.0, np.zeros(3), np.eye(3))
    values = np.zeros((3, SH + 3), np.float32)
    values[:, MEAN + 2] = (1.0, 2.0, 3.0)
    values[:, QUAT] = 1.0
    values[:, SCALE:QUAT] = -1.0
    weight = np.ones((1, 1, 3))

    def slope(*opacity: float) -> np.ndarray:
        parameters, o = Parameters(values.copy()), np.array(opacity)
        parameters.values[: len(o), LOGIT] = np.log(o / (1 - o))
        parameters.values[len(o) :, MEAN + 2] = -1.0  # behind the camera
        found = backward(render(parameters, camera, BACKGROUND), weight)
        return whole(found, len(values))[: len(o), LOGIT] / (o * (1 - o))

    step = 1.5 - sum(BACKGROUND)  # coefficients 0: one half a channel, in place of the background
    for o, wanted in ((0.9899, step), (0.9901, 0.0), (1.01 / 255, step), (0.99 / 255, 0.0)):
        assert slope(o) == pytest.approx([wanted], rel=1e-4, abs=1e-9)
    # A clamped one between two: 0.01 of the light passes it.
    assert slope(0.9, 0.995, 0.5) == pytest.approx([0.005 * step, 0.0, 0.001 * step], rel=1e-4, abs=1e-9)
    # The third would leave 8e-5 and finishes the pixel, or leaves 1.2e-4 and does not.
    assert slope(0.9, 0.98, 0.96) == pytest.approx([0.02 * step, 0.1 * step, 0.0], rel=1e-4, abs=1e-9)
    assert slope(0.9, 0.98, 0.94) == pytest.approx([0.0012 * step, 0.006 * step, 0.002 * step], rel=1e-4)


def test_gaussian_that_only_finishes() -> None:
    """In the last tile, of two pixels, two wide Gaussians leave 1.06e-4, a narrow one of alpha 0.13 finishes one pixel and is blended in none, a wide faint one
    lies behind: it has no part in the finished pixel, neither in the picture nor in the derivatives, and has one in the other."""
    camera = Camera(18, 17, 10.0, 10.0, np.zeros(3), np.eye(3))
    values = np.zeros((4, SH + 3), np.float32)
    values[:, MEAN + 2] = (1.0, 2.0, 3.0, 4.0)
    values[:, QUAT] = 1.0
    values[:, SCALE:QUAT] = 8.0
    values[2, SCALE:QUAT] = -9.0
    values[2, MEAN : MEAN + 2] = 3.0 * (14.9 - 8.5) / 10.0, 3.0 * (16.0 - 8.0) / 10.0
    opacity = np.array([0.9897, 0.9897, 0.99, 0.02])
    values[:, LOGIT] = np.log(opacity / (1 - opacity))
    frame = render(Parameters(values), camera)
    assert frame.rows[2, :2] == pytest.approx((14.9, 16.0)) and frame.index.tolist() == [0, 1, 2, 3]
    assert frame.transmittance[16, 16] == pytest.approx(1.0609e-4, rel=1e-4)
    assert frame.transmittance[16, 17] == pytest.approx(1.0397e-4, rel=1e-4)
    for x, wanted in ((16, 0.0), (17, 0.02 * 1.0609e-4)):
        weight = np.zeros((17, 18, 3))
        weight[16, x] = 1.0
        assert whole(backward(frame, weight), 4)[3, SH] / 0.28209479177387814 == pytest.approx(wanted, rel=1e-3, abs=1e-12)


def test_float32() -> None:
    """Blending in float32, as fits do, is that in float64 but for rounding."""
    parameters, camera = busy(), look()
    weight = np.random.default_rng(seed()).normal(size=(37, 45, 3))
    frames = [render(parameters, camera, BACKGROUND, None, kind) for kind in (np.float32, np.float64)]
    assert frames[0].image.dtype == np.float32 and 0 < np.abs(frames[0].image - frames[1].image).max() < 1e-4
    short, long = (whole(backward(frame, weight), len(parameters)) for frame in frames)
    assert 0 < np.abs(short - long).max() and (np.abs(short - long).max(axis=0) < 1e-3 * np.abs(long).max(axis=0)).all()


def test_same_bits_for_any_number_of_threads() -> None:
    parameters, camera = busy(), look()
    weight = np.random.default_rng(seed()).normal(size=(37, 45, 3))
    results, threads = [], numba.get_num_threads()
    for count in (1, threads):
        numba.set_num_threads(count)
        result = []
        for kind in (np.float32, np.float64):
            frame = render(parameters, camera, BACKGROUND, None, kind)
            result += [frame.image.tobytes(), backward(frame, weight).values.tobytes(), loss_and_slope(frame.image, weight.astype(kind))[1].tobytes()]
        results.append(result)
    numba.set_num_threads(threads)
    assert results[0] == results[1]


def test_untrained_coefficients() -> None:
    frame = render(busy(), look(), BACKGROUND)
    weight = np.ones((37, 45, 3))
    all_, some = backward(frame, weight).values, backward(frame, weight, 4).values
    assert (some[:, SH + 12 :] == 0).all() and np.array_equal(some[:, : SH + 12], all_[:, : SH + 12]) and (all_[:, SH + 12 :] != 0).any()


def test_loss() -> None:
    """SSIM is that of the metrics away from the borders; the derivative is that of the loss, by central differences."""
    rng = np.random.default_rng(seed())
    image, photo = rng.random((2, 40, 36, 3))
    padded = [np.pad(p, ((10, 10), (10, 10), (0, 0))) for p in (image, photo)]
    inner, all_ = 50 * 46, 60 * 56  # the metrics leave out five pixels at the borders, where these are equal
    assert 1 - loss_and_slope(*padded, 1.0)[0] == pytest.approx((ssim(*padded) * inner + all_ - inner) / all_, abs=1e-9)
    assert loss_and_slope(photo, photo)[0] == pytest.approx(0.0, abs=1e-12)
    loss, slope = loss_and_slope(image, photo)
    assert loss == pytest.approx(0.8 * np.abs(image - photo).mean() + 0.2 * loss_and_slope(image, photo, 1.0)[0])
    for _ in range(20):
        at = tuple(rng.integers(0, image.shape))
        step = np.zeros_like(image)
        step[at] = 1e-5
        wanted = (loss_and_slope(image + step, photo)[0] - loss_and_slope(image - step, photo)[0]) / 2e-5
        assert slope[at] == pytest.approx(wanted, rel=1e-5, abs=1e-9)


# -- data sets ------------------------------------------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def shots() -> Views:
    """Views all around a small scene."""
    return views_around()


@pytest.fixture(scope="module")
def nerf(shots, tmp_path_factory) -> Path:
    """A data set with transforms.json."""
    folder = tmp_path_factory.mktemp("nerf")
    write_transforms(folder, shots)
    return folder


def same_cameras(a: Camera, b: Camera) -> None:
    assert (a.width, a.height) == (b.width, b.height) and (a.fx, a.fy) == pytest.approx((b.fx, b.fy), rel=1e-9)
    assert np.abs(a.position - b.position).max() < 1e-6 and np.abs(a.rotation - b.rotation).max() < 1e-6


def test_transforms(nerf, shots) -> None:
    """Cameras, every eighth for testing, names; half the size keeps the field of view."""
    data = load_dataset(nerf)
    assert [s.camera.img_name for s in data.tests] == ["r_0.png", "r_8.png", "r_16.png"] and len(data.fitted) == 14 and data.points is None
    for shot, number in zip(data.tests, (0, 8, 16)):
        same_cameras(shot.camera, replace(shots[number][0], fy=shots[number][0].fx))
        assert psnr(shot.load(), shots[number][1]) > 50
    half = load_dataset(nerf / "transforms.json", 24).tests[0]
    assert (half.camera.width, half.camera.height, half.load().shape) == (24, 20, (20, 24, 3))
    same_cameras(half.camera, data.tests[0].camera.resized(24, 20))


LENS = {"k1": 0.12, "k2": -0.2, "k3": 0.15, "p1": 0.004, "p2": -0.003, "cx": 66.0, "cy": 48.5, "fl_x": 90.0, "fl_y": 88.0}


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A smooth picture of directions."""
    return np.stack([0.5 + 0.4 * np.sin(9 * x + 2), 0.5 + 0.4 * np.cos(11 * y), 0.5 + 0.4 * np.sin(7 * (x + y))], axis=2)


def seen_by(lens: dict, width: int, height: int) -> np.ndarray:
    """What a lens makes of `pattern`: the direction of each pixel by repeated correction."""
    u, v = np.meshgrid((np.arange(width) + 0.5 - lens["cx"]) / lens["fl_x"], (np.arange(height) + 0.5 - lens["cy"]) / lens["fl_y"])
    x, y = u.copy(), v.copy()
    for _ in range(60):
        r = x * x + y * y
        radial = 1 + lens["k1"] * r + lens["k2"] * r**2 + lens["k3"] * r**3
        x += u - (x * radial + 2 * lens["p1"] * x * y + lens["p2"] * (r + 2 * x * x))
        y += v - (y * radial + lens["p1"] * (r + 2 * y * y) + 2 * lens["p2"] * x * y)
    return pattern(x, y)


def test_undistort(nerf, shots, tmp_path) -> None:
    """A known lens, its principal point off the middle: the pictures are then those of a pinhole, and can be fitted to; a lens of no effect changes nothing."""
    width, height = 128, 96
    bent = tmp_path / "bent"
    bent.mkdir()
    for k in range(4):
        save_png(bent / f"{k}.png", seen_by(LENS, width, height))
    frames = [{"file_path": f"{k}.png", "transform_matrix": pose(shots[k][0])} for k in range(4)]
    (bent / "transforms.json").write_text(json.dumps(LENS | {"w": width, "h": height, "aabb_scale": 4, "frames": frames}))
    done = flicker("undistort", bent, "-o", tmp_path / "flat")
    assert done.returncode == 0 and "4 photographs" in done.stdout, done.stderr
    data = load_dataset(tmp_path / "flat")
    camera = data.tests[0].camera
    assert 0.8 * width < camera.width < width and 0.8 * height < camera.height < height and (camera.fx, camera.fy) == pytest.approx((90.0, 88.0))
    x, y = np.meshgrid((np.arange(camera.width) + 0.5 - camera.width / 2) / 90.0, (np.arange(camera.height) + 0.5 - camera.height / 2) / 88.0)
    for shot in data.tests + data.fitted:
        assert psnr(shot.load(), pattern(x, y)) > 45
    assert psnr(seen_by(LENS, camera.width, camera.height), pattern(x, y)) < 30  # the lens matters
    assert json.loads((tmp_path / "flat" / "transforms.json").read_text())["aabb_scale"] == 4
    done = flicker("undistort", bent / "transforms.json", "-o", tmp_path / "small", "--size", 64)
    small = load_dataset(tmp_path / "small").tests[0]
    assert done.returncode == 0 and (small.camera.width, small.camera.fx) == (64, pytest.approx(90.0 * 64 / camera.width))
    assert flicker("undistort", nerf, "-o", tmp_path / "same").returncode == 0
    for a, b in zip(load_dataset(nerf).tests, load_dataset(tmp_path / "same").tests):
        same_cameras(a.camera, b.camera)
        assert np.array_equal(a.load(), b.load())
    for source, out, text in ((bent, "flat", "flat: is there already, and not empty"), (tmp_path, "new", "no transforms.json")):
        done = flicker("undistort", source, "-o", tmp_path / out)
        assert done.returncode == 2 and done.stderr.count("\n") == 1 and text in done.stderr
    (bent / "transforms.json").write_text(json.dumps(LENS | {"k1": 9.0, "k2": 40.0, "frames": frames}))
    done = flicker("undistort", bent, "-o", tmp_path / "new")
    assert done.returncode == 2 and "frames[0]: its lens leaves less than 50%" in done.stderr and not (tmp_path / "new").exists()


def test_colmap(shots, tmp_path) -> None:
    points = np.random.default_rng(seed()).uniform(-1, 1, (50, 3))
    points[3, 1] = np.nan
    data = load_dataset(write_colmap(tmp_path, shots, points=points))
    assert [s.camera.img_name for s in data.tests] == ["shot.00.png", "shot.08.png", "shot.16.png"]
    for shot, number in zip(data.tests, (0, 8, 16)):
        same_cameras(shot.camera, shots[number][0])
    assert data.dropped == 1 and np.array_equal(data.points, points[np.isfinite(points).all(axis=1)]) and data.colours[0] == pytest.approx([1, 0, 0.2])
    trainer = Trainer(data, Options(10, 40, degree=1))  # starts from 40 of the 49 points, in their colour
    assert len(trainer.parameters) == 40 and np.isin(trainer.parameters.means, np.float32(data.points)).all()
    assert trainer.parameters.scene().sh[:, 0] == pytest.approx(np.tile((np.array([1, 0, 0.2]) - 0.5) / samples.C0, (40, 1)), abs=1e-5)
    trainer.run()


def test_bad_transforms(nerf, tmp_path) -> None:
    """One line that names the file and the field."""
    good = json.loads((nerf / "transforms.json").read_text())
    (tmp_path / "images").symlink_to(nerf / "images")
    file = tmp_path / "transforms.json"

    def refused(pattern: str, frame: dict | None = None, **more) -> None:
        data = json.loads(json.dumps(good | more))
        data["frames"][5].update(frame or {})
        file.write_text(json.dumps(data))
        with pytest.raises(FlickerError, match=pattern) as caught:
            load_dataset(tmp_path)
        assert "\n" not in str(caught.value) and "transforms.json" in str(caught.value)

    refused(r"frames\[5\]: file_path: no picture .*r_99", {"file_path": "images/r_99"})
    refused(r"frames\[5\]: file_path: not a text", {"file_path": 5})
    refused(r"frames\[5\]: rotation: not a rotation matrix", {"transform_matrix": np.diag([0.0, 0.0, 0.0, 1.0]).tolist()})
    refused(r"frames\[5\]: transform_matrix: its last row", {"transform_matrix": np.zeros((4, 4)).tolist()})
    refused(r"frames\[5\]: transform_matrix: not finite", {"transform_matrix": [[1, 0, 0, math.nan], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})
    refused(r"frames\[5\]: transform_matrix: not 4x4 numbers", {"transform_matrix": [[1, 2], [3]]})
    refused(r"frames\[5\]: fl_x: not a number", {"fl_x": "wide"})
    refused(r"frames\[5\]: .*r_5.png is 48x40, not of the shape of the camera's 48x48", {"w": 48, "h": 48})
    refused(r"frames\[0\]: its lens leaves less than 50%", cx=40.0)
    refused(r"frames\[0\]: camera_angle_x: 4 is not between 0 and pi", camera_angle_x=4.0)
    file.write_text(json.dumps(good | {"frames": good["frames"][:1]}))
    with pytest.raises(FlickerError, match="1 photograph, at least 3 are needed"):
        load_dataset(tmp_path)
    file.write_text(json.dumps({"camera_angle_x": 1}))
    with pytest.raises(FlickerError, match="frames: not a list"):
        load_dataset(tmp_path)
    file.write_text("{")
    with pytest.raises(FlickerError, match=r"transforms.json: not JSON"):
        load_dataset(tmp_path)
    file.unlink()
    with pytest.raises(FlickerError, match=r"neither transforms.json, transforms_train.json nor a COLMAP model"):
        load_dataset(tmp_path)
    with pytest.raises(FlickerError, match=r"no such folder"):
        load_dataset(tmp_path / "none")


def test_bad_colmap(shots, tmp_path) -> None:
    sparse = write_colmap(tmp_path, shots, model=4) / "sparse" / "0"
    with pytest.raises(FlickerError, match=r"cameras.bin: truncated"):
        load_dataset(tmp_path)
    write_colmap(tmp_path, shots)
    whole = (sparse / "images.bin").read_bytes()
    (sparse / "images.bin").write_bytes(whole[:-5])
    with pytest.raises(FlickerError, match=r"images.bin: truncated"):
        load_dataset(tmp_path)
    (sparse / "images.bin").write_bytes(whole)
    (tmp_path / "images" / "shot.03.png").unlink()
    with pytest.raises(FlickerError, match=r"images.bin: image 3 \(shot.03.png\): no picture"):
        load_dataset(tmp_path)
    (sparse / "points3D.bin").unlink()
    (tmp_path / "images" / "shot.03.png").write_bytes((tmp_path / "images" / "shot.04.png").read_bytes())
    assert load_dataset(tmp_path).points is None  # a model of cameras alone


def test_views_that_do_not_overlap(nerf, tmp_path) -> None:
    """Random places need some that two cameras see."""
    data = json.loads((nerf / "transforms.json").read_text())
    (tmp_path / "images").symlink_to(nerf / "images")
    data["camera_angle_x"] = 0.01
    for k, frame in enumerate(data["frames"][:4]):  # that look outwards
        c, s = round(math.cos(k * math.pi / 2)), round(math.sin(k * math.pi / 2))
        frame["transform_matrix"] = [[c, 0, s, -s], [0, 1, 0, 0], [-s, 0, c, -c], [0, 0, 0, 1]]
    (tmp_path / "transforms.json").write_text(json.dumps(data | {"frames": data["frames"][:4]}))
    with pytest.raises(FlickerError, match="do not overlap"):
        Trainer(load_dataset(tmp_path), Options(10, 100))


def test_start_where_nothing_is_empty(shots, tmp_path) -> None:
    """Photographs with transparent parts: the first Gaussians are where none of them is empty, and have the colours of what they show."""
    (tmp_path / "images").mkdir()
    cameras = [camera for camera, _ in shots]
    middle = np.median(scene_of_shots().means, axis=0)
    masks = []
    for k, camera in enumerate(cameras):  # of a ball in the middle, red; beside it green that nobody may take
        away = np.linalg.norm(camera.position - middle)
        radius = 0.15 * camera.fx
        x, y = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, np.arange(HEIGHT) + 0.5 - HEIGHT / 2)
        at = (middle - camera.position) @ camera.rotation * (camera.fx, camera.fy, 1.0) / away
        masks.append((x - at[0]) ** 2 + (y - at[1]) ** 2 < radius**2)
        rgba = np.where(masks[-1][..., None], (200, 10, 10, 255), (0, 255, 0, 0)).astype(np.uint8)
        Image.fromarray(rgba).save(tmp_path / "images" / f"r_{k}.png")
    (tmp_path / "transforms.json").write_text(json.dumps({
        "camera_angle_x": 2 * math.atan(WIDTH / 2 / cameras[0].fx),
        "frames": [{"file_path": f"./images/r_{k}", "transform_matrix": pose(camera)} for k, camera in enumerate(cameras)],
    }))
    for size in (WIDTH, WIDTH // 2):  # a pixel that is partly transparent is not empty
        trainer = Trainer(load_dataset(tmp_path, size), Options(10, 1000))
        assert trainer.first == 300
        for shot, mask in zip(trainer.dataset.fitted, [m for k, m in enumerate(masks) if k % 8]):
            scale = WIDTH // size
            assert np.array_equal(shot.solid(), mask.reshape(HEIGHT // scale, scale, WIDTH // scale, scale).any(axis=(1, 3)))
            x, y, z = ((trainer.parameters.means - shot.camera.position) @ shot.camera.rotation).T
            column, line = ((f * v / z + 0.5 * n) * scale for f, v, n in ((shot.camera.fx, x, shot.camera.width), (shot.camera.fy, y, shot.camera.height)))
            reach = 2 * scale
            near = [mask[max(0, int(v - reach)) : int(v + reach) + 1, max(0, int(u - reach)) : int(u + reach) + 1].any() for u, v in zip(column, line)]
            assert all(near)
        colour = 0.5 + 0.28209479 * trainer.parameters.values[:, SH : SH + 3]
        assert (colour[:, 0] > 4 * colour[:, 1]).mean() > 0.9 and colour[:, 1].max() < 0.2
    for picture in (tmp_path / "images").iterdir():  # nothing is left that could be inside: as without transparency
        Image.new("RGBA", (WIDTH, HEIGHT)).save(picture)
    assert Trainer(load_dataset(tmp_path), Options(10, 1000)).first == 300


# -- training -------------------------------------------------------------------------------------------------------------------------


def test_fit_and_resume(nerf, tmp_path, monkeypatch) -> None:
    """It learns; interrupted and resumed it has the same bits; other options, other contents of photographs and other cameras are refused."""
    data, options = load_dataset(nerf), Options(iterations=200, gaussians=1500, degree=1, exposure=True)
    whole = Trainer(data, options)
    before = whole.measure()
    saved = tmp_path / "state.npz"
    for k in range(options.iterations):
        if k == 77:
            whole.save(saved)
        whole.step()
    assert whole.first < len(whole.parameters) <= 1500 and whole.measure() > before + 3
    again = Trainer(data, options)
    again.restore(saved)
    assert again.iteration == 77
    again.run()
    for name in ("parameters", "exposures"):
        a, b = (getattr(t, name) for t in (whole, again))
        assert (a.values if name == "parameters" else a).tobytes() == (b.values if name == "parameters" else b).tobytes()
    with pytest.raises(FlickerError, match="is of a fit with seed 1, not 2"):
        Trainer(data, replace(options, seed=2)).restore(saved)
    first = data.fitted[0]
    with monkeypatch.context() as patch:  # of the same names and sizes
        load = type(first).load
        patch.setattr(type(first), "load", lambda shot, background: load(shot, background) * np.float32(0.9 if shot is first else 1.0))
        with pytest.raises(FlickerError, match="state.npz: is of a fit with photographs or masks of other contents"):
            Trainer(data, options).restore(saved)
    moved = replace(first, camera=replace(first.camera, position=first.camera.position + 0.01))
    with pytest.raises(FlickerError, match="state.npz: is of a fit with other cameras"):
        Trainer(replace(data, fitted=[moved, *data.fitted[1:]]), options).restore(saved)
    saved.write_bytes(saved.read_bytes()[:-100])
    with pytest.raises(FlickerError, match="not a checkpoint"):
        Trainer(data, options).restore(saved)
    with pytest.raises(FlickerError, match="cannot be read"):
        Trainer(data, options).restore(tmp_path / "none")


def test_tune_through_a_machine(nerf, tmp_path) -> None:
    """Of what a sparse test misses something is won back; no Gaussian comes or goes; a checkpoint is of its scene."""
    data = load_dataset(nerf)
    options = Options(iterations=100, tune=True, through="flicker-sparse-fixed-factored")
    tuned = Trainer(data, options, Parameters.of(scene_of_shots()))
    before = tuned.quality(tuned.scene())
    tuned.run()
    after = tuned.quality(tuned.scene())
    assert len(tuned.parameters) == tuned.first and tuned.parameters.degree == 1
    assert before.machine < before.psnr - 1 and after.machine > before.machine + 0.05
    tuned.save(tmp_path / "state.npz")
    with pytest.raises(FlickerError, match="is of a fit with another scene"):
        Trainer(data, options, Parameters.of(tuned.scene())).restore(tmp_path / "state.npz")


def test_rates(nerf) -> None:
    """A scene that is tuned has rates that fall as those of a fit from a share on: 2/3, or as asked for. Those of a fit from nothing are larger, the more the
    fewer iterations it has."""
    data, given = load_dataset(nerf), Parameters.of(scene_of_shots())
    whole = Trainer(data, Options(iterations=300, tune=True, begin=0.0), given)
    for begin in (None, 0.0, 0.5):
        options = Options(iterations=100, tune=True)
        tuned = Trainer(data, options if begin is None else replace(options, begin=begin), given)
        first = 2 / 3 if begin is None else begin
        for share in (0.0, 0.5, 1.0):
            tuned.iteration = round(100 * share)
            whole.iteration = round(300 * (first + (1 - first) * share))
            np.testing.assert_allclose(tuned.rates(), whole.rates(), rtol=1e-5)
    for iterations, longer, options in ((30_000, 1.0, {}), (7_500, 2.0, {}), (100, 4.0, {}), (100, 1.5, {"longer": 1.5, "tune": True, "begin": 0.0})):
        fitted = Trainer(data, Options(iterations=iterations, **options), given)
        for share in (0.0, 1.0):
            fitted.iteration, whole.iteration = round(iterations * share), round(300 * share)
            ratio = fitted.rates() / whole.rates()
            wanted = np.full(len(ratio), 4 * longer)
            wanted[:SCALE], wanted[SCALE:LOGIT], wanted[LOGIT], wanted[SH : SH + 3] = longer, 2 * longer, 1.0, 2 * longer
            np.testing.assert_allclose(ratio, wanted, rtol=1e-5)


def test_squared_errors_in_the_end(nerf, tmp_path: Path) -> None:
    """The last share of a fit minimises squared errors: what comes before is as without it, the squared error ends lower; resumed in it, the same bits."""
    data, given = load_dataset(nerf), Parameters.of(scene_of_shots())
    rng = np.random.default_rng(seed())
    given.values[:, SH:] += rng.normal(scale=0.2, size=given.values[:, SH:].shape).astype(np.float32)
    plain = Options(iterations=60, tune=True)

    def run(trainer: Trainer, until: int) -> Trainer:
        while trainer.iteration < until:
            trainer.step()
        return trainer

    half, other = Trainer(data, replace(plain, squared=0.5), given), Trainer(data, plain, given)
    assert np.array_equal(run(half, 30).parameters.values, run(other, 30).parameters.values)
    run(half, 45).save(tmp_path / "state.npz")
    again = Trainer(data, replace(plain, squared=0.5), given)
    again.restore(tmp_path / "state.npz")
    assert np.array_equal(run(half, 60).parameters.values, run(again, 60).parameters.values)
    whole = Trainer(data, replace(plain, squared=1.0), given)

    def error(trainer: Trainer) -> float:
        return float(np.mean([log_error_slope(render(trainer.parameters, shot.camera).image, shot.load((0.0, 0.0, 0.0)))[0] for shot in data.fitted]))

    assert error(run(whole, 60)) < error(run(other, 60))
    # By default the second half of a fit from nothing, and no iteration of one that tunes.
    assert Options(iterations=300).first_squared == 150 and plain.first_squared == 60 and Options(iterations=300, squared=0.2).first_squared == 240


def test_least_size(nerf) -> None:
    """No Gaussian is smaller than asked for, from the beginning, while others come, and in the end; those that are larger stay."""
    data = load_dataset(nerf)
    cameras = [shot.camera for shot in data.fitted]
    given = Parameters.of(scene_of_shots())
    before = given.values.copy()
    held = Trainer(data, Options(iterations=10, tune=True, least=0.8), given)
    least = np.log(samples.least_scales(given.means, cameras, 0.8))[:, None]
    assert 0 < (given.log_scales < least).mean() < 1
    np.testing.assert_allclose(held.parameters.log_scales, np.maximum(given.log_scales, least), atol=1e-5)
    np.testing.assert_array_equal(given.values, before)
    for pixels in (0.0, 3.0):
        grown = Trainer(data, Options(iterations=300, gaussians=800, degree=1, least=pixels))
        grown.run()
        small = np.exp(grown.parameters.log_scales).min(axis=1) < samples.least_scales(grown.parameters.means, cameras, 3.0) * (1 - 1e-4)
        assert len(grown.parameters) > grown.first and small.any() == (pixels == 0.0)


def test_poisoned_scene(nerf) -> None:
    """Gaussians with numbers that are not finite, or that would give such pictures, are taken out and counted; the others learn as without them."""
    data, options = load_dataset(nerf), Options(iterations=200, gaussians=600, degree=1, least=0.1)
    clean = Trainer(data, options)
    poison = np.repeat(clean.parameters.values[:1], 6, axis=0)
    for k, (column, value) in enumerate(((MEAN, np.nan), (SCALE + 1, np.inf), (QUAT + 2, np.nan), (LOGIT, np.nan), (SH + 5, np.inf), (SH, 1e30))):
        poison[k, column] = value
    poisoned = Trainer(data, options, Parameters(np.concatenate([clean.parameters.values, poison])))
    poisoned.rng = np.random.default_rng(5)
    clean.rng = np.random.default_rng(5)
    losses = [(clean.step(), poisoned.step()) for _ in range(60)]
    assert np.isfinite(losses).all() and abs(poisoned.measure() - clean.measure()) < 0.1
    assert len(poisoned.scene()) == len(clean.parameters) == poisoned.first - 6
    while poisoned.iteration < 100:  # those that no view shows go when Gaussians are cloned and split
        poisoned.step()
    assert poisoned.removed == 6 and poisoned.parameters.finite().all()


def test_exposure(shots, nerf) -> None:
    """An affine change of colour is undone; photographs taken at half the light get darker colours of their own."""
    trainer = Trainer(load_dataset(nerf), Options(iterations=200, gaussians=600, degree=0, exposure=True))
    for k in range(0, len(trainer.dataset.fitted), 2):
        trainer._photos[k] *= np.float32(0.5)
    trainer.run()
    gain = trainer.exposures.reshape(-1, 3, 4)[:, range(3), range(3)].mean(axis=1)
    assert gain[::2].max() < gain[1::2].min()
    picture = shots[0][1]
    changed = picture @ np.array([[0.8, 0.1, 0.0], [0.0, 0.9, 0.0], [0.05, 0.0, 0.7]]) + 0.1
    assert psnr(affine_fit(changed, picture), picture) > 80 > 30 > psnr(changed, picture)


def test_command(nerf, tmp_path) -> None:
    """Scene and cameras that the other commands read; the same file whether interrupted or not; bad requests in one line."""
    def fit(*args: object, code: int = 0, out: str = "a.ply"):
        done = flicker("fit", nerf, "-o", tmp_path / out, "--gaussians", 800, "--size", 40, *args)
        assert done.returncode == code, done.stderr
        assert code == 0 or done.stderr.count("\n") == 1
        return " ".join((done.stdout + done.stderr).split())

    told = fit("--iterations", 120)
    assert "14 photographs to fit, 3 for testing, 40x33" in told and "PSNR on the test photographs" in told
    scene, cameras = load_scene(tmp_path / "a.ply"), load_cameras(tmp_path / "cameras.json")
    assert 0 < len(scene) <= 800 and [c.img_name for c in cameras] == ["r_0.png", "r_8.png", "r_16.png"] and cameras[0].width == 40
    first = (tmp_path / "a.ply").read_bytes()
    half = Trainer(load_dataset(nerf, 40), Options(iterations=120, gaussians=800))
    for _ in range(70):
        half.step()
    half.save(tmp_path / "s.npz")
    told = fit("--iterations", 120, "--checkpoint", tmp_path / "s.npz", "--resume")
    assert "continues after 70 iterations" in told and (tmp_path / "a.ply").read_bytes() == first
    done = flicker("render", tmp_path / "a.ply", "--engine", "reference", "--out", tmp_path / "a.png")
    assert done.returncode == 0, done.stderr
    told = fit("--from", tmp_path / "a.ply", "--through", "faithful", "--iterations", 20, out="b.ply")
    assert "as faithful draws" in told and len(load_scene(tmp_path / "b.ply")) == len(scene)
    assert "a.ply is the scene itself" in fit("--from", tmp_path / "a.ply", code=2) and (tmp_path / "a.ply").read_bytes() == first
    assert "its masks are not of 4x4 mini-tiles" in fit("--through", "log-lanes", code=2)
    assert "configuration 'fiathful' is unknown; close names: faithful" in fit("--through", "fiathful", code=2)
    assert "a.ply.checkpoint.npz: no checkpoint there: begins anew" in fit("--iterations", 1, "--resume")
    assert "--begin: of which scene, --from?" in fit("--begin", 0.5, code=2)
    assert "holds other cameras" in fit("--size", 30, code=2)
    assert "background: expected black" in fit("--background", "blue", code=2)
    done = flicker("fit", nerf, "-o", tmp_path / "a.spz")
    assert done.returncode == 2 and "not a .ply" in done.stderr
