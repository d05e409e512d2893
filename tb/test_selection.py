"""What tests read, what is taken from the cache, what `make check` runs: of a changed unit, package, module of the model, page, data file.

Not covered: programs that read the checkout in ways that neither strings nor opened files show (`flicker_tb.inputs`).
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import check
import pytest
from flicker_tb import inputs, passed
from flicker_tb.bench import rounds

from flicker.errors import FlickerError
from flicker.toolchain import ROOT


def readers(changed: str) -> set[str]:
    """Names of the test files that have a file among their inputs."""
    assert (ROOT / changed).is_file(), changed
    return {path.stem.removeprefix("test_") for path in inputs.test_files() if ROOT / changed in inputs.inputs(path)}


WHOLE = {"docs", "pages", "tooling", "formal", "synth", "commands"}  # test files that read the whole checkout


@pytest.mark.parametrize(("changed", "read_by", "not_by"), [
    ("rtl/ctu/flk_mmu.sv", {"mmu", "ctu", "render_stage", "frames", "chip_frames"}, {"vru", "lzc", "delivery", "camera", "top_axi_wiring"}),
    ("rtl/generated/flk_pkg.sv", {"ctu", "vru", "channel"}, {"lzc", "camera", "mmu", "delivery"}),
    ("rtl/common/flk_lzc.sv", {"lzc", "chip_frames"}, {"camera", "sram"}),
    ("rtl/sort/flk_delivery.sv", {"delivery", "rendering", "chip_frames", "chip_rendering"}, {"ctu", "lane", "preprocessing"}),
    ("model/flicker/golden/vru.py", {"vru", "golden", "channel", "frames"}, {"lzc", "delivery", "camera_files"}),
    ("model/flicker/params.py", {"vru", "golden", "camera"}, {"lzc", "sram"}),
    ("model/flicker/cost/areas.csv", {"chip", "energy", "docs"}, {"vru", "golden", "camera"}),
    ("model/flicker/sim/memory.hpp", {"chip_frames", "memory_port"}, {"vru", "golden", "camera"}),
    ("tb/flicker_tb/streams.py", {"vru", "lzc", "delivery"}, {"camera", "perf"}),
    ("tb/conftest.py", {"vru", "lzc", "camera", "pages", "chip_frames"}, set()),
    ("tb/model/conftest.py", {"camera", "chip_lists"}, {"vru", "chip_frames"}),
    ("tb/model/chip_samples.py", {"chip_lists"}, {"camera", "vru"}),
    ("tb/render/cocotb_vru.py", {"vru"}, {"channel", "lzc"}),
    ("tb/common/ff_harness.cpp", {"ff"}, {"fixed", "lzc"}),
    ("docs/glossary.md", {"pages", "docs"}, {"vru", "camera", "chip_frames"}),
    ("sw/flk.c", {"driver", "top_axi", "chip_frames"}, {"vru", "camera"}),
    ("scripts/lint.py", {"tooling"}, {"vru", "camera"}),
])
def test_who_reads_a_file(changed: str, read_by: set[str], not_by: set[str]) -> None:
    found = readers(changed)
    assert read_by | WHOLE <= found, (read_by | WHOLE) - found
    assert not found & not_by, found & not_by


@pytest.mark.parametrize(("reader", "file"), [
    ("tb/sort/test_delivery.py", "rtl/sort/flk_record_cache.sv"), ("tb/sort/test_delivery.py", "tb/sort/cocotb_delivery.py"),
    ("tb/sort/test_delivery.py", "tb/flicker_tb/runner.py"),
    ("tb/sort/test_delivery.py", "tb/conftest.py"), ("tb/model/test_chip.py", "model/flicker/cost/areas.csv"),
])
def test_key_holds_contents(reader: str, file: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another content of any input, or another version or variable, makes another key."""
    before = passed.key(ROOT / reader, "around")
    assert before == passed.key(ROOT / reader, "around") != passed.key(ROOT / reader, "elsewhere")
    content = passed._content
    monkeypatch.setattr(passed, "_content", lambda path: "other" if path == ROOT / file else content(path))
    assert passed.key(ROOT / reader, "around") != before


def test_surroundings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """SLOW, seed, compiler and scenes from outside count; notes on progress do not."""
    plain = passed.surroundings(False)
    assert passed.surroundings(True) != plain
    monkeypatch.setenv("FLICKER_PROGRESS", "elsewhere")
    assert passed.surroundings(False) == plain
    for name in ("FLICKER_SEED", "SLOW", "CXX"):
        with monkeypatch.context() as patch:
            patch.setenv(name, "17")
            patch.setattr("flicker.toolchain.versions", lambda: "fixed")
            assert passed.surroundings(False) != plain
    monkeypatch.setenv("FLICKER_SCENES", str(tmp_path))
    empty = passed.surroundings(False)
    (tmp_path / "scene.ply").write_text("ply")
    assert passed.surroundings(False) != empty


# ---- make check -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("edited", "about", "above", "further"), [
    ("rtl/ctu/flk_mmu.sv", {"mmu"}, {"ctu"}, {"frames", "chip_frames"}),
    ("rtl/sort/flk_delivery.sv", {"delivery"}, {"rendering"}, {"chip_frames"}),
    ("rtl/generated/flk_pkg.sv", set(), {"vru", "channel"}, {"pages"}),
    ("model/flicker/golden/vru.py", {"golden", "vru"}, {"channel"}, {"commands"}),
    ("model/flicker/scene/camera.py", {"camera", "camera_files"}, {"perf"}, {"pages"}),
    ("tb/render/cocotb_vru.py", {"vru"}, set(), {"pages"}),
    ("tb/model/test_camera.py", {"camera"}, set(), {"pages"}),
    ("docs/glossary.md", {"pages"}, set(), {"docs"}),
    ("model/flicker/cost/areas.csv", set(), set(), {"docs", "chip"}),
])
def test_plan(edited: str, about: set[str], above: set[str], further: set[str]) -> None:
    """Test files by how near they are to a changed file."""
    plan = check.plan([edited])
    for expected, found in zip((about, above, further), plan.tests):
        assert expected <= {path.stem.removeprefix("test_") for path in found}, found
    assert {path for group in plan.tests for path in group} == {path for path in inputs.test_files() if ROOT / edited in inputs.inputs(path)}
    assert (plan.python, plan.modules, plan.pages) == (
        [edited] if edited.endswith(".py") else [], [Path(edited).stem] if edited.endswith(".sv") else [], edited.endswith(".md"))


def test_as_many_as_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """In their order; one that is too long leaves the time to shorter ones behind it."""
    tests = [ROOT / "tb" / f"test_{k}.py" for k in range(5)]
    monkeypatch.setattr(check, "costs", lambda: {f"tb/test_{k}.py": seconds for k, seconds in enumerate((30, 200, 60, 120))})
    assert check.fitting(tests, 100, 2) == [tests[0], tests[2], tests[4]]
    assert check.fitting(tests, 105, 2) == [tests[0], tests[2], tests[3]]
    assert check.fitting(tests, 400, 2) == tests


def test_costs_are_of_test_files() -> None:
    """The order of a run and `make check` go by tb/costs.csv: no line is left over, and few files are without one (these count as UNKNOWN)."""
    files = {path.relative_to(ROOT).as_posix() for path in inputs.test_files()}
    assert check.costs().keys() <= files and len(files - check.costs().keys()) <= len(files) // 20


def test_what_changed(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Edited and new files, against any commit; files that git ignores are none."""
    monkeypatch.setattr(check, "ROOT", checkout)

    def git(*words: str) -> None:
        subprocess.run(["git", "-c", "user.name=x", "-c", "user.email=x@x", *words], cwd=checkout, check=True, capture_output=True)

    git("init", "-q")
    (checkout / ".gitignore").write_text("build/\n*.log\n")
    git("add", "-A")
    git("commit", "-qm", "one")
    assert check.changed("HEAD") == []
    (checkout / "CHANGELOG.md").write_text("x")
    (checkout / "new.py").write_text("x")
    (checkout / "x.log").write_text("x")
    assert check.changed("HEAD") == ["CHANGELOG.md", "new.py"]
    git("add", "-A")
    git("commit", "-qm", "two")
    assert check.changed("HEAD") == [] and check.changed("HEAD~1") == ["CHANGELOG.md", "new.py"]
    with pytest.raises(FlickerError, match="BASE=nothing: "):
        check.changed("nothing")


# ---- a run in a checkout of its own -------------------------------------------------------------

TESTS = {
    "test_reads.py": '''
import json, subprocess, sys
from pathlib import Path
import pytest
from reads_data import value
from flicker.errors import FlickerError
from flicker.toolchain import ROOT, filelist
NAME = "glossary"

def test_module(): assert value() > 0
@pytest.mark.parametrize("number", [1, 2])
def test_numbers(number): assert number
''',
    "test_hidden.py": '''
from pathlib import Path
def test_hidden(): assert (Path(*reversed(["CHANGELOG.md", str(Path.cwd())]))).read_text()
def test_fails(): assert "x" in "abc"
''',
}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout with tests of its own; packages are those of this one."""
    folder = tmp_path_factory.mktemp("selection") / "checkout"
    skip = shutil.ignore_patterns("__pycache__", "*.egg-info", "test_*.py", "mutants")
    for name in ("model", "tb", "rtl"):
        shutil.copytree(ROOT / name, folder / name, ignore=skip)
    for name in ("pyproject.toml", "CHANGELOG.md"):
        shutil.copy(ROOT / name, folder)
    for name, text in TESTS.items():
        (folder / "tb" / "model" / name).write_text(text)
    (folder / "tb" / "model" / "reads_data.py").write_text(
        'from pathlib import Path\ndef value(): return int(Path(__file__).with_name("number.txt").read_text())\n'
    )
    (folder / "tb" / "model" / "number.txt").write_text("1")
    return folder


def run(checkout: Path, **environment: str) -> tuple[str, dict]:
    """Output of `pytest --cached` there, and what is kept."""
    import os

    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "FLICKER_PROGRESS"))}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--cached", "-p", "no:cacheprovider", "-n", "0", "tb/model"], cwd=checkout, text=True, capture_output=True,
        env={**own, "PYTHONPATH": str(checkout / "model"), **environment},
    )
    kept = checkout / "build" / "tests" / "passed.json"
    return done.stdout + done.stderr, json.loads(kept.read_text())


def test_cached_run(checkout: Path) -> None:
    """Passed tests are left out until an input changes; a test that reads what its key does not hold never is, nor one that fails."""
    out, kept = run(checkout)
    assert "4 passed" in out and "1 failed" in out and "taken from the cache" not in out, out
    assert "not cached, reads more than its key holds: tb/model/test_hidden.py (CHANGELOG.md)" in out, out
    assert {name: len(entry["tests"]) for name, entry in kept.items()} == {"tb/model/test_reads.py": 3} and kept["tb/model/test_reads.py"]["all"]
    out, _ = run(checkout)
    assert "3 tests taken from the cache" in out and "1 passed" in out and "1 failed" in out, out
    (checkout / "tb" / "model" / "number.txt").write_text("0")
    out, kept = run(checkout)
    assert "2 failed" in out and "3 passed" in out and len(kept["tb/model/test_reads.py"]["tests"]) == 2, out
    if rounds(0, 1):
        (checkout / "tb" / "model" / "number.txt").write_text("2")
        for fresh in ({}, {"FRESH": "1"}):
            out, _ = run(checkout, **fresh)
            assert "4 passed" in out and "taken from the cache" not in out, out
