"""pytest plugin: a test that has passed is not run again while all that it reads stays as it is (`--cached`, as `make test` says; FRESH=1 runs all).

The key of a test file covers its inputs (`flicker_tb.inputs`), the versions of Python, of all its packages and of the compiler, the environment's variables
and the scenes from outside. It is kept in build/tests/passed.json, so a fresh clone runs everything. Nothing is kept

- of a test that opened a file of the checkout which its key does not hold, or that ran a program which may have; that it did, workers see (`Opened`)
- of tests one of whose inputs changed while they ran
- of runs on netlists, in four states or with traces (KINDS), of tests that were skipped or failed.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from flicker import toolchain
from flicker_tb import inputs

ROOT = toolchain.ROOT
FILE = toolchain.BUILD / "tests" / "passed.json"
KINDS = ("NETLIST", "FOUR_STATE", "WAVES")
# Variables that tests, tools or libraries look at.
VARIABLES = re.compile(
    r"FLICKER_(?!PROGRESS|TB_CONFIG)|(SLOW|CXX|CC|CXXFLAGS|LIBERTY|PYTHONPATH|COLUMNS|LINES|TERM|NO_COLOR|FORCE_COLOR|LANG|TZ)$|LC_|NUMBA_(?!CACHE_DIR)|XDG_"
)
SCENES = ("FLICKER_SCENES", "FLICKER_CASES")
_BUILT = tuple(f"{ROOT / name}{os.sep}" for name in ("build", ".venv", ".git", ".pytest_cache"))
# Programs that read what they are told to, of which their callers have read all themselves.
PROGRAMS = {"verilator", "ar", "ccache", "iverilog", "vvp", "ldconfig", "ld", "gcc", "cc", "uname"}


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


@functools.cache
def _content(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def surroundings(slow: bool) -> str:
    """Of everything that outcomes depend on beside the files of the checkout."""
    packages = sorted(f"{found.metadata['Name']}=={found.version}" for found in importlib.metadata.distributions())
    variables = sorted(f"{name}={value}" for name, value in os.environ.items() if VARIABLES.match(name))
    outside = []
    for folder in filter(None, map(os.environ.get, SCENES)):
        for path in sorted(Path(folder).rglob("*")):
            state = path.stat()
            outside.append(f"{path} {state.st_size} {state.st_mtime_ns}")
    return _digest([sys.version, toolchain.versions(), str(slow), *packages, *variables, *outside])


def key(test: Path, around: str) -> str:
    """Of a test file."""
    return _digest([around, *(part for path in sorted(inputs.inputs(test)) for part in (path.relative_to(ROOT).as_posix(), _content(path)))])


class Opened:
    """Files of the checkout that this process has opened; with a slash at the end, folders that it has searched; behind a "*" a program that may have opened
    any."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        sys.addaudithook(self._hook)

    def _hook(self, event: str, args: tuple) -> None:
        if event == "open":
            path = args[0]
            if isinstance(path, str) and path.startswith(str(ROOT)) and not path.startswith(_BUILT) and "/__pycache__/" not in path:
                self.files.add(os.path.relpath(os.path.normpath(path), ROOT))
            elif isinstance(path, str) and not path.startswith("/"):
                self.files.add(os.path.relpath(os.path.abspath(path), ROOT))
        elif event in ("pathlib.Path.glob", "pathlib.Path.rglob", "glob.glob"):
            path = os.path.abspath(str(args[0]))
            if f"{path}/".startswith(f"{ROOT}/") and not f"{path}/".startswith(_BUILT):
                self.files.add(f"{os.path.relpath(path, ROOT)}/")
        elif event == "subprocess.Popen":
            words = [os.fsdecode(word) for word in ([args[1]] if isinstance(args[1], (str, bytes)) else args[1])]
            if not self._known(words):
                self.files.add(f"*{Path(words[0]).name}")

    @staticmethod
    def _known(words: list[str]) -> bool:
        name = Path(words[0]).name
        if name == "make":
            return any(word.startswith(str(toolchain.BUILD)) for word in words[1:])
        return (name in PROGRAMS or name == Path(toolchain.compiler()).name or words[0].startswith(str(toolchain.BUILD)) or name.startswith("ffmpeg")
                or words[1:] == ["--version"] or any("multiprocessing" in word for word in words[1:3]))


class Runner:
    """In a process that runs tests: leaves out what has passed, says what each test opened. taken: tests; files: test files of which all have passed."""

    def __init__(self, taken: Iterable[str], files: Iterable[str], finished) -> None:
        self._taken, self._files, self._finished = set(taken), set(files), finished
        self._opened = Opened()
        self._counts: Counter[str] = Counter()

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        return True if collection_path.is_relative_to(ROOT) and collection_path.relative_to(ROOT).as_posix() in self._files else None

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> Iterator[None]:
        yield
        self._counts.update(item.nodeid.split("::")[0] for item in items)
        left = [item for item in items if item.nodeid in self._taken]
        items[:] = [item for item in items if item.nodeid not in self._taken]
        if left:
            config.hook.pytest_deselected(items=left)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._opened.files.clear()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo) -> Iterator[None]:
        report = yield
        if call.when == "teardown":
            report.user_properties.append(("opened", sorted(self._opened.files)))
        return report

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        self._finished(dict(self._counts))


class Passed:
    """In the process that reports: keys, what is taken from the cache, what is kept."""

    def __init__(self, config: pytest.Config, slow: bool, partial: bool, fresh: bool, file: Path = FILE) -> None:
        self._file, self._partial = file, partial
        self._around = surroundings(slow)
        self._state = self._stat()
        kept = json.loads(file.read_text()) if file.exists() else {}
        self._kept = {name: entry for name, entry in kept.items() if (ROOT / name).is_file() and entry["key"] == key(ROOT / name, self._around)}
        read = {} if fresh else self._kept
        self.files = [name for name, entry in read.items() if entry["all"]]
        self.taken = [test for entry in read.values() for test in entry["tests"]]
        self._passed: dict[str, set[str]] = {}
        self._failed: set[str] = set()
        self._counts: dict[str, int] = {}
        self.unkept: dict[str, set[str]] = {}

    @staticmethod
    def _stat() -> dict[Path, tuple[int, int]]:
        return {path: (state.st_mtime_ns, state.st_size) for path in inputs.tree() if (state := path.stat())}

    def counted(self, counts: dict[str, int]) -> None:
        """From a process that has run tests: how many of each file it collected."""
        self._counts |= counts

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node) -> None:
        node.workerinput["passed"] = (self.taken, self.files)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node) -> None:
        self.counted(getattr(node, "workeroutput", {}).get("passed", {}))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self._failed.add(report.nodeid)
        if report.when != "teardown" or report.nodeid in self._failed:
            return
        file = report.nodeid.split("::")[0]
        held = inputs.inputs(ROOT / file)
        opened = {name for found, names in report.user_properties if found == "opened" for name in names}
        outside = {name for name in opened if not self._read(name) <= held}
        if outside:
            self.unkept.setdefault(file, set()).update(outside)
        else:
            self._passed.setdefault(file, set()).add(report.nodeid)

    @staticmethod
    def _read(name: str) -> frozenset[Path]:
        """Files of the checkout behind what a process has noted (`Opened`)."""
        if name.startswith("*"):
            return inputs.tree()
        return inputs.below(name.rstrip("/").removeprefix(".")) if name.endswith("/") else inputs.tree() & {ROOT / name}

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.taken and session.exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
            session.exitstatus = pytest.ExitCode.OK
        inputs.tree.cache_clear()
        now = self._stat()
        changed = {path for path in now.keys() | self._state.keys() if now.get(path) != self._state.get(path)}
        for file, tests in self._passed.items():
            if inputs.inputs(ROOT / file) & changed:
                self._kept.pop(file, None)
                continue
            known = set(self._kept.get(file, {"tests": []})["tests"]) | tests
            # A file of which all have passed is not even collected; its outcomes of a part of a run do not say what there is.
            complete = not self._partial and len(known) == self._counts.get(file, -1)
            self._kept[file] = {"key": key(ROOT / file, self._around), "all": complete, "tests": sorted(known)}
        self._file.parent.mkdir(parents=True, exist_ok=True)
        new = self._file.with_suffix(".new")
        new.write_text(json.dumps(self._kept, indent=0))
        new.replace(self._file)

    def pytest_terminal_summary(self, terminalreporter) -> None:
        if self.taken:
            terminalreporter.write_line(f"{len(self.taken):,} tests taken from the cache, as they passed on the same inputs (FRESH=1 runs all)")
        for file, names in sorted(self.unkept.items()):
            some = ", ".join(f"program {name[1:]}" if name.startswith("*") else name for name in sorted(names)[:3])
            terminalreporter.write_line(f"not cached, reads more than its key holds: {file} ({some}{', ...' if len(names) > 3 else ''})")


def register(config: pytest.Config, slow: bool) -> None:
    """Add the plugins that this process needs."""
    if config.option.collectonly or not config.getoption("--cached") or any(os.environ.get(kind, "") not in ("", "0") for kind in KINDS):
        return
    if hasattr(config, "workerinput"):
        output = config.workeroutput = getattr(config, "workeroutput", {})
        config.pluginmanager.register(Runner(*config.workerinput["passed"], lambda counts: output.update(passed=counts)), "flicker-passed-runner")
        return
    partial = bool(config.option.keyword or config.option.markexpr or config.getoption("--unit") or any("::" in word for word in config.args))
    passed = Passed(config, slow, partial, os.environ.get("FRESH", "") not in ("", "0"))
    config.pluginmanager.register(passed, "flicker-passed")
    if not config.option.numprocesses:
        config.pluginmanager.register(Runner(passed.taken, passed.files, passed.counted), "flicker-passed-runner")
