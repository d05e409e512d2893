"""A frame of the RTL or of the verilated chip in a process of its own, so that the viewer goes on meanwhile."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection

from ..chip.run import render_on_chip
from ..errors import FlickerError
from ..front.view import View
from ..params import RenderConfig
from ..pipeline import Engine, Rendered, render_view
from ..progress import Steps
from .frames import Shot


class _Told(Steps):
    """Progress as texts into a pipe."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe = pipe

    @contextmanager
    def step(self, text: str) -> Iterator[None]:
        self.pipe.send(text)
        yield

    @contextmanager
    def bar(self, text: str):
        yield lambda done, total: self.pipe.send(f"{text}: {done / max(total, 1):.0%}")


def _child(pipe: Connection, view: View, engine: Engine, config: RenderConfig) -> None:
    steps = _Told(pipe)
    try:
        if engine is Engine.CHIP:
            pipe.send(render_on_chip(view, engine, config=config, steps=steps))
        else:
            pipe.send(render_view(view, engine=engine, config=config, steps=steps))
    except FlickerError as error:
        pipe.send(error)


class Simulation:
    """A simulation of a view that runs. told: called from a thread with every step; done: with the frame, or with why there is none."""

    def __init__(
        self, view: View, engine: Engine, config: RenderConfig, told: Callable[[str], None], done: Callable[[Shot | str], None],
    ) -> None:
        spawn = multiprocessing.get_context("spawn")  # a copy of this process would have the kernels' threads without what they hold
        self._pipe, other = spawn.Pipe(duplex=False)
        self._process = spawn.Process(target=_child, args=(other, view, engine, config), daemon=True)
        self._process.start()
        other.close()
        self._stopped = False

        def watch() -> None:
            result: Shot | str = "ended without a frame"
            try:
                while True:
                    message = self._pipe.recv()
                    if isinstance(message, Rendered):
                        result = Shot(engine, view.camera, config, message.image, message.stats)
                        break
                    if isinstance(message, FlickerError):
                        result = str(message)
                        break
                    told(message)
            except EOFError:
                pass
            self._process.join()
            done("stopped" if self._stopped else result)

        threading.Thread(target=watch, daemon=True).start()

    def stop(self) -> None:
        """End it; `done` is told."""
        self._stopped = True
        self._process.terminate()
