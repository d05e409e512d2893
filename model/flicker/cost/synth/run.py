"""Runs the flow for many units: parts before what they are put together from, in parallel, cached by content.

A result lives in ``build/synth/units/<module>-<hash>``; the hash covers the tokens of the sources, the parameters, the library, the flow's own
code and the results of the parts.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from importlib.metadata import version
from pathlib import Path

from ...errors import FlickerError
from ...toolchain import BUILD, locked, sources_of
from ..stamp import words
from .units import COMPOSED, MEMORIES, Unit, open_bits

FOLDER = BUILD / "synth"
UNITS = FOLDER / "units"


def _digest(*parts: object) -> str:
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()[:12]


@cache
def _tokens(path: Path) -> str:
    return " ".join(words(path.read_text()))


def _code() -> str:
    here = Path(__file__).parent
    return "".join((here / name).read_text() for name in ("flow.py", "timing.py", "liberty.py"))


class Runner:
    """Synthesises units with one library; ``result(unit)`` after ``run``.

    Args:
        liberty: cell library.
        jobs: processes at a time.
        report: called with (name, seconds or None if cached) as units finish.
    """

    def __init__(
        self, liberty: Path, jobs: int = 2, report: Callable[[str, float | None], None] = lambda name, s: None
    ) -> None:
        if not liberty.is_file():
            raise FlickerError(f"LIBERTY: {liberty}: no such file")
        self.liberty, self.jobs, self.report = liberty.resolve(), jobs, report
        self.common = (_code(), liberty.read_text(errors="replace"), version("pyosys"))
        self.keys: dict[tuple, str] = {}
        self.tasks: dict[str, dict] = {}  # key -> job, parts before wholes
        self.plans: dict[str, list] = {}
        self.lock = threading.Lock()

    # Planning

    def _sources(self, top: str) -> str:
        return "".join(_tokens(path) for path in sources_of(top))

    def _job(self, top: str, parameters: dict[str, int], action: str) -> dict:
        return {
            "action": action, "top": top, "parameters": parameters, "extra": [], "boxes": COMPOSED.get(top, []),
            "children": {}, "child_parameters": {}, "liberty": str(self.liberty), "results": str(UNITS),
            "open": open_bits(top, parameters),
        }

    def _children(self, top: str, parameters: dict[str, int]) -> list[tuple[str, str, dict[str, int]]]:
        """Parts of a composed unit: instance, module, all parameters that Yosys knows of it."""
        job = self._job(top, parameters, "plan")
        folder = FOLDER / "plans" / f"{top}-{_digest(self._sources(top), parameters, job['boxes'], *self.common[::2])}"
        with locked(folder.with_suffix(".lock")):
            if not (folder / "plan.json").exists():
                _process(folder, job)
        return json.loads((folder / "plan.json").read_text())

    def add(self, top: str, parameters: dict[str, int], part: bool = False) -> str:
        """Plan a unit and its parts; returns its key. part: it is one of another unit, where a memory is a macro."""
        identity = (top, tuple(sorted(parameters.items())), part and top in MEMORIES)
        if identity in self.keys:
            return self.keys[identity]
        job = self._job(top, parameters, "macro" if part and top in MEMORIES else "synthesise")
        for instance, module, everything in self._children(top, parameters) if top in COMPOSED else []:
            text = next(path for path in sources_of(top) if path.stem == module).read_text()
            own = re.findall(r"^\s*parameter\s+[\w\s]*?(\w+)\s*=", text, re.M)
            key = self.add(module, {name: everything[name] for name in own if name in everything}, part=True)
            job["children"][instance] = key
            job["child_parameters"][instance] = sorted(everything)
        key = f"{top}-{_digest(job['action'], self._sources(top), job['parameters'], job['open'], sorted(job['children'].items()), *self.common)}"
        self.keys[identity] = key
        self.tasks[key] = job
        return key

    # Running

    def run(self, units: Iterable[Unit]) -> dict[Unit, dict]:
        """Results of units by unit, each with the sums over its parts."""
        wanted = {unit: self.add(unit.top, dict(unit.parameters)) for unit in units}
        self.run_planned()
        return {unit: self.total(key) for unit, key in wanted.items()}

    def run_planned(self) -> None:
        """Synthesise what ``add`` has planned; afterwards ``results`` holds every unit and part by key."""
        futures: dict[str, Future] = {}
        # Parts have no children and go first, the slow ones before the others; wholes only wait for what was submitted before.
        order = sorted(self.tasks, key=lambda key: bool(self.tasks[key]["children"]))
        slow = ("flk_vru", "flk_prtu", "flk_fifo")
        order.sort(key=lambda key: (bool(self.tasks[key]["children"]), not key.startswith(slow)))
        with ThreadPoolExecutor(self.jobs) as pool:
            for key in order:
                futures[key] = pool.submit(self._one, key, futures)
            try:
                for future in futures.values():
                    future.result()
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
        self.results = {key: json.loads((UNITS / key / "result.json").read_text()) for key in self.tasks}

    def _one(self, key: str, futures: dict[str, Future]) -> None:
        job = self.tasks[key]
        for child in job["children"].values():
            futures[child].result()
        folder = UNITS / key
        with locked(folder.with_suffix(".lock")):
            if (folder / "result.json").exists():
                self.report(key, None)
                return
            _process(folder, job)
        self.report(key, json.loads((folder / "result.json").read_text())["seconds"])

    def total(self, key: str) -> dict:
        """Sums of a unit over itself and its parts: ge, ge_seq, ge_comb, ge_drivers, ff, mem_bits, sram_bits; fo4 and paths."""
        own = self.results[key]
        sums = ("ge_seq", "ge_comb", "ge_drivers", "ff", "mem_bits", "sram_bits")
        total: dict = {name: own[name] for name in ("top", "seconds", *sums)} | {"key": key, "paths": list(own["paths"])}
        for child, count in own["children"].items():
            inside = self.total(child)
            for name in sums:
                total[name] += count * inside[name]
            # A part's own ports are judged where it is used: only paths between its registers count here.
            label = self.results[child]["top"].removeprefix("flk_")
            total["paths"] += [
                {**path, "from": f"{label}.{path['from']}", "to": f"{label}.{path['to']}"}
                for path in inside["paths"] if not path.get("port")
            ]
        total["ge"] = total["ge_seq"] + total["ge_comb"]
        total["paths"].sort(key=lambda path: -path["fo4"])
        total["fo4"] = total["paths"][0]["fo4"] if total["paths"] else 0.0
        return total


def _process(folder: Path, job: dict) -> None:
    """Run one job in a process; its folder is complete or holds log and error."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    path, log = folder / "job.json", folder / "log"
    path.write_text(json.dumps(job))
    with log.open("w") as out:
        done = subprocess.run(
            [sys.executable, "-m", "flicker.cost.synth.flow", str(path)], stdout=out, stderr=subprocess.STDOUT,
            env={**os.environ, "TMPDIR": str(folder)},
        )
    error = folder / "error"
    if error.exists():
        raise FlickerError(error.read_text())
    if done.returncode or not (folder / ("plan.json" if job["action"] == "plan" else "result.json")).exists():
        telling = re.compile(r"(?i)\berror\b|warning: (wire|found logic loop|multiple)")
        lines = [line for line in log.read_text(errors="replace").splitlines() if telling.search(line)]
        raise FlickerError(f"{job['top']}: {lines[0] if lines else 'synthesis failed'} (see {log})")
