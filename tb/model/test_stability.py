"""Stability suite: quick run without a NaN, known failures where they are known, front ends, writers and bad input.

The full suite runs by `flicker stability`; the quick choice of configurations and steps stands for it here.
"""

from __future__ import annotations

import csv
import math
import os
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.runner import seed
from rich.console import Console
from typer.testing import CliRunner

from flicker.cli.main import app
from flicker.errors import FlickerError
from flicker.explore.configurations import run
from flicker.explore.stability import BROKEN_PSNR, FAMILIES, FRONT_ENDS, Case, Stability, break_table, run_stability, write_csv, write_pictures
from flicker.explore.stability.families import SIZE, _scene, crop
from flicker.explore.stability.front_ends import Drawer, FrontEnd, draw, drawable, in_float64
from flicker.explore.stability.run import ABSOLUTE, suite
from flicker.explore.stability.write import FRONT_TABLES
from flicker.front.records import build_lists
from flicker.front.view import View
from flicker.golden.front.frame import run_front
from flicker.golden.front.record import RecordKind
from flicker.output import check_folder
from flicker.params import TILE, Coords, RenderConfig
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat
from flicker.scene.packing import pack

# Where records of 16 bytes break earlier than those of 32, by format of the image.
EARLIER = {("colour", PackedFormat.CHUNK), ("colour", PackedFormat.FP16_LOCAL), ("faint", PackedFormat.FP16_LOCAL), ("sh", PackedFormat.FP16_LOCAL)}


@pytest.fixture(scope="module")
def quick() -> Stability:
    """The quick suite."""
    return run_stability(quick=True, seed=seed())


def test_no_nan(quick):
    """NaN never reaches a picture, at any step of any family."""
    assert quick.families == list(FAMILIES) and len(quick.configurations) >= 14
    for p in quick.points:
        assert not p.has_nan and not math.isnan(p.psnr_db) and not math.isnan(p.max_error), p
    fronts = [name for name in quick.configurations if name in FRONT_ENDS]
    steps = sum(len({0, len(f.values) // 2, len(f.values) - 1}) for f in FAMILIES.values())
    assert len(fronts) == 4 and len(quick.points) == steps * len(quick.configurations) - len(fronts)  # a screen of 16384 is none for them


def test_harmless_steps(quick):
    """The first step of every family is harmless: without a test every form stays above 40 dB."""
    for p in quick.points:
        if p.step == 0 and p.configuration in ("vanilla", "no-ctu-32", "no-ctu-32-conic", "rows"):
            assert not p.broken, p


@pytest.fixture(scope="module")
def fronts() -> Stability:
    """Every step of every family through every front end, with the seed of the tables in docs/."""
    return run_stability(names=list(FRONT_ENDS), seed=1)


def test_records_of_16_bytes_break_no_earlier(fronts):
    """Than those of 32 bytes, but where docs/reference/stability.md says so: opacity between two codes, colours above 2."""
    earlier = set()
    for family in FAMILIES:
        for image in (PackedFormat.CHUNK, PackedFormat.FP16_LOCAL):
            small, large = (fronts.breaks(family, FrontEnd(image, kind).name) for kind in (RecordKind.FACTORED16, RecordKind.CONIC32))
            if small is not None and (large is None or small.step < large.step):
                earlier.add((family, image))
    assert earlier == EARLIER
    worst = {(f, m): min(p.psnr_db for p in fronts.sweep(f, m)) for f in fronts.families for m in fronts.configurations}
    for family in ("thin", "thin_far", "far_mean", "inside"):  # nothing cancels in the factored form
        assert worst[family, "front-fp16-local-16"] > worst[family, "front-fp16-local-32"] + 8
        assert worst[family, "front-chunk-16"] > worst[family, "front-chunk-32"] + 5
    assert not any(p.has_nan or math.isnan(p.psnr_db) or math.isnan(p.max_error) for p in fronts.points)


def test_front_tables(fronts):
    """A row for every family, a cell for every front end, break points as in the points."""
    for name, made in FRONT_TABLES.items():
        lines = made(fronts).splitlines()
        header, rows = lines[0], {line.split(" | ")[0].strip("| "): line for line in lines[2:]}
        assert list(rows) == list(FAMILIES)
        assert "nan" not in "".join(lines) and all(line.count("|") == header.count("|") for line in lines)
        assert header.count("bytes") == (4 + 1 if name == "records" else 4) and (name == "formats") == ("21/13/13" in header)
    records, formats = (made(fronts).splitlines() for made in FRONT_TABLES.values())
    place = {name: 2 + k for k, name in enumerate(FAMILIES)}
    colour = records[place["colour"]]
    assert "| **10** (" in colour and colour.endswith("| `chunk`, `fp16-local` |")
    assert records[place["inside"]].endswith("| - |")
    loss = float(formats[place["inside"]].split(" | ")[3].split(" ")[0])
    assert 0.0 < loss == pytest.approx(max(
        b.psnr_db - a.psnr_db for a, b in zip(fronts.sweep("inside", "front-fp16-local-16"), fronts.sweep("inside", "front-fp16-local-16-21/13/13"))
    ), abs=0.06)


def case_of(name: str, step: int) -> Case:
    """A step of a family."""
    return FAMILIES[name].make(FAMILIES[name].values[step], np.random.default_rng(seed()))


def test_front_end_of_a_window():
    """The window's picture is that part of the whole picture: of the records, and of the truth."""
    case = case_of("covering", 1)
    assert case.screen.width == 256 and case.origin == (192, 192)
    rng = np.random.default_rng(seed())
    n = 60
    case.scene = _scene(rng.uniform(180, 256, (n, 2)), rng.uniform(1, 5, (n, 2)), 0.5, np.sort(rng.uniform(2, 6, n)), 0.7, rng.random((n, 3)), case.screen)
    frame = run_front(pack(case.scene, PackedFormat.FP16_LOCAL).packed, case.screen)
    whole = Case(case.projected, case.screen, case.scene, case.screen)
    part = np.s_[192:, 192:]
    assert draw(case, frame).max() > 0.3
    assert np.array_equal(draw(case, frame), draw(whole, frame)[part])
    assert np.allclose(in_float64(case, case.scene), in_float64(whole, case.scene)[part], atol=1e-12)


def test_truth_of_a_front_end():
    """Float64 depths decide; equal ones keep the packed scene's order; a scene written well is drawn in place of the one given."""
    equal = case_of("depth_gap", -1)
    image, reference = Drawer(equal)(FRONT_ENDS["front-fp16-local-32"])
    assert psnr(image, reference) > 55 > 40 > psnr(image, in_float64(equal, equal.scene))
    assert psnr(reference, in_float64(equal, equal.scene)) < 40
    long = case_of("quaternion", 4)
    packed, reference = Drawer(long)(FRONT_ENDS["image-chunk"])
    assert 45 < psnr(packed, reference) < 70 and np.allclose(reference, in_float64(long, long.meant), atol=1e-9)
    long.meant = case_of("colour", 0).scene
    image, reference = Drawer(long)(FRONT_ENDS["front-chunk-16"])
    assert psnr(image, reference) < 40 and np.allclose(reference, in_float64(long, long.meant), atol=1e-9)
    assert not drawable(case_of("screen", -1)) and drawable(case_of("screen", 3))


def test_known_failures(quick):
    """What docs/reference/stability.md says fails, fails here: the suite sees what it is there for."""
    worst = {(f, m): min(p.psnr_db for p in quick.sweep(f, m)) for f in quick.families for m in quick.configurations}
    assert worst["thin", "no-ctu-32-conic"] < 30 and worst["thin", "no-ctu-32"] > worst["thin", "no-ctu-32-conic"] + 10
    assert worst["far_mean", "no-ctu-32-conic"] < 30 and worst["far_mean", "no-ctu-32"] > 50
    assert worst["screen", "no-ctu-32" + ABSOLUTE] < 35 and worst["screen", "no-ctu-32"] > 55
    assert worst["thin", "flicker"] < 35
    for family in quick.families:  # masks with a proof cost nothing, however hard the input
        assert worst[family, "rows"] == worst[family, "no-ctu-32"] == worst[family, "oracle"]
        assert worst[family, "exact-fp16-conic-bound"] == worst[family, "no-ctu-32-conic"]
    first = quick.breaks("thin", "no-ctu-32-conic")
    assert first is not None and first.psnr_db < BROKEN_PSNR and first.step > 0


@pytest.mark.slow
def test_all_configurations_once():
    """Every configuration of the full suite through the worst step of two families: a finite picture."""
    full = run_stability(["thin_far", "colour"], suite(), quick=True, seed=seed())
    assert full.configurations == suite() and not any(p.has_nan for p in full.points)
    assert {p.precision for p in full.points} >= {"fp16", "mixed", "fp8", "e4m3", "e5m2", "-"} and {p.form for p in full.points} == {"conic", "factored", "-"}


def test_repeatable():
    """Same seed, same numbers; another seed, others."""
    for name in ("faithful", "front-chunk-16"):
        a, b, c = (run_stability(["thin"], [name], seed=s, quick=True).points for s in (3, 3, 4))
        assert a == b and a != c


def test_window_of_a_large_screen():
    """A cropped window has the sub-tile lists of the whole screen, with local and with absolute coordinates."""
    family = FAMILIES["screen"]
    from flicker.front.projection import project
    from flicker.scene.camera import Camera

    wide = Camera(1024, 1024, 1024.0, 1024.0, np.zeros(3), np.eye(3))
    rng = np.random.default_rng(seed())
    n = 120
    scene = _scene(rng.uniform(770, 820, (n, 2)), rng.uniform(0.6, 4, (n, 2)), 0.5, np.sort(rng.uniform(2, 6, n)), 0.5, 0.4, wide)
    projected = project(scene, wide)
    window, camera = crop(projected, wide, 768, 768)
    for coords in Coords:
        whole = build_lists(projected, wide, RenderConfig(coords=coords))
        part = View(camera, projected=window, coords=coords, origin=(768, 768)).lists(whole.form)
        entries = 0
        for s in range(part.cols * part.rows):
            t = (96 + s // part.cols) * whole.cols + 96 + s % part.cols
            a, b = slice(part.start[s], part.start[s + 1]), slice(whole.start[t], whole.start[t + 1])
            assert np.array_equal(part.mean[a], whole.mean[b])
            assert np.array_equal(part.gauss[part.entry[a]], whole.gauss[whole.entry[b]])
            entries += part.start[s + 1] - part.start[s]
        assert entries > 500 and camera.width == SIZE
    assert family.values[-1] + SIZE <= 16384


def test_families_do_what_they_say():
    """Spot checks: axis ratios, opacities, lengths of lists, equal depths, FP16 overflow, clusters, tiles."""
    case = case_of
    cov = case("thin", -1).projected.cov2d
    mid, gap = (cov[:, 0] + cov[:, 2]) / 2, np.sqrt((cov[:, 0] - cov[:, 2]) ** 2 / 4 + cov[:, 1] ** 2)
    assert np.sqrt((mid + gap) / np.maximum(mid - gap, 0.3)).max() > 3000
    assert np.abs(case("far_mean", -1).projected.mean).max() > 30000
    assert (case("opaque", -1).projected.opacity == 1).all()
    assert len(np.unique(case("depth_gap", -1).projected.depth)) == 1
    assert case("layers", -1).projected.n_visible > 9000
    assert case("colour", -1).projected.rgb.max() > 65504
    assert case("sh", -1).projected.rgb.max() > 1e4 and case("sh", 0).projected.rgb.max() < 1.1 and case("sh", 0).scene.sh_degree == 3
    levels = [255 * FAMILIES["threshold"].make(v, np.random.default_rng(seed())).scene.opacities.min() for v in FAMILIES["threshold"].values]
    assert np.allclose(levels, FAMILIES["threshold"].values) and min(levels) < 1 < max(levels)
    inside = pack(case("cluster", 2).scene, PackedFormat.FP16_LOCAL).packed
    assert len(inside.table) == 1 and len(inside) == 256 and (inside.table["low"] < 0).all() and (inside.table["high"] > 0).all()  # the camera is at 0
    assert not (pack(case("cluster", 0).scene, PackedFormat.FP16_LOCAL).packed.table["low"] < 0).all()
    assert case("behind", 0).projected.n_visible == 100 and case("behind", 3).projected.n_visible == 1 and case("behind", -1).projected.n_visible == 0
    crowd = case("one_tile", -1)
    frame = run_front(pack(crowd.scene, PackedFormat.FP16_LOCAL).packed, crowd.screen)
    assert crowd.screen.width == TILE and len(frame.packed.table) == 1 and len(frame.entry_tile) == 256 and len(np.unique(frame.splats().mean, axis=0)) < 8
    large = case("covering", -1)
    frame = run_front(pack(large.scene, PackedFormat.FP16_LOCAL).packed, large.screen)
    assert large.camera.width == SIZE and len(frame.entry_tile) == 256**2 and (frame.entry_mask == 15).all()
    depth = case("depth_range", -1).projected.depth
    assert depth.min() < 0.4 and depth.max() > 5e4


def test_writers(quick, tmp_path):
    """Table, CSV and pictures hold every point, family and configuration."""
    write_csv(quick, tmp_path / "s.csv")
    rows = list(csv.DictReader((tmp_path / "s.csv").open()))
    assert len(rows) == len(quick.points)
    assert {r["configuration"] for r in rows} == set(quick.configurations) and sum(r["broken"] == "1" for r in rows) == sum(p.broken for p in quick.points)
    console = Console(width=300, record=True, file=open(os.devnull, "w"))
    console.print(break_table(quick))
    text = console.export_text()
    assert all(f in text for f in quick.families) and all(m in text for m in quick.configurations)
    for picture in write_pictures(quick, tmp_path):
        assert picture.read_bytes()[:4] == b"\x89PNG"


def test_bad_input(tmp_path):
    """One clear line, before any work."""
    with pytest.raises(FlickerError, match="unknown family 'thim'; known are thin"):
        run_stability(["thim"])
    with pytest.raises(FlickerError, match="configuration 'flickr' is unknown; close names: flicker"):
        run_stability(["thin"], ["flickr"])
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(FlickerError, match="file/out: no folder can be made there"):
        check_folder(blocked / "out")
    with pytest.raises(FlickerError, match="cannot be written"):
        write_csv(Stability((), 1), Path(tmp_path / "none" / "s.csv"))


def test_command(tmp_path):
    """The sub-command: list, a run with results, a bad family."""
    runner = CliRunner()
    listing = runner.invoke(app, ["stability", "--list"])
    assert listing.exit_code == 0 and "thin_far" in listing.output and "rows" in listing.output
    done = runner.invoke(app, ["stability", "--family", "faint", "--config", "faithful", "--quick", "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    table = (tmp_path / "o" / "stability.md").read_text()
    assert "| `faithful` |" in table and "| faint | " in table
    assert len((tmp_path / "o" / "stability.csv").read_text().splitlines()) == 4 and not (tmp_path / "o" / "front_records.md").exists()
    front = runner.invoke(app, ["stability", "--family", "opaque", "--front", "--quick", "--out", str(tmp_path / "f")])
    assert front.exit_code == 0, front.output
    for name in FRONT_TABLES:
        assert "| opaque | " in (tmp_path / "f" / f"front_{name}.md").read_text()
    bad = runner.invoke(app, ["stability", "--family", "nothing", "--out", str(tmp_path / "o")])
    assert isinstance(bad.exception, FlickerError)


def test_absolute_lists_of_other_kinds():
    """Absolute coordinates are defined for sub-tile lists; asking for others is an error, not a wrong picture."""
    case = FAMILIES["screen"].make(0.0, np.random.default_rng(1))
    with pytest.raises(FlickerError, match="absolute coordinates"):
        run("vanilla", View(case.camera, projected=case.projected, coords=Coords.ABSOLUTE, origin=case.origin))
