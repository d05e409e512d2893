"""The viewer: maps against the models' counters, poses, pace, stills, refusals; and all of it in a real browser.

Covered: sums of every map against cycle models, lists and scene cost; the browser's camera there and back; which frame is due; what a comparison shows;
interactions in a headless chromium (skipped where there is none), which looks at the picture's pixels and the page's text. Not covered: browsers with a GPU;
the RTL itself in the viewer's process (what it gives is tested in tb/frames; its way into the viewer with a stand-in).
"""

from __future__ import annotations

import io
import json
import math
import re
import socket
import threading
import time
from dataclasses import replace
from unittest.mock import MagicMock

import browser
import numpy as np
import pytest
from flicker_tb.command import flicker
from flicker_tb.runner import seed
from PIL import Image

from flicker.errors import FlickerError
from flicker.front.ahead import common_up, target
from flicker.front.lists import subtile_lists
from flicker.front.view import View
from flicker.params import CHANNELS, CORES, FAITHFUL, RECOMMENDED, CatMode, Form, RenderConfig, SortOrder
from flicker.pipeline import Engine, render_view
from flicker.scene.camera import Camera, load_cameras, orbit_camera
from flicker.scene.files import Scene, save_ply
from flicker.scene.image import save_png
from flicker.scene.metrics import flip
from flicker.scene.trajectory import check_path, joined
from flicker.view import server
from flicker.view.frames import Choice, Renderer, Shot, composed, largest
from flicker.view.overlays import OVERLAYS, by_tile, imbalance_map, tile_cycles, tile_entries, visited_map
from flicker.view.pace import COARSEST, Pace
from flicker.view.pose import Pose, close, upright
from flicker.view.stills import save

SIZE = (160, 96)  # whole tiles
CONFIGS = (RECOMMENDED, RECOMMENDED.with_(lanes=128), RenderConfig(), FAITHFUL, RenderConfig(cat=CatMode.AUTO))


@pytest.fixture(scope="module")
def view() -> View:
    """A cloud of Gaussians that fills the picture."""
    rng, n = np.random.default_rng(seed()), 1500
    scene = Scene(
        means=rng.uniform(-1.0, 1.0, (n, 3)), scales=rng.uniform(0.02, 0.2, (n, 3)), quats=rng.normal(size=(n, 4)), opacities=rng.uniform(0.05, 1.0, n),
        sh=rng.normal(scale=0.8, size=(n, 4, 3)),
    )
    return View(orbit_camera(scene, 0, width=SIZE[0], height=SIZE[1]), scene, name="cloud")


@pytest.fixture(scope="module")
def cameras(view) -> list[Camera]:
    return [view.camera, *(orbit_camera(view.scene, k) for k in range(1, 8))]


@pytest.fixture(scope="module")
def renderer(view) -> Renderer:
    return Renderer(view)


# ---- frames and maps


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.stage}-{c.lanes}-{c.cat.name}-{c.form.name}")
def test_maps_sum_up(view, renderer, config) -> None:
    """Of a stage: visits are the model's, cycles end where the cycle model does, no channel or lane has less than the mean at its busiest."""
    camera = view.camera
    work = renderer.drawn(view, config).work
    cycles, counters = renderer.simulated(view, config)
    visited = visited_map(work, camera)
    assert visited.sum() == work.totals()["pixels_visited"] > 10_000
    counts = render_view(view, config=config).stats
    if config.by_lanes:
        assert visited.sum() == counts["lanes"]["visited"]  # the golden lanes'
    else:
        assert visited.sum() <= counts["pixel_pairs"] <= 16 * visited.sum()  # VRUs visit finished pixels of unfinished mini-tiles, too
    tiles = tile_cycles(work, counters)
    ends = [counters.subtile_end.reshape(work.rows, work.cols)[k // 2 :: 2, k % 2 :: 2].max() for k in range(CORES)]
    assert tiles.shape == (6, 10) and tiles.sum() == sum(ends) and max(ends) == cycles - 1
    busiest = imbalance_map(work, config)
    most = config.lanes // CORES if config.by_lanes else CHANNELS
    assert ((busiest >= 1) & (busiest <= most) | np.isnan(busiest)).all() and np.nanmax(busiest) > 1.05


def test_entries_and_error(view, renderer) -> None:
    """Entries are the lists' pairs with tiles; the mean of the error map is FLIP."""
    lists = subtile_lists(view.projected, view.camera, Form.FACTORED, RECOMMENDED.coords, (0, 0))
    assert tile_entries(view.projected, view.camera).sum() == lists.tile_pairs
    frame = renderer.frame(view.camera, Choice(overlay="error"))
    assert frame.overlay.mean() == pytest.approx(flip(frame.image, view.reference), rel=1e-9) and frame.overlay.max() > 0
    assert (renderer.frame(view.camera, Choice(Engine.REFERENCE, overlay="error")).overlay == 0).all()


def test_cost_of_gaussians(view, renderer) -> None:
    """The map has each Gaussian's cycles where it is seen; a click names it with the numbers of the scene's cost."""
    frame = renderer.frame(view.camera, Choice(overlay="cost"))
    cost = renderer.cost(view.camera)
    seen = cost.views[0].seen
    assert set(np.unique(seen[seen >= 0])) <= set(np.flatnonzero(cost.peak > 0)) and (seen >= 0).mean() > 0.3
    assert np.array_equal(np.isnan(frame.overlay), seen < 0)
    y, x = np.argwhere(seen >= 0)[len(seen)]
    found, of = renderer.picked(frame, int(x), int(y)), cost.of(seen[y, x])
    assert found["Gaussian"] == f"{of['gaussian']:,}" and found["pixel visits"] == f"{of['visits']:,.0f}" and found["cycles"] == f"{of['cycles']:,.1f}"
    assert frame.overlay[y, x] == pytest.approx(of["cycles"])
    # The largest alpha T by the reference's rules; the chip's records are rounded, so a few pixels differ.
    pixels, p = np.argwhere(seen >= 0)[::25, ::-1], view.projected
    dx, dy = np.moveaxis(pixels[:, None, :] - p.mean, -1, 0)
    alpha = np.minimum(0.99, p.opacity * np.exp(-(0.5 * (p.conic[:, 0] * dx**2 + p.conic[:, 2] * dy**2) + p.conic[:, 1] * dx * dy)))
    alpha[alpha < 1 / 255] = 0.0
    before = np.cumprod(np.concatenate([np.ones((len(pixels), 1)), 1.0 - alpha[:, :-1]], axis=1), axis=1)
    assert (p.index[(alpha * before).argmax(axis=1)] == seen[pixels[:, 1], pixels[:, 0]]).mean() > 0.95


def test_tiles_at_the_edge() -> None:
    """Half tiles have half of the sub-tiles."""
    assert np.array_equal(by_tile(np.arange(6), 3, 2), [[0 + 1 + 3 + 4, 2 + 5]])


def test_pictures_of_the_engines(view, renderer) -> None:
    """A frame is what `flicker render` draws, with a map of the stage or without; a coarse one is smaller, of the largest Gaussians."""
    for config in CONFIGS:
        plain, mapped = (renderer.frame(view.camera, Choice(config=config, overlay=o)) for o in (None, "visited"))
        assert np.array_equal(plain.image, render_view(view, config=config).image) and np.array_equal(plain.image, mapped.image)
    assert np.array_equal(renderer.frame(view.camera, Choice(Engine.REFERENCE)).image, view.reference)
    coarse = renderer.frame(view.camera, Choice(overlay="cycles"), 2)
    assert coarse.image.shape == (48, 80, 3) == (*coarse.overlay.shape, 3) and coarse.stats["visible"] <= -(-len(view.scene) // 2)
    assert renderer.frame(view.camera, Choice(overlay="cost"), 2).overlay is None
    few = largest(view.scene, 4)
    size = np.sort(view.scene.scales, axis=1)[:, 1:].prod(axis=1) * view.scene.opacities
    assert len(few) == -(-len(view.scene) // 4) and sorted(size)[-len(few)] <= min(np.sort(few.scales, axis=1)[:, 1:].prod(axis=1) * few.opacities) * 1.0001


def test_order_of_the_view(view) -> None:
    """Full and coarse frames, and the cost, by distance where the view is."""
    by = View(view.camera, view.scene, name="cloud", order=SortOrder.DISTANCE)
    renderer = Renderer(by)
    assert np.array_equal(renderer.frame(view.camera, Choice()).image, render_view(by, config=RECOMMENDED).image)
    assert not np.array_equal(by.reference, view.reference)
    few = View(view.camera, largest(view.scene, 2), order=SortOrder.DISTANCE)
    assert np.array_equal(renderer.view(view.camera, 2).projected.index, few.projected.index)
    assert not np.array_equal(renderer.cost(view.camera).views[0].seen, Renderer(view).cost(view.camera).views[0].seen)


def test_numbers(view, renderer) -> None:
    """Those of a golden frame come step by step and end with the cycle model's; the reference has no stage."""
    steps = [dict(found) for found in renderer.numbers(renderer.frame(view.camera, Choice()))]
    assert [len(s) for s in steps] == sorted(len(s) for s in steps) and len(steps) > 2
    assert steps[-1]["cycles (model)"] == f"{renderer.simulated(view, RECOMMENDED)[0]:,}" and steps[-1]["PSNR"].endswith("dB")
    reference = list(renderer.numbers(renderer.frame(view.camera, Choice(Engine.REFERENCE))))[-1]
    assert "PSNR" not in reference and "cycles (model)" not in reference
    missing = renderer.frame(view.camera, Choice(Engine.CHIP, overlay="visited"))
    assert not missing.image.any() and "no frame of the chip yet" in list(renderer.numbers(missing))[-1]["engine"]


def test_simulated_frames(view, renderer, cameras) -> None:
    """The last one of the RTL is shown from where it was simulated, with the model's maps of its own configuration."""
    camera = cameras[1].resized(96, 64)
    image = render_view(renderer.view(camera), config=FAITHFUL).image
    stats = {"visible": 5, "pixel_pairs": 7, "cycles": 1000}
    renderer.shots[Engine.RTL] = Shot(Engine.RTL, camera, FAITHFUL, image, stats)
    frame = renderer.frame(view.camera, Choice(Engine.RTL, overlay="visited"))
    work = renderer.drawn(renderer.view(camera), FAITHFUL).work
    assert frame.camera is camera and frame.image is image and frame.overlay.sum() == work.totals()["pixels_visited"]
    numbers = list(renderer.numbers(frame))[-1]
    assert numbers["pixels that differ from golden"] == "0" and numbers["cycles"] == "1,000" and "faithful" not in numbers and "conic" in numbers["engine"]


def test_composition(view, renderer) -> None:
    """The left part is the first frame's, the right the second's; equal maps share a scale; the legend has the map's colours."""
    a, b = (renderer.frame(view.camera, Choice(config=c)) for c in (RECOMMENDED, FAITHFUL))
    left, right, both = (np.asarray(composed(frames, SIZE, 0.25)) for frames in ([a], [b], [a, b]))
    assert np.array_equal(both[:, :40], left[:, :40]) and np.array_equal(both[:, 41:], right[:, 41:]) and not np.array_equal(left, right)
    stored = io.BytesIO()
    save_png(stored, a.image)
    assert np.array_equal(left, np.asarray(Image.open(stored)))
    mapped = [renderer.frame(view.camera, Choice(config=c, overlay="visited")) for c in (RECOMMENDED, FAITHFUL)]
    alone, beside = (np.asarray(composed(frames, (640, 384), 1.0, 1.0)) for frames in (mapped[:1], mapped))
    high = [OVERLAYS["visited"].limits([f.overlay])[1] for f in mapped]
    assert high[1] > high[0] and not np.array_equal(alone, beside)  # the second needs a larger scale
    assert (np.abs(alone[350:, 6:156].astype(int) - [253, 231, 36]).sum(axis=2) < 6).any()  # the upper end of viridis


# ---- camera


def test_camera_there_and_back() -> None:
    """Any camera, with roll and pixels that are not square."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        camera = Camera(320, 180, rng.uniform(100, 900), rng.uniform(100, 900), rng.normal(size=3) * 10, rotation * np.sign(np.linalg.det(rotation)),
                        cx=rng.uniform(100, 200), cy=rng.uniform(-50, 200))
        pose = Pose.of(camera)
        assert math.isclose(np.linalg.norm(pose.wxyz), 1.0)
        back = pose.camera(camera)
        assert (back.cx, back.cy) == (camera.cx, camera.cy)
        assert close(camera, back) and back.fx == pytest.approx(camera.fx) and np.allclose(back.rotation, camera.rotation)
        assert Pose(tuple(-w for w in pose.wxyz), pose.position, pose.fov).camera(camera).rotation == pytest.approx(back.rotation)
        moved = Pose(pose.wxyz, (pose.position[0] + 0.1, *pose.position[1:]), pose.fov).camera(camera)
        assert not close(camera, moved) and not close(camera, replace(back, cx=camera.cx + 1))
        # The browser makes its rotation of position, target and up.
        up = upright(camera, rng.normal(size=3))
        ahead = camera.rotation[:, 2]
        right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
        assert np.allclose(np.stack([right, np.cross(ahead, right), ahead], axis=1), camera.rotation)


def test_up_and_target(view) -> None:
    """Cameras of an orbit agree on what is up; what is orbited lies ahead, among the Gaussians."""
    assert np.allclose(common_up([orbit_camera(view.scene, k, up="z") for k in range(8)]), [0, 0, 1], atol=1e-6)
    at = target(view.camera, view.projected)
    depth = (at - view.camera.position) @ view.camera.rotation
    assert np.allclose(depth[:2], 0) and view.projected.depth.min() <= depth[2] <= view.projected.depth.max()


# ---- which frame is due


def test_pace() -> None:
    """Coarse at once while moving, full after a rest; the latest request is the one that counts; no frame twice."""
    pace = Pace(rest=0.2, budget=0.3, divisor=2)
    assert pace.due(0.0) == (0, math.inf)
    pace.ask("start", 0.0, moving=False)
    assert pace.due(0.0)[0] == 1
    pace.made("start", 1, 0.1, 0.1)
    assert pace.due(9.0) == (0, math.inf)
    pace.ask("a", 10.0)
    assert pace.due(10.0)[0] == 2
    pace.ask("b", 10.1)  # while a is made
    pace.made("a", 2, 0.1, 10.12)
    assert pace.due(10.15)[0] == 2 and pace.wanted == "b"
    pace.made("b", 2, 0.1, 10.5)
    divisor, wait = pace.due(10.6)  # what came while b was made may not be known yet
    assert divisor == 0 and wait == pytest.approx(0.1)
    pace.ask("b", 10.65)  # the same again is no motion
    assert pace.due(10.71)[0] == 1
    pace.made("b", 1, 5.0, 15.7)
    assert pace.due(99.0) == (0, math.inf) and pace.divisor == 2
    pace.ask("c", 100.0)
    pace.ask("c with another map", 100.01, moving=False)
    assert pace.due(100.02)[0] == 1


def test_pace_follows_the_budget() -> None:
    """Slow moving frames become coarser, fast ones finer; full ones do not count."""
    pace = Pace(budget=0.3, divisor=2)
    for expected in (4, 8, COARSEST, COARSEST):
        pace.made(0, pace.divisor, 1.0, 0.0)
        assert pace.divisor == expected
    for expected in (4, 2, 1, 1):
        pace.made(0, pace.divisor, 0.01, 0.0)
        assert pace.divisor == expected
    pace.made(0, 1, 1.0, 0.0)
    assert pace.divisor == 2
    pace.made(0, 1, 1.0, 0.0)
    assert pace.divisor == 2


# ---- files and refusals


def test_stills(view, cameras, tmp_path) -> None:
    """Cameras are added, and read as any others; a file that is none is named and kept."""
    folder = tmp_path / "new" / "folder"
    for k in range(2):
        still, number = save(folder, Image.new("RGB", SIZE), cameras[k].resized(*SIZE))
        assert number == k and Image.open(still).size == SIZE
    stored = load_cameras(folder / "cameras.json")
    assert [c.name for c in stored] == ["view_000.png", "view_001.png"] and close(stored[1], cameras[1].resized(*SIZE))
    (folder / "cameras.json").write_text("{")
    with pytest.raises(FlickerError, match="cameras.json: not JSON"):
        save(folder, Image.new("RGB", SIZE), view.camera)
    assert (folder / "cameras.json").read_text() == "{"
    (tmp_path / "file").write_text("")
    with pytest.raises(FlickerError, match="file"):
        save(tmp_path / "file", Image.new("RGB", SIZE), view.camera)


class Controls:
    """The controls of a browser without a browser: buttons that can be pressed, everything else is there and does nothing."""

    def __init__(self) -> None:
        self.client = MagicMock()
        self.buttons: dict[str, list] = {}
        self.client.gui.add_button.side_effect = self._button
        self.client.gui.add_number.side_effect = lambda label, value, **_: MagicMock(value=value)
        self.client.gui.add_checkbox.side_effect = lambda label, value, **_: MagicMock(value=value)
        self.client.gui.add_dropdown.side_effect = lambda label, options, initial_value=None, **_: MagicMock(value=initial_value or options[0])

    def _button(self, label: str) -> MagicMock:
        button = MagicMock()
        button.on_click.side_effect = self.buttons.setdefault(label, []).append
        return button

    def press(self, label: str) -> None:
        for callback in self.buttons[label]:
            callback(None)


def test_keyframes(view, cameras, tmp_path) -> None:
    """Recorded, one taken back, saved as a path that `flicker path` joins; a changed lens and a single keyframe are no path."""
    viewer = server.Viewer(view, cameras, tmp_path / "new", port=0)
    try:
        page = Controls()
        session = server.Session(viewer, page.client)
        page.press("save path")
        assert session.path_said.content.startswith("**path.json: no keyframe: a path needs two at least")
        for k, (camera, seconds) in enumerate(zip((*cameras, cameras[0]), (1.0, 2.5, 0.5, 9.0))):
            session.camera, session.seconds.value = camera.resized(64, 48), seconds
            page.press("add keyframe")
            if k == 2:
                page.press("remove last keyframe")
        page.press("save path")
    finally:
        viewer.stop()
    file = tmp_path / "new" / "path.json"
    assert session.path_said.content == f"3 keyframes, 11.5 s, saved as {file}"
    found = load_cameras(file)
    assert [c.timestamp for c in found] == [0.0, 2.5, 11.5] and np.allclose(found[1].position, cameras[1].position)
    check_path(found, "path.json")
    assert np.allclose(joined(found, 24)[5].position, cameras[1].position)
    session.keyframe(session.keyframes.add, replace(found[0], fx=1.1 * found[0].fx), 1.0)
    session.save_path()
    assert re.match(r"\*\*path.json: keyframe 3: fx: .* a path has one lens\*\*", session.path_said.content)


def test_boxed() -> None:
    """The picture keeps its shape in any window."""
    picture = Image.new("RGB", (160, 96), "white")
    for aspect, size, corner in ((160 / 96, (160, 96), (0, 0)), (1.0, (160, 160), (0, 32)), (3.0, (288, 96), (64, 0))):
        out, at = server.boxed(picture, aspect)
        assert out.size == size and at == corner
        assert out.getpixel(corner) == (255, 255, 255) and np.asarray(out).sum() == 3 * 255 * 160 * 96


def test_refusals(view, tmp_path, monkeypatch) -> None:
    """One line that names the option or the file, and exit code 2."""
    monkeypatch.setattr(server.Viewer, "serve", lambda _: pytest.fail("it serves"))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        (tmp_path / "file").write_text("")
        (tmp_path / "bad.ply").write_text("not a scene")
        scene = tmp_path / "cloud.ply"
        save_ply(view.scene, scene)
        for arguments, said in (
            (("demo", "--port", port), f"--port: {port} is in use"), (("demo", "--port", 70000), "--port"),
            ((scene, "--size", "0x10", "--port", 0), "width"), ((scene, "--size", "90000x1", "--port", 0), "width"), (("demo", "--size", "big"), "--size"),
            (("demo", "--size", "9000x9000"), "--size"), ((scene, "--view", 99, "--port", 0), "view 99"), (("demo", "--dir", tmp_path / "file"), "--dir"),
            ((tmp_path / "none.ply", "--port", 0), "none.ply"), ((tmp_path / "bad.ply", "--port", 0), "bad.ply"),
            (("demo", "--port", 0, "--cameras", tmp_path / "none.json"), "none.json"), (("demo", "--port", 0, "--up", "z"), "up: z"),
            (("demo", "--port", 0, "--host", "nowhere.invalid"), "--host"),
        ):
            run = flicker("view", *arguments)
            assert run.returncode == 2 and run.stdout == "", (arguments, run.stderr)
            lines = [line for line in run.stderr.splitlines() if "warning" not in line]
            assert len(lines) == 1 and said in lines[0], (arguments, run.stderr)


# ---- in a browser


class Page:
    """The viewer's page in a headless browser."""

    def __init__(self, page) -> None:
        self.page = page

    def pixels(self) -> np.ndarray:
        """uint8 (H, W, 3): what is to the left of the controls."""
        shot = np.asarray(Image.open(io.BytesIO(self.page.screenshot(animations="allow"))).convert("RGB"))
        return shot[:, : shot.shape[1] - 400]

    def until(self, true, what: str, seconds: float = 20.0):
        """What `true` gives, when it gives something."""
        end = time.monotonic() + seconds
        while not (found := true()):
            assert time.monotonic() < end, f"not within {seconds} s: {what}\n{self.page.inner_text('body')}"
            time.sleep(0.1)
        return found

    def changed(self, before: np.ndarray, what: str) -> np.ndarray:
        """The picture, once it is another."""
        return self.until(lambda: None if np.array_equal(found := self.pixels(), before) else (found,), what)[0]

    def settled(self) -> np.ndarray:
        """The picture, once it stays."""
        def twice():
            first = self.pixels()
            time.sleep(0.4)
            return first if np.array_equal(first, self.pixels()) else None

        return self.until(lambda: None if (found := twice()) is None else (found,), "the picture settles")[0]

    def choose(self, label: str, value: str, number: int = 0) -> None:
        self.page.get_by_role("combobox", name=label, exact=True).nth(number).click()
        self.page.get_by_role("option", name=value, exact=True).click()

    def numbers(self) -> dict[str, list[str]]:
        """Rows of the table of numbers."""
        rows = self.page.locator("table").first.locator("tr").all_inner_texts() if self.page.locator("table").count() else []
        return {cells[0]: cells[1:] for row in rows if len(cells := row.split("\t")) > 1}

    def number(self, name: str, column: int = 0, other_than: str = "") -> str:
        def there():
            row = self.numbers().get(name, [])
            return row[column].strip() if len(row) > column and row[column].strip() not in ("", other_than) else None

        return self.until(there, f"{name} in column {column}")


@pytest.fixture(scope="module")
def viewer(view, cameras, tmp_path_factory):
    viewer = server.Viewer(view, cameras, tmp_path_factory.mktemp("stills"), port=0)
    viewer.prepare()
    thread = threading.Thread(target=viewer.serve)
    thread.start()
    yield viewer
    viewer.stop()
    thread.join()


@pytest.mark.skipif(browser.CHROMIUM is None, reason=str(browser.missing()))
def test_browser(view, viewer, monkeypatch) -> None:
    """A picture comes; every control changes picture and numbers; the mouse orbits; a click names a Gaussian; the comparison; stills; a simulated frame."""
    with browser.opened((900, 460)) as page:
        page.goto(viewer.url)
        interact(Page(page), view, viewer, monkeypatch)


def interact(page: Page, view: View, viewer: server.Viewer, monkeypatch) -> None:
    page.until(lambda: viewer.sessions, "a session")
    note = page.page.locator(".mantine-Notification-closeButton")  # on drawing without a GPU
    if note.count():
        note.first.click()
    page.until(lambda: page.pixels()[200:260].max() > 60, "a picture")
    cycles = page.number("cycles (model)")
    lanes = page.settled()
    session = next(iter(viewer.sessions.values()))
    assert session.frames[0].coarse == 1 and session.camera is view.camera

    # Engine, stage, precision, mode, overlay.
    page.choose("stage", "channels")
    channels = page.number("cycles (model)", other_than=cycles)
    page.choose("form", "conic")
    page.choose("precision", "fp8")
    coarse_test = page.number("cycles (model)", other_than=channels)
    page.choose("mode", "sparse")
    page.number("cycles (model)", other_than=coarse_test)
    sparse = page.changed(lanes, "the picture of another mode and precision")
    page.choose("engine", "reference")
    assert page.until(lambda: "cycles (model)" not in page.numbers() and page.numbers(), "the reference has no cycles")
    reference = page.changed(sparse, "the reference")
    page.choose("engine", "golden")
    page.choose("stage", "lanes")
    shown = reference
    for name in OVERLAYS:
        page.choose("overlay", name)
        shown = page.changed(shown, f"the map {name}")
    assert session.frames[0].overlay is not None and session.frames[0].choice.overlay == "cost"

    # What is under the pointer.
    page.page.mouse.click(250, 230)
    page.until(lambda: "blended weight" in page.page.inner_text("body"), "the Gaussian under the pointer")
    page.choose("overlay", "picture")
    page.changed(shown, "the picture again")

    # A comparison by the slider.
    page.page.get_by_label("compare", exact=True).check()
    page.choose("overlay", "visited", 1)
    page.choose("stage", "channels", 1)
    page.until(lambda: [n.strip() for n in page.numbers().get("cycles (model)", [])] == [cycles, channels], "the cycles of both")
    half = page.settled()
    page.page.get_by_role("slider").first.scroll_into_view_if_needed()
    thumb = page.page.get_by_role("slider").first.bounding_box()
    x, y = thumb["x"] + thumb["width"] / 2, thumb["y"] + thumb["height"] / 2
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x + 30, y, steps=3)
    page.page.mouse.up()
    page.changed(half, "the slider")
    moved = page.settled()
    third = half.shape[1] // 3
    assert session.split.value > 0.55 and np.abs(half[:, :third].astype(int) - moved[:, :third]).max() < 20

    # Still and camera, from another place; what is saved renders to the same picture.
    page.page.get_by_label("compare", exact=True).uncheck()
    page.until(lambda: len(session.frames) == 1 and session.more is None, "one picture again")
    before, sent = page.settled(), len(session.sent)
    page.page.mouse.move(250, 230)
    page.page.mouse.down()
    for k in range(12):
        page.page.mouse.move(250 + 8 * k, 230)
        time.sleep(0.03)
    page.page.mouse.up()
    page.changed(before, "the orbit")
    page.until(lambda: session.frames[0].coarse == 1 and session.pace.due(time.monotonic())[0] == 0, "the full frame at rest")
    assert any(divisor > 1 for _, divisor in session.sent[sent:]) or session.pace.divisor == 1
    camera = session.camera
    assert not close(camera, view.camera) and np.linalg.norm(camera.position - view.camera.position) > 0.01
    page.page.get_by_role("button", name="save picture and camera").click()
    page.until(lambda: "saved" in page.page.inner_text("body"), "what was saved")
    stored = load_cameras(viewer.folder / "cameras.json")
    assert len(stored) == 1 and close(stored[0], camera) and len(json.loads((viewer.folder / "cameras.json").read_text())) == 1
    again = np.rint(np.clip(render_view(View(stored[0], view.scene), config=RECOMMENDED).image, 0, 1) * 255)
    assert np.array_equal(np.asarray(Image.open(viewer.folder / "view_000.png")), again)
    assert np.array_equal(again, np.asarray(composed(session.frames, SIZE)))

    # Back, exactly; a simulated frame (its simulation replaced) seen from elsewhere.
    page.page.get_by_role("button", name="go to view").click()
    page.until(lambda: session.camera is session.goal and session.frames[0].camera is session.goal, "view 0")
    time.sleep(0.5)  # what the browser answers
    assert session.camera is session.goal and close(session.goal, view.camera)

    class Simulated:
        def __init__(self, view, engine, config, told, done) -> None:
            told("simulating")
            shot = Shot(engine, view.camera, config, np.full((SIZE[1], SIZE[0], 3), [1.0, 0.0, 1.0]), {"visible": 1, "pixel_pairs": 2, "cycles": 1234})
            threading.Thread(target=done, args=(shot,)).start()

    monkeypatch.setattr(server, "Simulation", Simulated)
    page.page.get_by_text("simulate this view").click()
    page.page.get_by_role("button", name="chip", exact=True).click()
    page.choose("engine", "chip, last frame")
    assert page.number("cycles") == "1,234"
    page.until(lambda: (np.abs(page.pixels()[180:280, 150:350].astype(int) - [255, 0, 255]).max() < 40), "the simulated frame")
    page.choose("engine", "RTL, last frame")
    page.until(lambda: "no frame of the RTL yet" in page.page.inner_text("body"), "no frame of the RTL")
