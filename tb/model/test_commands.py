"""Commands of README.md, docs/, CONTRIBUTING.md and sw/README.md, run as they are written; what they print on narrow terminals and in pipes.

Every command with arguments that a page has must be accounted for here, so a new one fails until it is. The scenes, cameras and data sets that the pages
name are small ones in a sandbox folder; that makes a command fast without another word. Placeholders (`SCENE`, `<unit>`) are those of
`flicker_tb.doc_commands`. What takes long runs with SLOW=1.

Not covered: whole runs of `make test`, `make synth`, `make formal`, `make mutants` and `make docs`, which are run for one unit or part.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import math
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.command import flicker
from flicker_tb.doc_commands import all_commands, commands_of, words_of
from flicker_tb.screen import figures, on_screen

from flicker.budget.write import save
from flicker.cli.tables import Terminal
from flicker.explore.sweep import load_sweep
from flicker.explore.sweep.run import connect
from flicker.fit.dataset import Dataset
from flicker.fit.train import Options, Trainer
from flicker.front.view import View
from flicker.progress import Steps
from flicker.scene.camera import Camera, cameras_text, orbit_camera
from flicker.scene.files import load_scene, save_ply
from flicker.scene.image import save_png
from flicker.scene.packed import PackedFormat
from flicker.toolchain import ROOT

SHOTS, WIDTH, HEIGHT = 17, 48, 36
SIZE = 64, 48  # of the pictures of reports and sweeps that name none
ITERATIONS, GAUSSIANS = 60, 3000  # of a fit in the sandbox, at most
OWN = {"nearest": "vanilla", "nearest,flicker": "vanilla,flicker"}  # the reader's own configuration (docs/guide/extending.md)

# Who runs a command: "run" and "slow" are this file, in the sandbox; else the test that does the same, or why nothing does. The first pattern that fits.
ACCOUNTS: tuple[tuple[str, str], ...] = (
    (r"flicker render .*--device .*", "tb/soc/test_device.py::test_command"),
    (r"\.venv/bin/python soc/.*", "tb/soc/test_other_ways.py::test_boards"),
    (r"make soc(?: .*)?", "tb/soc/test_soc.py::test_whole"),
    (r"(?:\.venv/bin/)?flicker (?:render|path) .*--engine (?:rtl|chip)\b(?!-).*", "slow"),
    (r"flicker (?:chip .* --.*|cost .* --size .*|cost demo --fps .*)", "slow"),
    (r"(?:\.venv/bin/)?flicker render .*", "run"),
    (r"(?:\.venv/bin/)?flicker path .*", "run"),
    (r"flicker (?:chip|convert|cost|grow|pack) .*|\.venv/bin/flicker pack .*", "run"),
    (r"flicker (?:(?:report|stability) --list|--version)", "run"),
    (r"(?:\.venv/bin/)?flicker (?:fit|budget|undistort|report|stability|sweep|view)( .*)?", "slow"),
    (r"flicker demo", "slow"),
    (r"make (?:help|clean)", "run"),
    (r"make demo", "slow"),
    (r"make report(?: .*)?", "slow"),
    (r"make (?:setup|test|lint)", "tb/test_tooling.py::test_copied_checkout_tests_itself"),
    (r"make test (?:SLOW|FRESH)=1", "is what runs this"),
    (r"make check(?: BASE=.*)?", "tb/test_selection.py::test_plan"),
    (r"make record(?: REASON=.*)?", "tb/model/test_gates.py::test_holding"),
    (r"make site", "tb/test_pages.py::test_site_is_built"),
    (r"make fpga(?: .*)? ROUTE=1", "tb/model/test_fpga.py::test_placed"),
    (r"make fpga CHIP=tiny", "tb/model/test_fpga.py::test_within_budget"),
    (r"make fpga(?: .*)?", "tb/model/test_fpga.py::test_unit"),
    (r"make (?:sim|waves|synth|formal|mutants|docs) \w+=.*", "names"),
    (r"make (?:generate|synth|formal|mutants|docs)(?: \[.*\])?", "targets"),
    (r"scripts/gen_\w+.py --check", "tb/common/test_arithmetic.py::test_generated_packages"),
    (r"scripts/docs.py --list", "list"),
    (r"scripts/check.py --list", "tb/test_selection.py::test_plan"),
    (r"scripts/(?:make_demo_scene|formal|synth).py .*", "slow script"),
    (r"cc .*flk.c -lm", "cc"),
    (r".*pytest .*", "pytest"),
    (r"\.venv/bin/pip install -e '\.\[gpu\]'", "downloads PyTorch, of use with a GPU alone"),
)


def account(command: str) -> str | None:
    return next((who for pattern, who in ACCOUNTS if re.fullmatch(pattern, command)), None)


@functools.cache
def parameters(sub: str) -> list[Any]:
    """Of a subcommand of `flicker`."""
    from typer.main import get_command

    from flicker.cli.main import app

    return get_command(app).commands[sub].params


def is_whole(command: str) -> bool:
    """Whether a command can be typed as it stands: a mention such as `flicker view` or `flicker fit --engine gsplat` names no scene or data set."""
    words = words_of(command)
    if not words[0].endswith("flicker") or words[1].startswith("-"):
        return True
    arguments = [p for p in parameters(words[1]) if p.param_type_name == "argument"]
    if len(words) == 2 or words[2].startswith("-"):
        return not any(p.required for p in arguments) and words[-1] not in ("--photos", "--memories") and not (len(words) == 2 and words[1] == "pack")
    return True


WHOLE = {command: places for command, places in all_commands().items() if is_whole(command)}


def of(who: str) -> list[str]:
    """Commands of an account; of those that are the same with their placeholders filled in, one."""
    found = {tuple(words_of(command)): command for command in WHOLE if account(command) == who}
    return list(found.values())


# ---- every command is accounted for -------------------------------------------------------------


def test_every_command_is_accounted_for() -> None:
    """A new command on a page needs a line in ACCOUNTS; a line that names a test names one that is there; no line is left over."""
    lost = {command: places for command, places in WHOLE.items() if account(command) is None}
    assert not lost, lost
    assert len(WHOLE) > 150 and len(of("run")) >= 10 and len(of("slow")) >= 30
    for _, who in ACCOUNTS:
        if "::" in who:
            path, name = who.split("::")
            assert f"def {name}(" in (ROOT / path).read_text(), who
    first = {command: next(pattern for pattern, _ in ACCOUNTS if re.fullmatch(pattern, command)) for command in WHOLE}
    assert {pattern for pattern, _ in ACCOUNTS} <= set(first.values())


def test_commands_are_found() -> None:
    """Fenced lines without their remarks and inline code, both halves of &&; not programs, prose or marks of `make docs`."""
    page = (
        "Type `flicker render SCENE` or `make synth && make docs PART=areas`, not `flicker.metrics`.\n```\nflicker cost scene.ply   # what it costs\n"
        "make sim UNIT=lane\n```\n```python\nmake no = sense\n```\n<!-- make docs PART=areas -->\n`SLOW=1 .venv/bin/python -m pytest tb`\n"
    )
    assert list(commands_of(page)) == [
        "flicker render SCENE", "make synth", "make docs PART=areas", "flicker cost scene.ply", "make sim UNIT=lane", "SLOW=1 .venv/bin/python -m pytest tb",
    ]
    assert words_of("make waves UNIT=<unit>") == ["make", "waves", "UNIT=fifo"] and words_of("flicker report [SCENES...]") == ["flicker", "report"]


# ---- the sandbox --------------------------------------------------------------------------------

# `flicker` as the sandbox's make starts it: with the demo scene and the size of pictures that run_in and test_slow_command set in this process.
PROGRAM = """#!{python}
import sys
from pathlib import Path

from flicker.explore import points
from flicker.scene import demo
from flicker.scene.files import load_scene

demo.generate = lambda seed=1: load_scene(Path("{demo}"))
points.SIZE = {size}

from flicker.cli.main import main

sys.exit(main())
"""


def small_scene(count: int = 150):
    scene = samples.random_scene(1, count, 1)
    scene.scales *= np.float32(3.0)
    return scene


def small_cameras() -> list[Camera]:
    scene = small_scene()
    return [orbit_camera(scene, k, SHOTS, WIDTH, HEIGHT) for k in range(SHOTS)]


@pytest.fixture(scope="module")
def sandbox(tmp_path_factory) -> Path:
    """A folder with the scenes that the pages name, cameras.json beside them, and `.venv` and `make` as in a checkout."""
    here = tmp_path_factory.mktemp("sandbox")
    scene = small_scene()
    for name in ("scene", "guitar", "a"):
        save_ply(scene, here / f"{name}.ply")
    for name in ("scene.spz", "flowers.compressed.ply", "scene.flk"):
        save(scene, here / name, here / name, PackedFormat.CHUNK, Steps())
    for name in ("scene.sog", "playbot.sog", "st-peter.sog", "b.sog"):
        (here / name).write_bytes(samples.sog_bundle(samples.sog_files(scene)))
    (here / "build" / "view").mkdir(parents=True)
    for folder in (here, here / "build" / "view"):
        (folder / "cameras.json").write_text(cameras_text(small_cameras()))
    (here / "build" / "view" / "path.json").write_text(cameras_text(small_cameras()[:3]))
    for name in ("Makefile", "pyproject.toml", "requirements.lock", "scripts"):
        (here / name).symlink_to(ROOT / name)
    programs = here / ".venv" / "bin"
    programs.mkdir(parents=True)
    for path in Path(sys.executable).parent.iterdir():
        (programs / path.name).symlink_to(path)
    (programs / "flicker").unlink()
    (programs / "flicker").write_text(PROGRAM.format(python=sys.executable, demo=here / "guitar.ply", size=SIZE))
    (programs / "flicker").chmod(0o755)
    (here / ".venv" / ".installed").write_text(f"{here}\n")
    return here


def run_in(sandbox: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> subprocess.CompletedProcess:
    """A `flicker` command in the sandbox, in this process; the demo scene is a small one."""
    monkeypatch.chdir(sandbox)
    monkeypatch.setattr("flicker.scene.demo.generate", lambda seed=1: small_scene())
    monkeypatch.setattr("flicker.cli.path._cores", lambda: 1)  # processes take longer to start than small pictures to make
    printed: list[object] = []
    usual = Terminal.print

    def noted(console: Terminal, *objects: object, **options: Any) -> None:
        printed.extend(objects)
        usual(console, *objects, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Terminal, "print", noted)
        done = flicker(*(OWN.get(word, word) for word in words_of(command)[1:]))
    assert done.returncode == 0, f"{command}: {done.stderr or done.stdout}"
    assert done.stderr == "" and "…" not in done.stdout
    for thing in printed:  # on a terminal of 80 columns, with every figure that a pipe gets
        whole, shown = on_screen(thing, None), on_screen(thing, 80)
        assert "…" not in shown and not set(figures(whole)) - set(figures(shown)), shown
        assert max(map(len, shown.splitlines()), default=0) <= 80, shown
    return done


@pytest.mark.parametrize("command", [c for c in of("run") if "flicker" in c])
def test_command(command: str, sandbox: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = run_in(sandbox, monkeypatch, command)
    assert figures(done.stdout), done.stdout
    for option, name in re.findall(r"(--out|-o|--stats|--json) (\S+)", command):
        assert (sandbox / name).stat().st_size > 0, (option, name)


def test_example_of_the_api(sandbox: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The program of docs/reference/api/index.md, with a small scene in place of the demo's."""
    (program,) = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs" / "reference" / "api" / "index.md").read_text(), re.M | re.S)
    view = 'load_view("demo", 0, (640, 360))'
    assert view in program
    monkeypatch.chdir(sandbox)
    exec(program.replace(view, 'load_view("scene.ply", 0, (48, 32))'), {})
    assert (sandbox / "picture.png").is_file() and float(capsys.readouterr().out) > 30


def test_as_typed(sandbox: Path) -> None:
    """The words themselves in a shell, where `.venv` is the checkout's; make finds the environment up to date."""
    done = subprocess.run(["bash", "-c", ".venv/bin/flicker pack scene.ply -o typed.flk && make help"], cwd=sandbox, capture_output=True, text=True)
    assert done.returncode == 0 and "image" in done.stdout and "make report" in done.stdout and done.stderr == "", done
    assert load_scene(sandbox / "typed.flk").means.shape == (150, 3)
    assert subprocess.run(["make", "-q", "setup"], cwd=sandbox).returncode == 0


def test_make_clean(tmp_path: Path) -> None:
    """Removes builds and byte code; keeps .venv and the sources."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("build/sim", ".pytest_cache", "model/flicker/__pycache__", "tb/__pycache__", "scripts", ".venv"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "model/flicker/a.py").write_text("")
    assert subprocess.run(["make", "clean"], cwd=tmp_path, capture_output=True).returncode == 0
    assert {p.name for p in tmp_path.rglob("*")} == {"Makefile", "model", "flicker", "a.py", "tb", "scripts", ".venv"}


@pytest.mark.slow
def test_list_of_parts(capsys: pytest.CaptureFixture[str]) -> None:
    """`scripts/docs.py --list` has a line for each part of `make docs`."""
    import docs

    (command,) = of("list")
    assert docs.main(words_of(command)[1:]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [part.name for part in docs.PARTS]


def test_scripts_can_be_started() -> None:
    """What a page names without an interpreter is executable."""
    for command in WHOLE:
        if (word := words_of(command)[0]).startswith("scripts/"):
            assert (ROOT / word).stat().st_mode & 0o111, word


def test_driver_is_compiled_as_the_page_says(tmp_path: Path) -> None:
    """Into a program, as sw/README.md has it."""
    (command,) = of("cc")
    for name in ("flk.c", "flk.h", "flk_registers.h"):
        shutil.copy(ROOT / "sw" / name, tmp_path)
    (tmp_path / "main.c").write_text("#include \"flk.h\"\nint main(void) { return 0; }\n")
    assert subprocess.run([*words_of(command), "main.c", "-o", "program"], cwd=tmp_path).returncode == 0
    assert subprocess.run([tmp_path / "program"]).returncode == 0


# ---- names in commands of make and pytest -------------------------------------------------------


def names_of(target: str) -> set[str]:
    """What UNIT or PART of a target may be."""
    from flicker.cost.synth.units import all_units

    tests = {path.stem.removeprefix("test_") for path in (ROOT / "tb").rglob("test_*.py")}
    known: dict[str, Callable[[], set[str]]] = {
        "sim": lambda: tests, "waves": lambda: tests, "synth": lambda: {unit.name for unit in all_units()},
        "docs": lambda: set(re.findall(r'^    Part\("(\w+)"', (ROOT / "scripts" / "docs.py").read_text(), re.M)),
        "formal": lambda: {proof["name"] for proof in tomllib.loads((ROOT / "formal" / "proofs.toml").read_text())["proof"]},
        "mutants": lambda: {path.stem for path in (ROOT / "tb" / "mutants").glob("*.toml")},
    }
    return known[target]()


def test_names_of_units_and_parts() -> None:
    """Each UNIT, PART (one or more) and CONFIG of a page is one that its target knows; LIBERTY is a file's."""
    from flicker.cost.synth.units import all_units

    seen: dict[str, set[str]] = {}
    for command in of("names"):
        target, given = words_of(command)[1], dict(word.split("=", 1) for word in words_of(command)[2:])
        known = seen.setdefault(target, names_of(target))
        for key in ("UNIT", "PART"):
            assert key not in given or re.search(r"=(<|name|$)", command) or set(given[key].split()) <= known, (command, WHOLE[command])
        if "CONFIG" in given:
            assert (given["UNIT"], given["CONFIG"]) in {(unit.name, unit.config) for unit in all_units()}, command


def test_tests_that_pages_name() -> None:
    """Files, units and words of pytest's commands find tests."""
    for command in of("pytest"):
        words = words_of(command)
        for word in words:
            if word.startswith("tb/"):
                assert (ROOT / word).exists(), command
        if "-k" in words:
            file = next(ROOT / word for word in words if word.endswith(".py"))
            assert re.search(rf"def test_\w*{words[words.index('-k') + 1]}", file.read_text()), command


# ---- commands that take long --------------------------------------------------------------------


@pytest.fixture(scope="module")
def studio(sandbox: Path) -> Path:
    """The sandbox with data sets: lego and kunkun (transforms.json), room (COLMAP), a fit of lego and what belongs to it, sweep.yaml, curves of budgets."""
    import test_fit

    scene, cameras = small_scene(), small_cameras()
    shots = [(camera, View(camera, scene).reference) for camera in cameras]
    for name in ("lego", "kunkun"):
        folder = sandbox / name
        (folder / "images").mkdir(parents=True)
        for k, (_, picture) in enumerate(shots):
            save_png(folder / "images" / f"r_{k}.png", picture)
        frames = [{"file_path": f"./images/r_{k}", "transform_matrix": test_fit.pose(camera)} for k, camera in enumerate(cameras)]
        (folder / "transforms.json").write_text(json.dumps({"camera_angle_x": 2 * math.atan(WIDTH / 2 / cameras[0].fx), "frames": frames}))
    wide = [orbit_camera(scene, k, SHOTS, test_fit.WIDTH, test_fit.HEIGHT) for k in range(SHOTS)]
    test_fit.write_colmap(sandbox / "room", [(camera, View(camera, scene).reference) for camera in wide])
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(sandbox)
        assert flicker("fit", "lego", "-o", "lego/scene.ply", "--iterations", 30).returncode == 0
        (sandbox / "fit").mkdir()
        shutil.copytree(sandbox / "lego" / "images", sandbox / "fit" / "images")
        for name in ("scene.ply", "cameras.json"):
            shutil.copy(sandbox / "lego" / name, sandbox / "fit")
        for name in ("a", "b"):
            options = ("--keep", 0.5, "--count", 6, "--size", "32x24", "--rounds", 1, "--steps", 0, "--last", 0, "--refit", 0, "--json", f"{name}.json")
            assert flicker("budget", "scene.ply", "-o", "cut.ply", *options).returncode == 0
    (sandbox / "train.json").write_text(cameras_text(cameras))
    (sandbox / "sweep.yaml").write_text("scenes: [scene.ply]\nsize: 48x32\nconfigurations: [flicker, log-lanes]\nout: results\n")
    return sandbox


def make_fits_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever a command says, at most so many iterations and Gaussians."""
    usual = Trainer.__init__

    def short(trainer: Trainer, data: Dataset, options: Options, *others: Any) -> None:
        small = dataclasses.replace(options, iterations=min(options.iterations, ITERATIONS), gaussians=min(options.gaussians, GAUSSIANS))
        usual(trainer, data, small, *others)

    monkeypatch.setattr(Trainer, "__init__", short)


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in of("slow") if "flicker " in c])
def test_slow_command(command: str, studio: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flicker.explore.points.SIZE", SIZE)
    make_fits_short(monkeypatch)
    if " view " in command:
        def stop(_) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr("flicker.view.server.Viewer.serve", stop)
    shutil.rmtree(studio / "results", ignore_errors=True)  # of another sweep, which has every point
    beside = studio / "cameras.json"
    hidden = studio / "cameras.not.json"
    if "--up" in command or " fit " in command:  # for an orbit, and where a fit puts those of its test photographs
        beside.rename(hidden)
    with contextlib.ExitStack() as stack:
        if "--cluster" in command:
            client = stack.enter_context(connect(load_sweep(studio / "sweep.yaml")))
            command = command.replace("tcp://host:8786", client.scheduler.address)
        stack.callback(lambda: hidden.exists() and hidden.rename(beside))
        done = run_in(studio, monkeypatch, command)
        for line in done.stdout.splitlines():  # with the cameras that the command has put beside its scene
            for told in commands_of(f"`{line.strip()}`"):
                run_in(studio, monkeypatch, " ".join(told.split(" measures ")[0].split()))


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in of("slow") if c.startswith("make ")])
def test_slow_make(command: str, studio: Path) -> None:
    done = subprocess.run(["bash", "-c", command], cwd=studio, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    written = studio / ("build/demo/demo.png" if "demo" in command else "build/report/index.html")
    assert written.stat().st_size > 1000


TARGETS = (
    "make sim UNIT=stream_cells", "make waves UNIT=stream_cells", 'make synth UNIT=prtu CONFIG="factored fixed"', "make formal UNIT=fifo",
    "make mutants UNIT=ff", "make docs PART=parameters", "make generate",
)


@pytest.mark.slow
@pytest.mark.parametrize("command", TARGETS)
def test_target(command: str) -> None:
    """One unit or part of each target, in this checkout; what it generates is what is there."""
    before = changes()
    done = subprocess.run(["bash", "-c", command], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert changes() == before


def changes() -> str:
    """Of generated files in this checkout, against its last commit."""
    command = ["git", "diff", "--", "README.md", "docs", "model", "rtl", "sw", "tb/waves"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
@pytest.mark.parametrize("command", of("slow script"))
def test_slow_script(command: str, sandbox: Path) -> None:
    done = subprocess.run([sys.executable, *words_of(command)], cwd=sandbox, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_target_is_run() -> None:
    """Each target that `make help` lists is in TARGETS or in ACCOUNTS."""
    listed = set(re.findall(r"^([a-z]+):.*## ", (ROOT / "Makefile").read_text(), re.M))
    assert len(listed) >= 12
    for target in listed:
        assert any(c.split()[1] == target for c in TARGETS) or account(f"make {target}") not in (None, "targets"), target
