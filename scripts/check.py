#!/usr/bin/env python3
"""`make check`: what an edit asks for, in two minutes: lint of what changed, and the tests that read it, those nearest to it first.

    scripts/check.py [--base REF] [--jobs N] [--seconds N] [--list]

Changed is what differs from REF (HEAD), and what git does not know yet. Of the tests that read it (`flicker_tb.inputs`) those run that are about it: of its own
name, or that import or name it themselves; then those one step above; as many as fit --seconds by what they cost on a fresh build (tb/costs.csv). Tests
that passed on the same inputs are taken from the cache. What is left to `make test` is named. Exits 1 when something fails.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from flicker import toolchain
from flicker.errors import FlickerError

sys.path.insert(0, str(toolchain.ROOT / "tb"))

import lint  # noqa: E402
from flicker_tb import inputs  # noqa: E402

ROOT = toolchain.ROOT
COSTS = ROOT / "tb" / "costs.csv"
SECONDS = 80.0
SHOWN = 20  # names of what is left
UNKNOWN = 20.0  # processor seconds of a test file that is not in COSTS
PAGES = ROOT / "tb" / "test_pages.py"


@dataclass
class Plan:
    """What to run. python, modules, pages: what lint looks at. tests: files by nearness, 0: about the edit, 1: one step above, 2: the rest."""

    python: list[str] = field(default_factory=list)
    modules: list[str] = field(default_factory=list)
    pages: bool = False
    tests: tuple[list[Path], list[Path], list[Path]] = field(default_factory=lambda: ([], [], []))


def changed(base: str) -> list[str]:
    """Files that differ from a commit, or that git does not know; FlickerError where there is no such commit."""
    found = []
    for command in (["diff", "--name-only", "--no-renames", base, "--"], ["ls-files", "--others", "--exclude-standard"]):
        done = subprocess.run(["git", *command], cwd=ROOT, capture_output=True, text=True)
        if done.returncode:
            raise FlickerError(f"BASE={base}: {(done.stderr.splitlines() or ['git does not run'])[0]}")
        found += done.stdout.splitlines()
    return sorted(set(found))


@cache
def costs() -> dict[str, float]:
    """Processor seconds of test files, on a fresh build."""
    with COSTS.open(newline="") as rows:
        return {row["file"]: float(row["cpu"]) for row in csv.DictReader(rows)}


def cost(test: Path) -> float:
    return costs().get(test.relative_to(ROOT).as_posix(), UNKNOWN)


def _unit(path: Path) -> str:
    return path.stem.removeprefix("flk_").removeprefix("test_").removeprefix("cocotb_")


def _around(test: Path) -> frozenset[Path]:
    """A test file with what stands beside it and that it uses: cocotb modules, benches, harnesses."""
    found, pending = set[Path](), [test]
    while pending:
        path = pending.pop()
        if path not in found:
            found.add(path)
            pending += [other for other in inputs.used(path) if other.parent == test.parent and not other.name.startswith(("test_", "conftest"))]
    return frozenset(found)


@cache
def _named(source: Path) -> frozenset[str]:
    """Modules and packages of the RTL that a source names itself."""
    return inputs.words(source) & inputs.rtl().keys()


def nearness(test: Path, edited: Path) -> int:
    """How far a test that reads a file is from it (`Plan.tests`)."""
    if inputs.inputs(test) == inputs.tree():
        return 2
    own = _around(test)
    if edited in own or _unit(test) == _unit(edited):
        return 0
    direct = frozenset[Path]().union(*(inputs.imports(path) for path in own if path.suffix == ".py"))
    named = frozenset[str]().union(*(_named(path) for path in own))
    if edited in direct or edited.stem in named:
        return 0
    if any(edited in inputs.imports(path) for path in direct) or any(edited.stem in _named(inputs.rtl()[name]) for name in named):
        return 1
    return 2


def plan(edited: Iterable[str]) -> Plan:
    """What changed files ask for."""
    found = Plan()
    near: dict[Path, int] = {}
    for name in edited:
        path = ROOT / name
        if not path.is_file():
            continue
        if path.suffix == ".py":
            found.python.append(name)
        if path.suffix == ".sv" and path == inputs.rtl().get(path.stem):
            found.modules.append(path.stem)
        found.pages |= path.suffix == ".md" or name == "mkdocs.yml"
        for test in inputs.test_files():
            if path in inputs.inputs(test):
                near[test] = min(near.get(test, 2), nearness(test, path))
    if found.pages:
        near[PAGES] = 0
    for test, how in sorted(near.items(), key=lambda entry: (entry[1], cost(entry[0]))):
        found.tests[how].append(test)
    return found


def fitting(tests: Iterable[Path], seconds: float, jobs: int) -> list[Path]:
    """The first of them, as many as end in time."""
    taken, left = [], seconds * jobs
    for test in tests:
        if cost(test) <= left:
            taken.append(test)
            left -= cost(test)
    return taken


def _run(words: list[object]) -> bool:
    print("$", *(Path(word).name if isinstance(word, Path) else word for word in words), flush=True)
    return subprocess.run([str(word) for word in words], cwd=ROOT).returncode == 0


def _lint_rtl(modules: list[str]) -> bool:
    """Verilator on the changed modules with all that is below them, Verible on their files; whether nothing was found."""
    shapes = [shape for shape in lint.shapes_of([inputs.rtl()[name] for name in modules])]
    print("$ lint of", ", ".join(modules), flush=True)
    found = lint.elaborate(shapes)[0] if shapes else ""
    if shapes and not found:
        sizes = lint.elaborate(shapes, "-DSYNTHESIS")
        found = sizes[0] or "".join(lint.run(lint.verilator(group, "--lint-only", "-DSYNTHESIS"))[0] for group in lint.groups_of(shapes, sizes[1]))
    found += lint.run([Path(sys.executable).parent / "verible-verilog-lint", "--rules_config", "lint/verible.rules", "--waiver_files", "lint/verible.waiver",
                       *(path.relative_to(ROOT) for name in modules if (path := inputs.rtl()[name]).parent != lint.REGISTERS)])[0]
    print(found, end="")
    return not found


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--base", default="HEAD", help="commit to compare with (default HEAD)")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for the tests")
    parser.add_argument("--list", action="store_true", help="only say what would run")
    args = parser.parse_args()
    begun = time.monotonic()
    edited = changed(args.base)
    if not edited:
        print(f"check: nothing differs from {args.base}")
        return 0
    what = plan(edited)
    tests = fitting([*what.tests[0], *what.tests[1]], args.seconds, args.jobs)
    left = [test for group in what.tests for test in group if test not in tests]
    print(f"check: {len(edited)} files differ from {args.base}; {len(tests)} of {len(tests) + len(left)} test files that read them")
    binaries = Path(sys.executable).parent
    good = True
    if not args.list:
        if what.python:
            good &= _run([binaries / "ruff", "check", "--output-format", "concise", *what.python])
        if model := [name for name in what.python if name.startswith("model/")]:
            good &= _run([binaries / "mypy", *model])
        if what.modules:
            good &= _lint_rtl(what.modules)
        if what.pages:
            good &= _run([sys.executable, "scripts/check_pages.py"])
    if tests:
        names = [test.relative_to(ROOT).as_posix() for test in tests]
        if args.list:
            print("\n".join(names))
        else:
            good &= _run([sys.executable, "-m", "pytest", "-q", "-n", args.jobs, "--dist", "loadfile", "--cached", *names])
    if left:
        names = [_unit(test) for test in left]
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        print(f"left to make test, {sum(map(cost, left)) / 60:.1f} processor minutes on a fresh build: {', '.join(names[:SHOWN])}{more}")
    if not args.list:
        print(f"check: {'passed' if good else 'FAILED'} in {time.monotonic() - begun:.0f} s")
    return 0 if good else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"check: {error}")
