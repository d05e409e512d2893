"""Sweeps: points equal `evaluate`, nothing is computed twice, a killed worker loses nothing that was finished, bad input is refused first.

Two local worker processes on a scene of 300 Gaussians at 64x48. Not covered: clusters of several machines.
"""

from __future__ import annotations

import csv
import os
import signal
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.command import flicker
from flicker_tb.screen import on_screen
from scene_samples import random_scene

from flicker.cli.sweep import summary
from flicker.errors import FlickerError
from flicker.explore.evaluate import evaluate
from flicker.explore.store import plain
from flicker.explore.sweep import load_results, load_sweep, run_sweep
from flicker.explore.sweep.results import KEY
from flicker.explore.sweep.run import connect
from flicker.front.view import load_view
from flicker.scene.camera import Camera, cameras_text
from flicker.scene.files import save_ply

CONFIGURATIONS = ["no-ctu-32", "no-ctu-64", "gscore", "oracle", "flicker-*-fp16-factored", "flicker-*-mixed-factored"]


def write(folder: Path, **changes) -> Path:
    """A sweep file; None removes a key."""
    import yaml

    data = {"scenes": ["tiny.ply"], "views": [0, 1], "size": "64x48", "configurations": CONFIGURATIONS, "out": str(folder / "out"),
            "cluster": {"workers": 2}}
    data |= changes
    path = folder / "sweep.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in data.items() if v is not None}))
    return path


@pytest.fixture
def folder(tmp_path) -> Path:
    save_ply(random_scene(5, 300, 0), tmp_path / "tiny.ply")
    return tmp_path


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """Two worker processes. What they run is compiled here first, so that they find it in the cache."""
    folder = tmp_path_factory.mktemp("warm")
    save_ply(random_scene(5, 300, 0), folder / "tiny.ply")
    sweep = load_sweep(write(folder))
    data = load_view(folder / "tiny.ply", 0, (64, 48))
    for name in sweep.configurations:
        evaluate(data, name)
    with connect(sweep) as client:
        yield client


def test_rows_equal_evaluate_and_are_resumed(folder, client):
    sweep = load_sweep(write(folder))
    result = run_sweep(sweep, client=client)
    assert (result.computed, result.resumed, result.lost) == (28, 0, 0)
    assert [(r["view"], r["config"]) for r in result.rows] == [(p.target.view, p.configuration) for p in sweep.points]
    data = load_view(folder / "tiny.ply", 1, (64, 48))
    for row in result.rows:
        if row["view"] == 1 and row["config"] in ("gscore", "oracle", "flicker-smooth-mixed-factored"):
            expected = {name: plain(value) if hasattr(value, "dtype") else value for name, value in evaluate(data, row["config"]).row.items()}
            assert {name: row[name] for name in expected} == expected
    before = (sweep.folder / "results.parquet").read_bytes()
    again = run_sweep(sweep)  # no client: nothing to do, so no cluster is started
    assert (again.computed, again.resumed) == (0, 28)
    assert again.rows == result.rows == load_results(sweep.folder)
    assert (sweep.folder / "results.parquet").read_bytes() == before
    part = run_sweep(load_sweep(write(folder, configurations=["gscore", "oracle"])))  # another sweep finds the points
    assert (part.computed, part.resumed) == (0, 4)


PATHS = [0, {"pan": 0.5, "frames": 3}, {"shake": True, "view": 1, "frames": 2, "seed": 4, "fps": 1000, "clock": 1e-3}, {"frames": 2}]


def test_paths_are_those_of_flicker_path(folder, client, monkeypatch):
    """Temporal figures are those of the same path by `flicker path`, still figures the means of `evaluate`; cycles and late frames those of the frames;
    kept and resumed as stills are."""
    sweep = load_sweep(write(folder, views=PATHS, configurations=["flicker", "log-lanes"]))
    assert [t.title for t in sweep.targets] == ["tiny 0", "tiny 0, pan 0.5", "tiny 1, shake", "tiny 0, cameras in order"]
    result = run_sweep(sweep, client=client)
    assert (result.computed, result.resumed) == (8, 0) and len({row[KEY] for row in result.rows}) == 8
    assert [row.get("path") for row in result.rows[::2]] == [None, "pan 0.5", "shake", "cameras in order"] and "jumps" not in result.rows[0]
    monkeypatch.chdir(folder)
    words = (("--pan", 0.5, "--frames", 3), ("--shake", "--view", 1, "--frames", 2, "--seed", 4, "--fps", 1000), ("--frames", 2))
    for number, motion in enumerate(words, 1):
        files = ("--stats", "a.csv", "--save-cameras", "a.json", "-o", f"out{number}")
        done = flicker("path", "tiny.ply", "--size", "64x48", *motion, "--stage", "channels", *files)
        assert done.returncode == 0, done.stderr
        row, frames = result.rows[2 * number], list(csv.DictReader(Path("a.csv").open()))
        stills = [evaluate(load_view("tiny.ply", n, None, "a.json"), "flicker").row for n in range(len(frames))]
        assert (row["config"], row["frames"], row["view"]) == ("flicker", len(frames), motion[2] if "--view" in motion else 0)
        changes = [10 ** (-float(frame["temporal_psnr_db"]) / 10) for frame in frames[1:]]
        assert row["temporal_psnr_db"] == pytest.approx(-10 * np.log10(np.mean(changes)), abs=1e-3)
        assert row["jumps"] == pytest.approx(np.mean([float(frame["jumps"]) for frame in frames[1:]]), abs=1e-9)
        assert row["worst_frame"] == 1 + int(np.argmax(changes))
        assert row["ssim"] == pytest.approx(np.mean([still["ssim"] for still in stills])) and row["energy_uj"] == pytest.approx(
            np.mean([still["energy_uj"] for still in stills]))
        cycles = [still["cycles"] for still in stills]
        assert (row["cycles"], row["cycles_p50"], row["cycles_worst"]) == (pytest.approx(np.mean(cycles)), np.median(cycles), max(cycles))
        assert cycles[row["cycles_worst_frame"]] == max(cycles) >= row["cycles_p99"] >= row["cycles_p50"]
        slot = 1000 if "--shake" in motion else 1e9 / 90
        assert row["late"] == np.mean([count > slot for count in cycles]) and row["psnr_db"] == pytest.approx(
            -10 * np.log10(np.mean([10 ** (-float(frame["psnr_db"]) / 10) for frame in frames])), abs=1e-3)
    again = run_sweep(sweep)
    assert (again.computed, again.resumed) == (0, 8) and again.rows == result.rows
    assert [{name: value for name, value in row.items() if name in kept} for row, kept in zip(load_results(sweep.folder), result.rows)] == result.rows
    shown, stills = on_screen(summary(result.rows), 300), on_screen(summary(result.rows[:2]), 300)
    assert "temporal dB" in shown and "1, shake" in shown and "100.0%" in shown and "temporal dB" not in stills
    other = load_sweep(write(folder, views=[{"pan": 0.5, "frames": 3, "clock": 0.5}, {"pan": 0.25, "frames": 3}], configurations=["flicker", "log-lanes"]))
    assert not {p.key for p in other.points} & {p.key for p in sweep.points} and other.hash != sweep.hash


def test_path_that_fails_keeps_the_others(folder, client):
    """Cameras that are known only with the scene: an orbit is a path; a scene that cannot be read names its path."""
    (folder / "broken.ply").write_bytes((folder / "tiny.ply").read_bytes()[:2000])
    sweep = load_sweep(write(folder, scenes=["broken.ply", "tiny.ply"], views=[{"pan": 1, "frames": 2}], configurations=["gscore"]))
    with pytest.raises(FlickerError, match="1 of 2 views failed; .*broken.ply view 0, pan 1: "):
        run_sweep(sweep, client=client)
    assert len(list(sweep.store.glob("*.json"))) == 1


def test_interrupted_sweep_continues(folder, client):
    sweep = load_sweep(write(folder, views=[0]))

    def interrupt(done: int, total: int, event: dict) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(sweep, client=client, on_point=interrupt)
    kept = len(list(sweep.store.glob("*.json")))
    assert kept >= 3
    with pytest.raises(FlickerError, match="not complete"):
        load_results(sweep.folder)
    damaged = next(sweep.store.glob("*.json"))
    damaged.write_text("{")
    result = run_sweep(sweep, client=client)
    assert result.resumed == kept - 1 and result.resumed + result.computed == 14
    assert len({row[KEY] for row in result.rows}) == 14


def test_killed_worker_loses_nothing_finished(folder, client):
    sweep = load_sweep(write(folder))
    finished, killed = Counter(), []

    def kill_first(done: int, total: int, event: dict) -> None:
        if not event:
            return
        finished[event["key"]] += 1
        if not killed and event["pid"] is not None:
            killed.append(event["pid"])
            os.kill(event["pid"], signal.SIGKILL)

    result = run_sweep(sweep, client=client, on_point=kill_first)
    assert killed and result.lost >= 1
    assert sorted(finished) == sorted(p.key for p in sweep.points)
    assert set(finished.values()) == {1}
    assert Counter(row[KEY] for row in load_results(sweep.folder)) == finished


def test_hash_follows_content(folder):
    """The same file elsewhere is the same sweep; other contents, size, view or configuration are another."""
    sweep = load_sweep(write(folder))
    other = folder / "elsewhere"
    other.mkdir()
    (other / "tiny.ply").write_bytes((folder / "tiny.ply").read_bytes())
    same = load_sweep(write(other, cluster={"workers": 1}))
    assert same.hash == sweep.hash and [p.key for p in same.points] == [p.key for p in sweep.points]
    hashes = {sweep.hash, load_sweep(write(folder, size="64x49")).hash, load_sweep(write(folder, views=[1])).hash}
    hashes.add(load_sweep(write(folder, configurations=["gscore"])).hash)
    save_ply(random_scene(6, 300, 0), folder / "tiny.ply")
    hashes.add(load_sweep(write(folder)).hash)
    assert len(hashes) == 5


def test_demo_with_other_cameras(folder, monkeypatch):
    """As other commands take them: their view, their name, another key."""
    (folder / "own.json").write_text(cameras_text([Camera(48, 32, 40.0, 40.0, np.array([0.0, 0.0, -5.0]), np.eye(3))]))
    given, = load_sweep(write(folder, scenes=[{"path": "demo", "cameras": "own.json"}], views=[0])).targets
    own, = load_sweep(write(folder, scenes=["demo"], views=[0])).targets
    assert given.scene.views() == 1 and given.scene.cameras_from == str(folder / "own.json") and given.key() != own.key()
    monkeypatch.setattr("flicker.scene.demo.generate", lambda: random_scene(5, 20, 0))
    assert given.load().camera.position.tolist() == [0.0, 0.0, -5.0]


@pytest.mark.parametrize(("changes", "message"), [
    ({"scenes": [{"path": "demo", "up": "z"}]}, r"scenes\[0\]: up: z: only orbit cameras can be turned"),
    ({"scenes": [{"path": "demo", "cameras": "x.json"}]}, r"scenes\[0\]: cameras: .*x.json: no such file"),
    ({"scenes": ["no.ply"]}, r"scenes\[0\]: .*no.ply: no such file"),
    ({"scenes": ["sweep.yaml"]}, r"scenes\[0\]: .*unknown format"),
    ({"scenes": [{"path": "tiny.ply", "camera": "x"}]}, r"scenes\[0\]: unknown key 'camera'; did you mean 'cameras'"),
    ({"scenes": [{"path": "tiny.ply", "cameras": "x.json"}]}, r"scenes\[0\]: cameras: .*x.json: no such file"),
    ({"scenes": ["tiny.ply", "tiny.ply"]}, "is there twice"),
    ({"scenes": None}, "key 'scenes' is missing"),
    ({"scenes": []}, "scenes: expected a list"),
    ({"views": [8]}, "view 8: there are 8 cameras"),
    ({"views": [-1]}, "views: expected camera numbers"),
    ({"views": [{"pan": 1, "walk": True}]}, "views: entry 0: pan, walk: one motion makes a path"),
    ({"views": [0, {"pan": 1, "sped": 2}]}, "views: entry 1: unknown key 'sped'; did you mean 'speed'"),
    ({"views": [{"pan": "fast"}]}, "views: entry 0: pan: input should be a valid number, not 'fast'"),
    ({"views": [{"pan": float("nan")}]}, "views: entry 0: pan: nan is not from"),
    ({"views": [{"seed": 1}]}, "views: entry 0: seed: for shake only"),
    ({"views": [{"walk": True, "frames": 0}]}, "views: entry 0: frames: input should be greater than or equal to 1, not '0'"),
    ({"views": [{"walk": True, "fps": 0}]}, "views: entry 0: fps: 0 is not from"),
    ({"views": [{"walk": True, "view": 8}]}, r"scenes\[0\]: view 8: there are 8 cameras"),
    ({"views": [{"walk": True, "view": -1}]}, "views: entry 0: view: input should be greater than or equal to 0"),
    ({"views": [{"keyframes": True}], "scenes": [{"path": "tiny.ply", "cameras": "one.json"}]}, r"scenes\[0\]: .*one.json: one camera: a path needs two"),
    ({"views": [{"frames": 9}], "scenes": [{"path": "demo"}]}, r"scenes\[0\]: .* cameras, not 9, each a frame"),
    ({"scenes": ["tiny.ply", "tiny.ply"], "views": [{"walk": True}]}, "view 0, walk of .* is there twice"),
    ({"views": ["walk"]}, "views: expected camera numbers from 0 on, or paths, not 'walk'"),
    ({"size": "64"}, "size: expected WxH"),
    ({"size": "0x48"}, "size: width and height must be 1 to"),
    ({"configuration": ["gscore"]}, "unknown key 'configuration'; did you mean 'configurations'"),
    ({"configurations": ["gscor"]}, "'gscor' is unknown; close names: gscore"),
    ({"configurations": ["x*"]}, "no configuration matches 'x\\*'"),
    ({"cluster": {"workers": 0}}, "cluster: workers: must be 1 to"),
    ({"cluster": {"workers": 1, "address": "tcp://a:1"}}, "either workers or address"),
    ({"cluster": {"nodes": 1}}, "cluster: unknown key 'nodes'"),
])
def test_bad_configuration(folder, changes, message):
    path = write(folder, **changes)
    (folder / "one.json").write_text(cameras_text([Camera(48, 32, 40.0, 40.0, np.array([0.0, 0.0, -5.0]), np.eye(3))]))
    with pytest.raises(FlickerError, match=message) as raised:
        load_sweep(path)
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)


def test_bad_files(folder):
    with pytest.raises(FlickerError, match="cannot be read"):
        load_sweep(folder / "no.yaml")
    (folder / "bad.yaml").write_text("scenes: [demo\nviews: {")
    with pytest.raises(FlickerError, match="bad.yaml: line 2: not YAML"):
        load_sweep(folder / "bad.yaml")
    (folder / "list.yaml").write_text("- demo\n")
    with pytest.raises(FlickerError, match="expected a mapping"):
        load_sweep(folder / "list.yaml")


def test_unwritable_folder_and_unreachable_cluster(folder):
    """Found before any work: nothing is reported as finished."""
    (folder / "file").write_text("")
    sweep = load_sweep(write(folder, out=str(folder / "file")))
    with pytest.raises(FlickerError, match="cannot be written"):
        run_sweep(sweep)
    sweep = replace(load_sweep(write(folder)), address="tcp://127.0.0.1:1", workers=None)
    done = []
    with pytest.raises(FlickerError, match="cluster tcp://127.0.0.1:1: cannot be reached") as raised:
        run_sweep(sweep, on_point=lambda *a: done.append(a[0]))
    assert done == [0] and "\n" not in str(raised.value)
    for address in ("nonsense://x", "tcp://host:port"):
        with pytest.raises(FlickerError, match="cannot be reached"):
            run_sweep(replace(sweep, address=address))


def test_failed_view_keeps_the_others(folder, client):
    """A scene that cannot be rendered ends with one line; the rows of the other scene are there."""
    (folder / "broken.ply").write_bytes((folder / "tiny.ply").read_bytes()[:2000])
    sweep = load_sweep(write(folder, scenes=["broken.ply", "tiny.ply"], views=[0], configurations=["gscore"]))
    with pytest.raises(FlickerError, match="1 of 2 views failed; .*broken.ply view 0") as raised:
        run_sweep(sweep, client=client)
    assert "\n" not in str(raised.value)
    assert len(list(sweep.store.glob("*.json"))) == 1


def test_command_refuses(folder):
    """One line on standard error, exit code 2, no Dask cluster started."""
    run = flicker("sweep", write(folder, scenes=["no.ply"]))
    assert run.returncode == 2 and run.stdout == ""
    assert run.stderr.count("\n") == 1 and "no.ply: no such file" in run.stderr
