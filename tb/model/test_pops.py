"""Pops: counted pixel by pixel, none by distance while the camera turns on the spot, and the order in every command.

Not covered: engines in RTL, whose lists are those of the golden front end (tests of `preprocessing` and `chip_frames`).
"""

from __future__ import annotations

import csv
import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.bench import rounds
from flicker_tb.command import flicker
from flicker_tb.runner import seed
from PIL import Image

from flicker.cli.engine import parse_engine
from flicker.explore.stability.moving import MOVING, run_moving
from flicker.explore.sweep.config import load_sweep
from flicker.front import pops as counting
from flicker.front.pops import Seen, pops, seen_in
from flicker.front.projection import Projected, project
from flicker.front.view import View
from flicker.golden.front.blend import alpha_at
from flicker.golden.front.frame import run_front
from flicker.golden.front.record import RecordKind
from flicker.motion.frames import seen_by
from flicker.params import Form, SortOrder
from flicker.scene.camera import Camera, cameras_text
from flicker.scene.files import Scene, save_ply
from flicker.scene.motion import panned
from flicker.scene.packing import pack

SIZE = (40, 28)


def scene_of(count: int = 120) -> Scene:
    scene = samples.random_scene(seed() + 5, count, 1)
    scene.scales *= np.float32(2.0)
    return scene


def camera() -> Camera:
    return Camera(*SIZE, 30.0, 30.0, np.array([0.2, -0.1, -3.0]), np.eye(3))


def touched(projected: Projected) -> dict[int, np.ndarray]:
    """Pixels of each Gaussian with an alpha of at least 1/255, in its 3-sigma box."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    found = {}
    for i, number in enumerate(projected.index.tolist()):
        (mx, my), (a, b, c), (rx, ry) = projected.mean[i], projected.conic[i], projected.radii[i]
        alpha = projected.opacity[i] * np.exp(-(0.5 * a * (x - mx) ** 2 + b * (x - mx) * (y - my) + 0.5 * c * (y - my) ** 2))
        # A box has the sub-tiles that it meets, all of their pixels.
        boxed = [[low // 8 * 8 <= v < (high // 8 + 1) * 8 for v in range(n)] for low, high, n in (
            (np.ceil(mx - rx), np.floor(mx + rx), SIZE[0]), (np.ceil(my - ry), np.floor(my + ry), SIZE[1]),
        )]
        found[number] = (alpha >= 1 / 255) & np.array(boxed[1])[:, None] & np.array(boxed[0])[None, :]
    return found


def test_counted_pixel_by_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs of Gaussians seen in both frames, of either order, and the pixels where they overlap in the later one; at once and a few Gaussians at a time."""
    scene = scene_of()
    before, after = (project(scene, c) for c in panned(camera(), 6.0, 2))
    place = {int(number): k for k, number in enumerate(before.index)}
    pixels = touched(after)
    want, where = 0, np.zeros(SIZE[::-1], np.bool_)
    for one, other in combinations([n for n in after.index.tolist() if n in place], 2):
        both = pixels[one] & pixels[other]
        if place[one] > place[other] and both.any():
            want += 1
            where |= both
    assert want > 20 and not where.all()
    first, second = (seen_in(p, camera()) for p in (before, after))
    found = pops(first, second)
    assert (found.pops, found.popped) == (want, where.mean())
    assert pops(second, second) == counting.Pops(0, 0.0)
    monkeypatch.setattr(counting, "AT_ONCE", 7)
    assert pops(first, second) == found


def test_who_comes_and_goes_does_not_count() -> None:
    """Three in a row, of which the middle one is missing before; then in reverse."""
    start, entry, size = np.array([0, 3]), np.array([0, 1, 2], np.int32), (8, 8)
    seen = lambda *order: Seen(np.array(order), np.array([0, len(order)]), entry[: len(order)], np.full(len(order), 9, np.uint64), size)  # noqa: E731
    assert pops(seen(4, 9), seen(4, 7, 9)).pops == 0 and pops(seen(9, 4), seen(4, 7, 9)) == counting.Pops(1, 2 / 64)
    assert pops(seen(9, 7, 4), seen(4, 7, 9)).pops == 3
    apart = Seen(np.array([4, 7, 9]), start, entry, np.array([1, 2, 3], np.uint64), size)
    assert pops(seen(9, 7, 4), apart) == counting.Pops(2, 2 / 64)
    nothing = Seen(np.zeros(0, np.int64), np.array([0, 0]), entry[:0], np.zeros(0, np.uint64), size)
    assert pops(nothing, apart).pops == pops(apart, nothing).pops == 0


@pytest.mark.parametrize("kind", list(RecordKind))
def test_pixels_of_records(kind: RecordKind) -> None:
    """What the records of the front end touch is what its blending in float64 draws."""
    frame = run_front(pack(scene_of()).packed, camera(), kind=kind)
    seen, splats = frame.seen(), frame.splats()
    start, record = frame.sorted_subtiles()
    number = {int(g): k for k, g in enumerate(frame.gaussian)}
    cols, wrong, all_of = -(-SIZE[0] // 8), 0, 0
    assert np.array_equal(start, seen.start)
    for s in range(len(start) - 1):
        for e in range(start[s], start[s + 1]):
            i = number[int(seen.gaussian[seen.entry[e]])]
            assert i == record[e]
            for y in range(8):
                for x in range(8):
                    px, py = s % cols * 8 + x, s // cols * 8 + y
                    dx, dy = px - splats.mean[i, 0] / 128, py - splats.mean[i, 1] / 128
                    want = px < SIZE[0] and py < SIZE[1] and alpha_at(splats.shape[i], kind.form is Form.FACTORED, splats.opacity[i], dx, dy) > 0
                    wrong += want != bool(int(seen.pixels[e]) >> (8 * y + x) & 1)
                    all_of += want
    assert all_of > 5000 and wrong <= 2  # roundings at 1/255


def test_none_by_distance_on_the_spot() -> None:
    """Families that turn: pairs change by depth, in float64 and in the front end's numbers; none by distance. Sideways they change by distance, too."""
    assert {"swap", "turned", "culled"} <= set(MOVING)
    names, speeds = ["no-ctu-32", "front-chunk-16", "front-fp16-local-16", "image-chunk"][: rounds(2, 4)], (1.0, 16.0)
    by_depth = run_moving(["swap", "turned", "culled"], names, speeds)
    by_distance = run_moving(["swap", "turned", "culled"], names, speeds, order=SortOrder.DISTANCE)
    assert all(p.pops > 0 for p in by_depth if p.speed == 16.0) and len(by_distance) == 6 * len(names)
    assert all(p.pops == 0 for p in by_distance)
    assert all(p.psnr_db > 35 for p in by_distance)
    assert run_moving(["moved"], names[:2], (16.0,), order=SortOrder.DISTANCE)[1].pops > 0


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene with a camera beside it, as the current folder."""
    save_ply(scene_of(400), tmp_path / "scene.ply")
    (tmp_path / "cameras.json").write_text(cameras_text([camera()]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: object, code: int = 0):
    done = flicker(*words)
    assert done.returncode == code, done.stderr or done.stdout
    return done


@pytest.mark.parametrize("options", [
    ("--engine", "reference"), ("--engine", "golden"), ("--engine", "golden", "--stage", "channels"), ("--engine", "golden", "--front", "golden"),
    ("--engine", "chip-golden"),
], ids=" ".join)
def test_render_takes_an_order(options: tuple[str, ...], place: Path) -> None:
    """Depth is the default; distance is another picture, which statistics tell, nearest to the reference of its own order."""
    for name, order in (("a", ()), ("b", ("--order", "depth")), ("c", ("--order", "distance"))):
        run("render", "scene.ply", *options, *order, "--out", f"{name}.png", "--depth", f"{name}_depth.png", "--stats", f"{name}.json",
            "--compare", "reference")
    a, b, c = (np.asarray(Image.open(f"{name}.png"), np.int64) for name in "abc")
    assert np.array_equal(a, b) and not np.array_equal(a, c)
    told = [json.loads(Path(f"{name}.json").read_text()) for name in "abc"]
    assert [stats["order"] for stats in told] == ["depth", "depth", "distance"]
    assert "reference" in options or abs(told[2]["psnr_db"] - told[0]["psnr_db"]) < 3
    # Depths along the axis, blended in another order, which moves them where many overlap.
    depths = [np.asarray(Image.open(f"{name}_depth.png"), np.int64) for name in "ac"]
    assert (depths[0] > 0).sum() == (depths[1] > 0).sum() and np.median(np.abs(depths[0] - depths[1])) < 0.01 * depths[0].max()


def test_path_counts_pops(place: Path) -> None:
    """Of a pan by depth some, by distance none; by one process and by two (with SLOW=1 the same pops); resumed with another order it is another path."""
    by_depth = []
    for order, workers in [("depth", 1), ("depth", 2), ("distance", 2)][:: rounds(2, 1)]:
        done = run("path", "scene.ply", "--pan", 4, "--frames", 4, "--order", order, "--front", "golden", "-o", f"{order}{workers}", "--stats", "a.csv",
                   "--workers", workers)
        found = list(csv.DictReader(Path("a.csv").open()))
        assert found[0]["pops"] == found[0]["popped"] == ""
        numbers = [(int(row["pops"]), float(row["popped"])) for row in found[1:]]
        if order == "depth":
            assert all(pairs > 0 and 0 < share < 1 for pairs, share in numbers)
            by_depth.append(numbers)
        else:
            assert numbers == [(0, 0.0)] * 3
        assert f"{sum(pairs for pairs, _ in numbers) / 3:,.1f} pairs" in done.stdout
    assert by_depth[0] == by_depth[-1]
    assert "order" in run("path", "scene.ply", "--pan", 4, "--frames", 4, "--front", "golden", "-o", "distance2", "--stats", "a.csv", "--resume", code=2).stderr


def test_lists_that_are_counted(place: Path) -> None:
    """Of every engine those of its front end."""
    view = View(camera(), scene_of(400), order=SortOrder.DISTANCE)
    count = {words: len(seen_by(view, parse_engine(words, "x").drawing()).entry) for words in (
        "--engine reference", "--engine rtl", "--front golden", "--engine rtl --front rtl", "--engine chip", "--engine chip --lists box",
    )}
    exact, _, packed, rtl, chip, box = count.values()
    assert count["--engine rtl"] == exact and packed == rtl == chip < box


def test_refused(place: Path) -> None:
    assert "'near' is not one of 'depth', 'distance'" in run("render", "scene.ply", "--order", "near", code=2).stderr.replace("\n", " ")
    assert run("stability", "--order", "distance", code=2).stderr == "flicker: --order: for --moving only\n"
    text = "scenes: [{path: scene.ply, order: %s}]\nconfigurations: [lanes]\n"
    Path("bad.yaml").write_text(text % "near")
    assert run("sweep", "bad.yaml", code=2).stderr == "flicker: bad.yaml: scenes[0]: order: input should be 'depth' or 'distance', not 'near'\n"
    hashes = []
    for order in ("depth", "distance"):
        Path("a.yaml").write_text(text % order)
        found = load_sweep("a.yaml")
        assert found.targets[0].load().order.value == order
        hashes.append(found.hash)
    Path("a.yaml").write_text("scenes: [scene.ply]\nconfigurations: [lanes]\n")
    assert hashes[0] != hashes[1] and load_sweep("a.yaml").hash == hashes[0]


def test_moving_families_of_the_command(tmp_path: Path) -> None:
    run("stability", "--moving", "--order", "distance", "--quick", "--family", "swap", "--config", "front-chunk-16", "--out", tmp_path)
    assert [float(row["pops"]) for row in csv.DictReader((tmp_path / "moving.csv").open())] == [0.0, 0.0]
