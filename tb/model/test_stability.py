"""Stability suite: quick run without a NaN, known failures where they are known, writers and bad input.

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
from flicker.explore.stability import BROKEN_PSNR, FAMILIES, Stability, break_table, run_stability, write_csv, write_pictures
from flicker.explore.stability.families import SIZE, crop
from flicker.explore.stability.run import ABSOLUTE, suite
from flicker.explore.stability.write import check_folder
from flicker.front.records import build_lists
from flicker.front.view import View
from flicker.params import Coords, RenderConfig


@pytest.fixture(scope="module")
def quick() -> Stability:
    """The quick suite."""
    return run_stability(quick=True, seed=seed())


def test_no_nan(quick):
    """NaN never reaches a picture, at any step of any family."""
    assert quick.families == list(FAMILIES) and len(quick.configurations) >= 14
    for p in quick.points:
        assert not p.has_nan and not math.isnan(p.psnr_db) and not math.isnan(p.max_error), p
    assert len(quick.points) == sum(len({0, len(f.values) // 2, len(f.values) - 1}) for f in FAMILIES.values()) * len(quick.configurations)


def test_harmless_steps(quick):
    """The first step of every family is harmless: without a test every form stays above 40 dB."""
    for p in quick.points:
        if p.step == 0 and p.configuration in ("vanilla", "no-ctu-32", "no-ctu-32-conic", "rows"):
            assert not p.broken, p


def test_known_failures(quick):
    """What docs/stability.md says fails, fails here: the suite sees what it is there for."""
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


def test_all_configurations_once():
    """Every configuration of the full suite through the worst step of two families: a finite picture."""
    full = run_stability(["thin_far", "colour"], suite(), quick=True, seed=seed())
    assert full.configurations == suite() and not any(p.has_nan for p in full.points)
    assert {p.precision for p in full.points} >= {"fp16", "mixed", "fp8", "e4m3", "e5m2", "-"} and {p.form for p in full.points} == {"conic", "factored"}


def test_repeatable():
    """Same seed, same numbers; another seed, others."""
    a, b, c = (run_stability(["thin"], ["faithful"], seed=s).points for s in (3, 3, 4))
    assert a == b and a != c


def test_window_of_a_large_screen():
    """A cropped window has the sub-tile lists of the whole screen, with local and with absolute coordinates."""
    family = FAMILIES["screen"]
    from flicker.explore.stability.families import _scene
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
    """Spot checks: axis ratios, opacities, lengths of lists, equal depths, FP16 overflow."""
    def case(name: str, step: int):
        return FAMILIES[name].make(FAMILIES[name].values[step], np.random.default_rng(seed()))

    cov = case("thin", -1).projected.cov2d
    mid, gap = (cov[:, 0] + cov[:, 2]) / 2, np.sqrt((cov[:, 0] - cov[:, 2]) ** 2 / 4 + cov[:, 1] ** 2)
    assert np.sqrt((mid + gap) / np.maximum(mid - gap, 0.3)).max() > 3000
    assert np.abs(case("far_mean", -1).projected.mean).max() > 30000
    assert (case("opaque", -1).projected.opacity == 1).all()
    assert len(np.unique(case("depth_gap", -1).projected.depth)) == 1
    assert case("layers", -1).projected.n_visible > 9000
    assert case("colour", -1).projected.rgb.max() > 65504
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
    assert len((tmp_path / "o" / "stability.csv").read_text().splitlines()) == 4
    bad = runner.invoke(app, ["stability", "--family", "nothing", "--out", str(tmp_path / "o")])
    assert isinstance(bad.exception, FlickerError)


def test_absolute_lists_of_other_kinds():
    """Absolute coordinates are defined for sub-tile lists; asking for others is an error, not a wrong picture."""
    case = FAMILIES["screen"].make(0.0, np.random.default_rng(1))
    with pytest.raises(FlickerError, match="absolute coordinates"):
        run("vanilla", View(case.camera, projected=case.projected, coords=Coords.ABSOLUTE, origin=case.origin))
