"""Frames through the verilated chip back to back: a row of them, and `flicker path --engine chip`.

State space: cameras that move, on two regions in turn, with DRAM timing; too little list memory in the middle of a row; Ctrl-C, in a register's callback too,
and --resume; a picture that is wrong; a frame that ends with an error; with SLOW=1 bytes and cycles beside the model, of the demo scene and of flowers at
640x360. Parameter space: a stage of 32 lanes. What a frame leaves by itself: tb/frames/test_chip_frames.py; everything else of `flicker path`:
tb/model/test_path.py.
"""

from __future__ import annotations

import csv
import ctypes
import dataclasses
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.command import flicker
from flicker_tb.runner import seed
from test_chip_frames import BLUE, LIMIT, camera, golden, session

from flicker.chip.compare import frame_cost
from flicker.chip.dram import DramConfig
from flicker.chip.drawing import Drawing
from flicker.errors import FlickerError
from flicker.front.view import View
from flicker.params import RECOMMENDED
from flicker.pipeline import Engine
from flicker.scene.camera import cameras_text, load_cameras
from flicker.scene.demo import generate
from flicker.scene.files import Scene, save_ply
from flicker.scene.real import REAL_VIEWS, real_scenes
from flicker.scene.sources import open_scene
from flicker.sim import chip as sim_chip
from flicker.sim.chip import OF_PLACE, ChipSession
from flicker.sim.half import MemoryOptions
from flicker.sim.row import back_to_back, differs

VIEWS = [camera(x=0.3 * k) for k in range(4)]
DRAM = MemoryOptions(DramConfig().timing)


def of_dram(chip: ChipSession) -> dict[str, int]:
    """Bytes that the DRAM has moved in all, by purpose."""
    counts = [chip.purposes(number) for number in (0, 1, 2)]
    moved = lambda c: int(c.dram_read_bytes + c.dram_write_bytes)  # noqa: E731
    return {name: moved(c) if name not in OF_PLACE else sum(moved(each[name]) for each in counts[1:]) for name, c in counts[0].items()}


def test_row_of_frames() -> None:
    """Pictures, intervals between ends, and bytes that add up to all that the DRAM has moved; each begins before the one before it has ended."""
    with session(memory=DRAM) as chip:
        done = list(back_to_back(chip, VIEWS, background=BLUE, limit=LIMIT))
        assert [d.number for d in done] == [0, 1, 2, 3]
        for view, each in zip(VIEWS, done):
            assert np.array_equal(each.frame.buffer, golden(chip.packed, view)[1].buffer) and all(count > 0 for count in each.moved.values())
        ends = [d.frame.stamps["rendering_done"] for d in done]
        assert [d.interval for d in done] == [None, *(b - a for a, b in zip(ends, ends[1:]))]
        assert all(b.frame.stamps["taken"] < a.frame.stamps["rendering_done"] for a, b in zip(done, done[1:]))
        total = of_dram(chip)
        assert {name: sum(d.moved[name] for d in done) for name in done[0].moved} == {name: total[name] for name in done[0].moved}
        assert all(sum(o.clocks for o in d.rows.values()) == d.spent["rows"] for d in done) and all(d.spent["rows"] > 0 for d in done[:-1])
        assert sum(d.rows["records"].rows for d in done) > 0
        bursts = {name: sum(d.rows[name].bursts for d in done) for name in total}
        assert bursts == {name: moved // DRAM.timing.burst_bytes for name, moved in total.items()}
        assert total["image header"] == 0 and len({d.moved["records"] for d in done}) > 1


def test_row_with_too_little_list_memory() -> None:
    """From a frame on that lists more than those before it: the row goes on with the one before, and every frame is given once, with its interval."""
    views = [camera(away=True), camera(away=True), *VIEWS[:2]]
    with session(memory=DRAM) as chip:
        done = list(back_to_back(chip, views, chunks=1, background=BLUE, limit=LIMIT))
        assert chip.field("frames", "started") > len(views)
        assert [d.number for d in done] == [0, 1, 2, 3] and [d.interval is None for d in done] == [True, False, False, False]
        for view, each in zip(views, done):
            assert np.array_equal(each.frame.buffer, golden(chip.packed, view)[1].buffer)
        alone = list(back_to_back(chip, views[2:], background=BLUE, limit=LIMIT))
        assert alone[0].moved["lists"] == done[2].moved["lists"] > done[0].moved["lists"]


def test_row_that_meets_an_error() -> None:
    """It names the frame; those before it were given."""
    with session() as chip:
        row_of = back_to_back(chip, VIEWS, limit=LIMIT)
        next(row_of)
        chip.fail(sim_chip.IMAGE, 1 << 20, writes=False)
        with pytest.raises(FlickerError, match=r"chip: frame [12]: .*seed"):
            list(row_of)


def test_pictures_that_differ() -> None:
    picture = np.zeros((4, 6, 3))
    other = picture.copy()
    other[2, 3, 1] = other[3, 0, 0] = 1 / 255
    assert differs(picture, picture) is None
    assert differs(picture, other) == "pixel (3, 2): (0, 0, 0), golden (0, 1, 0); 2 pixels differ"


# ---- flicker path -------------------------------------------------------------------------------


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small scene with its camera, as the current folder."""
    rng = np.random.default_rng(seed())
    count = 150
    save_ply(Scene(
        means=np.stack([*rng.uniform(-1.0, 1.0, (2, count)), rng.uniform(1.0, 4.0, count)], axis=1), scales=rng.uniform(0.02, 0.1, (count, 3)),
        quats=rng.normal(size=(count, 4)), opacities=rng.uniform(0.1, 1.0, count), sh=rng.normal(scale=0.3, size=(count, 4, 3)),
    ), tmp_path / "scene.ply")
    (tmp_path / "cameras.json").write_text(cameras_text([camera(48, 32)]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def path(*words: object, code: int = 0):
    done = flicker("path", *words)
    assert done.returncode == code, done.stderr or done.stdout
    return done


def rows(file: str = "a.csv") -> list[dict[str, str]]:
    return list(csv.DictReader(Path(file).open()))


def near_model(scene: str | Path, view: int, size: str, motion: tuple, frames: int, say: bool = False) -> None:
    """A path through the chip: no picture differs (an error of the command); of every frame what is listed is the golden front end's, bytes are within 10 %
    of the model's and the interval within 15 %, all intervals together within 10 %. In smaller pictures how the halves meet in the memory moves single frames
    by more."""
    words = (scene, "--view", view, "--size", size, *motion, "--frames", frames, "--engine", "chip", "-o", "out")
    done = path(*words, "--stats", "a.csv", "--chart", "a.png", "--save-cameras", "along.json")
    found, drawing = rows(), Drawing(Engine.CHIP_GOLDEN, RECOMMENDED)
    longest = max(found[1:], key=lambda row_: int(row_["cycles"]))
    assert f"frame {longest['frame']}: {int(longest['cycles']):,} cycles" in done.stdout and Path("a.png").is_file()
    source = open_scene(scene)
    assert len(found) == frames and found[0]["cycles"] == found[0]["late"] == ""
    modelled = 0
    for number, (row_, seen) in enumerate(zip(found, load_cameras("along.json"))):
        view_ = View(seen, source.scene)
        want, stats = frame_cost(view_, drawing), drawing.render(view_).stats
        assert (int(row_["visible"]), int(row_["tile_entries"])) == (stats["visible"], stats["list_entries"])
        moved = {name: int(value) for name, value in row_.items() if name.startswith("bytes_")}
        assert moved.keys() == {name for name in want if name.startswith("bytes_")} and int(row_["bytes"]) == sum(moved.values())
        off = {name: count / want[name] - 1 for name, count in moved.items()}
        if number:
            off["interval"] = int(row_["cycles"]) / want["cycles"] - 1
            modelled += want["cycles"]
            assert int(row_["late"]) == (int(row_["cycles"]) > 1e9 / 90)
        if say:
            print(f"frame {number}: {row_['cycles']} cycles, " + ", ".join(f"{name} {value:+.1%}" for name, value in off.items()))
        assert all(abs(value) <= (0.15 if name == "interval" else 0.1) for name, value in off.items()), (number, off)
        assert int(row_["latency_cycles"]) >= int(row_["render_cycles"])
    assert sum(int(row_["cycles"]) for row_ in found[1:]) == pytest.approx(modelled, rel=0.1)


@pytest.mark.slow
def test_eight_frames_of_the_demo_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third of its Gaussians, seen by its own camera."""
    monkeypatch.chdir(tmp_path)
    whole = generate()
    fields = {field.name: getattr(whole, field.name) for field in dataclasses.fields(whole)}
    few = replace(whole, **{name: value[::3] for name, value in fields.items() if isinstance(value, np.ndarray)})
    monkeypatch.setattr("flicker.scene.demo.generate", lambda seed=1: few)
    near_model("demo", 0, "128x72", ("--pan", 3), 8, say=True)


@pytest.mark.slow
def test_eight_frames_of_flowers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = real_scenes()
    if folder is None:
        pytest.skip("FLICKER_SCENES is not set")
    monkeypatch.chdir(tmp_path)
    real = next(v for v in REAL_VIEWS if v.folder == "flowers")
    near_model(real.path(folder), real.number, "640x360", ("--walk",), 8, say=True)


@contextmanager
def patched(owner: object, name: str, change) -> Iterator[None]:
    """A function of the simulation, replaced by `change` of it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(owner, name, change(getattr(owner, name)))
        yield


PAN = ("scene.ply", "--pan", 1, "--frames", 5, "--engine", "chip")


def stops(after: int):
    """Ctrl-C in the wait for the frame behind `after` of them."""
    ended = []

    def change(usual):
        def wait(self, *words):
            if len(ended) == after:
                raise KeyboardInterrupt
            ended.append(usual(self, *words))

        return wait

    return change


def test_interrupted_on_the_chip(place: Path) -> None:
    """What is there is kept; --resume makes one frame again and goes on; pictures and bytes are those of a run that was not interrupted."""
    path(*PAN, "-o", "whole")
    with patched(ChipSession, "wait", stops(3)):
        done = path(*PAN, "-o", "part", code=130)
    assert "interrupted: 3 of 5 frames are in part; to go on: flicker path" in done.stderr and len(list(Path("part").glob("*.png"))) == 3
    simulated = []
    with patched(ChipSession, "finish", lambda usual: lambda self, *words: simulated.append(1) or usual(self, *words)):
        done = path(*PAN, "-o", "part", "--resume")
    assert "goes on after 3 of 5 frames" in done.stdout and len(simulated) == 3
    timed = ("made_s", "cycles", "late", "latency_cycles", "front_cycles", "render_cycles", "subtile_entries", "bytes_records")
    whole, found = ([json.loads(line) for line in Path(out, "rows.jsonl").read_text().splitlines()] for out in ("whole", "part"))
    plain = lambda row_: {name: value for name, value in row_.items() if name not in timed}  # noqa: E731
    assert [plain(row_) for row_ in found] == [plain(row_) for row_ in whole] and "bytes_lists" in plain(found[3])
    assert ["cycles" in row_ for row_ in found] == ["cycles" in row_ for row_ in whole] == [False] + 4 * [True]
    for file in sorted(Path("whole").glob("*.png")):
        assert file.read_bytes() == (Path("part") / file.name).read_bytes()


def test_interrupted_in_a_callback() -> None:
    """Ctrl-C while the driver reads a register: not lost."""
    with session() as chip:
        def interrupt(*_: object) -> int:
            raise KeyboardInterrupt

        register, chip._lib.flk_chip_register = chip._lib.flk_chip_register, interrupt
        try:
            with pytest.raises(KeyboardInterrupt):
                chip.call("flk_ready", ctypes.byref(chip.device))
        finally:
            chip._lib.flk_chip_register = register


def test_wrong_picture_is_an_error(place: Path) -> None:
    """It names frame and pixel; the frames before are kept."""
    made = []

    def change(usual):
        def buffer(self, frame):
            made.append(usual(self, frame))
            if len(made) == 3:
                made[-1][5, 3 * 7 + 1] ^= 1
            return made[-1]

        return buffer

    with patched(ChipSession, "buffer", change):
        done = path(*PAN, "-o", "a.gif", code=2)
    assert done.stderr.startswith("flicker: frame 2: the chip's picture is not that of its golden model: pixel (7, 5): (") and done.stderr.count("\n") == 1
    assert done.stderr.endswith("1 pixels differ; 2 frames are kept in a.gif.frames, --resume goes on\n")


def test_order_of_splats_reaches_the_chip(place: Path) -> None:
    """By distance the golden model's picture is another one, and the chip's with it; the pops that the path counts are those of its golden front end."""
    words = ("scene.ply", "--pan", 8, "--frames", 2, "--stats", "a.csv", "--order", "distance")
    path(*words, "--engine", "chip", "-o", "distance")
    found = rows()
    path(*words, "--engine", "chip-golden", "-o", "golden")
    assert [row_["pops"] for row_ in found] == [row_["pops"] for row_ in rows()] == ["", "0"]
    path(*words[:-1], "depth", "--engine", "chip-golden", "-o", "depth")
    read = lambda folder: Path(folder, "frame_00001.png").read_bytes()  # noqa: E731
    assert read("distance") == read("golden") != read("depth")


def test_other_hardware_is_another_path(place: Path) -> None:
    """Frames of another simulator are not gone on with; --workers has no meaning."""
    with patched(ChipSession, "wait", stops(2)):
        path(*PAN, "-o", "a.gif", code=130)
    with patched(sim_chip, "build", lambda usual: lambda config: Path("/other/lib.so")):
        done = path(*PAN, "-o", "a.gif", "--resume", code=2)
    assert done.stderr == "flicker: a.gif.frames: its frames are of another path (simulator); without --resume it begins anew\n"
    done = path(*PAN, "-o", "a.gif", "--workers", 2, code=2)
    assert done.stderr == "flicker: --workers: not with --engine chip, whose frames go through one simulation\n"
