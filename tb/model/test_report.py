"""Report: a small one on the demo scene, resumed from its store; FLIP and SSIM; verdicts; bad input.

FLIP is compared with a second implementation by two-dimensional convolutions and with values that follow from its publication: 0 for equal
pictures, 1 for plain green against plain blue, the largest distance of colours 41.2761. The report on real scenes is run by hand (docs/reference/report.md).
"""

from __future__ import annotations

import base64
import csv
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from inspect import signature

import numpy as np
import pytest
from flicker_tb.bench import rounds
from flicker_tb.runner import seed
from PIL import Image
from scene_samples import random_scene, thinned
from scipy.signal import convolve2d
from typer.testing import CliRunner

from flicker.chip.drawing import Drawing
from flicker.cli.main import app
from flicker.cli.report import report
from flicker.errors import FlickerError
from flicker.explore import facts
from flicker.explore.configurations import group
from flicker.explore.evaluate import evaluate
from flicker.explore.points import SceneFile, Target
from flicker.explore.store import Store
from flicker.explore.sweep import load_sweep, run_sweep
from flicker.front.paths import path_of
from flicker.front.view import DEMO, View, load_view
from flicker.motion import strip as shown
from flicker.motion.frames import Wanted
from flicker.motion.keep import Kept
from flicker.motion.record import Recording, record, summary_of
from flicker.params import FAITHFUL, RECOMMENDED, Form
from flicker.report import claims, collect, figures, moving, page
from flicker.report.write import SUMMARY, check, write_report
from flicker.scene import metrics
from flicker.scene.demo import generate
from flicker.scene.files import save_ply
from flicker.scene.sources import open_scene

SIZE = 160, 90
NAMES = ["vanilla", "no-ctu-32-conic", "no-ctu-64-conic", "gscore-conic", "faithful", "lanes"] + [
    f"flicker-{mode}-mixed-conic" for mode in ("dense", "sparse", "smooth", "spiky")
] + ["flicker-smooth-fp16-conic", "flicker-smooth-fp8-conic", "log-lanes"]  # stages with other parts of energy than the first


@pytest.fixture(scope="module", autouse=True)
def demo_scene():
    """A part of the demo scene in its place; with SLOW=1 all of it."""
    scene = thinned(generate(), rounds(6, 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flicker.scene.demo.generate", lambda seed=1: scene)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A report on the demo scene: (job, what was written, the calls of its progress)."""
    folder = tmp_path_factory.mktemp("report")
    cost = {"cycles": 1e6, "lane_cycles": 3e5, "bytes": 2e7, "picture_bytes": 3e6, "image_bytes": 1000}
    steps = [{"step": "", "gaussians": n, "coefficients": 4.0, "decibels": dB, "cost": cost} for n, dB in ((100, None), (50, 40.0), (25, 30.0))]
    (folder / "budget.json").write_text(json.dumps({"scene": "a/demo.ply", "gaussians": [100, 25], "steps": steps}))
    job = check([], folder / "out", SIZE, NAMES, folder / "store", budgets=[folder / "budget.json"], frames=2)
    calls = []
    return job, write_report(job, seed(), lambda *call: calls.append(call)), calls


def _rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# -- metrics --------------------------------------------------------------------------------------------------------------------------


def _flip_2d(image, reference, ppd):
    """FLIP restated: two-dimensional kernels, colours by CIE's definitions, pixel loops nowhere shared with the module."""
    matrix = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
    white = matrix @ np.ones(3)

    def linear(c):
        return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)

    def conv(channel, kernel):
        pad = kernel.shape[0] // 2
        return convolve2d(np.pad(channel, pad, mode="edge"), kernel, mode="valid")

    def grid(radius):
        return np.meshgrid(np.arange(-radius, radius + 1), np.arange(-radius, radius + 1))

    def prepared(picture):
        xyz = linear(picture) @ matrix.T / white
        opponent = [116 * xyz[..., 1] - 16, 500 * (xyz[..., 0] - xyz[..., 1]), 200 * (xyz[..., 1] - xyz[..., 2])]
        radius = math.ceil(3 * math.sqrt(0.04 / (2 * math.pi**2)) * ppd)
        x, y = grid(radius)
        d = (x**2 + y**2) / ppd**2
        seen = []
        for channel, terms in zip(opponent, ([(1, 0.0047)], [(1, 0.0053)], [(34.1, 0.04), (13.5, 0.025)])):
            kernel = sum(a * math.sqrt(math.pi / b) * np.exp(-(math.pi**2) * d / b) for a, b in terms)
            seen.append(conv(channel, kernel / kernel.sum()))
        y_ = (seen[0] + 16) / 116
        rgb = np.clip(np.stack([y_ + seen[1] / 500, y_, y_ - seen[2] / 200], -1) * white @ np.linalg.inv(matrix).T, 0, 1)
        t = rgb @ matrix.T / white
        f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t * (29 / 6) ** 2 / 3 + 4 / 29)
        light = 116 * f[..., 1] - 16
        sd = 0.041 * ppd
        x, y = grid(math.ceil(3 * sd))
        g = np.exp(-(x**2 + y**2) / (2 * sd**2))
        strengths = []
        for kernel in (-x * g, (x**2 / sd**2 - 1) * g):
            kernel = np.where(kernel < 0, kernel / -kernel[kernel < 0].sum(), kernel / kernel[kernel > 0].sum())
            strengths.append(np.hypot(conv(xyz[..., 1], kernel), conv(xyz[..., 1], kernel.T)))
        return np.stack([light, 5 * light * (f[..., 0] - f[..., 1]), 2 * light * (f[..., 1] - f[..., 2])], -1), strengths

    (lab_a, (edge_a, point_a)), (lab_b, (edge_b, point_b)) = prepared(image), prepared(reference)
    delta = np.abs(lab_a - lab_b)
    colour = (delta[..., 0] + np.linalg.norm(delta[..., 1:], axis=-1)) ** 0.7
    top = 41.2761
    colour = np.where(colour < 0.4 * top, 0.95 * colour / (0.4 * top), 0.95 + 0.05 * (colour - 0.4 * top) / (0.6 * top))
    feature = np.sqrt(np.maximum(np.abs(edge_a - edge_b), np.abs(point_a - point_b)) / math.sqrt(2))
    return np.clip(colour, 0, 1) ** (1 - np.clip(feature, 0, 1))


@pytest.mark.parametrize("ppd", [67.0206, 20.0])
def test_flip_equals_restatement(ppd):
    """Noise, edges, fine and coarse differences, at two distances of the observer."""
    rng = np.random.default_rng(seed())
    reference = np.kron(rng.random((4, 5, 3)), np.ones((8, 8, 1)))
    for image in (rng.random(reference.shape), np.clip(reference + 0.02 * rng.normal(size=reference.shape), 0, 1), np.roll(reference, 2, axis=1)):
        assert np.abs(metrics.flip_map(image, reference, ppd) - _flip_2d(image, reference, ppd)).max() < 2e-4


def test_flip_published_values():
    """Equal pictures, the extreme colours, symmetry, growth with the difference, the constants of the publication."""
    rng = np.random.default_rng(seed())
    a, black = rng.random((24, 32, 3)), np.zeros((24, 32, 3))
    assert metrics.flip(a, a) == 0.0
    assert metrics.flip(black + [0, 1, 0], black + [0, 0, 1]) == pytest.approx(1.0, abs=1e-9)
    assert metrics._largest_colour_error() == pytest.approx(41.2761, abs=5e-5)
    assert metrics.PIXELS_PER_DEGREE == pytest.approx(67.0206, abs=5e-5)
    b, c = np.clip(a + 0.02, 0, 1), np.clip(a + 0.2, 0, 1)
    assert metrics.flip(a, b) == metrics.flip(b, a)
    assert 0 < metrics.flip(b, a) < metrics.flip(c, a) < 1
    step = black.copy()
    step[:, 16:] = 0.05
    far = metrics.flip_map(step, black)
    assert far[:, 16:20].mean() > far[:, 26:].mean() > far[:, :6].mean()  # an edge that should not be there is worse than the shift of brightness
    assert metrics.flip(a + 5.0, np.ones_like(a)) == 0.0  # clamped to [0, 1] first


def test_remembered_metrics_look_at_content():
    """A picture changed in place is measured again; other parameters too."""
    rng = np.random.default_rng(seed())
    a, b = rng.random((2, 16, 16, 3))
    first = metrics.flip(a, b), metrics.ssim(a, b)
    assert (metrics.flip(a, b), metrics.ssim(a.copy(), b)) == first
    assert metrics.flip(a, b, 20.0) != first[0]
    a[:] = b
    assert (metrics.flip(a, b), metrics.ssim(a, b)) == (0.0, pytest.approx(1.0))


# -- the report -----------------------------------------------------------------------------------------------------------------------


def test_summary(made):
    """One row per configuration, equal to what `evaluate` says."""
    job, written, _ = made
    rows = _rows(written.summary)
    assert [r["config"] for r in rows] == NAMES and set(SUMMARY) <= set(rows[0])
    data = load_view(DEMO, 0, SIZE)
    parts = {r["config"]: {key for key in r if key.startswith("energy_uj_") and r[key]} for r in rows}
    assert parts["log-lanes"] - parts["faithful"] and parts["faithful"] - parts["log-lanes"]
    for name in ("faithful", "vanilla", "log-lanes"):
        row = next(r for r in rows if r["config"] == name)
        fresh = evaluate(data, name).row
        assert int(row["cycles"]) == fresh["cycles"] and row["model_only"] == str(fresh["model_only"])
        for key in ("psnr_db", "ssim", "flip", "area_ge", "energy_uj"):
            assert float(row[key]) == pytest.approx(fresh[key], rel=1e-6), (name, key)
    assert all(float(r["cycles"]) > 0 and 0 < float(r["ssim"]) <= 1 and 0 <= float(r["flip"]) < 1 for r in rows)


class _Page(HTMLParser):
    """Collects what a page refers to."""

    def __init__(self):
        super().__init__()
        self.sources, self.links, self.ids = [], [], set()

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.sources += [attrs["src"]] if "src" in attrs else []
        self.links += [attrs["href"]] if "href" in attrs else []
        self.ids |= {attrs["id"]} if "id" in attrs else set()


def test_page_is_self_contained(made):
    """No network, no missing file, every figure there, the chart's points those of the summary."""
    job, written, _ = made
    text = written.page.read_text()
    parsed = _Page()
    parsed.feed(text)
    assert len(parsed.sources) >= 8 and all(s.startswith("data:image/") for s in parsed.sources)
    for link in parsed.links:
        assert link[1:] in parsed.ids if link.startswith("#") else (job.folder / link).is_file(), link
    assert not re.search(r"(@import|fetch\(|XMLHttpRequest|<script src|url\(http)", text)
    for name in ("fig3a_modes", "fig4_intersection", "fig7c_precision", "fig8_rendering_stage", "fig9_fifo_depth", "fig10_whole_system",
                 "table1_contribution_test", "table2_area", "heat_demo_0", "stability", "budget", "speed_stability"):
        assert name in parsed.ids and (job.folder / "figures" / f"{name}.csv").stat().st_size > 30, name
    for name in ("fig8_rendering_stage", "speed_accuracy", "heat_demo_0", "speed_stability"):
        assert all((job.folder / "figures" / f"{name}.{kind}").stat().st_size > 5000 for kind in ("png", "svg"))
    points = json.loads(re.search(r"const DATA = (.*);\n", text).group(1))["demo 0"]
    for point, row in zip(points, _rows(written.summary), strict=True):
        assert point["config"] == row["config"] and float(point["cycles"]) == float(row["cycles"])
        assert point["psnr_db"] == pytest.approx(float(row["psnr_db"])) and point["flip"] == pytest.approx(float(row["flip"]))


def test_figures_hold_the_data(made):
    """FIFO depths 1 to 128, tile sizes 4 to 32, modes and builds with the numbers of the summary."""
    job, written, _ = made
    summary = {r["config"]: r for r in _rows(written.summary)}
    folder = job.folder / "figures"
    fifo = _rows(folder / "fig9_fifo_depth.csv")
    assert [int(r["fifo_depth"]) for r in fifo] == [1, 2, 4, 8, 16, 32, 64, 128]
    assert int(next(r for r in fifo if r["fifo_depth"] == "16")["cycles"]) == int(summary["faithful"]["cycles"])
    assert int(fifo[0]["cycles"]) > int(fifo[-1]["cycles"]) and float(fifo[0]["ctu_stall_rate"]) > float(fifo[-1]["ctu_stall_rate"])
    four = _rows(folder / "fig4_intersection.csv")
    pairs = [int(r["value"]) for r in four if r["what"] == "duplicates"]
    assert len(pairs) == 4 and pairs == sorted(pairs, reverse=True)
    for r in _rows(folder / "fig8_rendering_stage.csv"):
        assert float(r["cycles"]) == float(summary[r["config"]]["cycles"])
    heat = {(r["config"], r["map"]): r for r in _rows(folder / "heat_demo_0.csv")}
    for name in ("vanilla", "faithful", "lanes"):
        row = summary[name]
        assert float(heat[name, "gaussians"]["mean"]) == pytest.approx(int(row["pixels_visited"]) / (SIZE[0] * SIZE[1]), rel=0.1)
        assert float(heat[name, "error"]["mean"]) == pytest.approx(float(row["flip"]), rel=1e-4)
    modes = {r["mode"]: int(r["leader_pixels"]) for r in _rows(folder / "fig3a_modes.csv")}
    assert modes["Uniform-Dense"] == 2 * modes["Uniform-Sparse"]
    assert modes["Smooth-Focused"] + modes["Spiky-Focused"] == modes["Uniform-Dense"] + modes["Uniform-Sparse"]


def test_resumed_in_seconds(made):
    """The second run computes no configuration and writes the same bytes; a lost result is the only one computed again."""
    job, written, calls = made
    before = {p.name: p.read_bytes() for p in (written.page, written.summary)}
    stored = {p: p.stat().st_mtime_ns for p in job.store.iterdir()}
    assert calls[-1][:2] == (1, 1) and any(c[2] == "demo 0: faithful" for c in calls)
    again = write_report(job, seed())
    assert {p.name: p.read_bytes() for p in (again.page, again.summary)} == before
    assert {p: p.stat().st_mtime_ns for p in job.store.iterdir()} == stored
    rows = {p: json.loads(p.read_text()) for p in stored if p.suffix == ".json"}
    for path, run in (
        (None, lambda: collect.collect(job.targets, NAMES, Store(job.store))),
        ("shake", lambda: moving.collect_moving(job.targets, job.moving, job.frames, Store(job.store))),
    ):
        lost = next(p for p, row in rows.items() if row.get("config") == "faithful" and row.get("path") == path)
        lost.write_text("{")  # a torn file counts as lost
        before = {p: p.stat().st_mtime_ns for p in job.store.iterdir()}
        run()
        changed = {p for p in job.store.iterdir() if p.stat().st_mtime_ns != before.get(p)}
        assert lost in changed and changed <= {lost, lost.with_suffix(".npz")} and json.loads(lost.read_text()) == rows[lost]


# -- stability over time --------------------------------------------------------------------------------------------------------------

DRAWN = {"faithful": FAITHFUL, "log-lanes": RECOMMENDED}


@pytest.mark.parametrize("motion", [pytest.param(name, marks=[pytest.mark.slow] * (name != "pan")) for name in moving.MOTIONS])
def test_figures_in_motion(made, motion, tmp_path):
    """Temporal figures are those that `flicker.motion` finds along the same path, cycles the mean of those of the frames."""
    job, _, _ = made
    source = open_scene(DEMO)
    cameras = path_of(source, replace(moving.MOTIONS[motion][1], size=SIZE, frames=2))[0]
    rows = {row["config"]: row for row in _rows(job.folder / "figures" / "speed_stability.csv") if row["motion"] == motion}
    assert list(rows) == NAMES and {row["view"] for row in rows.values()} == {"demo 0"}
    for name, config in DRAWN.items():
        kept = Kept(tmp_path / name, whole=True)
        kept.begin({"frames": 2}, resume=False)
        wanted = Wanted(Drawing(config=config), reference=True)
        record(Recording(source.scene, DEMO, cameras, moving.FPS, 1e9, wanted, name), kept, 1, lambda n: None, pytest.fail)
        found = summary_of(kept.rows, moving.FPS)
        row = {key: float(value) for key, value in rows[name].items() if key not in ("motion", "view", "config")}
        cycles = np.mean([evaluate(View(camera, source.scene), name).row["cycles"] for camera in cameras])
        assert row == pytest.approx({
            "million_cycles": cycles / 1e6, "psnr_db": found.psnr_db, "temporal_psnr_db": found.temporal_psnr_db, "jumps_percent": 100 * found.jumps,
        }, rel=1e-5)


def test_page_in_motion(made):
    """The table has the numbers of the CSV; the strip and the clip are there, whole, and in the page."""
    job, written, _ = made
    text, folder = written.page.read_text(), job.folder / "figures"
    table = re.search(r'<table class="moving">.*?</table>', text).group(0)
    lines = [re.findall(r"<t[hd]>(.*?)</t[hd]>", line) for line in re.findall(r"<tr>(.*?)</tr>", table.split("<tbody>")[1])]
    rows = _rows(folder / "speed_stability.csv")
    expected = {name: [name] for name in NAMES}
    for row in rows:
        jumps = moving.jumps_text(float(row["jumps_percent"]) / 100).replace("<", "&lt;")
        expected[row["config"]] += [f"{float(row['temporal_psnr_db']):.1f}", jumps, f"{float(row['million_cycles']):.3g}"]
    assert lines == list(expected.values()) and len(rows) == 3 * len(NAMES)
    assert "2 frames a motion at 90 Hz, 160x90" in text and "<a href='#motion'>" in text
    for name, suffix in (("flicker_strip_demo_0", "png"), ("flicker_clip_demo_0", "webp")):
        data = (folder / f"{name}.{suffix}").read_bytes()
        assert f'<section id="{name}">' in text and f"data:image/{suffix};base64,{base64.b64encode(data).decode()}" in text
    with Image.open(folder / "flicker_strip_demo_0.png") as picture:
        assert picture.height == 7 * (40 * 3 + 2) - 2 and picture.width > 6 * (40 * 3 + 2)
    with Image.open(folder / "flicker_clip_demo_0.webp") as film:
        assert (film.n_frames, film.size) == (moving.FILM, (2 * SIZE[0], 2 * SIZE[1]))


def test_strip_shows_what_flickers():
    """The square is where errors change, not where they are largest; rows are the reference, pictures, errors."""
    rng = np.random.default_rng(seed())
    references = [rng.random((60, 90, 3)) * 0.5 for _ in range(4)]
    still, blinking = (np.zeros((60, 90, 3)) for _ in range(2))
    still[5:15, 5:15], blinking[15:55, 45:85] = 0.4, 0.01
    bad = [reference + still + (n % 2) * blinking for n, reference in enumerate(references)]
    assert shown.flickering(bad, references, 40) == (45, 15)
    film = {shown.REFERENCE: references, "bad": bad, "good": references}
    picture = shown.strip(film, ("bad", "good"))
    step, left = 40 * 3 + 2, picture.shape[1] - (4 * (40 * 3 + 2) - 2)
    rows = [[picture[y : y + 120 : 3, left + x : left + x + 120 : 3] for x in range(0, 4 * step, step)] for y in range(0, 5 * step, step)]
    for n, reference in enumerate(references):
        square = reference[15:55, 45:85]
        for row, expected in zip(rows, (square, square + (n % 2) * 0.01, square, np.full_like(square, (n % 2) * 0.08), np.zeros_like(square)), strict=True):
            assert np.abs(row[n] / 255 - expected).max() < 0.003
    assert [frame.shape for frame in shown.clip(film, ("bad", "good"))] == [(120, 180, 3)] * 4


def test_what_moves(scene, tmp_path):
    """Configurations: those that are named, else the group; of each scene the first view; pictures no larger than asked for."""
    assert check([], tmp_path / "a", SIZE, NAMES, tmp_path / "store").moving == tuple(NAMES)
    usual = check([f"{scene}:3-4", "demo"], tmp_path / "a", (1000, 250), None, tmp_path / "store")
    assert (usual.moving, usual.frames) == (tuple(group("stability in time")), moving.FRAMES)
    assert signature(report).parameters["frames"].default == moving.FRAMES
    assert check([], tmp_path / "a", SIZE, None, tmp_path / "store", frames=0).moving == ()
    found = moving.collect_moving([replace(t, size=(64, 48)) for t in usual.targets], ["flicker"], 2, Store(tmp_path / "store"))
    assert [(m.target.title, m.size, m.filmed) for m in found] == [("small 3", (64, 48), (64, 48)), ("demo 0", (64, 48), (64, 48))]
    path = moving._path(usual.targets[0], moving.MOTIONS["walk"][1], 5, moving.MEASURED)
    assert (path.size, path.path.view, path.path.frames, path.view) == ((480, 120), 3, 5, 3)
    figure = moving.moving_figure(found)
    assert [row[:3] for row in figure.rows[:3]] == [["pan", "small 3", "flicker"], ["pan", "demo 0", "flicker"], ["shake", "small 3", "flicker"]]
    figure.write(tmp_path)


@pytest.mark.slow
def test_sweeps_rows_are_read(scene, tmp_path):
    """What a sweep has computed is not computed again, along paths too; what only the report shows of it is."""
    out = tmp_path / "sweep"
    views = "[0, {pan: 0.25, frames: 2}, {shake: true, frames: 2}, {walk: true, frames: 2}]"
    (tmp_path / "sweep.yaml").write_text(f"scenes: [{scene}]\nviews: {views}\nsize: 64x48\nconfigurations: [flicker, gscore]\nout: {out}\n")
    run_sweep(load_sweep(tmp_path / "sweep.yaml"))
    rows = {p: p.stat().st_mtime_ns for p in (out / "points").glob("*.json")}
    assert len(rows) == 8
    write_report(check([str(scene)], tmp_path / "out", (64, 48), ["flicker", "gscore"], out / "points", frames=2), seed())
    again = {p.name: p.stat().st_mtime_ns for p in rows}
    before = {p.name: t for p, t in rows.items()}
    assert sum(again[name] != before[name] for name in before) == 1  # flicker, for its maps


def test_duplicates_are_counted(scene):
    """Tile pairs by the definition: tiles with a pixel centre in the box."""
    data = load_view(scene, 0, (96, 64))
    found = facts.duplicates(data.projected, 96, 64)
    low, high = data.projected.mean - data.projected.radii, data.projected.mean + data.projected.radii
    for size in (8, 32):
        total = 0
        for (x0, y0), (x1, y1) in zip(low, high):
            columns = {x // size for x in range(96) if x0 <= x <= x1}
            total += len(columns) * len({y // size for y in range(64) if y0 <= y <= y1})
        assert found[str(size)] == total
    lists = data.lists(Form.CONIC)
    assert found["8"] == len(lists.entry)


def test_pareto():
    """Against the definition, ties included."""
    rng = np.random.default_rng(seed())
    points = [tuple(p) for p in rng.integers(0, 6, (40, 2)).astype(float)]
    front = {points[i] for i in figures.pareto(points)}
    beaten = {p for p in points if any(q[0] <= p[0] and q[1] >= p[1] and q != p for q in points)}
    assert front == set(points) - beaten


def test_moves(tmp_path):
    """An arrow and two circles for each machine; the numbers beside the picture."""
    figure = figures.moves("m", "Moved", [figures.Move("a", (2e5, 31.0), (1.8e5, 33.5)), figures.Move("b", (3e5, 30.0), (3e5, 30.0))], "dB")
    axes = figure.canvas.axes[0]
    assert [line.get_xydata().tolist() for line in axes.lines] == [[[200.0, 31.0]], [[180.0, 33.5]], [[300.0, 30.0]], [[300.0, 30.0]]]
    assert [(arrow.xyann, arrow.xy) for arrow in axes.texts] == [((200.0, 31.0), (180.0, 33.5)), ((300.0, 30.0), (300.0, 30.0))]
    figure.write(tmp_path)
    assert [row["psnr_db_after"] for row in _rows(tmp_path / "m.csv")] == ["33.5", "30"] and (tmp_path / "m.png").exists()


def _view(title: str, **values) -> collect.ViewResult:
    view = collect.ViewResult(Target(SceneFile(f"{title}.ply"), 0, SIZE))
    view.rows = {"a": values}
    return view


def test_bounds_stand_in_no_front():
    """Free masks beat everything here and are in no front; the RTL has its own; the page's points say which they are."""
    made = {
        "oracle": (1.0, 90.0, True), "lanes": (2.0, 70.0, True), "flicker": (3.0, 40.0, False), "no-ctu-64": (4.0, 65.0, False),
        "faithful": (5.0, 30.0, False),
    }
    view = _view("one")
    view.rows = {
        name: {"config": name, "title": name, "cycles": cycles, "psnr_db": db, "ssim": 1.0, "flip": 0.0, "area_ge": 1.0, "energy_uj": 1.0, "model_only": model}
        for name, (cycles, db, model) in made.items()
    }
    figure = figures.speed_accuracy([view])
    column = {name: figure.header.index(name) for name in figure.header}
    fronts = {
        which: {row[column["config"]] for row in figure.rows if row[column[which]]} for which in ("pareto", "pareto_of_rtl")
    }
    assert fronts == {"pareto": {"lanes"}, "pareto_of_rtl": {"flicker", "no-ctu-64"}}
    points = json.loads(page._points([view]))["one 0"]
    assert {p["config"] for p in points if p["bound"]} == {"oracle"}
    view.rows["lanes"]["area_ge"] = 4.0
    rows = figures.speed_area_accuracy([view]).rows
    assert {row[column["config"]] for row in rows if row[column["pareto"]]} == {"flicker", "no-ctu-64", "lanes"}  # now it costs 8, and 4 and 3 do the others


def test_verdicts_are_computed():
    """Each outcome: on all views, on none, on some, over the mean, over the best, and with a configuration missing."""
    views = [_view("one", x=1.0), _view("two", x=3.0)]

    def claim(limit, **more):
        return claims.Claim(
            "3a", "text", "2", lambda v: v.rows["a"]["x"], lambda x: x >= limit, f"at least {limit}", "{:.1f}", lambda v: f"x is {v.rows['a']['x']}", **more
        )

    assert claim(1).judge(views).verdict == "holds (at least 1)" and claim(1).judge(views).kind == "yes"
    none = claim(4).judge(views)
    assert none.kind == "no" and none.verdict.startswith("does not hold here, because one 0: x is 1.0; two 0: x is 3.0")
    some = claim(2).judge(views)
    assert some.kind == "partly" and some.verdict.startswith("holds on two 0; not on one 0, because one 0: x is 1.0")
    assert claim(2, average=True).judge(views).kind == "yes" and claim(2.5, average=True).judge(views).kind == "no"
    assert claim(3, best=True).judge(views).kind == "yes" and claim(3, best=True).judge(views).ours["largest"] == "3.0"
    views[0].rows = views[1].rows = {}
    assert claim(1).judge(views).verdict == "not evaluated: this run has no a"


def test_drop():
    """The loss of PSNR, by adding errors to a picture and measuring."""
    rng = np.random.default_rng(seed())
    truth = np.full((400, 400, 3), 0.5)
    model = truth + rng.normal(scale=10 ** (-25.56 / 20), size=truth.shape) * 0.5
    test = model + rng.normal(scale=0.02, size=truth.shape)
    base = metrics.psnr(model, truth)
    assert claims.drop(metrics.psnr(test, model), base) == pytest.approx(base - metrics.psnr(test, truth), abs=0.05)
    assert claims.drop(math.inf, 25.56) == 0.0


def test_every_claim_has_a_verdict(made):
    """All figures and tables of the paper appear; what photographs and GPUs are needed for says so."""
    _, written, _ = made
    kinds = {v.figure for v in written.verdicts}
    assert {"1a", "3a", "4", "7c", "8a", "8b", "9", "10a", "10b", "Table 1", "Table 2a", "Table 2b"} <= kinds
    for v in written.verdicts:
        assert v.verdict.startswith(("holds", "does not hold here, because ", "not evaluated: ", "published only: ")), v
        assert v.ours or v.kind == "open", v
    measured = [v for v in written.verdicts if v.figure[0].isdigit() and v.figure not in ("1a", "1b") and "XNX" not in v.claim]
    assert len(measured) >= 20 and all(v.kind != "open" for v in measured)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A small scene without cameras."""
    path = tmp_path_factory.mktemp("scene") / "small.ply"
    save_ply(random_scene(seed()), path)
    return path


@pytest.mark.slow
def test_few_configurations(scene, tmp_path):
    """A run without the paper's configurations and without motion still gives a page, and says what is missing."""
    job = check([f"{scene}:1"], tmp_path / "out", (64, 48), ["flicker"], tmp_path / "store", frames=0)
    written = write_report(job, seed())
    assert [r["view"] for r in _rows(written.summary)] == ["1"]
    assert any(v.verdict == "not evaluated: this run has no flicker-dense-mixed-conic" for v in written.verdicts)
    assert "#motion" not in written.page.read_text() and not [*(job.folder / "figures").glob("flicker_*"), *(job.folder / "figures").glob("speed_stab*")]


@pytest.mark.parametrize("arguments, message", [
    (["nothing.ply"], "nothing.ply: no such scene"),
    (["SCENE:8"], "view 8: there are"),
    (["SCENE", "SCENE"], "is there twice"),
    (["FOLDER"], "meta.json"),
    (["NOTES"], "unknown format"),
    (["SCENE", "--configs", "faithfull"], "configuration 'faithfull' is unknown; close names: faithful"),
    (["SCENE", "--configs", "faithful,,"], "an empty name"),
    (["SCENE", "--frames", "1"], "--frames 1: a change takes two frames; 0: no section on stability over time"),
    (["SCENE", "--size", "12"], "expected WxH"),
    (["SCENE", "--size", "0x90"], "0"),
    (["SCENE", "--out", "NOTES"], "no folder can be made there"),
])
def test_bad_input(scene, tmp_path, monkeypatch, arguments, message):
    """One line, before any work."""
    notes = tmp_path / "notes.txt"
    notes.write_text("no scene")
    monkeypatch.setattr("flicker.report.write.write_report", lambda *a: pytest.fail("work has begun"))
    words = {"SCENE": str(scene), "FOLDER": str(tmp_path), "NOTES": str(notes)}
    filled = [re.sub("SCENE|FOLDER|NOTES", lambda m: words[m[0]], a) for a in arguments]
    if "--out" not in filled:
        filled += ["--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, ["report", *filled])
    assert isinstance(result.exception, FlickerError), result.output
    assert message in str(result.exception) and "\n" not in str(result.exception)


def test_unwritable_folder(tmp_path, monkeypatch):
    """A folder that cannot be written is found before any work, also one in the way of a file."""
    monkeypatch.setattr("flicker.output.os.access", lambda *a: False)
    with pytest.raises(FlickerError, match="not writable"):
        check([], tmp_path / "out", SIZE, NAMES)
    monkeypatch.undo()
    (tmp_path / "other" / "index.html").mkdir(parents=True)
    with pytest.raises(FlickerError, match="index.html: is a folder"):
        check([], tmp_path / "other", SIZE, NAMES)
