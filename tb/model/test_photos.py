"""Photographs: found, composed, averaged, measured against, judged; bad input.

Averages are compared with a sum over overlaps, PSNR with the noise that was added to a rendered picture before it was stored as a photograph. Where
FLICKER_SCENES names the folder of real scenes, a test photograph of lego is measured.
"""

from __future__ import annotations

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.runner import seed
from PIL import Image
from scene_samples import random_scene
from typer.testing import CliRunner

from flicker.cli.main import app
from flicker.errors import FlickerError
from flicker.explore.evaluate import evaluate
from flicker.explore.points import SIZE, SceneFile, Target
from flicker.explore.store import Store
from flicker.explore.sweep import load_sweep
from flicker.front.view import load_view
from flicker.report import claims, figures
from flicker.report.collect import ViewResult, by_scene, collect
from flicker.report.write import check
from flicker.scene.camera import orbit_camera
from flicker.scene.files import save_ply
from flicker.scene.image import load_coverage, load_picture
from flicker.scene.photos import area_average, load_photo, parse_background, photo_beside
from flicker.scene.real import real_scenes

WIDTH, HEIGHT = 64, 48
BACKGROUND = (0.2, 0.5, 0.8)
VIEWS = 3  # the first two have photographs
NOISE = 0.05


def store(path: Path, picture: np.ndarray) -> None:
    """A float picture of any number of channels as 8 bits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)).save(path)


def decibels(a: np.ndarray, b: np.ndarray) -> float:
    return -10 * math.log10(((np.clip(a, 0, 1) - np.clip(b, 0, 1)) ** 2).mean())


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> Path:
    """A scene with cameras and, of all but the last, photographs: its pictures over `BACKGROUND` at twice the size, and noise."""
    folder = tmp_path_factory.mktemp("fitted")
    rng = np.random.default_rng(seed())
    scene = random_scene(seed(), 200)
    save_ply(scene, folder / "fit.ply")
    cameras = [orbit_camera(scene, k, VIEWS, WIDTH, HEIGHT) for k in range(VIEWS)]
    (folder / "cameras.json").write_text(json.dumps([
        {"img_name": f"shot.{k}", "width": c.width, "height": c.height, "fx": c.fx, "fy": c.fy, "position": c.position.tolist(),
         "rotation": c.rotation.tolist()}
        for k, c in enumerate(cameras)
    ]))
    for k in range(VIEWS - 1):
        picture = load_view(folder / "fit.ply", k, background=BACKGROUND).reference
        noisy = picture + rng.normal(scale=NOISE, size=picture.shape)
        store(folder / "images" / f"shot.{k}.png", noisy.repeat(2, axis=0).repeat(2, axis=1))
    return folder


# -- pictures -------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(7, 5), (4, 3), (14, 10), (1, 1), (13, 9)])
def test_area_average_is_the_mean_over_areas(size):
    """Every ratio, whole or not: pixels weighted by the share of them inside the new pixel."""
    image = np.random.default_rng(seed()).random((10, 14, 3))
    found = area_average(image, size)
    height, width = size[1], size[0]

    def shares(old: int, new: int) -> np.ndarray:
        edge = np.arange(new + 1) * old / new
        return np.array([[max(0.0, min(edge[i + 1], j + 1) - max(edge[i], j)) for j in range(old)] for i in range(new)])

    weights = np.einsum("yj,xi->yxji", shares(10, height), shares(14, width))
    wanted = np.einsum("yxji,jic->yxc", weights, image) / weights.sum(axis=(2, 3))[..., None]
    assert found.shape == (height, width, 3)
    assert np.abs(found - wanted).max() < 1e-12
    if size == (14, 10):
        assert np.array_equal(found, image)


def test_transparent_pixels_show_the_background(tmp_path):
    """Composed before they are averaged, as the values are stored."""
    rgba = np.random.default_rng(seed()).integers(0, 256, (6, 8, 4)) / 255.0
    store(tmp_path / "a.png", rgba)
    for behind in ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), BACKGROUND):
        composed = rgba[..., :3] * rgba[..., 3:] + np.array(behind) * (1 - rgba[..., 3:])
        assert np.abs(load_photo(tmp_path / "a.png", (8, 6), behind) - composed).max() < 1e-9
        assert np.abs(load_photo(tmp_path / "a.png", (4, 3), behind) - composed.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))).max() < 1e-9


def test_photographs_are_found_by_name(tmp_path):
    """With or without a suffix, in any case, with dots in the name; a name with a suffix is that file, whatever it holds; images/ before the folder itself;
    two in equal places are refused."""
    cameras, picture = tmp_path / "cameras.json", np.zeros((2, 2, 3))
    assert photo_beside(cameras, "a") is None
    assert photo_beside(cameras, "") is None
    store(tmp_path / "a.png", picture)
    assert photo_beside(cameras, "a") == tmp_path / "a.png"
    store(tmp_path / "images" / "a.JPG", picture)
    store(tmp_path / "images" / "aa.png", picture)
    store(tmp_path / "images" / "b.01.png", picture)
    store(tmp_path / "images" / "left" / "a.png", picture)
    (tmp_path / "images" / "c.txt").write_text("no picture")
    found = {name: photo_beside(cameras, name) for name in ("a", "a.JPG", "b.01", "b", "left/a", "c", "c.txt", "images")}
    assert {name: path and str(path.relative_to(tmp_path)) for name, path in found.items()} == {
        "a": "images/a.JPG", "a.JPG": "images/a.JPG", "b.01": "images/b.01.png", "b": None, "left/a": "images/left/a.png", "c": None,
        "c.txt": "images/c.txt", "images": None,
    }
    store(tmp_path / "train" / "d.png", picture)
    assert photo_beside(cameras, "d") == tmp_path / "train" / "d.png"
    store(tmp_path / "test" / "d.png", picture)
    with pytest.raises(FlickerError, match=r"train/d.png: .*test/d.png is a picture of 'd' too: .*--photos FOLDER"):
        photo_beside(cameras, "d")


# -- measuring ------------------------------------------------------------------------------------------------------------------------


def test_rows_are_against_the_photograph(fitted):
    """The noise of the photograph for float64; a configuration's own error on top; every engine over the same background."""
    target = SceneFile(str(fitted / "fit.ply"), background=BACKGROUND).target(0)
    assert target.size == (WIDTH, HEIGHT)
    view = target.load()
    png = np.asarray(Image.open(fitted / "images" / "shot.0.png"), np.float64)[::2, ::2] / 255.0
    for name in ("faithful", "gscore", "lanes", "vanilla", "oracle-conic"):
        found = evaluate(view, name)
        row = found.row
        assert row["photo_psnr_db"] == pytest.approx(decibels(found.image, png), abs=1e-6), name
        assert row["reference_photo_psnr_db"] == pytest.approx(decibels(view.reference, png), abs=1e-6)
        assert row["reference_photo_psnr_db"] == pytest.approx(-20 * math.log10(NOISE), abs=1.0)  # clamped noise is a little less
        assert row["psnr_db"] > 30 and 0 < row["photo_ssim"] < 1 and 0 < row["reference_photo_ssim"] < 1, name
    black = evaluate(replace(target, scene=replace(target.scene, background=(0.0, 0.0, 0.0))).load(), "lanes").row
    assert black["photo_psnr_db"] < row["photo_psnr_db"] - 5  # the scene leaves much of the picture free
    without = evaluate(SceneFile(str(fitted / "fit.ply"), background=BACKGROUND).target(2, (WIDTH, HEIGHT)).load(), "faithful").row
    assert [without[key] for key in ("photo_psnr_db", "photo_ssim", "reference_photo_psnr_db", "reference_photo_ssim")] == [None] * 4


def test_sizes(fitted):
    """The camera's own with a photograph, the usual one without; any other of the same shape that is not larger."""
    scene = SceneFile(str(fitted / "fit.ply"))
    assert [scene.target(k).size for k in range(VIEWS)] == [(WIDTH, HEIGHT)] * 2 + [SIZE]
    assert replace(scene, photos="none").target(0).size == SIZE and replace(scene, photos="none").target(0).photo is None
    half = scene.target(0, (WIDTH // 2, HEIGHT // 2)).load()
    assert half.photo.shape == (HEIGHT // 2, WIDTH // 2, 3)
    assert scene.target(0, (2 * WIDTH, 2 * HEIGHT)).load().photo.shape == (2 * HEIGHT, 2 * WIDTH, 3)


def test_results_depend_on_looks(fitted, tmp_path):
    """Background and content of the photograph are in the name of a result; where the photograph lies is not."""
    copy = tmp_path / "copy"
    shutil.copytree(fitted, copy)

    def name(folder: Path, **more) -> str:
        return SceneFile(str(folder / "fit.ply"), **more).target(0, (WIDTH, HEIGHT)).key("x")

    shutil.copytree(copy / "images", tmp_path / "else")
    same = {name(fitted), name(copy), name(copy, photos=str(tmp_path / "else"))}
    assert len(same) == 1
    others = [name(copy, background=BACKGROUND), name(copy, photos="none")]
    store(copy / "images" / "shot.0.png", np.zeros((HEIGHT, WIDTH, 3)))
    others.append(name(copy))
    assert len(same | set(others)) == 4


def test_sweep_file_names_photographs(fitted, tmp_path):
    """photos and background of a scene; the camera's size where no size is given; other looks are another sweep."""
    file = tmp_path / "sweep.yaml"

    def loaded(more: str, size: str = ""):
        file.write_text(f"scenes: [{{path: {fitted / 'fit.ply'}{more}}}]\nconfigurations: [lanes]\n{size}")
        return load_sweep(file)

    first = loaded("")
    assert first.targets[0].photo == fitted / "images" / "shot.0.png" and first.targets[0].size == (WIDTH, HEIGHT)
    shutil.copytree(fitted / "images", tmp_path / "pictures")
    given = loaded(", photos: pictures, background: '0.2,0.5,0.8'")
    assert given.targets[0].photo == tmp_path / "pictures" / "shot.0.png" and given.targets[0].scene.background == BACKGROUND
    assert len({s.hash for s in (first, given, loaded(", background: white"), loaded(", photos: none", "size: 64x48"))}) == 4
    for more, size, message in (
        (", background: '2,0,0'", "", r"sweep.yaml: scenes\[0\]: background: expected black, white or r,g,b"),
        (", photos: nowhere", "", r"sweep.yaml: scenes\[0\]: photos: .*nowhere: no such folder"),
        ("", "size: 64x64", r"sweep.yaml: scenes\[0\]: .*shot.0.png: is 128x96, which is not the shape of 64x64"),
    ):
        with pytest.raises(FlickerError, match=message):
            loaded(more, size)


# -- judging --------------------------------------------------------------------------------------------------------------------------


def table_1(verdicts) -> list:
    return [v for v in verdicts if v.figure == "Table 1" and v.kind != "open"]


@pytest.mark.slow
def test_table_1_is_measured(fitted, tmp_path):
    """Losses are means of the views' own, their figures are in the verdict; the view without photograph is judged apart, by the assumption."""
    names = [claims.NO_CTU, claims.FAITHFUL]
    targets = check([f"{fitted / 'fit.ply'}:all"], tmp_path / "out", None, names, tmp_path / "store", background=BACKGROUND).targets
    targets = [replace(t, size=(WIDTH, HEIGHT)) for t in targets]
    assert len(targets) == VIEWS
    views = collect(targets, names, Store(tmp_path / "store"))
    rows = [v.rows for v in views[: VIEWS - 1]]
    base, without, ours = (
        np.mean([r[claims.FAITHFUL]["reference_photo_psnr_db"] for r in rows]), *(np.mean([r[n]["photo_psnr_db"] for r in rows]) for n in names),
    )
    whole, ssim, test, _ = (v for v in table_1(claims.all_verdicts(views, {})) if "measured against photographs" in v.verdict)
    whole, test, ssim = sorted((whole, ssim, test), key=lambda v: ("SSIM" in v.claim, "Of it" in v.claim))
    for verdict, name, db in ((whole, "float64", base), (test, claims.NO_CTU, without)):
        text = verdict.ours["fit, 2 views"]
        assert text.startswith(f"{db - ours:.3f} dB (")
        assert f"{name} {db:.2f} dB" in text and f"faithful {ours:.2f} dB" in text
        assert (verdict.kind == "yes") == (db - ours <= 0.11)
    assert ssim.kind in ("yes", "no") and f"faithful {ours:.2f} dB" in ssim.ours["fit, 2 views"]
    assumed = [v for v in table_1(claims.all_verdicts(views, {})) if "no photographs" in v.verdict]
    assert len(assumed) == 4 and all(set(v.ours) == {"fit 2"} for v in assumed)
    assert all("assumed uncorrelated errors; no photographs" in v.verdict for v in assumed if "SSIM" not in v.claim)
    published = [v for v in claims.published_verdicts(by_scene(views[: VIEWS - 1])) if v.figure == "Table 1"]
    assert [v.ours for v in published] == [{"fit, 2 views": f"{base:.2f} dB, float64"}, {}, {"fit, 2 views": f"{ours:.2f} dB, faithful"}]
    assert not any(v.ours for v in claims.published_verdicts(by_scene(views[VIEWS - 1:])))
    figure = figures.contribution_test(views)
    columns = [figure.header.index(c) for c in ("photo_psnr_db_with", "loss_db_by_test", "loss_is")]
    assert [row[columns[2]] for row in figure.rows] == ["measured"] * 2 + ["assumed at 25.99 dB"]
    for row, own in zip(figure.rows, rows):
        assert row[columns[0]] == own[claims.FAITHFUL]["photo_psnr_db"]
        assert row[columns[1]] == pytest.approx(own[claims.NO_CTU]["photo_psnr_db"] - own[claims.FAITHFUL]["photo_psnr_db"])


def made(name: str, number: int, photo: float | None) -> ViewResult:
    view = ViewResult(Target(SceneFile(f"{name}.ply"), number, (8, 8)))
    for config, psnr, seen in (("faithful", 40.0 + number, photo), (claims.NO_CTU, 60.0, None if photo is None else photo + 0.3 * number)):
        view.rows[config] = {"psnr_db": psnr, "ssim": 0.99, "photo_psnr_db": seen, "photo_ssim": None if seen is None else 0.9, "model_only": True,
                             "reference_photo_psnr_db": None if photo is None else 31.0, "reference_photo_ssim": None if photo is None else 0.95}
    view.facts = {"fifo": {"depth": [1, 2], "cycles": [10 * (number + 1), 4]}, "chip": {"faithful": {"bottleneck": "sort" if number else "memory"}}}
    return view


def test_views_of_a_scene_are_averaged():
    """Numbers, lists and facts by their mean; words by what is frequent; an "up to" is still of single views."""
    views = [made("one", k, 30.0) for k in range(3)] + [made("two", 0, None)]
    one, two = by_scene(views)
    assert (one.title, two.title, one.count) == ("one, 3 views", "two 0", 3)
    assert one.rows["faithful"]["psnr_db"] == 41.0 and one.rows["faithful"]["photo_psnr_db"] == 30.0 and one.rows["faithful"]["model_only"] is True
    assert one.facts == {"fifo": {"depth": [1.0, 2.0], "cycles": [20.0, 4.0]}, "chip": {"faithful": {"bottleneck": "sort"}}}
    assert one.photographed and not two.photographed and two.rows["faithful"]["photo_psnr_db"] is None
    claim = claims.Claim("3a", "text", "", lambda v: v.rows["faithful"]["psnr_db"], lambda x: x > 41, "above 41")
    assert claim.verdicts(views)[0].ours == {"one, 3 views": "41.00", "two 0": "40.00"}
    best = replace(claim, best=True).verdicts(views)[0]
    assert best.kind == "yes" and best.ours["largest"] == "42.00" and len(best.ours) == 5


def test_verdicts_say_what_was_measured():
    """Photographs decide where there are some; elsewhere the assumption, which says so. The same rows give other verdicts."""
    loss = next(c for c in claims.claims() if c.text.startswith("Of it the contribution test"))
    measured, assumed = loss.verdicts([made("one", k, 30.0) for k in range(3)] + [made("two", 0, None)])
    assert measured.kind == "no" and measured.ours["one, 3 views"].startswith("0.300 dB (")
    assert "mean 0.300 dB; asked for: mean at most 0.11 dB, measured against photographs" in measured.verdict
    assert "30.30 dB with no-ctu-32-conic, 30.00 dB with faithful, which is 41.0 dB from float64" in measured.verdict
    expected = claims.drop(40.0, claims.PAPER_PRUNED_PSNR) - claims.drop(60.0, claims.PAPER_PRUNED_PSNR)
    assert assumed.ours == {"two 0": f"{expected:.3f} dB"}
    assert assumed.verdict.endswith("mean at most 0.11 dB at 25.99 dB, assumed uncorrelated errors; no photographs)")
    assert [len(loss.verdicts([made("two", 0, photo)])) for photo in (None, 30.0)] == [1, 1]


def test_every_loss_asks_for_photographs():
    """No claim about a loss of quality is judged by the assumption without a word of it."""
    told = {c.text for c in claims.claims() if c.unmeasured}
    for claim in claims.claims():
        view = made("one", 1, None)
        for name in (claims.DENSE, claims.SPARSE, claims.SMOOTH, claims.SPIKY, claims.WIDE, claims.NARROW):
            view.rows[name] = {"psnr_db": 50.0, "ssim": 0.9}
        seen = made("one", 1, 30.0)
        seen.rows |= {name: row | {"photo_psnr_db": 20.0, "photo_ssim": 0.5} for name, row in view.rows.items() if name not in seen.rows}
        seen.rows[claims.FAITHFUL]["photo_psnr_db"] = 25.0
        view.facts = seen.facts = {}
        try:
            changed = claim.measure(view) != claim.measure(seen)
        except KeyError:
            continue
        assert not changed or claim.text in told, claim.text


# -- bad input ------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("arguments", "message"), [
    (["FIT", "--size", "64x64"], r"images/shot.0.png: is 128x96, which is not the shape of 64x64: leave out the size, or the photographs \(--photos none\)"),
    (["FIT", "--size", "256x192"], r"images/shot.0.png: is 128x96, smaller than the picture of 256x192"),
    (["FIT:2", "--photos", "FOLDER/images"], r"photos: .*images: no picture 'shot.2'"),
    (["FIT", "--photos", "FOLDER/nowhere"], r"photos: .*nowhere: no such folder"),
    (["FIT:3"], r"fit.ply: view 3: there are 3 cameras, 0 to 2"),
    (["FIT:2-1"], r"fit.ply: views 2-1: there are none"),
    (["FIT", "--background", "1,0"], r"--background: expected black, white or r,g,b with numbers from 0 to 1, not '1,0'"),
    (["FIT", "--background", "nan,0,0"], r"--background: expected black, white"),
    (["--photos", "FOLDER/images"], r"photos: demo: view 0 has no 'img_name'"),
    (["LONE", "--photos", "FOLDER/images"], r"photos: .*lone.ply: view 0 has no 'img_name' in a cameras.json"),
    (["FIT", "--photos", "FOLDER/text"], r"text/shot.0.png: not a picture"),
    (["FIT", "--photos", "FOLDER/twice"], r"shot.0.jpg: .*shot.0.png is a picture of 'shot.0' too"),
])
def test_bad_input(fitted, tmp_path, monkeypatch, arguments, message):
    """One line that names the file, before any work."""
    monkeypatch.setattr("flicker.report.write.write_report", lambda *a: pytest.fail("work has begun"))
    folder = tmp_path / "fit"
    shutil.copytree(fitted, folder)
    (folder / "text").mkdir()
    (folder / "text" / "shot.0.png").write_text("no picture")
    for suffix in ("png", "jpg"):
        store(folder / "twice" / f"shot.0.{suffix}", np.zeros((HEIGHT, WIDTH, 3)))
    (tmp_path / "lone").mkdir()
    shutil.copy(folder / "fit.ply", tmp_path / "lone" / "lone.ply")
    words = {"FIT": str(folder / "fit.ply"), "LONE": str(tmp_path / "lone" / "lone.ply"), "FOLDER": str(folder)}
    filled = [re.sub("FIT|LONE|FOLDER", lambda m: words[m[0]], a) for a in arguments]
    result = CliRunner().invoke(app, ["report", *filled, "--out", str(tmp_path / "out"), "--store", str(tmp_path / "store")])
    assert isinstance(result.exception, FlickerError), result.output
    assert re.search(message, str(result.exception)) and "\n" not in str(result.exception), result.exception


def test_deep_pictures(tmp_path):
    """Grey of 16 bits is scaled, not cut, upright or turned, one value of it transparent; 32 bits and floats are refused."""
    values = np.linspace(0, 65535, 24).astype(np.uint16).reshape(4, 6)
    for suffix in (".png", ".tif"):
        Image.fromarray(values).save(tmp_path / f"deep{suffix}")
        assert np.array_equal(load_photo(tmp_path / f"deep{suffix}", (6, 4)), np.repeat(values[..., None] / 65535, 3, axis=2))
        assert load_coverage(tmp_path / f"deep{suffix}") is None
    exif = Image.Exif()
    exif[274] = 6
    Image.fromarray(values).save(tmp_path / "lying.png", exif=exif)
    assert np.array_equal(load_picture(tmp_path / "lying.png")[..., 0], np.rot90(values, -1) / 65535)
    Image.fromarray(values).save(tmp_path / "hole.png", transparency=int(values[1, 2]))
    assert load_picture(tmp_path / "hole.png", (0.25, 0.5, 0.75))[1, 2].tolist() == [0.25, 0.5, 0.75]
    assert np.argwhere(load_coverage(tmp_path / "hole.png") == 0).tolist() == [[1, 2]]
    for mode in ("I", "F"):
        Image.new(mode, (4, 4)).save(tmp_path / "deeper.tif")
        with pytest.raises(FlickerError, match=f"deeper.tif: pixels of mode {mode} are not read"):
            load_photo(tmp_path / "deeper.tif", (4, 4))


def test_parse_background():
    assert [parse_background(text) for text in ("white", "0.25,0,1")] == [(1.0, 1.0, 1.0), (0.25, 0.0, 1.0)]


# -- a real photograph ----------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_lego_loses_what_photographs_show():
    """Test view 1 of the fit of lego: float64 and lanes are as near to the photograph, `faithful` is more than a decibel farther."""
    scenes = real_scenes()
    if scenes is None or not (scenes / "lego" / "scene.ply").exists():
        pytest.skip("FLICKER_SCENES names no folder with lego")
    target = SceneFile(str(scenes / "lego" / "scene.ply")).target(1)
    view = target.load()
    rgba = np.asarray(Image.open(scenes / "lego" / "images" / "r_8.png"), np.float64) / 255.0
    rows = {name: evaluate(view, name).row for name in ("no-ctu-32-conic", "faithful", "lanes")}
    base = rows["faithful"]["reference_photo_psnr_db"]
    assert target.size == (400, 400) and base == pytest.approx(decibels(view.reference, rgba[..., :3] * rgba[..., 3:]), abs=1e-6)
    assert 35 < base < 36.5
    assert base - rows["lanes"]["photo_psnr_db"] == pytest.approx(0, abs=0.02)
    assert base - rows["no-ctu-32-conic"]["photo_psnr_db"] == pytest.approx(0, abs=0.02)
    assert 1.3 < base - rows["faithful"]["photo_psnr_db"] < 1.8
    assert 0.003 < rows["no-ctu-32-conic"]["photo_ssim"] - rows["faithful"]["photo_ssim"] < 0.007
