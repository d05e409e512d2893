"""The bit-true front end: against float64, against lists found pixel by pixel, at its edges."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.real import real_views
from scene_samples import random_scene
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from flicker.cli.main import app
from flicker.errors import FlickerError
from flicker.front.projection import _C1, _C2, _C3, project
from flicker.front.view import DEMO, View, load_view
from flicker.golden.front import colour
from flicker.golden.front.blend import blend_records
from flicker.golden.front.cull import cull
from flicker.golden.front.fields import Fields, splats_of
from flicker.golden.front.frame import FrontFrame, ListKind, depth_key, run_front, sort_key
from flicker.golden.front.record import MEAN_FIELD, RecordKind, decode_mean, decode_shape, encode_mean, encode_shape
from flicker.golden.front.setup import FORMATS, FrameSetup, FrontFormats, rounded
from flicker.golden.render import render_golden
from flicker.params import SUBTILE, TILE, CatMode, Form, RenderConfig, SortOrder
from flicker.pipeline import Engine, Front, FrontOptions, render_view
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat, PackedScene, decode
from flicker.scene.packing import pack
from flicker.scene.real import real_scenes

SIZE = (320, 180)


@pytest.fixture(scope="module")
def demo() -> View:
    return load_view(DEMO, 0, SIZE)


def picture(frame: FrontFrame, background=(0.0, 0.0, 0.0)) -> np.ndarray:
    start, entry = frame.sorted_subtiles()
    return blend_records(frame.splats(), frame.kind.form, start, entry, frame.camera.width, frame.camera.height, background)


def seen_from(scene: Scene, camera: Camera, form: PackedFormat = PackedFormat.FP16, **options) -> FrontFrame:
    return run_front(pack(scene, form).packed, camera, **options)


def plain_camera(width: int = 64, height: int = 64, focal: float = 64.0) -> Camera:
    return Camera(width, height, focal, focal, np.zeros(3), np.eye(3))


def some(count: int, **changes) -> Scene:
    """Gaussians in front of `plain_camera`, round, grey, half opaque; fields as given, broadcast."""
    rng = np.random.default_rng(5)
    values = {
        "means": np.stack([*rng.uniform(-1, 1, (2, count)), np.full(count, 4.0)], axis=1), "scales": np.full((count, 3), 0.1),
        "quats": np.tile([1.0, 0, 0, 0], (count, 1)), "opacities": np.full(count, 0.5), "sh": np.zeros((count, 1, 3)),
    }
    for name, value in changes.items():
        values[name] = np.broadcast_to(value, (count, *np.shape(values[name])[1:])).astype(np.float64)
    return Scene(**values)


def turned(seed: int, away: float = 3.0) -> Camera:
    """A camera that looks somewhere near the origin from a distance."""
    rng = np.random.default_rng(seed)
    forward = rng.normal(size=3)
    forward /= np.linalg.norm(forward)
    right = np.cross(rng.normal(size=3), forward)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    return Camera(200, 120, 150.0, 160.0, -away * forward + rng.normal(scale=0.3, size=3), rotation)


# ---- against float64 ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("form", "features"), [*((form, False) for form in PackedFormat), (PackedFormat.CHUNK, True), (PackedFormat.FP16_LOCAL, True)])
def test_values_are_those_of_float64(form: PackedFormat, features: bool) -> None:
    """Mean, shape, depth order, colour and what is left out, Gaussian by Gaussian, of the scene as its bits say it. features: of an antialiased scene, through
    a camera with its principal point off the middle."""
    scene, camera = random_scene(3, 3000), turned(1)
    if features:
        scene, camera = dataclasses.replace(scene, antialiased=True), dataclasses.replace(camera, cx=30.4, cy=131.7)
    packed = pack(scene, form).packed
    exact = project(decode(packed), camera)
    frame = run_front(packed, camera)
    place = np.full(len(packed), -1)
    place[exact.index] = np.arange(len(exact.index))
    j = place[frame.gaussian]
    assert (j >= 0).all()  # nothing is recorded that float64 does not see
    splats = frame.splats()
    near = np.abs(exact.mean[j]).max(axis=1) < 4096
    assert np.abs(splats.mean[near] / 128 - exact.mean[j][near]).max() <= (1.0 if features else 0.5) / 128 + 1e-3  # the principal point is rounded, too
    k = 0.5 * np.log2(np.e)
    a, b, c = exact.conic[j].T
    l0 = np.sqrt(a * k)
    want = np.stack([l0, b * k / l0, np.sqrt(k / exact.cov2d[j, 2])], axis=1)
    size = np.stack([want[:, 0], np.hypot(want[:, 1], want[:, 2]), want[:, 2]], axis=1)  # l1's error goes with the row's length
    ulp = 2.0**-FORMATS.shape
    assert (np.abs(splats.shape - want) <= size * 32 * ulp).all()
    assert np.median(np.abs(splats.shape - want) / size) < max(4 * ulp, 2.0**-10)
    colour = np.minimum(exact.rgb[j], 1023 / 512)
    assert np.abs(splats.rgb - colour).max() <= 0.5 / 512 + 4e-3
    assert np.abs(splats.opacity - exact.opacity[j]).max() <= (0.5 + (1024 if features else 128) * ulp) / 255  # the product is rounded before
    assert not features or exact.opacity[j].mean() < 0.95 * decode(packed).opacities[exact.index[j]].mean()
    assert (splats.spiky == exact.spiky[j]).mean() > 0.999
    order = np.argsort(frame.key, kind="stable")
    assert (np.diff(exact.depth[j][order].astype(np.float64)) > -2e-5 * 6).all()


@pytest.mark.parametrize(("form", "least"), [(PackedFormat.FP16_LOCAL, 55.0), (PackedFormat.CHUNK, 50.0), (PackedFormat.FP16, 50.0)])
def test_picture_of_the_demo_scene(demo: View, form: PackedFormat, least: float) -> None:
    frame = run_front(pack(demo.scene, form).packed, demo.camera)
    assert psnr(picture(frame), demo.reference) > least
    golden = render_golden(frame.subtile_lists(), RenderConfig(cat=CatMode.OFF)).image()
    assert psnr(golden, picture(frame)) > 55.0


@pytest.mark.parametrize("form", [PackedFormat.FP16_LOCAL, PackedFormat.CHUNK])
@pytest.mark.parametrize("real", real_views())
def test_real_scenes(real, form: PackedFormat) -> None:
    """The front end's own loss: at least 60 dB with FP16 relative to the cluster, 56 with chunks."""
    folder = real_scenes()
    if folder is None:
        pytest.skip("FLICKER_SCENES is not set")
    view = load_view(real.path(folder), real.number, (640, 360))
    frame = run_front(pack(view.scene, form).packed, view.camera)
    assert psnr(picture(frame), view.reference) >= (60.0 if form is PackedFormat.FP16_LOCAL else 56.0)


# ---- clusters ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
def test_no_visible_gaussian_is_culled(seed: int) -> None:
    """Cameras around, far away and within the clusters."""
    near = random_scene(seed, 20_000, 0)
    packed = pack(dataclasses.replace(near, means=10 * near.means), PackedFormat.FP16_LOCAL).packed
    camera = turned(seed, (0.0, 7.0, 30.0, 4000.0)[seed % 4])
    if seed >= 8:
        camera = dataclasses.replace(camera, cx=(-300.0, 40.0, 999.0, 0.0)[seed % 4], cy=(60.0, 200.0, -3000.0, 5.5)[seed % 4])
    found = cull(packed, FrameSetup.of(camera))
    exact = project(decode(packed), camera)
    assert found[packed.cluster[exact.index]].all()
    if seed % 4 == 1:
        assert not found.all()


def test_keys_of_depths() -> None:
    """Codes of the ff number less that of 1/8: order kept, a step of 2^-19 of the depth, the ends saturated; fewer or more bits drop or add the last ones."""
    nearest, farthest = float(rounded(0.2, 19)), 2.0**29 - 2.0**9
    expected = {0.125: 0, nearest: round(0.6 * 2**19), 0.25: 1 << 19, 1.0: 3 << 19, 1.0 + 2.0**-19: (3 << 19) + 1, farthest: (1 << 24) - 1}
    assert {depth: depth_key(depth, 19) for depth in expected} == expected
    assert [depth_key(depth, 19) for depth in (-1e30, -0.5, 0.0, 1e-30, 0.1249)] == [0] * 5
    assert [depth_key(depth, 19) for depth in (2.0**29, 1e30)] == [(1 << 24) - 1] * 2
    depths = rounded(np.sort(np.exp(np.random.default_rng(7).uniform(np.log(0.2), np.log(5e8), 1000))), 19)
    keys = np.array([depth_key(depth, 19) for depth in depths.tolist()])
    assert (np.diff(keys)[np.diff(depths) > 0] > 0).all()
    assert [depth_key(depth, 19, 16) for depth in depths.tolist()] == (keys >> 8).tolist()
    assert [depth_key(depth, 19, 26) for depth in depths.tolist()] == (keys << 2).tolist()


def test_keys_of_distances() -> None:
    """Of a square the code without its last bit, less that of 2^-5: order kept, a step of 2^-19 of the distance at most, the ends saturated; fewer or more bits
    as of depths."""
    key = lambda square, bits=24: sort_key(True, -7.0, square, 19, bits)  # noqa: E731
    least, last = float(rounded(0.04, 19)), (2.0 - 2.0**-18) * 2.0**58
    expected = {2.0**-5: 0, least: round(0.28 * 2**18), 0.0625: 1 << 18, 1.0: 5 << 18, 1.0 + 2.0**-19: 5 << 18, 1.0 + 2.0**-18: (5 << 18) + 1}
    expected[last] = (1 << 24) - 1
    assert {square: key(square) for square in expected} == expected
    assert [key(square) for square in (0.0, 1e-30, 0.0312)] == [0] * 3 and [key(square) for square in (2.0**59, 1e38)] == [(1 << 24) - 1] * 2
    away = np.sort(np.exp(np.random.default_rng(7).uniform(np.log(0.2), np.log(5e8), 1000)))
    keys = np.array([key(square) for square in rounded(away**2, 19).tolist()])
    assert (np.diff(keys) >= 0).all() and (np.diff(keys)[np.diff(away) > 2.0**-17 * away[1:]] > 0).all()
    assert [key(square, 16) for square in rounded(away**2, 19).tolist()] == (keys >> 8).tolist()
    assert [key(square, 26) for square in rounded(away**2, 19).tolist()] == (keys << 2).tolist()


@pytest.mark.parametrize("form", list(PackedFormat))
def test_order_by_distance(form: PackedFormat) -> None:
    """Only keys change; they are in the order of float64's distances, and the same bits for every turn of the camera on the spot, where depths' are not."""
    packed, camera = pack(random_scene(3, 3000), form).packed, turned(1)
    plain, frame = run_front(packed, camera), run_front(packed, camera, order=SortOrder.DISTANCE)
    for name in ("gaussian", "number", "records", "entry_splat", "entry_tile", "entry_mask"):
        assert np.array_equal(getattr(plain, name), getattr(frame, name)), name
    exact = project(decode(packed), camera, SortOrder.DISTANCE)
    away = np.linalg.norm(decode(packed).means - camera.position, axis=1)
    assert (np.diff(away[exact.index]) > -1e-6).all() and (np.diff(exact.depth) < 0).any()
    assert (np.diff(away[frame.gaussian[np.argsort(frame.key, kind="stable")]]) > -2e-5 * 6).all()
    for about in ([0.0, 0.3, 0.0], [0.1, 0.0, 0.05]):
        other = dataclasses.replace(camera, rotation=camera.rotation @ Rotation.from_rotvec(about).as_matrix())
        after, by_depth = run_front(packed, other, order=SortOrder.DISTANCE), run_front(packed, other)
        _, before, now = np.intersect1d(frame.gaussian, after.gaussian, return_indices=True)
        assert len(now) > 500 and np.array_equal(frame.key[before], after.key[now])
        assert (plain.key[before] != by_depth.key[now]).mean() > 0.9
        again = project(decode(packed), other, SortOrder.DISTANCE)
        seen = np.isin(again.index, exact.index)
        assert np.array_equal(again.index[seen], exact.index[np.isin(exact.index, again.index)])


# ---- lists -------------------------------------------------------------------------------------------


def by_pixel(frame: FrontFrame, slack: float) -> set[tuple[int, int, int]]:
    """(record, tile, sub-tile) whose pixel centres meet the ellipse, its limit changed by `slack`, and the 3-sigma box; from the records, in float64."""
    camera, splats = frame.camera, frame.splats()
    exact = project(decode(frame.packed), camera)
    place = np.full(len(frame.packed), -1)
    place[exact.index] = np.arange(len(exact.index))
    found = set()
    cols = -(-camera.width // TILE)
    for i, j in enumerate(place[frame.gaussian]):
        mean, radii = splats.mean[i] / 128, exact.radii[j] + slack
        x0, y0 = np.maximum(np.ceil(mean - radii), 0).astype(int)
        x1, y1 = np.minimum(np.floor(mean + radii), (camera.width - 1, camera.height - 1)).astype(int)
        if x0 > x1 or y0 > y1:
            continue
        y, x = np.mgrid[y0 : y1 + 1, x0 : x1 + 1]
        l0, l1, l2 = splats.shape[i]
        energy = (l0 * (x - mean[0]) + l1 * (y - mean[1])) ** 2 + (l2 * (y - mean[1])) ** 2
        inside = energy <= np.log2(255 * splats.opacity[i]) * (1 + slack) + slack
        for ty, tx in set(zip(y[inside] // SUBTILE, x[inside] // SUBTILE)):
            found.add((i, int(ty // 2 * cols + tx // 2), int(ty % 2 * 2 + tx % 2)))
    return found


@pytest.mark.parametrize("seed", range(3))
def test_lists_are_those_of_the_ellipse(seed: int) -> None:
    """Every sub-tile in which a pixel centre is clearly inside is listed; what is listed beyond these is rare: an interval is of all rows of a band."""
    scene, camera = random_scene(seed, 600), turned(seed + 40)
    frame = run_front(pack(scene, PackedFormat.FP16_LOCAL).packed, camera)
    listed = {
        (int(i), int(t), k) for i, t, m in zip(frame.entry_splat, frame.entry_tile, frame.entry_mask) for k in range(4) if int(m) >> k & 1
    }
    assert len(listed) > 2000
    assert by_pixel(frame, -0.02) <= listed
    assert len(listed) <= 1.02 * len(by_pixel(frame, 0.02))


def test_entries_are_in_scene_order_and_tiles_in_rows(demo: View) -> None:
    frame = run_front(pack(demo.scene, PackedFormat.CHUNK).packed, demo.camera)
    assert (np.diff(frame.entry_splat) >= 0).all()
    same = np.diff(frame.entry_splat) == 0
    assert (np.diff(frame.entry_tile)[same] > 0).all()
    assert (frame.entry_mask > 0).all() and (frame.entry_mask < 16).all()
    unlisted = frame.outcomes["ellipse holds no pixel"] + frame.outcomes["opacity below 1/510"]
    assert len(np.unique(frame.entry_splat)) == frame.outcomes["listed"] == len(frame.gaussian) - unlisted
    assert (np.diff(frame.number) > 0).all() and (np.diff(frame.gaussian) > 0).all()
    cluster = frame.packed.cluster[frame.gaussian]
    first = np.searchsorted(cluster, np.unique(cluster))
    assert (frame.number[first] == frame.packed.first[np.unique(cluster)]).all()
    assert sum(frame.outcomes.values()) == len(frame.packed)


def test_box_lists_hold_the_ellipse_lists(demo: View) -> None:
    packed = pack(demo.scene, PackedFormat.FP16_LOCAL).packed
    narrow, wide = run_front(packed, demo.camera), run_front(packed, demo.camera, ListKind.BOX)
    tiles = lambda f: set(zip(f.gaussian[f.entry_splat].tolist(), f.entry_tile.tolist()))  # noqa: E731
    assert tiles(narrow) < tiles(wide)
    assert len(narrow.entry_tile) < 0.97 * len(wide.entry_tile)


# ---- records -----------------------------------------------------------------------------------------


def test_means_beyond_the_field_get_coarser() -> None:
    for x in (0, 1, -1, 2**19 - 1, -(2**19), 2**19, 123456789, -987654321, 2**32 - 1, -(2**32)):
        field = encode_mean(x)
        step = 4 ** (field >> MEAN_FIELD)
        assert abs(decode_mean(field) - x) <= step // 2
        assert step == 1 or abs(x) >= 2**19 * step // 4 - step



def test_shapes_keep_nine_bits() -> None:
    values = np.concatenate([np.geomspace(2.0**-29, 3.9, 5000), [1.0, 1.0 + 2.0**-10, 2.0 - 2.0**-12]])
    back = decode_shape(np.array([encode_shape(v) for v in values]))
    assert (np.abs(back - values) <= values * 2.0**-10).all()
    assert decode_shape(np.array([encode_shape(v) for v in (0.0, 2.0**-40, 1e9)])).tolist() == [0.0, 0.0, (2.0 - 2.0**-9) * 2.0]


def test_conic_records(demo: View) -> None:
    packed = pack(demo.scene, PackedFormat.FP16_LOCAL).packed
    frame = run_front(packed, demo.camera, ListKind.BOX, RecordKind.CONIC32)
    assert frame.records.shape[1] == 32 and frame.subtile_lists().form is Form.CONIC
    assert psnr(picture(frame), demo.reference) > 45.0


# ---- other widths ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def packed() -> PackedScene:
    return pack(random_scene(11, 3000), PackedFormat.FP16_LOCAL).packed


@pytest.fixture(scope="module")
def default(packed: PackedScene) -> FrontFrame:
    return run_front(packed, turned(6))


@pytest.mark.parametrize("name", ["mean", "direction", "harmonics", "coefficient", "sums", "term", "key"])
def test_each_width_matters_and_only_where_it_should(name: str, packed: PackedScene, default: FrontFrame) -> None:
    """What changes with 3 bits fewer stays within their step; the rest stays as it is."""
    bits = getattr(FORMATS, name) - (2 if name == "mean" else 3)
    other = run_front(packed, turned(6), formats=dataclasses.replace(FORMATS, **{name: bits}))
    a, b = default.splats(), other.splats()
    if name == "mean":
        assert (b.mean % 4 == 0).all() and np.abs(a.mean - b.mean).max() == 2.0
        return
    assert (a.mean == b.mean).all() and (a.shape == b.shape).all() and (a.opacity == b.opacity).all()
    if name == "key":
        assert (other.key == default.key >> 3).all() and default.key.max() >= 1 << 21
        return
    off = np.abs(default.unrounded[:, 4:] - other.unrounded[:, 4:])
    assert (other.key == default.key).all() and 0.0 < np.median(off[off > 0]) and (off > 0).mean() > 0.3
    assert off.max() < 2.0**-bits * {"direction": 16, "harmonics": 16, "coefficient": 16, "sums": 16 * 2.0**-11, "term": 4}[name]


def test_finer_widths_come_closer_to_float64(packed: PackedScene, default: FrontFrame) -> None:
    """Colours and means, all fixed point widened at once, records left out."""
    exact = project(decode(packed), turned(6))
    place = np.full(len(packed), -1)
    place[exact.index] = np.arange(len(exact.index))
    fine = FrontFormats(23, 11, 19, mean=9, direction=15, harmonics=15, coefficient=15, sums=7, term=16)
    errors = []
    for frame in (default, run_front(packed, turned(6), formats=fine)):
        j = place[frame.gaussian]
        near = (j >= 0) & (np.abs(exact.mean[j]) < 900).all(axis=1)  # 20 bits of 1/512 pixel
        errors.append([np.abs(got - want[j])[near].max() for got, want in ((frame.splats().mean / 128, exact.mean), (frame.unrounded[:, 4:], exact.rgb))])
    assert errors[1][0] < 0.3 * errors[0][0] and errors[1][1] < 0.2 * errors[0][1]


@pytest.mark.parametrize("form", PackedFormat)
def test_fields_of_default_widths_are_the_record(form: PackedFormat) -> None:
    frame = run_front(pack(random_scene(12, 2000), form).packed, turned(3))
    want, got = frame.splats(), splats_of(frame)
    for field in dataclasses.fields(want):
        assert (getattr(got, field.name) == getattr(want, field.name)).all(), field.name


def test_fields_of_other_widths(default: FrontFrame) -> None:
    """Each within half its step of what it is rounded from, on numbers of its step, and not those of the record."""
    frame, want = default, default.splats()
    fewer = splats_of(frame, Fields(shape=6, colour=6, opacity=5))
    shape, opacity, rgb = frame.unrounded[:, :3], frame.unrounded[:, 3], frame.unrounded[:, 4:]
    mantissa = np.ldexp(np.frexp(fewer.shape)[0], 7)
    assert (mantissa == np.rint(mantissa)).all() and (np.abs(fewer.shape - shape) <= np.abs(shape) * 2.0**-7 + 2.0**-29).all()
    assert (fewer.rgb * 64 == np.rint(fewer.rgb * 64)).all() and np.abs(fewer.rgb - np.minimum(rgb, 127 / 64)).max() <= 1 / 128
    assert np.abs(fewer.opacity * 31 - np.rint(fewer.opacity * 31)).max() < 1e-12 and np.abs(fewer.opacity - opacity).max() <= 0.51 / 31
    for name in ("shape", "opacity", "rgb"):
        assert (getattr(fewer, name) != getattr(want, name)).mean() > 0.5
    assert (splats_of(frame, Fields(opacity=None)).opacity == opacity).all()
    more = splats_of(frame, Fields(opacity=12))
    assert np.abs(more.opacity - opacity).max() < np.abs(want.opacity - opacity).max() / 4
    with pytest.raises(FlickerError, match="records of 16 bytes"):
        splats_of(dataclasses.replace(frame, unrounded=None))


# ---- edges -------------------------------------------------------------------------------------------


def test_nothing_to_see() -> None:
    camera = plain_camera()
    frame = seen_from(some(20, means=[0, 0, -5.0]), camera)
    assert len(frame.records) == len(frame.entry_tile) == 0 and frame.clusters_kept == 0
    assert not picture(frame).any()
    aside = seen_from(some(20, means=[300.0, 0, 4.0]), camera)
    assert len(aside.records) == 0


def test_one_gaussian_over_4096_x_4096() -> None:
    camera = plain_camera(4096, 4096, 4096.0)
    frame = seen_from(some(1, means=[0, 0, 4.0], scales=50.0, opacities=0.9), camera)
    assert len(frame.entry_tile) == 256 * 256 and (frame.entry_mask == 15).all()
    with pytest.raises(FlickerError, match="width: 4097"):
        seen_from(some(1), plain_camera(4097))


def test_all_in_one_tile_with_equal_depths() -> None:
    """Keys are equal: the order is that of the scene."""
    frame = seen_from(some(256, means=[0.02, 0.02, 4.0], scales=0.01, opacities=0.3), plain_camera(focal=64.0))
    assert len(np.unique(frame.key)) == 1
    start, entry = frame.sorted_subtiles()
    one = entry[start[27] : start[28]] if start[28] > start[27] else entry[start[36] : start[37]]
    assert one.tolist() == list(range(256))


def test_opacity_at_1_over_255() -> None:
    """Visible at its very centre only; below, not at all."""
    centre = [(32 - 31.5) / 64 * 4.0, (32 - 31.5) / 64 * 4.0, 4.0]  # pixel (32, 32)
    frame = seen_from(some(1, means=centre, opacities=1 / 255), plain_camera(), PackedFormat.CHUNK)
    assert frame.splats().opacity.tolist() == [1 / 255] and len(frame.entry_tile) == 1
    assert (picture(frame).sum(axis=2) > 0).sum() == 1
    between = seen_from(some(1, means=[0.031, 0.0, 4.0], opacities=1 / 255), plain_camera(), PackedFormat.CHUNK)
    assert between.outcomes["ellipse holds no pixel"] == 1
    packed = pack(some(3), PackedFormat.FP16).packed
    colour = packed.colour.copy()
    colour.reshape(-1, packed.format.colour_stride(0))[:3, :2] = np.array([0.4 / 255], np.float16).view(np.uint8)
    faint = run_front(dataclasses.replace(packed, colour=colour), plain_camera())
    assert faint.outcomes["opacity below 1/510"] == 3


def test_quaternions_of_any_length() -> None:
    scene = random_scene(9, 400)
    packed = pack(scene, PackedFormat.FP16).packed
    geometry = packed.geometry.copy()
    geometry[:, 6:] = (geometry[:, 6:].view(np.float16) * np.float16(0.125)).view(np.uint16)
    other = dataclasses.replace(packed, geometry=geometry)
    camera = turned(4)
    a, b = run_front(packed, camera), run_front(other, camera)
    assert (a.gaussian == b.gaussian).mean() > 0.99
    assert np.abs(a.splats().shape - b.splats().shape).max() < 2.0**-8


def test_degenerate_scales() -> None:
    for scales in ([1e-7, 1e-7, 1e-7], [3.0, 1e-7, 1e-7], [40.0, 1e-6, 1e-6]):
        frame = seen_from(some(8, scales=scales, quats=[0.9, 0.1, 0.3, 0.2]), plain_camera())
        assert len(frame.records) == 8 and np.isfinite(picture(frame)).all()
        exact = View(plain_camera(), decode(frame.packed)).reference
        assert psnr(picture(frame), exact) > 50.0


def test_bright_colours_are_clipped_and_counted() -> None:
    rng = np.random.default_rng(1)
    sh = rng.normal(size=(64, 16, 3))
    sh[:, 0] *= 3.0
    assert np.abs(sh[:, 1:]).max() < 4.0
    frame = run_front(pack(Scene(**(vars_of(some(64)) | {"sh": sh})), PackedFormat.FP16).packed, plain_camera())
    exact = project(decode(frame.packed), plain_camera())
    place = np.argsort(exact.index)
    too_bright = (exact.rgb[place] > 1023.5 / 512).any(axis=1)
    assert frame.adjusted["colour above 2 clipped"] == too_bright.sum() > 0
    assert np.abs(frame.splats().rgb - np.clip(exact.rgb[place], 0, 1023 / 512)).max() < 0.01


def test_coefficients_of_fp16_end_at_4() -> None:
    sh = np.zeros((2, 4, 3))
    sh[:, 2] = np.array([[6.0], [8191 / 2048]]) * [1.0, -1.0, 1.0]
    scene = Scene(**(vars_of(some(2, means=[0.0, 0.0, 4.0])) | {"sh": sh}))
    rgb = seen_from(scene, plain_camera()).splats().rgb
    assert (rgb[0] == rgb[1]).all() and rgb[0, 0] == 1023 / 512 and rgb[0, 1] == 0.0


def test_basis_functions_are_those_of_float64() -> None:
    rng = np.random.default_rng(2)
    d = np.concatenate([rng.normal(size=(2000, 3)), np.repeat(np.eye(3), 2, axis=0) * np.tile([[1.0], [-1.0]], (3, 1))])
    unit = d / np.linalg.norm(d, axis=1, keepdims=True)
    for row, (x, y, z) in zip(d, unit):
        out = np.zeros(16, np.int64)
        colour.basis_functions(*rounded(row, FORMATS.colour).tolist(), 3, out, FORMATS.colour)
        exact = [
            -_C1 * y, _C1 * z, -_C1 * x, _C2[0] * x * y, _C2[1] * y * z, _C2[2] * (3 * z * z - 1), _C2[3] * x * z, _C2[4] * (x * x - y * y),
            _C3[0] * y * (3 * x * x - y * y), _C3[1] * x * y * z, _C3[2] * y * (5 * z * z - 1), _C3[3] * z * (5 * z * z - 3),
            _C3[4] * x * (5 * z * z - 1), _C3[5] * z * (x * x - y * y), _C3[6] * x * (x * x - 3 * y * y),
        ]
        assert np.abs(out[1:] / 2048 - exact).max() < 5.0 / 2048


def vars_of(scene: Scene) -> dict[str, np.ndarray]:
    return {name: getattr(scene, name) for name in ("means", "scales", "quats", "opacities", "sh")}


def test_formats_are_checked() -> None:
    with pytest.raises(FlickerError, match="shape must have 10 to 23"):
        FrontFormats(shape=9)
    with pytest.raises(FlickerError, match="mean must have 5 to 9 bits, not 10"):
        FrontFormats(mean=10)
    assert FORMATS.position <= 23


# ---- pipeline and command line -----------------------------------------------------------------------


def test_engines_take_the_golden_front_end(demo: View) -> None:
    options = FrontOptions(PackedFormat.FP16_LOCAL)
    config = RenderConfig(cat=CatMode.OFF)
    floating = render_view(demo, engine=Engine.REFERENCE, front=Front.GOLDEN, options=options, config=config, compare=True)
    golden = render_view(demo, engine=Engine.GOLDEN, front=Front.GOLDEN, options=options, config=config, compare=True)
    assert 55 < golden.stats["psnr_db"] < floating.stats["psnr_db"]
    assert golden.stats["outcomes"]["listed"] == golden.stats["visible"] and golden.stats["format"] == "fp16-local"


@pytest.mark.parametrize(("arguments", "message"), [
    (["--format", "chunk"], "--format: for --front golden and rtl only"),
    (["--lists", "box"], "--lists: for --front golden and rtl only"),
    (["--front", "golden", "--faithful", "--lists", "box"], "--faithful: fixes the configuration, so it cannot be combined with --lists"),
    (["--front", "golden", "--coords", "absolute"], "coords absolute: for --front float only"),
    (["--front", "rtl", "--stage", "lanes", "--form", "conic"], "--stage lanes: takes records of 16 bytes"),
    (["--engine", "chip-golden", "--memories", "small"], "--memories: for --engine chip only"),
    (["--engine", "chip-golden", "--port-bits", "128"], "--port-bits: for --engine chip only"),
    (["--engine", "chip", "--port-bits", "64"], "configuration: port_bits must be 128, 256 or 512, not 64"),
    (["--engine", "rtl", "--refresh", "per-bank"], "--refresh: for --engine chip only"),
    (["--engine", "rtl", "--sort-units", "2"], "--sort-units: for --engine chip only"),
    (["--engine", "chip", "--list-writers", "3"], "list_writers must be 1, 2 or 4, not 3"),
    (["--engine", "chip", "--preproc-lanes", "0"], "preproc_lanes must be 1, 2 or 4, not 0"),
    (["--engine", "chip", "--preproc-interval", "3"], "preproc_interval must be 2 or 4, not 3"),
    (["--engine", "rtl", "--preproc-interval", "4"], "--preproc-interval: for --engine chip only"),
    (["--engine", "chip", "--stage", "lanes", "--faithful"], "--stage lanes: takes records of 16 bytes"),
])
def test_refused_combinations(arguments: list[str], message: str, tmp_path: Path) -> None:
    from flicker.scene.files import save_ply

    save_ply(random_scene(1, 20), tmp_path / "scene.ply")
    result = CliRunner().invoke(app, ["render", str(tmp_path / "scene.ply"), "--size", "32x32", *arguments])
    assert result.exit_code != 0
    assert message in str(result.exception) + result.output


@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--form", "conic"], ["--faithful"]], ids=" ".join)
def test_command_gives_the_same_picture_with_the_rtl(options: list[str], tmp_path: Path) -> None:
    """`--front rtl` against `--front golden`, `--engine chip` against `chip-golden`."""
    from flicker.scene.files import save_ply

    save_ply(random_scene(4, 3000), tmp_path / "scene.ply")
    for kind, names in (("--front", ("golden", "rtl")), ("--engine", ("chip-golden", "chip"))):
        pictures = []
        for name in names:
            result = CliRunner().invoke(
                app, ["render", str(tmp_path / "scene.ply"), "--size", "160x90", kind, name, "--out", str(tmp_path / f"{name}.png"), *options],
            )
            assert result.exit_code == 0, result.output
            pictures.append((tmp_path / f"{name}.png").read_bytes())
        assert pictures[0] == pictures[1]


def test_packed_file_renders_as_its_scene(tmp_path: Path) -> None:
    scene = random_scene(2, 500)
    packed = pack(scene, PackedFormat.FP16_LOCAL).packed
    path = tmp_path / "scene.flk"
    path.write_bytes(packed.image())
    view = load_view(path, 0, (64, 64))
    shown = render_view(view, engine=Engine.REFERENCE, front=Front.GOLDEN)
    assert (shown.image == picture(run_front(packed, view.camera))).all()
    with pytest.raises(FlickerError, match="is packed as fp16-local, not chunk"):
        render_view(view, front=Front.GOLDEN, options=FrontOptions(PackedFormat.CHUNK))
