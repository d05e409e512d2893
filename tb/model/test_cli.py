"""The command line: what it writes, and how it refuses bad input.

Runs `flicker` inside the tests' process, and once as a user does. The RTL engine on whole frames is tested in tb/frames; here one small frame
shows that the engines and the files fit together.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.bench import rounds
from flicker_tb.command import flicker

from flicker.scene.demo import write_demo
from flicker.scene.files import load_scene, save_ply
from flicker.scene.image import load_picture


@pytest.fixture(scope="session")
def demo(tmp_path_factory) -> Path:
    """Folder with the demo scene and its cameras."""
    folder = tmp_path_factory.mktemp("demo")
    write_demo(folder)
    return folder


def test_engines_and_files(demo, tmp_path):
    """Golden and RTL give the same picture and counts; the reference is what they are compared with. A build of tb/frames/test_frames.py: FAITHFUL, with SLOW=1
    SHALLOW."""
    stats, pictures = {}, {}
    options = (["--faithful"], ["--form", "conic", "--precision", "fp8", "--fifo-depth", 1])[rounds(0, 1)]
    for engine in ("reference", "golden", "rtl"):
        run = flicker("render", demo / "demo.ply", "--size", "160x90", "--engine", engine, *options, "--compare", "reference",
                      "--out", tmp_path / f"{engine}.png", "--stats", tmp_path / f"{engine}.json")
        assert run.returncode == 0, run.stderr
        stats[engine] = json.loads((tmp_path / f"{engine}.json").read_text())
        pictures[engine] = load_picture(tmp_path / f"{engine}.png")
        assert pictures[engine].shape == (90, 160, 3)
    assert np.array_equal(pictures["golden"], pictures["rtl"])
    assert not np.array_equal(pictures["golden"], pictures["reference"])
    common = ("scene", "view", "width", "height", "gaussians", "visible", "tile_pairs", "subtile_pairs")
    for key in (*common, "minitiles_sent", "pixel_pairs", "psnr_db"):
        assert stats["rtl"][key] == stats["golden"][key], key
    assert all(stats["reference"][k] == stats["golden"][k] for k in common)
    assert stats["reference"]["psnr_db"] is None  # equal to itself
    assert stats["golden"]["psnr_db"] > 35
    assert stats["rtl"]["engine"] == "rtl" and stats["rtl"]["cycles"] > 1000
    assert len(stats["rtl"]["cores"]) == 4 and all(len(c["channels"]) == 4 for c in stats["rtl"]["cores"])
    assert stats["golden"]["gaussians"] == len(load_scene(demo / "demo.ply"))


def test_json_and_quiet(demo, tmp_path):
    """--json prints the statistics and nothing else, --quiet nothing; both write their files; of all views a list. `flicker cost` likewise."""
    path, scene = tmp_path / "s.json", demo / "demo.ply"
    common = (scene, "--size", "64x36", "--engine", "golden", "--out", tmp_path / "x.png", "--stats", path)
    done = flicker("render", *common, "--json")
    assert done.returncode == 0 and done.stderr == "" and json.loads(done.stdout) == json.loads(path.read_text()), done.stderr
    for file in (path, tmp_path / "x.png"):
        file.unlink()
    done = flicker("render", *common, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "") and path.exists() and (tmp_path / "x.png").exists()
    views = json.loads(flicker("render", scene, "--size", "32x18", "--engine", "golden", "--view", "all", "--json").stdout)
    assert [row["view"] for row in views] == list(range(4))
    words = ("cost", scene, "--size", "64x36", "--view", 0)
    done = flicker(*words, "--json", "-")
    assert done.returncode == 0 and {"scene", "numbers"} <= json.loads(done.stdout).keys()
    assert flicker(*words, "--json", path).stdout.startswith(str(scene)) and json.loads(path.read_text()) == json.loads(done.stdout)
    assert flicker(*words, "-q").stdout == ""
    for more in (("render", scene, "--json", "-q"), (*words, "--json", "-", "-q")):
        done = flicker(*more)
        assert done.returncode and done.stdout == "" and len(done.stderr.splitlines()) == 1 and "not with --quiet" in done.stderr


def test_options_reach_the_engine(demo, tmp_path):
    """Each option changes what it says; --faithful is the combination that it names."""
    def run(*args) -> dict:
        path = tmp_path / "s.json"
        done = flicker("render", demo / "demo.ply", "--size", "160x90", "--compare", "reference", "--stats", path, *args)
        assert done.returncode == 0, done.stderr
        return json.loads(path.read_text())

    base = run("--stage", "channels")
    assert (base["form"], base["precision"], base["cat"], base["fifo_depth"]) == ("factored", "fixed", "smooth", 16)
    faithful = run("--faithful")
    assert (faithful["form"], faithful["precision"], faithful["cat"], faithful["fifo_depth"]) == ("conic", "mixed", "smooth", 16)
    assert faithful["psnr_db"] == run("--form", "conic", "--precision", "mixed")["psnr_db"] != base["psnr_db"]
    off = run("--cat", "off")
    assert off["psnr_db"] > base["psnr_db"] and off["minitiles_sent"] > base["minitiles_sent"]
    assert run("--precision", "fp8")["minitiles_sent"] != base["minitiles_sent"]
    assert run("--coords", "absolute")["psnr_db"] != base["psnr_db"]
    assert run("--view", "1")["visible"] != base["visible"]


def test_bad_gaussians_are_reported(demo, tmp_path):
    """Left out, counted in the statistics and shown; the picture is made."""
    scene = load_scene(demo / "demo.ply")
    scene.means[:3] = np.nan
    save_ply(scene, tmp_path / "bad.ply")
    run = flicker("render", tmp_path / "bad.ply", "--cameras", demo / "cameras.json", "--size", "64x32", "--stats", tmp_path / "s.json")
    assert run.returncode == 0, run.stderr
    stats = json.loads((tmp_path / "s.json").read_text())
    assert sum(stats["gaussians_left_out"].values()) == 3
    assert stats["gaussians"] == len(scene.means) - 3
    assert all(reason in run.stdout for reason in stats["gaussians_left_out"])


def test_scenes_as_people_have_them(demo, tmp_path):
    """A SOG folder, its meta.json and a zip give one picture; a wrong suffix one line of warning; --up another orbit."""
    files = samples.sog_files(samples.random_scene(1))
    folder = tmp_path / "robot"
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    with zipfile.ZipFile(tmp_path / "robot.zip", "w") as bundle:
        for name, data in files.items():
            bundle.writestr("robot/" + name, data)
    shutil.copy(tmp_path / "robot.zip", tmp_path / "robot.ply")

    def run(scene, *args) -> tuple[dict, str, str]:
        path = tmp_path / "s.json"
        done = flicker("render", scene, "--size", "64x48", "--out", tmp_path / "p.png", "--stats", path, *args)
        assert done.returncode == 0, done.stderr
        return json.loads(path.read_text()) | {"picture": load_picture(tmp_path / "p.png").tobytes()}, done.stdout, done.stderr

    found = {name: run(tmp_path / name) for name in ("robot", "robot/meta.json", "robot.zip", "robot.ply")}
    stats = [f[0] for f in found.values()]
    for key in ("gaussians", "visible", "subtile_pairs", "pixel_pairs", "picture"):
        assert all(s[key] == stats[0][key] for s in stats)
    assert stats[0]["gaussians"] == 300
    assert "robot, view 0" in found["robot"][1] and "robot, view 0" in found["robot/meta.json"][1]
    assert all(found[name][2] == "" for name in ("robot", "robot/meta.json", "robot.zip"))
    warning = found["robot.ply"][2]
    assert warning.startswith("flicker: warning: ") and warning.count("\n") == 1 and "robot.ply" in warning

    turned = {up: run(folder, "--up", up)[0]["picture"] for up in ("-y", "z", "-z")}
    assert turned["-y"] == stats[0]["picture"] and len(set(turned.values())) == 3


def test_as_a_process(tmp_path):
    """The command says the same in a process of its own: a picture, a warning, an error."""
    save_ply(samples.random_scene(1), tmp_path / "scene.ply")
    shutil.copy(tmp_path / "scene.ply", tmp_path / "scene.spz")
    for args in (("scene.spz", "--size", "32x32", "--out", "a.png"), ("none.ply",)):
        words = ["render", *(tmp_path / word if "." in word else word for word in args)]
        here = flicker(*words)
        done = subprocess.run([sys.executable, "-m", "flicker.cli.main", *words], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (here.returncode, here.stderr) and done.stderr.count("\n") == 1
        assert done.returncode == 2 * (args[0] == "none.ply")
    assert load_picture(tmp_path / "a.png").shape == (32, 32, 3)


BAD = {
    "missing file": (["nowhere.ply"], "nowhere.ply"),
    "unknown format": (["{here}/test.txt"], "test.txt"),
    "truncated": (["{here}/cut.ply"], "cut.ply"),
    "no cameras file": (["{scene}", "--cameras", "nowhere.json"], "nowhere.json"),
    "view out of range": (["{scene}", "--view", "99"], "view"),
    "negative view": (["{scene}", "--view=-1"], "view"),
    "streamed SOG": (["{here}/lod-meta.json"], "give"),
    "folder": (["{here}"], "meta.json"),
    "no axis": (["{scene}", "--up", "w"], "up: 'w'"),
    "orbit with cameras": (["{scene}", "--up", "z"], "cameras.json"),
    "zero size": (["{scene}", "--size", "0x10"], "width"),
    "absurd size": (["{scene}", "--size", "64x1000000"], "height"),
    "no size": (["{scene}", "--size", "big"], "--size"),
    "fifo depth": (["{scene}", "--fifo-depth", "129"], "fifo_depth"),
    "unknown mode": (["{scene}", "--cat", "best"], "--cat"),
    "two configurations": (["{scene}", "--faithful", "--form", "conic"], "--form"),
    "no folder": (["{scene}", "--out", "{here}/none/x.png"], "--out"),
    "no png": (["{scene}", "--out", "{here}/x.jpg"], "--out"),
    "stats is a folder": (["{scene}", "--stats", "{here}"], "--stats"),
    "no scene": ([], "scene"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input(case, demo, tmp_path):
    """One line on standard error that names the culprit, exit code 2, nothing written."""
    (tmp_path / "test.txt").write_text("not a scene")
    (tmp_path / "lod-meta.json").write_text('{"filenames": ["0_0/meta.json"]}')
    (tmp_path / "cut.ply").write_bytes((demo / "demo.ply").read_bytes()[:5000])
    before = sorted(tmp_path.iterdir())
    args, named = BAD[case]
    args = [a.format(scene=demo / "demo.ply", here=tmp_path) for a in args]
    if "--out" not in args:
        args += ["--out", str(tmp_path / "out.png")]
    run = flicker("render", *args)
    assert run.returncode == 2, run.stdout + run.stderr
    assert run.stderr.count("\n") == 1 and named in run.stderr, run.stderr
    assert "Traceback" not in run.stderr + run.stdout
    assert sorted(tmp_path.iterdir()) == before
