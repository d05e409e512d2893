#!/usr/bin/env python3
"""Mutants of the hardware: every one must die in the tests of its own unit (tb/mutants/*.toml; docs/reference/mutants.md).

    scripts/mutants.py [--unit NAME ...] [--jobs N] [--seed N] [--match TEXT] [--check]

Each mutant is a source with one piece of text replaced, in a copy of the checkout; then the unit's own tests run as `make sim UNIT=` runs them, and with SLOW=1
where none of these fails. One that survives goes on to the tests of LEVELS, to say who notices. A mutant that does not build counts as wrong, not as killed.
Prints a table, writes tb/mutants/results.csv, which is kept with the sources (finished mutants are not run again while what their unit's tests use stays
as it is); exits 1 when fewer than KILLED_AT_HOME die at home, when a survivor has no reason, or when a mutant is wrong. `make docs PART=mutants` puts the table
into docs/results/mutants.md, with the mutants that were run on sources or tests that have changed since, and says how many these are.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import os
import queue
import re
import shutil
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import grimp
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from flicker import markdown, toolchain
from flicker.cli.tables import Terminal
from flicker.errors import FlickerError

ROOT = toolchain.ROOT
LISTS = ROOT / "tb" / "mutants"
FOLDER = toolchain.BUILD / "mutants"
RESULTS = LISTS / "results.csv"
COPIED = ("Makefile", "pyproject.toml", "rtl", "tb", "model", "scripts", "lint", "formal", "sw")
LEVELS = ("rendering_core", "render_stage", "frames")  # who may notice what a unit's own tests do not, from below
KILLED_AT_HOME = 0.95
TIMEOUT = {False: 900, True: 5400}  # seconds of a test run on a busy machine, without and with SLOW=1
# Modules that build, simulate memory, show and report. Outcomes are not run anew when they change: what kills a mutant is not in them.
HOUSEHOLD = {"flicker", *(f"flicker.{name}" for name in ("toolchain", "errors", "progress", "markdown", "sim.memory", "sim.half"))}
# Modules whose numbers stand in a generated package: an outcome depends on that.
PACKAGES = {"flicker.params": ROOT / "rtl/generated/flk_param_pkg.sv", "flicker.layout": ROOT / "rtl/generated/flk_pkg.sv"}
KEYS = {"file", "find", "replace", "unit", "note", "survives", "times"}


@dataclass(frozen=True)
class Mutant:
    """find occurs `times` in file and is replaced everywhere. unit: whose tests must kill it (tb/**/test_UNIT.py). note: what it breaks. survives: why none
    can notice."""

    number: int
    file: str
    find: str
    replace: str
    unit: str
    note: str = ""
    survives: str = ""
    times: int = 1

    @property
    def title(self) -> str:
        return f"{Path(self.file).stem.removeprefix('flk_')}: {_short(self.find)} -> {_short(self.replace)}"


@dataclass(frozen=True)
class Outcome:
    """killer: unit whose tests failed, "" if none did. wrong: why the mutant is none. key: of what it was run on; "": of what is there now."""

    mutant: Mutant
    killer: str = ""
    wrong: str = ""
    key: str = ""

    @property
    def at_home(self) -> bool:
        return self.killer == self.mutant.unit


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


def load(folder: Path = LISTS) -> list[Mutant]:
    """All mutants. FlickerError, naming file and entry, for one that could not be made."""
    found: list[Mutant] = []
    units = {path.stem.removeprefix("test_") for path in (ROOT / "tb").rglob("test_*.py")}
    for path in sorted(folder.glob("*.toml")):
        try:
            entries = tomllib.loads(path.read_text())["mutant"]
        except (tomllib.TOMLDecodeError, KeyError) as error:
            raise FlickerError(f"{path}: not a list of mutants ({error})") from None
        for i, entry in enumerate(entries):
            where = f"{path}: mutant {i + 1}"
            if unknown := entry.keys() - KEYS:
                raise FlickerError(f"{where}: unknown key '{sorted(unknown)[0]}'")
            if missing := KEYS - {"note", "survives", "times"} - entry.keys():
                raise FlickerError(f"{where}: key '{sorted(missing)[0]}' is missing")
            source = ROOT / entry["file"]
            if not source.is_file():
                raise FlickerError(f"{where}: {entry['file']}: no such file")
            if (count := source.read_text().count(entry["find"])) != entry.get("times", 1):
                raise FlickerError(f"{where}: '{_short(entry['find'])}' occurs {count} times in {entry['file']}")
            if entry["unit"] not in units:
                raise FlickerError(f"{where}: no unit '{entry['unit']}'")
            found.append(Mutant(len(found), **entry))
    if not found:
        raise FlickerError(f"{folder}: no mutants")
    return found


class Copies:
    """Copies of the checkout, one for each job at a time."""

    def __init__(self, count: int) -> None:
        self.free: queue.Queue[Path] = queue.Queue()
        for number in range(count):
            folder = FOLDER / f"tree{number}"
            for name in COPIED:
                target = folder / name
                if target.is_dir():
                    shutil.rmtree(target)
                if (ROOT / name).is_dir():
                    shutil.copytree(ROOT / name, target, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
                else:
                    folder.mkdir(parents=True, exist_ok=True)
                    shutil.copy(ROOT / name, target)
            self.free.put(folder)

    def run(self, mutant: Mutant, seed: int) -> Outcome:
        """Apply, test from home upwards, restore."""
        folder = self.free.get()
        source = folder / mutant.file
        text = source.read_text()
        try:
            source.write_text(text.replace(mutant.find, mutant.replace))
            home = [(mutant.unit, slow) for slow in (False, True)]
            for unit, slow in (*home, *((unit, False) for unit in _above(mutant))):
                died, wrong = _test(folder, unit, seed, slow)
                if wrong:
                    return Outcome(mutant, wrong=wrong)
                if died:
                    return Outcome(mutant, unit)
            return Outcome(mutant)
        finally:
            source.write_text(text)
            self.free.put(folder)


def _above(mutant: Mutant) -> tuple[str, ...]:
    """LEVELS for what is part of the rendering stage, nothing for the rest."""
    return LEVELS if ROOT / mutant.file in toolchain.sources_of("flk_render_stage") else ()


def _test(folder: Path, unit: str, seed: int, slow: bool) -> tuple[bool, str]:
    """Whether the tests of a unit fail in a copy; and what is wrong if they could not run."""
    environment = {**os.environ, "PYTHONPATH": f"{folder / 'model'}{os.pathsep}{folder / 'scripts'}", "FLICKER_SEED": str(seed), "SLOW": "1" if slow else ""}
    environment.pop("FLICKER_SCENES", None)
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "sim", "--unit", unit, "tb"]
    try:
        done = subprocess.run(command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=TIMEOUT[slow])
    except subprocess.TimeoutExpired:
        return True, ""  # a hang is noticed
    (FOLDER / f"last-{unit}.log").write_text(done.stdout)
    if done.returncode == 0:
        return False, ""
    if re.search(r"(verilator|make|g\+\+): (%Error|.*-USERERROR|.*error:)", done.stdout):
        return False, "does not build"
    if done.returncode != 1 or "no tests ran" in done.stdout:
        return False, f"tests of {unit} did not run (exit code {done.returncode})"
    return True, ""


@cache
def _imports() -> grimp.ImportGraph:
    return grimp.build_graph("flicker")


def _modules(text: str) -> set[Path]:
    """Files of the model that a test imports, and what these import."""
    graph = _imports()
    found: set[str] = set()
    for module, names in re.findall(r"from (flicker[\w.]*) import ([\w, ]+)", text):
        found |= {name for name in (module, *(f"{module}.{word}" for word in re.findall(r"\w+", names))) if name in graph.modules}
    for module in found - HOUSEHOLD:
        found |= graph.find_upstream_modules(module)
    places = [ROOT / "model" / module.replace(".", "/") for module in found - HOUSEHOLD - PACKAGES.keys()]
    files = {path for place in places for path in (place / "__init__.py", place.with_suffix(".py")) if path.is_file()}
    return files | {PACKAGES[module] for module in found & PACKAGES.keys()}


@cache
def _used(unit: str) -> tuple[Path, ...]:
    """Files that the outcome of a unit's tests depends on: its tests, the modules that they name with all below these, the model's that they import."""
    (test,) = (ROOT / "tb").rglob(f"test_{unit}.py")
    beside: dict[str, list[Path]] = {}
    for path in test.parent.iterdir():
        if path.suffix in (".py", ".sv", ".cpp"):
            beside.setdefault(path.stem, []).append(path)
    own: set[Path] = set()
    pending = [test]
    while pending:
        path = pending.pop()
        if path not in own:
            own.add(path)
            pending += [other for word in set(re.findall(r"\w+", path.read_text())) & beside.keys() for other in beside[word]]
    named = set(re.findall(r"\bflk_\w+", " ".join(path.read_text() for path in own)))
    tops = [top for top in sorted(named) if any((ROOT / "rtl").rglob(f"{top}.sv"))]
    files = {*own, *(source for top in tops for source in toolchain.sources_of(top))}
    python = " ".join(path.read_text() for path in files if path.suffix == ".py")
    return tuple(sorted(files | _modules(python)))


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _key(mutant: Mutant) -> str:
    """Of a mutant and of all that its outcome depends on, as far as it is about its own unit's tests."""
    files = {*_used(mutant.unit), ROOT / mutant.file}
    parts = [part for path in sorted(files) for part in (str(path.relative_to(ROOT)), _digest(path))]
    return hashlib.sha256("\0".join((*parts, mutant.file, mutant.find, mutant.replace, mutant.unit)).encode()).hexdigest()[:16]


def _kept() -> dict[int, Outcome]:
    """Outcomes of mutants that are still in the lists, by number."""
    if not RESULTS.exists():
        return {}
    with RESULTS.open(newline="") as file:
        rows = {(row["file"], row["find"], row["replace"], row["unit"]): row for row in csv.DictReader(file)}
    found = {}
    for m in load():
        if (row := rows.get((m.file, m.find, m.replace, m.unit))) is not None and not row["wrong"]:
            found[m.number] = Outcome(m, row["killer"], key=row["key"])
    return found


def _current(outcome: Outcome) -> bool:
    """Nothing that the outcome depends on has changed since."""
    return outcome.key in ("", _key(outcome.mutant))


def _write(outcomes: list[Outcome]) -> None:
    with RESULTS.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["key", "file", "find", "replace", "unit", "killer", "wrong"])
        for o in sorted(outcomes, key=lambda o: o.mutant.number):
            m = o.mutant
            writer.writerow([o.key or _key(m), m.file, m.find, m.replace, m.unit, o.killer, o.wrong])


def results() -> list[Outcome]:
    """Outcomes of all mutants that have been run. FlickerError when none has."""
    found = _kept()
    if not found:
        raise FlickerError(f"{RESULTS.relative_to(ROOT)} holds no result; run make mutants first")
    return [found[number] for number in sorted(found)]


def summary(outcomes: list[Outcome]) -> str:
    """Markdown: how many die where, by unit, and every mutant that does not die at home."""
    units = list(dict.fromkeys(o.mutant.unit for o in outcomes))
    left = len(load()) - len(outcomes)
    rows = []
    for unit in units:
        own = [o for o in outcomes if o.mutant.unit == unit]
        rows.append((f"`{unit}`", str(len(own)), str(sum(o.at_home for o in own)), str(sum(bool(o.killer) and not o.at_home for o in own)),
                     str(sum(not o.killer for o in own))))
    home = sum(o.at_home for o in outcomes)
    rows.append(("all", str(len(outcomes)), f"{home} ({home / len(outcomes):.0%})", str(sum(bool(o.killer) and not o.at_home for o in outcomes)),
                 str(sum(not o.killer for o in outcomes))))
    changed = sum(not _current(o) for o in outcomes)
    text = f"{len(outcomes)} mutants run{f', {left} not yet' if left else ''}; sources or tests of {changed} have changed since.\n\n"
    text += markdown.table(["unit", "mutants", "killed by its own tests", "killed above", "survived"], rows)
    others = [o for o in outcomes if not o.at_home]
    if others:
        text += "\n\n" + markdown.table(
            ["mutant", "killed by", "why"],
            [(f"`{o.mutant.title}`".replace("|", "\\|"), o.killer or "-", o.mutant.survives or o.wrong or o.mutant.note) for o in others],
        )
    return text


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--unit", action="append", help="only mutants of this unit, repeatable")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--match", default="", help="only mutants whose file or text contains this")
    parser.add_argument("--check", action="store_true", help="only check that every mutant could be made")
    args = parser.parse_args()
    mutants = [m for m in load() if (not args.unit or m.unit in args.unit) and args.match in f"{m.file} {m.find}"]
    if not mutants:
        raise FlickerError(f"no mutants of {', '.join(args.unit or ['any unit'])} that match '{args.match}'")
    if args.check:
        print(f"mutants: {len(mutants)} can be made")
        return 0
    FOLDER.mkdir(parents=True, exist_ok=True)
    with toolchain.locked(FOLDER / "lock"):  # the copies are one run's
        return _run(mutants, args.jobs, args.seed)


def _run(mutants: list[Mutant], jobs: int, seed: int) -> int:
    """Run those whose outcome is not known, show all; the exit code."""
    console = Terminal()
    kept = _kept()
    outcomes = {m.number: kept[m.number] for m in mutants if m.number in kept and _current(kept[m.number])}
    left = [m for m in mutants if m.number not in outcomes]
    console.print(f"mutants: {len(mutants)}, {len(outcomes)} known, seed {seed}")
    copies = Copies(jobs) if left else None
    with Progress(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"), console=console, transient=True,
                  disable=not console.is_terminal) as bar, ThreadPoolExecutor(jobs) as pool:
        task = bar.add_task("", total=len(mutants), completed=len(outcomes))
        for outcome in pool.map(lambda m: copies.run(m, seed), left):
            outcomes[outcome.mutant.number] = outcome
            bar.update(task, advance=1, description=outcome.mutant.title)
            if not console.is_terminal:
                print(f"{outcome.killer or outcome.wrong or 'SURVIVED':<16} {outcome.mutant.title}", flush=True)
            _write(list((_kept() | {outcome.mutant.number: outcome}).values()))
    found = [outcomes[m.number] for m in mutants]
    table = Table()
    for column in ("unit", "mutant", "killed by", "note"):
        table.add_column(column, overflow="fold")
    for o in found:
        style = "" if o.at_home else "yellow" if o.killer else "red"
        table.add_row(o.mutant.unit, o.mutant.title, o.killer or o.wrong or "survived", o.mutant.note, style=style)
    console.print(table)
    home = sum(o.at_home for o in found)
    wrong = [o for o in found if o.wrong]
    unexplained = [o for o in found if not o.killer and not o.wrong and not o.mutant.survives]
    console.print(
        f"{home} of {len(found)} ({home / len(found):.1%}) killed by the tests of their own unit; "
        f"{len(unexplained)} survivors without a reason; {len(wrong)} wrong",
    )
    return 1 if home < KILLED_AT_HOME * len(found) or unexplained or wrong else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"mutants: {error}")
