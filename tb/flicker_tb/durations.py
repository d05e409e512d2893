"""pytest plugin: what each test costs, for the order of a run and for whoever looks for time.

Every process that runs tests measures processor time, its own and that of the programs that it waits for: wall-clock time of two tests at once, or on a busy
machine, says little. The process that reports writes FILE; lines of tests that did not run this time stay.
"""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import pytest

from flicker import toolchain

from numba.core import event  # isort: skip  # behind flicker, which says where compiled kernels are kept

FILE = toolchain.BUILD / "tests" / "durations.csv"


@dataclass(frozen=True)
class Cost:
    """Of one test with its fixtures, in seconds. cpu: processor time of all processes. builds: thereof Verilator's and compilers'. numba: thereof compilation
    of kernels in this process."""

    wall: float
    cpu: float
    builds: float
    numba: float


class _Compilation(event.Listener):
    """Processor time of numba's compilation in this process; calls that are compiled for others are inside."""

    def __init__(self) -> None:
        self.seconds, self._depth, self._begun = 0.0, 0, 0.0

    def on_start(self, event: event.Event) -> None:
        if not self._depth:
            self._begun = time.process_time()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if not self._depth:
            self.seconds += time.process_time() - self._begun


class Measured:
    """The plugin of a process that runs tests."""

    def __init__(self) -> None:
        self._builds = 0.0
        self._numba = _Compilation()
        event.register("numba:compile", self._numba)
        run_tool = toolchain.run_tool

        def timed(*args, **kwargs) -> None:
            before = _children()
            try:
                run_tool(*args, **kwargs)
            finally:
                self._builds += _children() - before

        toolchain.run_tool = timed

    def _now(self) -> tuple[float, ...]:
        return time.monotonic(), time.process_time() + _children(), self._builds, self._numba.seconds

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._begun = self._now()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo) -> Iterator[None]:
        report = yield
        if call.when == "teardown":
            report.user_properties.append(("cost", [round(now - then, 3) for now, then in zip(self._now(), self._begun)]))
        return report


def _children() -> float:
    times = os.times()
    return times.children_user + times.children_system


def read(file: Path = FILE) -> dict[str, Cost]:
    """Costs by test; none where there is no file."""
    if not file.exists():
        return {}
    with file.open(newline="") as rows:
        return {row.pop("test"): Cost(**{name: float(value) for name, value in row.items()}) for row in csv.DictReader(rows)}


class Reported:
    """The plugin of the process that reports."""

    def __init__(self, file: Path = FILE) -> None:
        self._file, self._costs = file, dict[str, Cost]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        for name, value in report.user_properties:
            if name == "cost" and report.when == "teardown":
                self._costs[report.nodeid] = Cost(*value)

    def pytest_sessionfinish(self) -> None:
        if not self._costs:
            return
        self._file.parent.mkdir(parents=True, exist_ok=True)
        costs = read(self._file) | self._costs
        new = self._file.with_suffix(".new")
        with new.open("w", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(["test", *(field.name for field in fields(Cost))])
            writer.writerows([name, *vars(cost).values()] for name, cost in sorted(costs.items()))
        new.replace(self._file)


def register(config: pytest.Config) -> None:
    """Add the plugins that this process needs."""
    if config.option.collectonly:
        return
    worker = hasattr(config, "workerinput")
    if not worker:
        config.pluginmanager.register(Reported(), "flicker-reported")
    if worker or not config.option.numprocesses:
        config.pluginmanager.register(Measured(), "flicker-measured")
