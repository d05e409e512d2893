"""`flicker path`: videos and figures of a camera path, interrupted, resumed, on full disks, and what it refuses.

Not covered: what players make of the videos; engines in RTL, which `flicker render` has the tests of.
"""

from __future__ import annotations

import csv
import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.command import flicker
from PIL import Image, ImageChops
from test_terminal import full_disk

from flicker.chip.compare import chip_estimates
from flicker.cli.engine import parse_engine
from flicker.errors import FlickerError
from flicker.front.view import load_view
from flicker.motion import frames as motion_frames
from flicker.motion.frames import Wanted, frames
from flicker.motion.video import durations, write_video
from flicker.perf.timing import Timing
from flicker.scene.camera import cameras_text, load_cameras, orbit_camera
from flicker.scene.files import load_scene, save_ply
from flicker.scene.metrics import flip, psnr, ssim

SIZE = (48, 32)
COUNT = 6
PAN = ("--pan", 0.5, "--frames", COUNT)
GOLDEN = ("--engine", "golden", "--front", "golden")


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """The pictures are too small to share among threads, which wait for each other."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(threads)


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small scene with cameras beside it, as the current folder."""
    scene = samples.random_scene(1, 150, 1)
    scene.scales *= np.float32(3.0)
    save_ply(scene, tmp_path / "scene.ply")
    (tmp_path / "cameras.json").write_text(cameras_text([orbit_camera(scene, k, 24, *SIZE) for k in range(4)]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def path(*words: object, code: int = 0):
    done = flicker("path", "scene.ply", *words)
    assert done.returncode == code, done.stderr or done.stdout
    return done


def rows(file: str = "a.csv") -> list[dict[str, str]]:
    return list(csv.DictReader(Path(file).open()))


def shown(file: str) -> list[np.ndarray]:
    """The frames of a video, as ffmpeg or Pillow reads them."""
    if Path(file).suffix in (".gif", ".webp"):
        with Image.open(file) as video:
            found = []
            for n in range(video.n_frames):
                video.seek(n)
                found.append(np.asarray(video.convert("RGB")))
            return found
    from imageio_ffmpeg import read_frames

    reader = read_frames(file)
    width, height = next(reader)["size"]
    return [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader]


# ---- frames and figures -------------------------------------------------------------------------


def test_frames_are_those_of_render() -> None:
    """Each frame, seen by its camera as it is saved, is what `flicker render` draws; figures are those of the pictures; options are render's."""
    options = ("--stage", "channels", "--cat", "sparse", "--background", "0.2,0,0.4")
    done = path("-o", "out", *PAN, *options, "--stats", "a.csv", "--save-cameras", "along.json")
    assert "pan of 0.5 pixels a frame from camera 0 of cameras.json, 6 frames of 48x32 at 90 frames a second" in done.stdout
    assert sorted(p.name for p in Path("out").glob("*.png")) == [f"frame_{n:05d}.png" for n in range(COUNT)]
    assert [c.timestamp for c in load_cameras("along.json")] == pytest.approx([n / 90 for n in range(COUNT)])
    found = rows()
    assert flicker("render", "scene.ply", "--cameras", "along.json", "--view", "all", "-o", "one", *options, "--stats", "one.json").returncode == 0
    errors, changes = [], []
    for n, (row, stats) in enumerate(zip(found, json.loads(Path("one.json").read_text()))):
        with Image.open(f"out/frame_{n:05d}.png") as a, Image.open(f"one/view_{n:03d}.png") as b:
            assert ImageChops.difference(a, b).getbbox() is None
            image = np.asarray(a) / 255.0
        view = load_view("scene.ply", n, None, "along.json", background=(0.2, 0.0, 0.4))
        assert (int(row["frame"]), int(row["visible"]), int(row["subtile_entries"])) == (n, stats["visible"], stats["subtile_pairs"])
        assert float(row["ssim"]) == pytest.approx(ssim(image, view.reference), abs=2e-3)
        assert float(row["flip"]) == pytest.approx(flip(image, view.reference), abs=0.01)
        assert float(row["psnr_db"]) == pytest.approx(psnr(image, view.reference), abs=0.3)
        errors.append(image - np.clip(view.reference, 0, 1))
        if n:
            changes.append(-10 * np.log10(np.mean((errors[n] - errors[n - 1]) ** 2)))
            assert float(row["temporal_psnr_db"]) == pytest.approx(changes[-1], abs=0.5)
            assert float(row["jumps"]) == pytest.approx((np.abs(errors[n] - errors[n - 1]).max(axis=2) > 8 / 255).mean(), abs=0.01)
    assert found[0]["temporal_psnr_db"] == "" and f"frame {1 + int(np.argmin(changes))}: " in done.stdout


@pytest.mark.slow
def test_processes_make_the_same() -> None:
    """Two processes and none: the same pictures and figures; a process that dies is one line, and what is there is kept."""
    path("-o", "one", *PAN, "--stats", "a.csv", "--workers", 1)
    path("-o", "two", *PAN, "--stats", "b.csv", "--workers", 2)
    for name in (f"frame_{n:05d}.png" for n in range(COUNT)):
        assert (Path("one") / name).read_bytes() == (Path("two") / name).read_bytes()
    strip = lambda found: [{k: v for k, v in row.items() if k != "made_s"} for row in found]  # noqa: E731
    assert strip(rows("a.csv")) == strip(rows("b.csv"))


def dies(*_: object) -> None:
    os._exit(1)


def test_process_that_dies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_frames, "_begin", dies)
    scene = load_scene("scene.ply")
    with pytest.raises(FlickerError, match="a process that made frames has ended"):
        list(frames(scene, "scene.ply", load_cameras("cameras.json"), Wanted(parse_engine("", "x").drawing()), workers=2))


def test_cycles_are_those_of_the_chip() -> None:
    """Bytes by purpose and cycles are those of the chip's models; late where they do not fit in the slot."""
    done = path("-o", "out", *PAN, "--frames", 2, "--cycles", "--stats", "a.csv", "--chart", "a.png", "--save-cameras", "along.json", "--clock", 0.001)
    for n, row in enumerate(rows()):
        want = chip_estimates(load_view("scene.ply", n, None, "along.json"), ["log-lanes"])["log-lanes"]
        assert int(row["cycles"]) == want["interval_cycles"] and int(row["latency_cycles"]) == want["latency_cycles"]
        assert int(row["bytes"]) == want["dram_bytes"] == sum(int(value) for name, value in row.items() if name.startswith("bytes_"))
        assert int(row["late"]) == (want["interval_cycles"] > 1e6 / 90)
    assert f"late at 90 Hz │ {'0.00%' if int(row['cycles']) < 1e6 / 90 else '100.00%'} of the frames" in re.sub(" +", " ", done.stdout)
    assert Image.open("a.png").size[1] > 600
    path("-o", "golden", *PAN, "--frames", 2, "--engine", "chip-golden", "--cycles", "--stats", "b.csv")
    assert [row["cycles"] for row in rows("b.csv")] == [row["cycles"] for row in rows()]
    found = Timing.of([*range(1, 101)], 90.5)
    assert (found.p50, found.worst, found.worst_frame, found.late) == (50.5, 100, 99, 0.1) and 98 < found.p99 < 100


def test_warping_error_stands_beside() -> None:
    done = path("-o", "out", *PAN, "--frames", 3, "--warping", "--stats", "a.csv")
    found = rows()
    assert found[0]["warping_error"] == "" and all(float(row["warping_error_reference"]) > 0 for row in found[1:])
    assert "warping error of the reference" in done.stdout


# ---- paths --------------------------------------------------------------------------------------


def test_cameras_in_order_and_as_keyframes() -> None:
    path("-o", "order", "--save-cameras", "order.json")
    path("-o", "keys", "--keyframes", "--frames", 7, "--save-cameras", "keys.json")
    given, order, keys = (load_cameras(file) for file in ("cameras.json", "order.json", "keys.json"))
    assert len(order) == 4 and all(np.allclose(a.position, b.position) for a, b in zip(given, order))
    assert all(np.allclose(a.position, b.position) and np.allclose(a.rotation, b.rotation) for a, b in zip(given, keys[::2]))
    path("-o", "first", "--frames", 2)
    assert len(list(Path("first").glob("*.png"))) == 2
    done = path("-o", "long", "--keyframes", "--fps", 2, "--size", "24x16")
    assert "4 keyframes of cameras.json, 7 frames of 24x16 at 2 frames a second" in done.stdout


@pytest.mark.parametrize("words", [
    ("--orbit", 20), ("--dolly", "--speed", 0.5), ("--walk",), ("--shake", "--seed", 4), ("--shake", "--ahead", 5), ("--keyframes",),
])
def test_every_motion(words: tuple) -> None:
    done = path("-o", "out", "--frames", 3, "--size", "16x16", *words)
    assert "3 frames of 16x16" in done.stdout and ("seed" not in words or "seed 4" in done.stdout)


# ---- files --------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["mp4", "webm", "gif", "webp"])
def test_video_has_the_frames(suffix: str) -> None:
    """All frames, in order, nearly their colours; nothing beside the file; odd sizes are filled up for codecs that want even ones."""
    path("-o", "pictures", *PAN, "--size", "47x31", "--view", 1)
    path("-o", f"a.{suffix}", *PAN, "--size", "47x31", "--view", 1)
    found = shown(f"a.{suffix}")
    assert len(found) == COUNT and not Path(f"a.{suffix}.frames").exists()
    for n, frame in enumerate(found):
        with Image.open(f"pictures/frame_{n:05d}.png") as picture:
            assert psnr(frame[:31, :47] / 255.0, np.asarray(picture) / 255.0) > 24
    assert found[0].shape == ((32, 48, 3) if suffix in ("mp4", "webm") else (31, 47, 3))


def test_durations_do_not_drift() -> None:
    """Frames of formats that count in steps: the sum stays within half a step."""
    for step in (0.001, 0.010):
        for fps in (24.0, 30.0, 72.0, 90.0):
            times = np.cumsum(durations(300, fps, step)) / 1000
            assert np.abs(times - np.arange(1, 301) / fps).max() <= step / 2 + 1e-9
    assert durations(3, 240, 0.010) == [10, 10, 10]


def test_too_many_frames_a_second_for_gif() -> None:
    done = path("-o", "a.gif", *PAN, "--fps", 120)
    assert done.stderr == "flicker: warning: a.gif: holds a frame for 0.01 s at least: it plays at 100 frames a second, not 120\n"
    assert len(shown("a.gif")) == COUNT


def test_side_by_side() -> None:
    """The second configuration or the reference, then the error."""
    path("-o", "alone", *PAN, "--stage", "channels", "--cat", "sparse")
    path("-o", "lanes", *PAN)
    path("-o", "ref", *PAN, "--engine", "reference")
    path("-o", "a", *PAN, "--stage", "channels", "--cat", "sparse", "--side-by-side", "--stage lanes --lanes 64")
    path("-o", "b", *PAN, "--stage", "channels", "--cat", "sparse", "--side-by-side", "reference", "--amplify", 0)
    width, height = SIZE
    captions = slice(0, height - 18)
    read = lambda folder: np.asarray(Image.open(f"{folder}/frame_00003.png")).astype(int)  # noqa: E731
    three, two = read("a"), read("b")
    assert three.shape == (height, 3 * width, 3) and two.shape == (height, 2 * width, 3)
    assert (three[captions, :width] == read("alone")[captions]).all() and (three[captions, width : 2 * width] == read("lanes")[captions]).all()
    assert (two[captions, width:] == read("ref")[captions]).all()
    error = np.abs(read("alone") - read("lanes"))[captions]
    assert np.abs(three[captions, 2 * width :] - np.clip(8 * error, 0, 255)).max() <= 9


# ---- interrupted --------------------------------------------------------------------------------


@contextmanager
def stopped_at(number: int, error: BaseException) -> Iterator[None]:
    """Ctrl-C, or an error, when a frame is begun."""
    usual = motion_frames.make

    def make(scene, wanted, n, camera, kept):
        if n == number:
            raise error
        return usual(scene, wanted, n, camera, kept)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motion_frames, "make", make)
        yield


@pytest.mark.parametrize("out", ["a.mp4", "a.gif", "folder"])
def test_interrupted_path_goes_on(out: str) -> None:
    """What is there is a valid file with its figures; --resume ends with what an uninterrupted run gives."""
    path("-o", f"whole.{out}" if "." in out else "whole", *PAN, "--stats", "whole.csv")
    words = ("-o", out, *PAN, "--stats", "a.csv")
    with stopped_at(4, KeyboardInterrupt()):
        done = path(*words, code=130)
    again = "flicker path scene.ply -o " + " ".join(map(str, words[1:]))
    assert done.stderr == f"flicker: interrupted: 4 of 6 frames are in {out}; to go on: {again} --resume\n"
    assert len(rows()) == 4
    if "." in out:
        assert len(shown(out)) == 4 and len(list(Path(f"{out}.frames").glob("frame_*.png"))) == 4
    done = path(*words, "--resume")
    assert "goes on after 4 of 6 frames" in done.stdout
    strip = lambda found: [{k: v for k, v in row.items() if k != "made_s"} for row in found]  # noqa: E731
    assert strip(rows()) == strip(rows("whole.csv")) and not Path("a.mp4.frames").exists()
    if "." in out:
        assert all((a == b).all() for a, b in zip(shown(out), shown(f"whole.{out}"), strict=True))
    else:
        assert all(p.read_bytes() == (Path("whole") / p.name).read_bytes() for p in Path(out).glob("*.png"))


def test_kept_colours() -> None:
    """The share of stored colours and what they take from the memory stand in the figures; a path that is taken up again ends with what an
    uninterrupted run gives; of a camera that turns on the spot no pixel differs."""
    words = (*PAN, *GOLDEN, "--keep-colours", "0", "--cycles")
    path("-o", "whole", *words, "--stats", "whole.csv")
    path("-o", "plain", *PAN, *GOLDEN, "--stats", "plain.csv", "--cycles")
    found, plain = rows("whole.csv"), rows("plain.csv")
    shares = [float(row["kept_colours"]) for row in found]
    assert shares[0] == 0.0 and min(shares[1:]) > 0.5 and "kept_colours" not in plain[0]
    assert [row["psnr_db"] for row in found] == [row["psnr_db"] for row in plain]
    assert all(int(a["bytes_store"]) > 0 and int(a["bytes_colour"]) < int(b["bytes_colour"]) for a, b in zip(found[1:], plain[1:]))
    assert all((Path("plain") / p.name).read_bytes() == p.read_bytes() for p in Path("whole").glob("*.png"))
    with stopped_at(3, KeyboardInterrupt()):
        path("-o", "again", *words, "--stats", "a.csv", code=130)
    path("-o", "again", *words, "--stats", "a.csv", "--resume")
    strip = lambda found: [{k: v for k, v in row.items() if k != "made_s"} for row in found]  # noqa: E731
    assert strip(rows()) == strip(found)


def test_resume_is_of_the_same_path() -> None:
    """Frames of other settings are refused; a cut-off last line counts as no frame; without --resume a line says what goes."""
    with stopped_at(3, KeyboardInterrupt()):
        path("-o", "a.gif", *PAN, code=130)
    done = path("-o", "a.gif", *PAN, "--stage", "channels", "--resume", code=2)
    assert done.stderr == "flicker: a.gif.frames: its frames are of another path (drawing); without --resume it begins anew\n"
    done = path("-o", "a.gif", *PAN, "--frames", 5, "--fps", 30, "--resume", code=2)
    assert "of another path (cameras, fps, frames)" in done.stderr
    file = Path("a.gif.frames/rows.jsonl")
    file.write_text(file.read_text()[:-20])
    done = path("-o", "a.gif", *PAN, "--resume")
    assert "goes on after 2 of 6 frames" in done.stdout and len(shown("a.gif")) == COUNT
    done = path("-o", "b.gif", *PAN, "--resume")
    assert "b.gif.frames: no frames there: begins anew" in done.stdout
    path("-o", "folder", *PAN)
    done = path("-o", "folder", *PAN, "--frames", 2)
    assert "folder: 6 frames of an earlier run are overwritten; --resume goes on with them" in done.stdout
    assert len(list(Path("folder").glob("*.png"))) == 2


def test_error_in_mid_path_keeps_the_frames() -> None:
    with stopped_at(2, FlickerError("a tile's list has 70,000 entries")):
        done = path("-o", "a.mp4", *PAN, code=2)
    assert done.stderr == "flicker: a tile's list has 70,000 entries; 2 frames are kept in a.mp4.frames, --resume goes on\n"
    path("-o", "a.mp4", *PAN, "--resume")
    assert len(shown("a.mp4")) == COUNT
    for error, code in ((FlickerError("bad"), 2), (KeyboardInterrupt(), 130)):
        with stopped_at(0, error):
            assert path("-o", "b.mp4", *PAN, code=code).stderr == ("flicker: bad\n" if code == 2 else "flicker: interrupted\n")
        assert not list(Path().glob("b.mp4*"))


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "a.gif", "a.webp"])
def test_full_disk_behind_a_video(name: str) -> None:
    """The video cannot be written: one line with its name and a reason, the one that was there stays, frames are kept for --resume."""
    Path(name).write_text("before")

    def limited(out: Path, pictures, fps: float) -> None:
        with full_disk(600):
            write_video(out, pictures, fps)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flicker.motion.video.write_video", limited)
        done = path("-o", name, *PAN, "--size", "160x96", code=2)
    assert re.fullmatch(rf"flicker: {name}: cannot be written \([^\n]+\); 6 frames are kept in {name}.frames, --resume writes it\n", done.stderr), done.stderr
    assert Path(name).read_text() == "before" and not list(Path().glob(".a*"))
    path("-o", name, *PAN, "--size", "160x96", "--resume")
    assert len(shown(name)) == COUNT


def test_full_disk_behind_frames() -> None:
    """A frame cannot be written: those before it are kept."""
    with full_disk(3000):
        done = path("-o", "a.mp4", *PAN, "--size", "160x96", code=2)
    assert re.match(r"flicker: a.mp4.frames/frame_0000\d.png: cannot be written \(File too large\)", done.stderr) and done.stderr.count("\n") == 1


# ---- refused ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("words", "said"), [
    (("-o", "a.mp4", "--pan", 1, "--walk"), "--pan, --walk: one motion makes a path"),
    (("-o", "a.mp4", "--keyframes", "--shake"), "--keyframes: joins given cameras, so it cannot be combined with --shake"),
    (("-o", "a.mp4", "--seed", 3), "--seed: for --shake only"),
    (("-o", "a.mp4", "--pan", 1, "--speed", 3), "--speed: for --dolly, --walk only"),
    (("-o", "a.mp4", "--orbit", 90, "--ahead", 3), "--ahead: for --dolly, --walk, --shake only"),
    (("-o", "a.mp4", "--pan", "nan"), "--pan: nan is not from -100,000 to 100,000"),
    (("-o", "a.mp4", "--walk", "--fps", 0), "--fps: 0 is not from 0.001 to 100,000"),
    (("-o", "a.mp4", "--walk", "--fps", "inf"), "--fps: inf is not from 0.001 to 100,000"),
    (("-o", "a.mp4", "--walk", "--amplify", 3), "--amplify: for --side-by-side only"),
    (("-o", "a.mp4", "--walk", "--engine", "reference", "--cycles"), "--cycles: not with --engine reference, which is no machine"),
    (("-o", "a.mp4", "--walk", "--side-by-side", "--cat sprse"), "--side-by-side: "),
    (("-o", "a.mp4", "--walk", "--side-by-side", "--lanes 32 --cat dense"), "--side-by-side: --stage lanes: takes records of 16 bytes"),
    (("-o", "a.avi", "--walk"), "--out: a.avi: .avi is not one of .mp4, .webm, .gif, .webp, nor a folder"),
    (("-o", "none/a.mp4", "--walk"), "--out: none: no such folder"),
    (("-o", "scene.ply", "--walk"), "--out: scene.ply: .ply is not one of"),
    (("-o", "/proc/a", "--walk"), "--out: /proc/a: cannot be written"),
    (("-o", "a.mp4", "--walk", "--stats", "a.json"), "--stats: a.json: only .csv is written"),
    (("-o", "a.mp4", "--walk", "--view", 4), "view 4: there are 4 cameras, 0 to 3"),
    (("-o", "a.mp4", "--walk", "--coords", "absolute", "--cycles"), "--cycles: not with --coords absolute, of which no chip has records"),
    (("-o", "a.mp4", "--walk", "--faithful", "--cat", "dense"), "--faithful: fixes the configuration"),
    (("-o", "a.mp4", "--walk", "--frames", 0), "--frames"),
    *((("-o", "a.mp4", "--walk", "--keep-colours", text), f"--keep-colours: {text}: not 0 to 1, such as 2/255") for text in ("2", "-1/255", "nan", "1/0", "x")),
    (("-o", "a.mp4", "--walk", "--keep-colours", "2/255"), "--keep-colours: for --engine golden with --front golden, chip-golden and chip"),
    (("-o", "a.mp4", "--walk", *GOLDEN, "--format", "fp16", "--keep-colours", "0"), "--keep-colours: of scenes in chunks, in records of 16 bytes"),
    (("-o", "a.mp4", "--walk", *GOLDEN, "--workers", 2, "--keep-colours", "0"), "--keep-colours: --workers must be 1"),
    (("-o", "a.mp4", "--walk", "--engine", "chip-golden", "--chip", "tiny", "--keep-colours", "0"), "--keep-colours: the chip has no colour store"),
    (("-o", "a.mp4", "--walk", "--engine", "chip", "--resume", "--keep-colours", "0"), "--keep-colours: no --resume with --engine chip"),
    (("-o", "a.mp4", "--frames", 9), "cameras.json: 4 cameras, not 9, each a frame; as keyframes they make any number"),
])
def test_refused_in_one_line(words: tuple, said: str) -> None:
    done = path(*words, code=2)
    assert done.stderr.startswith(f"flicker: {said}") or said == "--frames" and said in done.stderr
    assert done.stderr.count("\n") == 1 and not Path("a.mp4").exists() and not list(Path().glob("a.mp4.*"))


@pytest.mark.parametrize(("change", "said"), [
    ([{"width": 96}], "cameras.json: camera 1: width: 96 pixels, 48 before: a path has one size, which --size gives"),
    ([{"fx": 70.0}], "cameras.json: camera 1: fx: 70 pixels, "),
    ([{"timestamp": 1.0}, {"timestamp": 1.0}, {"timestamp": 2.0}], "cameras.json: camera 1: timestamp: 1 s is not after 1 s, that of the one before"),
    ([{"position": [0.0, float("nan"), 0.0]}], "cameras.json: camera 1: position: not finite"),
    ([{"rotation": [[0.0] * 3] * 3}], "cameras.json: camera 1: rotation: not a rotation matrix"),
    (None, "cameras.json: one camera: a path needs two at least, or a motion (--pan, --orbit, --dolly, --walk, --shake)"),
])
@pytest.mark.parametrize("words", [(), ("--keyframes",)])
def test_cameras_that_are_no_path(change: list | None, said: str, words: tuple) -> None:
    data = json.loads(Path("cameras.json").read_text())
    if change is None:
        data = data[:1]
    elif len(change) == 3:
        data = [a | b for a, b in zip(data, change)]
    else:
        data[1] |= change[0]
    Path("cameras.json").write_text(json.dumps(data))
    done = path("-o", "a.mp4", *words, code=2)
    assert done.stderr.startswith(f"flicker: {said}") and done.stderr.count("\n") == 1 and not list(Path().glob("a.mp4*"))


def test_folder_of_other_pictures_stays() -> None:
    Path("out").mkdir()
    Path("out/frame_00001.png").write_text("mine")
    done = path("-o", "out", *PAN, code=2)
    assert done.stderr == "flicker: out: has frame_00001.png, which is no frame of a path: name another folder\n"
    assert Path("out/frame_00001.png").read_text() == "mine"


def test_sizes_that_change_can_be_given_one() -> None:
    given = load_cameras("cameras.json")
    Path("cameras.json").write_text(cameras_text([given[0], given[1].resized(96, 64)]))
    path("-o", "out", "--size", "24x16")
    assert len(list(Path("out").glob("*.png"))) == 2


def test_engine_options_of_a_text() -> None:
    """As on a command line of their own."""
    chosen = parse_engine("--engine chip-golden --format fp16-local --lanes 64", "--x")
    assert (chosen.engine.value, chosen.memory.value, chosen.config.lanes, chosen.config.stage) == ("chip-golden", "fp16-local", 64, "lanes")
    assert parse_engine("", "--x").config.by_lanes and replace(parse_engine("--faithful", "--x")).faithful
    for text, said in (
        ("--cat", "--x: "), ("'", "--x: ''': No closing quotation"), ("a", "--x: "), ("--engine reference --lanes 32", "--x: --stage lanes: not for"),
    ):
        with pytest.raises(FlickerError, match=re.escape(said)):
            parse_engine(text, "--x")
