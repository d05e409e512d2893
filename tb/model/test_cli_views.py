"""Which scene, cameras and size the commands take, what they say of it, and what `flicker render` writes: every view, background, depth, alpha.

Scenes are of a few Gaussians, small enough to know the picture by hand. Not covered: engines of the RTL, whose pictures equal the golden model's (tb/frames).
"""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from flicker_tb.command import flicker
from PIL import Image

from flicker.budget.views import cameras_of
from flicker.cli.main import app
from flicker.cli.options import parse_view, writable_folder
from flicker.errors import FlickerError
from flicker.explore.points import SceneFile
from flicker.explore.sweep.config import load_sweep
from flicker.front.unseen import BEHIND, FAINT, INSIDE, places, unseen
from flicker.front.view import load_view
from flicker.report.write import parse_targets
from flicker.scene.camera import Camera, cameras_beside, cameras_text, load_cameras
from flicker.scene.files import Scene, load_scene, save_ply
from flicker.scene.folders import trained_scene
from flicker.scene.image import load_picture
from flicker.scene.sources import open_scene, read_scene, scene_path
from flicker.view.pose import Pose, close

WHITE = 0.5 / 0.28209479177387814  # the constant harmonic of colour 1


def balls(*means: tuple[float, float, float], opacity: float = 0.9, size: float = 0.3, rgb: tuple[float, float, float] = (1, 1, 1)) -> Scene:
    n = len(means)
    sh = np.tile((2 * np.array(rgb) - 1) * WHITE, (n, 1))[:, None]
    return Scene(np.array(means, float), np.full((n, 3), size), np.tile([1.0, 0, 0, 0], (n, 1)), np.full(n, opacity), sh)


def camera(width: int = 48, height: int = 80, focal: float = 100.0, **more: Any) -> Camera:
    """At (0, 0, -6), looking along z."""
    return Camera(width, height, focal, focal, np.array([0.0, 0, -6]), np.eye(3), **more)


def stored(folder: Path, scene: Scene, *cameras: Camera) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    save_ply(scene, folder / "s.ply")
    (folder / "cameras.json").write_text(cameras_text(cameras))
    return folder / "s.ply"


def run(*arguments: object) -> str:
    """What a command says that succeeds."""
    done = flicker(*arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def refused(*arguments: object) -> str:
    done = flicker(*arguments)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def grey(path: Path) -> np.ndarray:
    picture = Image.open(path)
    assert picture.mode == "I;16"
    return np.asarray(picture).astype(np.float64)


def spread(picture: np.ndarray) -> tuple[float, float]:
    """Standard deviations of what is drawn along x and y, pixels."""
    weight = picture.sum(axis=2) / picture.sum()
    y, x = np.indices(weight.shape)
    return tuple(float(np.sqrt((weight * (v - (weight * v).sum()) ** 2).sum())) for v in (x, y))  # type: ignore[return-value]


# ---- size


@pytest.mark.parametrize("size", ["128x80", "48x40", "40x40"])
def test_a_ball_stays_round(size: str, tmp_path: Path) -> None:
    """At another aspect ratio too, and as large a part of the height as before."""
    path = stored(tmp_path, balls((0, 0, 0), size=0.4), camera())
    run("render", path, "--engine", "reference", "--out", tmp_path / "own.png")
    run("render", path, "--engine", "reference", "--size", size, "-o", tmp_path / "other.png")
    own, other = (spread(load_picture(tmp_path / name)) for name in ("own.png", "other.png"))
    assert other[0] == pytest.approx(other[1], rel=0.01)
    assert other[1] / int(size.split("x")[1]) == pytest.approx(own[1] / 80, rel=0.04)


def test_one_rule_for_every_command(tmp_path: Path) -> None:
    """The camera of render, view, chip, cost (`load_view`), sweep, report and budget at a size is the same one."""
    path = stored(tmp_path, balls((0, 0, 0)), *(camera(cx=20.0) for _ in range(6)))
    wanted = load_cameras(tmp_path / "cameras.json")[0].resized(160, 90)
    assert wanted.fx == wanted.fy == pytest.approx(100 * 90 / 80)
    (tmp_path / "sweep.yaml").write_text("scenes: [s.ply]\nsize: 160x90\nconfigurations: [flicker]\n")
    given = [
        load_view(path, 0, (160, 90)).camera, load_sweep(tmp_path / "sweep.yaml").targets[0].load().camera,
        parse_targets(str(path), (160, 90))[0].load().camera, cameras_of(load_scene(path), tmp_path / "cameras.json", size=(160, 90))[1][0],
    ]
    assert all(close(c, wanted) and c.cx == wanted.cx for c in given)
    # The browser's camera keeps what its numbers do not say.
    back = Pose.of(wanted).camera(wanted)
    assert close(back, wanted) and back.cx == pytest.approx(wanted.cx) and back.fx == pytest.approx(back.fy)
    assert not close(back, Camera(160, 90, back.fx, back.fy, back.position, back.rotation))


# ---- scenes and cameras


def trained(folder: Path, *iterations: str) -> Path:
    """An output folder as the INRIA code writes it."""
    for k, name in enumerate(iterations):
        place = folder / "point_cloud" / name
        place.mkdir(parents=True)
        save_ply(balls(*[(0, 0, 0)] * (k + 1)), place / "point_cloud.ply")
    (folder / "cameras.json").write_text(cameras_text([camera(), camera()]))
    save_ply(balls((9, 9, 9)), folder / "input.ply")
    return folder


def test_output_folder_of_a_trainer(tmp_path: Path) -> None:
    """The highest iteration as a number, cameras from the folder's top, both said; an iteration and its PLY mean themselves."""
    folder = trained(tmp_path / "out", "iteration_7000", "iteration_30000", "iteration_900")
    best, clouds = folder / "point_cloud" / "iteration_30000" / "point_cloud.ply", folder / "point_cloud"
    for given in (folder, clouds, best.parent, best):
        source = open_scene(given)
        assert (len(source.scene), len(source.cameras), source.file, source.cameras_from) == (2, 2, str(best), str(folder / "cameras.json")), given
    assert len(read_scene(clouds / "iteration_7000")) == 1 and trained_scene(tmp_path) is None and scene_path(tmp_path) is tmp_path
    assert cameras_beside(best) == folder / "cameras.json"
    (clouds / "iteration_40000").mkdir()
    assert trained_scene(folder) == best  # nothing in it
    (clouds / "iteration_50000").mkdir()
    shutil.copy(best, clouds / "iteration_50000" / "point_cloud_rk0.ply")
    assert trained_scene(folder).parent.name == "iteration_50000"
    shutil.rmtree(clouds / "iteration_50000")
    assert "iteration_30000" in "".join(run("convert", folder, tmp_path / "c.ply").split()) and len(load_scene(tmp_path / "c.ply")) == 2
    told = run("render", folder, "--engine", "reference", "--stats", tmp_path / "s.json")
    stats = json.loads((tmp_path / "s.json").read_text())
    assert (stats["scene"], stats["cameras"]) == (str(best), str(folder / "cameras.json"))
    assert "iteration_30000" in "".join(c for c in told if c not in "│\n ") and "cameras.json" in told
    shutil.copy(best, folder / "point_cloud" / "s.ply")  # not of an iteration: no camera of the folder's
    assert cameras_beside(folder / "point_cloud" / "s.ply") is None
    assert parse_targets(str(folder), (32, 32))[0].scene.path == str(best)
    (tmp_path / "sweep.yaml").write_text("scenes: [out]\nsize: 32x32\nconfigurations: [flicker]\n")
    assert load_sweep(tmp_path / "sweep.yaml").targets[0].scene.path == str(best.resolve())


def test_which_cameras_is_said(tmp_path: Path) -> None:
    """A file by its name, an orbit by its axis and by what is not taken; in what commands print and write."""
    path = stored(tmp_path, balls((0, 0, 0), (0.5, 0.2, 0)), camera())
    for words in (("cost",), ("chip",)):
        assert f"cameras: {tmp_path / 'cameras.json'}" in run(*words, path, "--size", "32x32")
    assert SceneFile(str(path)).cameras_from == str(tmp_path / "cameras.json") and "demo" in SceneFile("demo").cameras_from
    (tmp_path / "cameras.json").rename(tmp_path / "given.json")
    (tmp_path / "transforms.json").write_text("{}")
    run("render", path, "--engine", "reference", "--size", "32x32", "--up", "z", "--stats", tmp_path / "s.json")
    said = json.loads((tmp_path / "s.json").read_text())["cameras"]
    assert said == f"orbit of 8, up z; not {tmp_path / 'transforms.json'}, which --cameras takes"
    run("render", path, "--engine", "reference", "--cameras", tmp_path / "given.json", "--stats", tmp_path / "s.json")
    assert json.loads((tmp_path / "s.json").read_text())["cameras"] == str(tmp_path / "given.json")


def test_photographs_beside_other_formats(tmp_path: Path) -> None:
    """Those of a transforms.json and of a COLMAP model are found as those of a cameras.json."""
    path = stored(tmp_path, balls((0, 0, 0)), camera())
    (tmp_path / "cameras.json").unlink()
    model = tmp_path / "data" / "sparse" / "0"
    model.mkdir(parents=True)
    (model / "cameras.txt").write_text("1 PINHOLE 48 80 100 100 24 40\n")
    (model / "images.txt").write_text("1 1 0 0 0 0 0 6 1 a.png\n\n")
    pose = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -6], [0, 0, 0, 1]]
    nerf = {"fl_x": 100, "w": 48, "h": 80, "frames": [{"file_path": "./images/a", "transform_matrix": pose}]}
    (tmp_path / "data" / "transforms.json").write_text(json.dumps(nerf))
    (tmp_path / "data" / "images").mkdir()
    Image.new("RGB", (48, 80)).save(tmp_path / "data" / "images" / "a.png")
    digests = set()
    for cameras in (model, tmp_path / "data", tmp_path / "data" / "transforms.json"):
        scene = SceneFile(str(path), str(cameras))
        assert scene.photo(0) == tmp_path / "data" / "images" / "a.png" and scene.target(0).size == (48, 80)
        digests.add(scene.digest)
    assert len(digests) == 2  # of contents
    (model / "images.txt").write_text("1 1 0 0 0 0 0 7 1 a.png\n\n")
    assert SceneFile(str(path), str(model)).digest not in digests


def test_photographs_of_colmap_are_as_they_are_stored(tmp_path: Path) -> None:
    """By half a turn, of which both have the shape: COLMAP's camera is of the stored pixels, that of a transforms.json of the upright ones."""
    path = stored(tmp_path, balls((0, 0, 0)), camera())
    (tmp_path / "cameras.json").unlink()
    model = tmp_path / "data" / "sparse" / "0"
    model.mkdir(parents=True)
    (model / "cameras.txt").write_text("1 PINHOLE 48 80 100 100 24 40\n")
    (model / "images.txt").write_text("1 1 0 0 0 0 0 6 1 sub\\a.png\n\n")  # as on Windows
    (tmp_path / "data" / "images" / "sub").mkdir(parents=True)
    values = np.arange(48 * 80, dtype=np.uint16).reshape(80, 48) * 17
    exif = Image.Exif()
    exif[274] = 3
    Image.fromarray(values).save(tmp_path / "data" / "images" / "sub" / "a.png", exif=exif)
    pose = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -6], [0, 0, 0, 1]]
    nerf = {"fl_x": 100, "w": 48, "h": 80, "frames": [{"file_path": "images/sub/a", "transform_matrix": pose}]}
    (tmp_path / "data" / "transforms.json").write_text(json.dumps(nerf))
    for cameras, wanted in ((model, values), (tmp_path / "data" / "transforms.json", values[::-1, ::-1])):
        scene = SceneFile(str(path), str(cameras))
        assert np.array_equal(scene.target(0).load().photo[..., 0], wanted / 65535)


def test_demo_is_a_scene_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its name, with a title; its own cameras unless others are given."""
    monkeypatch.setattr("flicker.scene.demo.generate", lambda: balls((0, 0, 0)))
    told = run("render", "demo", "--engine", "reference", "--size", "32x18", "--stats", tmp_path / "s.json")
    assert told.strip().startswith("demo, view 0, 32x18") and json.loads((tmp_path / "s.json").read_text())["scene"] == "demo"
    assert [t.title for t in parse_targets("demo:1-2", (32, 32))] == ["demo 1", "demo 2"] and parse_targets("demo", None)[0].scene.path == "demo"
    stored(tmp_path, balls((0, 0, 0)), camera())
    view = load_view("demo", 0, cameras=tmp_path / "cameras.json")
    assert (view.camera.width, view.cameras_from) == (48, str(tmp_path / "cameras.json"))
    with pytest.raises(FlickerError, match="up: z: .*the demo scene has its own"):
        open_scene("demo", up="z")


def test_out_is_o_everywhere() -> None:
    """Every option --out; of `convert` it is an argument."""
    commands = typer.main.get_command(app).commands
    found = {name: next(p for p in command.params if p.name == "out") for name, command in commands.items() if any(p.name == "out" for p in command.params)}
    for name, parameter in found.items():
        assert parameter.param_type_name == "argument" or "-o" in parameter.opts, name
    assert {"render", "chip", "cost", "report", "stability", "sweep", "budget", "fit", "pack", "undistort"} <= set(found)


# ---- empty pictures


def test_why_nothing_is_seen(tmp_path: Path) -> None:
    """Counts of where the Gaussians are, and what to try."""
    c = camera()
    means = [(0, 0, -9), (0, 0, -5.9), (-30, 0, 0), (30, 1, 0), (30, 0, 3), (0, -40, 0), (0, 40, 0), (0, 0, 0), (0, 0, 1)]
    scene = balls(*means)
    scene.opacities[-1] = 0.003
    assert places(scene, c) == {
        BEHIND: 2, "left of the picture": 1, "right of the picture": 2, "above the picture": 1, "below the picture": 1, FAINT: 1, INSIDE: 1,
    }
    path = stored(tmp_path, balls(*means[:6]), c, c)
    view = load_view(path, background=(0.5, 0.5, 0.5))
    grey_picture = np.full((80, 48, 3), 0.5)
    assert unseen(view, grey_picture) == unseen(view, np.ones((80, 48, 3)), 0) == places(view.scene, c)
    assert unseen(view, np.ones((80, 48, 3))) is None and unseen(view, grey_picture + np.eye(80, 48)[..., None] * 0.1, 7) is None
    for engine in ("reference", "golden", "chip-golden"):
        told = run("render", path, "--engine", engine, "--stats", tmp_path / "s.json")
        stats = json.loads((tmp_path / "s.json").read_text())
        assert stats["visible"] == 0 and stats["unseen"] == {
            BEHIND: 2, "left of the picture": 1, "right of the picture": 2, "above the picture": 1,
        }
        assert "another --view (0 to 1)" in stats["advice"] and "--cameras" in stats["advice"] and "nothing is seen" in told
    assert "nothing is seen: behind" in run("cost", path, "--view", 1) and "nothing is seen: behind" in run("chip", path)
    path = stored(tmp_path, balls((0, 0, 0), opacity=0.003), c)
    run("render", path, "--engine", "reference", "--background", "white", "--stats", tmp_path / "s.json")
    stats = json.loads((tmp_path / "s.json").read_text())
    assert stats["unseen"] == {FAINT: 1} and "too faint" in stats["advice"]
    path = stored(tmp_path, balls((0, 0, 0)), c)
    run("render", path, "--engine", "reference", "--stats", tmp_path / "s.json")
    assert "unseen" not in json.loads((tmp_path / "s.json").read_text())


# ---- every view, background, depth, alpha


def test_every_view(tmp_path: Path) -> None:
    """The pictures of single runs, numbered, into a folder or by a pattern; statistics are a list; nothing when a name does not fit."""
    path = stored(tmp_path, balls((0, 0, 0), (0.6, 0, 1)), camera(), camera(40, 40), camera(32, 48))
    told = run("render", path, "--view", "all", "-o", tmp_path / "new" / "deep", "--alpha", tmp_path / "new" / "a%d.png", "--stats", tmp_path / "s.json")
    stats = json.loads((tmp_path / "s.json").read_text())
    assert [(s["view"], s["width"], s["alpha"]["file"]) for s in stats] == [(k, w, str(tmp_path / "new" / f"a{k}.png")) for k, w in enumerate((48, 40, 32))]
    assert sorted(p.name for p in (tmp_path / "new").rglob("*.png")) == ["a0.png", "a1.png", "a2.png", *(f"view_{k:03d}.png" for k in range(3))]
    run("render", path, "--view", 1, "--out", tmp_path / "one.png", "--stats", tmp_path / "one.json")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "new" / "deep" / "view_001.png").read_bytes()
    single = json.loads((tmp_path / "one.json").read_text())
    assert {k: v for k, v in stats[1].items() if k != "alpha"} == single and "32x48" in told
    before = sorted(tmp_path.rglob("*"))
    for arguments, words in (
        (("--out", tmp_path / "x.png"), "--out: .*view_%03d.png"), (("--out", tmp_path / "%d%d.png"), "--out"), (("--out", tmp_path / "%s.png"), "--out"),
        (("--out", tmp_path / "one.json"), "--out: .*not a folder"),
        (("--out", tmp_path / "%d.png", "--depth", tmp_path / "%d.png"), "is the file of --out too"),
    ):
        assert re.search(words, refused("render", path, "--view", "all", *arguments)), arguments
    assert sorted(tmp_path.rglob("*")) == before
    assert parse_view("all") is None and parse_view("-1") == -1
    assert "--view: expected" in refused("render", path, "--view", "some")


@pytest.mark.parametrize("engine", ["reference", "golden", "chip-golden"])
def test_background(engine: str, tmp_path: Path) -> None:
    """Where nothing is it shows as it is; under a Gaussian as much as alpha lets through."""
    path = stored(tmp_path, balls((0, 0, 0), rgb=(1, 0.5, 0)), camera(40, 40))
    pictures = {}
    for text in ("black", "white", "0.2,0.4,0.6"):
        run("render", path, "--engine", engine, "--background", text, "--out", tmp_path / "p.png", "--stats", tmp_path / "s.json")
        pictures[text] = load_picture(tmp_path / "p.png")
    assert json.loads((tmp_path / "s.json").read_text())["background"] == [0.2, 0.4, 0.6]
    assert np.allclose(pictures["0.2,0.4,0.6"][0, 0], [0.2, 0.4, 0.6], atol=0.002)
    assert (pictures["white"][0, 0] == 1).all() and (pictures["black"][0, 0] == 0).all()
    clear = pictures["white"] - pictures["black"]
    assert clear[20, 20, 2] == pytest.approx(0.1, abs=0.02)
    assert np.abs(pictures["0.2,0.4,0.6"] - pictures["black"] - clear * [0.2, 0.4, 0.6]).max() < 2.1 / 255
    if engine == "golden":
        assert "--background: expected" in refused("render", path, "--background", "pink")


@pytest.mark.parametrize("options", [("--engine", "reference"), ("--engine", "golden"), ("--engine", "golden", "--stage", "channels"),
                                     ("--engine", "reference", "--front", "golden")])
def test_alpha(options: tuple[str, ...], tmp_path: Path) -> None:
    """That of the engine: what a white background does not add."""
    path = stored(tmp_path, balls((0, 0, 0), (0.1, 0, 1)), camera(40, 40))
    for text in ("black", "white"):
        run("render", path, *options, "--background", text, "--out", tmp_path / f"{text}.png", "--alpha", tmp_path / "a.png", "--stats", tmp_path / "s.json")
    clear = (load_picture(tmp_path / "white.png") - load_picture(tmp_path / "black.png"))[..., 0]
    alpha = grey(tmp_path / "a.png") / 65535
    assert np.abs(1 - clear - alpha).max() < 1.1 / 255 and alpha.max() > 0.9 and alpha.min() == 0
    assert json.loads((tmp_path / "s.json").read_text())["alpha"] == {"file": str(tmp_path / "a.png"), "of": options[1], "step": 1 / 65535}


def test_depth(tmp_path: Path) -> None:
    """Of the reference whatever the engine: along the axis, by share of the picture, 0 where nothing is."""
    near, far = balls((0, 0, 0), opacity=0.5, size=1.0), balls((0, 0, 4), opacity=0.8, size=1.0)
    both = Scene(*(np.concatenate([getattr(near, n), getattr(far, n)]) for n in ("means", "scales", "quats", "opacities", "sh")))
    path = stored(tmp_path, both, camera(401, 401))
    run("render", path, "--engine", "golden", "--size", "41x41", "--depth", tmp_path / "d.png", "--stats", tmp_path / "s.json")
    said, values = json.loads((tmp_path / "s.json").read_text())["depth"], grey(tmp_path / "d.png")
    assert said["of"] == "float64 reference" and said["file"] == str(tmp_path / "d.png")
    middle = (0.5 * 6 + 0.5 * 0.8 * 10) / (0.5 + 0.5 * 0.8)
    assert values[20, 20] * said["step"] == pytest.approx(middle, abs=2e-3) and said["farthest"] == pytest.approx(values.max() * said["step"])
    ball = stored(tmp_path / "ball", balls((1, 0.5, 0)), camera(80, 80))
    run("render", ball, "--engine", "reference", "--depth", tmp_path / "d.png", "--stats", tmp_path / "s.json")
    said, values = json.loads((tmp_path / "s.json").read_text())["depth"], grey(tmp_path / "d.png")
    seen = values > 0
    assert np.ptp(values[seen]) == 0 and values.max() == 65535 and values.max() * said["step"] == pytest.approx(6) and not seen[0, 0]
    assert said["nearest"] == pytest.approx(6)


def test_what_has_no_alpha(tmp_path: Path) -> None:
    path = stored(tmp_path, balls((0, 0, 0)), camera(32, 32))
    for engine in ("chip", "chip-golden"):
        assert f"--alpha: not with --engine {engine}" in refused("render", path, "--engine", engine, "--alpha", tmp_path / "a.png")
    for option in ("--depth", "--alpha"):
        assert f"{option}: " in refused("render", path, option, tmp_path / "a.jpg")
    assert "is the file of --out too" in refused("render", path, "--out", tmp_path / "a.png", "--alpha", tmp_path / "a.png")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cameras.json", "s.ply"]


def test_folder_of_the_viewer_comes_first(tmp_path: Path) -> None:
    """Before the scene is looked at; what could not be written into is refused, and nothing is left behind."""
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "deeper", Path("/proc/none/stills")):
        assert "--dir: " in refused("view", tmp_path / "none.ply", "--dir", folder)
    writable_folder(tmp_path / "a" / "b", "--dir")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]
    if os.getuid():
        (tmp_path / "locked").mkdir(mode=0o500)
        assert "--dir: " in refused("view", "demo", "--dir", tmp_path / "locked" / "stills")


@pytest.mark.parametrize("name", ["cam_portrait", "cam_transforms", "cam_path"])
def test_cases(name: str, tmp_path: Path) -> None:
    """A letter F, upright: its red stem left, its green arm above the blue one; twice as wide a picture leaves its shape."""
    if "FLICKER_CASES" not in os.environ:
        pytest.skip("FLICKER_CASES names no folder of cases")
    path = Path(os.environ["FLICKER_CASES"]) / name / "s.ply"
    pictures = []
    for size in ("160x160", "320x160"):
        run("render", path, "--engine", "reference", "--size", size, "--out", tmp_path / "p.png")
        picture = load_picture(tmp_path / "p.png")
        place = [np.argwhere((picture[..., k] > 0.3) & (picture.argmax(axis=2) == k)) for k in range(3)]
        assert place[0][:, 1].mean() < place[1][:, 1].mean() and place[1][:, 0].mean() < place[2][:, 0].mean()
        pictures.append(picture)
    assert np.abs(pictures[0] - pictures[1][:, 80:240]).max() < 3 / 255
