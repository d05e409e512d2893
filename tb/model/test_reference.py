"""Projection and reference renderer.

Checked against an independent renderer below (plain numpy, a loop over pixels, matrices as the 3DGS paper writes them), against
formulas for single Gaussians, against rational arithmetic for extreme shapes, and, where FLICKER_SCENES names a folder of real
scenes with reference pictures, against those.
"""

from __future__ import annotations

import math
import os
import zipfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import scene_samples as samples

from flicker.errors import FlickerError
from flicker.front.projection import project
from flicker.front.reference import render_reference, render_with_transmittance
from flicker.scene.camera import Camera, load_cameras
from flicker.scene.files import Scene, load_scene
from flicker.scene.image import load_picture, save_png
from flicker.scene.metrics import psnr, ssim

SEED = int(os.environ.get("FLICKER_SEED", "1"))


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """Columns are the axes turned by v -> q v q*."""
    def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])

    q = q / np.linalg.norm(q)
    return np.stack([product(product(q, np.append(0.0, axis)), q * [1, -1, -1, -1])[1:] for axis in np.eye(3)], axis=1)


def slow_projection(scene: Scene, camera: Camera) -> list[dict]:
    out = []
    world_to_camera = np.linalg.inv(camera.rotation)
    # gsplat's rule: the slopes of the picture's edges, counted from its corner, and 0.3 half fields of view beyond.
    centre = np.array([camera.cx, camera.cy]) + 0.5
    size, focal = np.array([camera.width, camera.height]), np.array([camera.fx, camera.fy])
    most, least = (size - centre) / focal + 0.15 * size / focal, -centre / focal - 0.15 * size / focal
    for k in range(len(scene)):
        mean = scene.means[k].astype(float)
        t = world_to_camera @ (mean - camera.position)
        if t[2] <= 0.2:
            continue
        r = rotation_matrix(scene.quats[k].astype(float))
        s = np.diag(scene.scales[k].astype(float))
        sigma = r @ s @ s.T @ r.T
        x, y = np.clip(t[:2] / t[2], least, most) * t[2]
        j = np.array([[camera.fx / t[2], 0, -camera.fx * x / t[2] ** 2], [0, camera.fy / t[2], -camera.fy * y / t[2] ** 2]])
        thin = j @ world_to_camera @ sigma @ world_to_camera.T @ j.T
        cov = thin + 0.3 * np.eye(2)
        factor = math.sqrt(max(0.0, np.linalg.det(thin) / np.linalg.det(cov))) if scene.antialiased else 1.0
        middle, det = np.trace(cov) / 2, np.linalg.det(cov)
        way = (mean - camera.position) / np.linalg.norm(mean - camera.position)
        values = samples.basis(way[None])[0, : scene.sh.shape[1]] @ scene.sh[k].astype(float)
        eigen = np.linalg.eigvalsh(cov)
        out.append({
            "k": k, "depth": np.float32(t[2]), "cov": cov, "conic": np.linalg.inv(cov), "opacity": float(scene.opacities[k]) * factor,
            "mean": focal * t[:2] / t[2] + centre - 0.5,
            "radius": math.ceil(3 * math.sqrt(middle + math.sqrt(max(0.1, middle**2 - det)))),
            "rgb": np.maximum(0, 0.5 + values), "spiky": math.sqrt(eigen[1] / eigen[0]) >= 3,
        })
    return sorted(out, key=lambda g: g["depth"])  # sorted() is stable


def slow_render(gaussians: list[dict], camera: Camera, background: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    image = np.zeros((camera.height, camera.width, 3))
    left = np.ones((camera.height, camera.width))
    tiles = np.array([-(-camera.width // 16), -(-camera.height // 16)])
    for g in gaussians:
        g["first"] = np.clip(np.trunc((g["mean"] - g["radius"]) / 16), 0, tiles)
        g["last"] = np.clip(np.trunc((g["mean"] + g["radius"] + 15) / 16), 0, tiles)
    for y in range(camera.height):
        for x in range(camera.width):
            tile = np.array([x // 16, y // 16])
            for g in gaussians:
                if (tile < g["first"]).any() or (tile >= g["last"]).any():
                    continue
                d = np.array([x, y]) - g["mean"]
                power = -0.5 * d @ g["conic"] @ d
                alpha = min(0.99, g["opacity"] * math.exp(power))
                if power > 0 or alpha < 1 / 255:
                    continue
                if left[y, x] * (1 - alpha) < 1e-4:
                    break
                image[y, x] += g["rgb"] * alpha * left[y, x]
                left[y, x] *= 1 - alpha
    return image + left[:, :, None] * background, left


def look(width: int, height: int, focal: float, position: tuple = (0, 0, -3), seed: int | None = None) -> Camera:
    """Camera looking along z, tilted a little with a seed."""
    quat = np.array([1.0, 0, 0, 0]) if seed is None else np.array([1.0, *np.random.default_rng(seed).uniform(-0.1, 0.1, 3)])
    return Camera(width, height, focal, 1.1 * focal, np.array(position, float), rotation_matrix(quat))


@pytest.mark.parametrize(("degree", "scale", "position", "antialiased", "centre"), [
    (0, 1.0, (0, 0, -3), False, None), (1, 3.0, (0, 0, -2.5), False, None), (2, 6.0, (0.5, 0.2, -1.2), False, None),  # the last among the Gaussians
    (3, 1.0, (0, 0, -3), False, None), (3, 20.0, (0, 0, -2), False, None), (0, 3.0, (0, 0, -2.5), True, (10.3, 19.0)),
    (0, 6.0, (0, 0, -3), False, (-3.0, 26.25)),  # the principal point outside
])
def test_against_independent_renderer(
    degree: int, scale: float, position: tuple[float, float, float], antialiased: bool, centre: tuple[float, float] | None,
) -> None:
    scene = samples.random_scene(SEED + degree, count=120, degree=degree)
    scene.scales *= np.float32(scale)
    scene.scales[:, 0] *= np.float32(0.05)  # some of them spiky
    scene.means[:40] *= np.float32(2.5)  # beside and behind the camera
    scene.opacities[60:] = 0.995  # above the clamp
    scene.means[100:] = scene.means[80:100]  # equal depths
    scene.antialiased = antialiased
    camera = look(*((45, 37) if centre is None else (29, 23)), 40.0, position, seed=SEED)
    if centre is not None:
        camera = replace(camera, cx=centre[0], cy=centre[1])
    wanted = slow_projection(scene, camera)
    got = project(scene, camera)
    kept = [g for g in wanted if g["k"] in set(got.index)]
    assert [g["k"] for g in kept] == got.index.tolist() and got.n_visible > (60 if centre is None else 20)
    for name, array in (("mean", got.mean), ("rgb", got.rgb), ("opacity", got.opacity), ("depth", got.depth), ("spiky", got.spiky)):
        np.testing.assert_allclose(array, np.array([g[name] for g in kept]), rtol=1e-10, atol=1e-10, err_msg=name)
    for name, array in (("cov", got.cov2d), ("conic", got.conic)):
        matrices = np.array([g[name] for g in kept]).reshape(-1, 4)[:, [0, 1, 3]]
        np.testing.assert_allclose(array, matrices, rtol=1e-8, atol=1e-10, err_msg=name)
    np.testing.assert_array_equal(got.circle, [g["radius"] for g in kept])
    np.testing.assert_allclose(got.radii, 3 * np.sqrt(got.cov2d[:, ::2]))
    background = np.array([0.2, 0.5, 0.9])
    image, left = render_with_transmittance(got, camera, background)
    slow_image, slow_left = slow_render(wanted, camera, background)  # all of them: culling must not show
    assert np.abs(image - slow_image).max() < 1e-9 and np.abs(left - slow_left).max() < 1e-9
    assert slow_left.min() < (1e-3 if scale > 1 and centre is None else 0.5 if centre is None else 0.8)


def one(mean: tuple, scale: float, opacity: float, colour: float = 0.0) -> Scene:
    return Scene([mean], [[scale] * 3], [[1, 0, 0, 0]], [opacity], np.full((1, 1, 3), colour))


def test_single_gaussian_in_closed_form() -> None:
    camera = Camera(15, 13, 100.0, 100.0, np.array([0.0, 0, -4]), np.eye(3))
    projected = project(one((0, 0, 0), 0.1, 0.8, 1.0), camera)
    variance = (100 * np.float32(0.1).astype(float) / 4) ** 2 + 0.3
    np.testing.assert_allclose(projected.cov2d, [[variance, 0, variance]], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(projected.mean, [[7, 6]])  # the middle of the picture, a pixel centre
    y, x = np.mgrid[0:13, 0:15]
    alpha = np.float32(0.8).astype(float) * np.exp(-((x - 7) ** 2 + (y - 6) ** 2) / (2 * variance))
    alpha[alpha < 1 / 255] = 0
    image, left = render_with_transmittance(projected, camera)
    np.testing.assert_allclose(left, 1 - alpha, rtol=1e-12)
    np.testing.assert_allclose(image[:, :, 1], alpha * (0.5 + 0.28209479177387814), rtol=1e-12)


def test_last_gaussian_is_not_blended() -> None:
    """alpha is clamped to 0.99: after two Gaussians T is 2e-4, and the third never counts."""
    camera = Camera(16, 16, 100.0, 100.0, np.array([0.0, 0, -4]), np.eye(3))
    scene = Scene(
        [[0, 0, 0], [0, 0, 1], [0, 0, 2]], np.full((3, 3), 50.0), [[1, 0, 0, 0]] * 3, [1.0, 0.98, 1.0],
        np.array([[[0.0] * 3], [[1.0] * 3], [[2.0] * 3]]),
    )
    image, left = render_with_transmittance(project(scene, camera), camera)
    np.testing.assert_allclose(left, 0.01 * 0.02, rtol=5e-3)  # after two: the third would leave 2e-6
    np.testing.assert_allclose(image, 0.99 * 0.5 + 0.01 * 0.98 * (0.5 + 0.28209479177387814), rtol=1e-4)


def test_nothing_to_see() -> None:
    camera = look(20, 10, 30.0)
    for scene in (one((0, 0, -3.1), 0.1, 0.9), one((0, 0, -2.81), 0.1, 0.9), one((50, 0, 0), 0.1, 0.9), one((0, 0, 0), 0.1, 0.003)):
        image = render_reference(project(scene, camera), camera, (0.1, 0.2, 0.3))
        assert (image == np.array([0.1, 0.2, 0.3])).all()
    assert project(one((0, 0, -2.79), 0.01, 0.9), camera).n_visible == 1  # just past the near plane


def test_principal_point_is_a_crop() -> None:
    """A window of a larger picture is the picture of a camera whose principal point lies as far off its middle."""
    scene = samples.random_scene(SEED, count=60, degree=1)
    scene.means *= np.float32(0.3)  # no Gaussian where the Jacobian is clamped, which the smaller picture does sooner
    camera = look(96, 80, 90.0, seed=SEED)
    window = replace(camera, width=48, height=32, cx=camera.cx - 32, cy=camera.cy - 16)
    large, small = (render_reference(project(scene, c), c) for c in (camera, window))
    assert small.max() > 0.2 and np.abs(small - large[16:48, 32:80]).max() < 1e-12


def test_antialiased_opacity_in_closed_form() -> None:
    """A round splat of variance v before dilation keeps v / (v + 0.3) of its opacity; one without area, seen along its edge, is not there."""
    camera = Camera(15, 13, 100.0, 100.0, np.array([0.0, 0, -4]), np.eye(3))
    for scale in (0.001, 0.02, 0.5):
        scene = replace(one((0, 0, 0), scale, 0.8), antialiased=True)
        variance = (25 * float(scene.scales[0, 0])) ** 2
        np.testing.assert_allclose(project(scene, camera).opacity, float(scene.opacities[0]) * variance / (variance + 0.3), rtol=1e-9)
    flat = replace(one((0, 0, 0), 0.3, 0.8), antialiased=True)
    flat.scales[0, 0] = 1e-30
    assert (render_reference(project(flat, camera), camera) == 0).all()


def test_equal_depths_keep_scene_order() -> None:
    scene = samples.random_scene(SEED, count=500, degree=0)
    scene.means[:, 2] = np.random.default_rng(SEED).integers(0, 4, 500)
    camera = look(64, 64, 60.0)
    projected = project(scene, camera)
    depth = (scene.means[projected.index, 2] + 3).astype(np.float32)
    np.testing.assert_array_equal(projected.depth, depth)
    np.testing.assert_array_equal(projected.index, sorted(projected.index, key=lambda k: (scene.means[k, 2], k)))


def test_conic_of_needles() -> None:
    """Axis ratios up to 1e9: the conic agrees with one from rational arithmetic, where a float64 determinant would not."""
    count = 200
    scene = samples.random_scene(SEED, count=count, degree=0)
    scene.scales[:] = np.random.default_rng(SEED).permuted(np.tile(np.float32([1e5, 1e-4, 1e-4]), (count, 1)), axis=1)
    camera = look(64, 64, 6000.0)
    projected = project(scene, camera)
    assert projected.n_visible > 100 and projected.spiky.any()
    a, b, c = projected.conic.T
    xx, xy, yy = projected.cov2d.T
    assert (a > 0).all() and (c > 0).all()
    exact = np.vectorize(Fraction, otypes=[object])
    wanted = []
    for k in projected.index:
        r = exact(rotation_matrix(scene.quats[k].astype(float))) * exact(scene.scales[k].astype(float))
        t = exact(scene.means[k].astype(float) - camera.position)
        limit = [Fraction(1.3 * 64 / (2 * f)) for f in (camera.fx, camera.fy)]
        x, y = (min(max(t[i] / t[2], -limit[i]), limit[i]) for i in range(2))
        u = (r[0] - x * r[2]) * Fraction(camera.fx) / t[2]
        v = (r[1] - y * r[2]) * Fraction(camera.fy) / t[2]
        cov = u @ u + Fraction(0.3), u @ v, v @ v + Fraction(0.3)
        det = cov[0] * cov[2] - cov[1] ** 2
        wanted.append([float(cov[2] / det), float(-cov[1] / det), float(cov[0] / det)])
    wanted = np.array(wanted)
    np.testing.assert_allclose(projected.conic, wanted, rtol=1e-9, atol=1e-15)
    with np.errstate(divide="ignore"):
        naive = yy / (xx * yy - xy * xy)
    assert np.abs(naive / wanted[:, 0] - 1).max() > 0.1  # so that this test says something
    assert np.isfinite(render_reference(projected, camera)).all()


def test_extreme_numbers_stay_finite() -> None:
    values = np.float32([-3e38, -1e20, -1.0, 0, 1e-30, 2, 1e20, 3e38])
    means = np.array(np.meshgrid(values, values, values)).reshape(3, -1).T
    rng = np.random.default_rng(SEED)
    count = len(means)
    scene = Scene(
        means, rng.choice(np.float32([1e-38, 1, 3e38]), (count, 3)), rng.normal(size=(count, 4)), rng.uniform(0.1, 1, count),
        rng.choice(np.float32([-1e30, 0, 1]), (count, 16, 3)),
    )
    for focal in (1e-29, 1.0, 500.0, 9e29):
        camera = Camera(40, 24, focal, focal, np.zeros(3), np.eye(3))
        projected = project(scene, camera)
        for name in ("mean", "cov2d", "conic", "opacity", "rgb", "radii", "circle"):
            assert np.isfinite(getattr(projected, name)).all(), (focal, name)
        assert np.isfinite(render_reference(projected, camera)).all()


def test_metrics_and_pictures(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    a = rng.uniform(0, 1, (24, 32, 3))
    assert psnr(a, a) == math.inf and psnr(a, a + 0) == math.inf
    assert psnr(np.zeros((4, 4, 3)), np.full((4, 4, 3), 0.1)) == pytest.approx(20.0)
    assert psnr(np.full((4, 4, 3), 1.5), np.ones((4, 4, 3))) == math.inf  # clamped
    assert ssim(a, a) == pytest.approx(1.0) and ssim(a, 1 - a) < 0.5
    with pytest.raises(ValueError, match="shape"):
        psnr(a, a[1:])
    save_png(tmp_path / "a.png", a * 1.2 - 0.1)
    back = load_picture(tmp_path / "a.png")
    assert back.shape == a.shape and np.abs(back - np.clip(a * 1.2 - 0.1, 0, 1)).max() <= 0.5 / 255 + 1e-12
    (tmp_path / "b.png").write_bytes(b"not a picture")
    with pytest.raises(FlickerError, match="b.png"):
        load_picture(tmp_path / "b.png")
    with pytest.raises(FlickerError, match="none.png"):
        load_picture(tmp_path / "none.png")


SCENES = {"flowers": "flowers.compressed.ply", "guitar": "guitar.ply", "playbot": "playbot.sog", "stpeter": "st-peter.sog"}


@pytest.mark.parametrize(("name", "unpacked"), [
    *(pytest.param(n, False, marks=pytest.mark.slow) for n in SCENES), ("stpeter", True),
])
def test_real_scenes(name: str, unpacked: bool, tmp_path: Path) -> None:
    """Every stored reference picture (8 bits, so about 58 dB is what agreement guarantees), of a SOG also unpacked."""
    if "FLICKER_SCENES" not in os.environ:
        pytest.skip("FLICKER_SCENES names no folder of real scenes")
    folder = Path(os.environ["FLICKER_SCENES"]) / name
    if unpacked:
        zipfile.ZipFile(folder / SCENES[name]).extractall(tmp_path)
    scene = load_scene(tmp_path if unpacked else folder / SCENES[name])
    assert scene.rejected == {}
    for k, camera in enumerate(load_cameras(folder / "cameras.json")):
        picture = render_reference(project(scene, camera), camera)
        value = psnr(picture, load_picture(folder / "reference" / f"{k:03d}.png"))
        print(f"{name} {k}: {value:.2f} dB")
        assert value >= 55
