"""What a person sees: start-up without heavy imports, tables on narrow terminals and in pipes, errors, Ctrl-C, full disks.

Not covered: colours; terminals that are resized while a command runs.
"""

from __future__ import annotations

import ast
import io
import json
import os
import re
import resource
import subprocess
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.command import flicker
from flicker_tb.screen import figures, on_screen
from PIL import Image
from rich.table import Table

from flicker import output
from flicker.chip.run import FRONT, RENDERING, stall_shares
from flicker.cli import main as entry
from flicker.cli.tables import Terminal, bar, bytes_text, decibels
from flicker.errors import FlickerError, FlickerWarning, Interrupted
from flicker.scene.files import save_ply
from flicker.toolchain import ROOT

CLI = ROOT / "model" / "flicker" / "cli"


# ---- start-up -----------------------------------------------------------------------------------

HEAVY = ("numba", "scipy", "matplotlib", "dask", "distributed", "gsply", "viser", "skimage", "pandas", "pyarrow", "yaml", "imagecodecs")
LIGHT = (
    ["--version"], ["--help"], ["rendr"], [], *([name, "--help"] for name in sorted(c.name or c.callback.__name__ for c in entry.app.registered_commands)),
    ["render", "scene.ply", "--engin", "rtl"], ["render", "scene.ply", "--engine", "rtll"], ["demo", "--size", "3"],
)
# These look at what is there.
NO_FILE = (
    ["render", "none.ply"], ["cost", "none.ply"], ["chip", "none.ply"], ["view", "none.ply"], ["pack", "none.ply", "-o", "x.flk"],
    ["path", "none.ply", "-o", "x.mp4", "--walk"],
    ["convert", "none.ply", "x.ply"], ["report", "none.ply:3"],
    ["budget", "none.ply", "-o", "x.ply", "--keep", "0.4"], ["sweep", "none.yaml"], ["stability", "--out", "/proc/none"],
)
COUNT = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout
for words in json.loads(sys.argv[1]):
    sys.argv = ["flicker", *words]
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            from flicker.cli.main import main
            main()
    except SystemExit as exit:
        print(json.dumps([exit.code, sorted({name.split(".")[0] for name in sys.modules})]))
"""


def test_start_is_light(tmp_path: Path) -> None:
    """Help, versions and errors of the command line load none of the packages that take seconds; what is asked of files may add numpy and Pillow."""
    done = subprocess.run([sys.executable, "-c", COUNT, json.dumps([*LIGHT, *NO_FILE])], cwd=tmp_path, capture_output=True, text=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(LIGHT) + len(NO_FILE), done.stderr
    for words, (code, modules) in zip([*LIGHT, *NO_FILE], found):
        assert code == (0 if words and words[-1] in ("--help", "--version") else 2), words
        assert not set(HEAVY) & set(modules), (words, set(HEAVY) & set(modules))
        assert words in NO_FILE or "numpy" not in modules, words


def test_version_is_the_package() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    done = flicker("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"flicker {version}\n", "")


@pytest.mark.parametrize(("words", "said"), [
    (["rendr", "a.ply"], "No such command 'rendr'. Did you mean 'render'? (see 'flicker --help')"),
    (["render", "a.ply", "--siz", "3x3"], "--size) (see 'flicker render --help')"),
    (["--versio"], "--version) (see 'flicker --help')"),
    (["cost"], "(see 'flicker cost --help')"),
    (["cost", "a.ply", "--views", "0"], "(see 'flicker cost --help')"),
    (["cost", "a.ply", "b.ply"], "b.ply"),
])
def test_wrong_words_are_one_line(words: list[str], said: str) -> None:
    done = flicker(*words)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
    assert done.stderr.startswith("flicker: ") and said in done.stderr


def test_warnings_of_libraries_are_not_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ours are one line; with -W all are there."""
    def warn(*args: object) -> None:
        warnings.warn("of a library", UserWarning, stacklevel=1)
        warnings.warn(FlickerWarning("of ours"), stacklevel=1)
        raise FlickerError("end")

    monkeypatch.setattr("flicker.cli.pack.check_scene", warn)
    monkeypatch.setattr(entry, "_show_others", lambda message, *rest: print(message, file=sys.stderr))
    for asked in ([], ["default"]):
        monkeypatch.setattr(sys, "warnoptions", asked)
        done = flicker("pack", "a.ply", "-o", tmp_path / "a.flk")
        assert done.returncode == 2 and ("of a library" in done.stderr) == bool(asked)
        assert "flicker: warning: of ours\n" in done.stderr and done.stderr.endswith("flicker: end\n")


def test_no_words_show_help() -> None:
    done = flicker()
    assert done.returncode == 2 and "Usage: flicker" in done.stdout and done.stderr == ""


# ---- tables -------------------------------------------------------------------------------------


def wide_table() -> Table:
    table = Table(title="a frame of each view, with a title that is longer than forty columns")
    for name in ("view", "front end, cycles", "rendering, cycles", "frames a second", "MB", "recorded", "tile entries", "visits"):
        table.add_column(name, justify="right" if name != "view" else "left")
    for k in range(3):
        table.add_row(f"view {k}", "1,518,123", f"{k},518,124", "518", "123.45", "2,518,126", "11,518,127", "211,518,128")
    return table


def label_table() -> Table:
    table = Table(show_header=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_row("  stalled: front end, cluster for its geometry and more that is long", "123,456,789 cycles, sum over 4 cores")
    table.add_row("picture", f"a [bold]/[x] :smile: {'long/' * 20}name.png", end_section=True)
    table.add_row("Gaussians", "1,234,567")
    return table


@pytest.mark.parametrize("made", [wide_table, label_table])
@pytest.mark.parametrize("width", [24, 40, 80, 200, None])
def test_no_figure_is_cut(made: Callable[[], Table], width: int | None) -> None:
    """At any width; None: a pipe, where nothing is wrapped either."""
    everything = [cell for column in made().columns for cell in column.cells]
    shown = on_screen(made(), width)
    assert "…" not in shown
    assert {f for cell in everything for f in figures(cell)} <= set(figures(shown))
    if width is None:
        assert all(cell in shown for cell in everything) and shown.count("┏") + shown.count("┌") == 1
    elif width >= 40:
        assert max(map(len, shown.splitlines())) <= width


def test_rows_keep_their_names() -> None:
    """A table that is cut between columns repeats the column that names the rows; labels that wrap keep their indent; titles are whole lines."""
    shown = on_screen(wide_table(), 40)
    assert shown.count("view 2") > 1 and shown.startswith("a frame of each view, with a title that")
    assert len({shown.count(f"view {k}") for k in range(3)}) == 1
    lines = [line.split("│")[1] for line in on_screen(label_table(), 60).splitlines() if line.startswith("│")]
    label = lines[: next(k for k, line in enumerate(lines) if "picture" in line)]
    assert len([line for line in label if line.strip()]) >= 2 and all(line.startswith("   ") for line in label)
    assert "a [bold]/[x] :smile: " in on_screen(label_table(), None)


def statistics() -> dict[str, Any]:
    """Of a frame of the chip in which everything waits that can."""
    from flicker.cli.render import timed

    waits = ["no records for the lanes", "no slot in the lanes' store", "no room in a lane's queue", *(c.stall for c in (*FRONT, *RENDERING) if c.stall)]
    stalls = {cause: 1000 * (k + 1) ** 2 for k, cause in enumerate(waits)} | {"records, at the port": 0}
    return timed({
        "scene": "scenes/flowers/point_cloud.ply", "view": 0, "width": 1280, "height": 720, "cameras": "cameras.json beside the scene", "engine": "chip",
        "formats": "9 / 9 / 16", "front": "rtl", "format": "chunk", "records": "factored-16", "psnr_db": 41.234, "gaussians": 1234567, "visible": 234567,
        "list_entries": 3456789, "subtile_pairs": 2345678, "lanes": {"lanes": 32, "visited": 15475440, "skipped": 400000}, "cycles": 766540,
        "phases": {"front end": 98148, "rendering": 668392}, "dram_bytes": {"table": (12345, 0), "records": (12345678, 1234567), "frame": (0, 2764800)},
        "dram_efficiency": 0.41, "refresh": "all-banks", "stalls": stalls, "stall_shares": stall_shares(stalls, 766540),
        "bottleneck": "rendering: lanes, busy 71%",
        "busy": {"front end": {"lanes": 0.31, "DRAM": 0.5}, "rendering": {"lanes": 0.71, "record cache's port": 1.02}}, "simulated_cycles_per_second": 12345,
        "gaussians_left_out": {"opacity of 0": 12}, "adjusted": {"colour above 2 clipped": 3},
    }, True)


def test_summary_of_a_frame() -> None:
    """Sections in 80 columns, each label on one line, waits as bars with the longest first, units and thousands; a narrow terminal loses no figure."""
    from flicker.cli.render import summary

    table = summary(statistics(), Path("out/picture.png"))
    shown = on_screen(table, 80)
    lines = [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines() if line.startswith("│")]
    assert max(map(len, shown.splitlines())) <= 80
    assert [name for name, _, _ in lines if name] == ["picture", "quality", "work", "time", "memory", "busy", "waits", "front end", "left out", "adjusted"]
    labels = [str(cell).strip() for cell in table.columns[1].cells]
    assert [label for _, label, _ in lines if label] == labels and len(labels) > 40
    assert "766,540 cycles" in shown and "0.767 ms, 1,305 a second" in shown and "12.35 MB read" in shown and "12.3 KB read" in shown
    assert f"{'█' * 12} 102.0%" in shown and f"{'█' * 6}{' ' * 8}50.0%" in shown
    sections: dict[str, list[float]] = {}
    for name, _, value in lines:
        section = name or section  # noqa: F821  # the first line has one
        if found := re.search(r"(?:^| )([\d.]+)%$", value):
            sections.setdefault(section, []).append(float(found[1]))
    waits, front = sections["waits"], sections["front end"]
    assert waits == sorted(waits, reverse=True) and front == sorted(front, reverse=True) and "at the port" not in shown
    assert len(waits) + len(front) == len(statistics()["stalls"]) - 1 and len(front) == sum(bool(c.stall) for c in FRONT)
    assert set(figures(shown)) <= set(figures(on_screen(table, 44)))


def test_every_command_prints_through_the_terminal() -> None:
    """No other console in the commands, nothing that rich would take for markup."""
    for path in CLI.glob("*.py"):
        tree = ast.parse(path.read_text())
        made = [node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
        assert "Console" not in made, path.name
        assert not re.search(r"\[/?(bold|yellow|red|green|dim|italic)\]", path.read_text()), path.name


def test_units() -> None:
    assert decibels(None) == decibels(np.inf) == "equal" and decibels(31.416) == "31.42 dB" and decibels(31.416, 1, "") == "31.4"
    assert (bytes_text(9999), bytes_text(12345), bytes_text(1234567890)) == ("9,999 bytes", "12.3 KB", "1,234.57 MB")
    assert (bar(0.0, 4), bar(0.125, 4), bar(0.99, 4), bar(1.5, 4)) == ("       0.0%", "▌     12.5%", "████  99.0%", "████ 150.0%")
    assert stall_shares({"front end, records": 200, "delivery for entries": 200}, 1000) == {"front end, records": 0.05, "delivery for entries": 0.2}
    for path in [*CLI.glob("*.py"), *(ROOT / "model" / "flicker" / "view").glob("*.py")]:
        assert "999" not in path.read_text(), path.name


# ---- Ctrl-C -------------------------------------------------------------------------------------


def raises(error: BaseException) -> Callable[..., None]:
    def stop(*args: object, **options: object) -> None:
        raise error

    return stop


def test_ctrl_c_says_what_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line, exit code 130; what was promised is there."""
    import flicker.chip.run
    import flicker.explore.stability.run
    import flicker.explore.sweep.run
    import flicker.report.write

    save_ply(samples.random_scene(1, 20, 0), tmp_path / "scene.ply")
    (tmp_path / "sweep.yaml").write_text("scenes: [scene.ply]\nsize: 32x32\nconfigurations: [flicker]\nout: results\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("flicker.scene.demo.generate", lambda seed=1: samples.random_scene(1, 20, 0))
    for module, name in (
        (flicker.explore.sweep.run, "run_sweep"), (flicker.explore.stability.run, "run_stability"), (flicker.report.write, "collect"),
        (flicker.chip.run, "render_on_chip"),
    ):
        monkeypatch.setattr(module, name, raises(KeyboardInterrupt()))
    told = {
        ("sweep", "sweep.yaml"): "0 of 1 points are kept in results/points; the same command continues",
        ("stability", "--quick", "--out", "stable"): "nothing was written to stable; the same command begins anew, --quick and --family make it shorter",
        ("report", "scene.ply", "--size", "32x32", "--configs", "flicker", "--out", "made", "--store", "kept"):
            "what is measured is kept in kept, and the same command goes on from there; no page was written",
        ("demo", "--size", "32x32", "--dir", "demo"):
            "nothing was written to demo; simulators that were built are kept, and the same command begins anew",
    }
    for words, line in told.items():
        done = flicker_command(words)
        assert (done.returncode, done.stderr) == (130, f"flicker: interrupted: {line}\n"), done
    assert not (tmp_path / "demo").exists() and (tmp_path / "kept").is_dir() and not list((tmp_path / "made").glob("*.html"))
    monkeypatch.setattr("flicker.cli.pack.check_scene", raises(KeyboardInterrupt()))
    done = flicker_command(("pack", "scene.ply", "-o", "x.flk"))
    assert (done.returncode, done.stderr) == (130, "flicker: interrupted\n")


flicker_command = lambda words: flicker(*words)  # noqa: E731  # `flicker` is a package where its modules are patched


# ---- full disks ---------------------------------------------------------------------------------


@contextmanager
def full_disk(size: int = 0) -> Iterator[None]:
    """Files of this process end at `size` bytes: writing fails with a reason of the system, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def writers(folder: Path) -> dict[str, Callable[[], object]]:
    """Everything that commands write with, by the file that it must name."""
    from flicker.explore.stability.run import Point, Stability
    from flicker.explore.stability.write import write_csv
    from flicker.explore.store import Store
    from flicker.explore.sweep.results import write_rows
    from flicker.report.figures import Figure
    from flicker.scene.camera import Camera
    from flicker.scene.demo import write_demo
    from flicker.view import stills

    camera = Camera(16, 16, 16.0, 16.0, np.zeros(3), np.eye(3))
    point = Point(**{name: 1 if kind in ("int", int) else 1.0 if kind in ("float", float) else "thin" for name, kind in Point.__annotations__.items() if name})
    return {
        "text.json": lambda: output.write_text(folder / "text.json", "x" * 5000),
        "records.csv": lambda: output.write_records(folder / "records.csv", ["a"], [{"a": 1, "b": "x" * 5000}]),
        "stability.csv": lambda: write_csv(Stability((point,) * 200, 1), folder / "stability.csv"),
        "key.json": lambda: Store(folder).put("key", {"x": "y" * 5000}),
        "key.npz": lambda: Store(folder).put("key", {}, {"x": np.random.default_rng(1).random(5000)}),
        "rows.parquet": lambda: write_rows(folder / "rows.parquet", [{"x": float(k)} for k in range(5000)]),
        "figure.csv": lambda: Figure("figure", "", "", "", ["a"], [["x" * 5000]]).write(folder),
        "demo.ply": lambda: write_demo(folder),
        "view_000.png": lambda: stills.save(folder, Image.fromarray(np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8)), camera),
    }


@pytest.mark.parametrize("name", [
    "text.json", "records.csv", "stability.csv", "key.json", "key.npz", "rows.parquet", "figure.csv", "demo.ply", "view_000.png",
])
def test_full_disk(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line with file and reason; what was there before stays, nothing half-written beside it."""
    monkeypatch.setattr("flicker.scene.demo.generate", lambda seed=1: samples.random_scene(1))
    write = writers(tmp_path)[name]
    (tmp_path / name).write_text("before")
    with full_disk(1000), pytest.raises(FlickerError) as caught:
        write()
    assert re.fullmatch(rf"{re.escape(str(tmp_path / name))}: cannot be written \([^\n]+\)", str(caught.value)), caught.value
    assert (tmp_path / name).read_text() == "before" and [p.name for p in tmp_path.iterdir()] == [name]


def test_what_a_name_leads_to_stays(tmp_path: Path) -> None:
    """A device or pipe gets the content and is not replaced by a file; a link still leads to its file, which is new."""
    pipe, link, file = tmp_path / "pipe.json", tmp_path / "link.json", tmp_path / "deep" / "file.json"
    os.mkfifo(pipe)
    file.parent.mkdir()
    file.write_text("before")
    link.symlink_to("deep/file.json")
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        for path in (pipe, link):
            output.write_text(path, "x" * 5000)
        assert os.read(reader, 9000) == b"x" * 5000 and pipe.is_fifo()
    finally:
        os.close(reader)
    assert link.is_symlink() and file.read_text() == "x" * 5000
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["deep", "file.json", "link.json", "pipe.json"]
    full = tmp_path / "full.json"
    full.symlink_to("/dev/full")
    with pytest.raises(FlickerError, match=r"full.json: cannot be written \(No space left on device\)"):
        output.write_text(full, "x")
    assert full.is_symlink() and full.is_char_device()


def test_full_disk_behind_a_command(tmp_path: Path) -> None:
    """A picture that cannot be written, and a pipe that ends at a full disk."""
    save_ply(samples.random_scene(1), tmp_path / "scene.ply")
    with full_disk(1000):
        done = flicker("pack", tmp_path / "scene.ply", "-o", tmp_path / "scene.flk")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"flicker: {tmp_path / 'scene.flk'}: cannot be written (") and [p.name for p in tmp_path.iterdir()] == ["scene.ply"]
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    for words in ("--version", "--help"):
        with open("/dev/full", "w") as full:
            done = subprocess.run([sys.executable, "-m", "flicker.cli.main", words], stdout=full, stderr=subprocess.PIPE, text=True, env=buffered)
        assert (done.returncode, done.stderr) == (2, "flicker: standard output: No space left on device\n"), words


def test_whole_folder_or_none(tmp_path: Path) -> None:
    """`folder_atomically`: beside what is there at the end, nothing after a failure."""
    folder = tmp_path / "a" / "made"
    for error in (KeyboardInterrupt, OSError("x")):
        with pytest.raises(KeyboardInterrupt if error is KeyboardInterrupt else OSError), output.folder_atomically(folder) as made:
            (made / "half").write_text("")
            raise error
        assert list((tmp_path / "a").iterdir()) == []
    folder.mkdir()
    (folder / "old").write_text("old")
    (folder / "new").write_text("old")
    with output.folder_atomically(folder) as made:
        (made / "new").write_text("new")
    assert {p.name: p.read_text() for p in folder.iterdir()} == {"old": "old", "new": "new"} and list(tmp_path.glob("a/.*")) == []
    with pytest.raises(FlickerError, match="is not a folder"), output.folder_atomically(folder / "old"):
        pass


def test_records_of_several_kinds(tmp_path: Path) -> None:
    """Columns in order of appearance over all records, not those of the first."""
    output.write_records(tmp_path / "x.csv", ["b", "a"], [{"a": 1, "b": 2}, {"a": 3, "c": "x,y"}])
    assert (tmp_path / "x.csv").read_text() == 'b,a,c\n2,1,\n,3,"x,y"\n'


def test_interrupted_is_ctrl_c() -> None:
    """So that what expects KeyboardInterrupt stops for it, too."""
    assert issubclass(Interrupted, KeyboardInterrupt) and isinstance(Terminal(file=io.StringIO()), Terminal)
