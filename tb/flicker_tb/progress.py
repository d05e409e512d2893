"""pytest plugin: says what a run is doing while nothing else is printed.

The process that reports (the only one, or the controller of pytest-xdist) prints one line when a Verilator model begins to be built, and
every PAUSE seconds the tests and builds under way. Builds, which happen in any process, are seen through notes in a folder that
``flicker.toolchain.under_way`` writes.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
import time
from pathlib import Path

import pytest

from flicker import toolchain

PAUSE = 15.0  # seconds between two lists of what is under way
_POLL = 0.5


class Progress:
    """The plugin. ``pause``: seconds between two lists."""

    def __init__(self, config: pytest.Config, pause: float) -> None:
        self._pause = pause
        self._plugins = config.pluginmanager
        # Capture replaces file descriptor 1 while a test runs in this process.
        self._out = os.fdopen(os.dup(1), "w")
        self._folder = Path(tempfile.mkdtemp(prefix="flicker-progress-"))
        os.environ[toolchain.PROGRESS] = str(self._folder)  # workers inherit it
        self._width = 0  # of the reporter's line when this last began a line
        self._tests: dict[str, float] = {}
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def pytest_sessionstart(self) -> None:
        self._thread.start()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        with self._lock:
            self._tests[nodeid] = time.monotonic()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        with self._lock:
            self._tests.pop(nodeid, None)

    def pytest_unconfigure(self) -> None:
        self._done.set()
        if self._thread.is_alive():
            self._thread.join()
        self._out.close()
        os.environ.pop(toolchain.PROGRESS, None)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _watch(self) -> None:
        builds: dict[Path, tuple[str, float]] = {}
        begun = listed = time.monotonic()
        while not self._done.wait(_POLL):
            now = time.monotonic()
            notes = set(self._folder.glob("*.note"))
            for gone in builds.keys() - notes:
                del builds[gone]
            for new in sorted(notes - builds.keys()):
                try:
                    builds[new] = new.read_text(), now
                except FileNotFoundError:  # finished meanwhile
                    continue
                self._say(builds[new][0])
            if now - listed >= self._pause:
                listed = now
                with self._lock:
                    running = [(start, name.rsplit("/", 1)[-1]) for name, start in self._tests.items()]
                running += [(start, text) for text, start in builds.values()]
                # What began since the last list is no news yet.
                lasting = [f"{text} ({now - start:.0f} s)" for start, text in sorted(running) if now - start >= self._pause / 2]
                if lasting:
                    self._say(f"{now - begun:.0f} s, under way: {', '.join(lasting)}")

    def _say(self, text: str) -> None:
        # Begin a line of one's own behind a row of dots.
        reporter = self._plugins.get_plugin("terminalreporter")
        width = getattr(getattr(reporter, "_tw", None), "width_of_current_line", 0)
        self._out.write(("\n" if width and width != self._width else "") + f"[{text}]\n")
        self._out.flush()
        self._width = width


def register(config: pytest.Config, pause: float = PAUSE) -> None:
    """Add the plugin in the process that reports."""
    if not hasattr(config, "workerinput") and not config.option.collectonly:
        config.pluginmanager.register(Progress(config, pause), "flicker-progress")
