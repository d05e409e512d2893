"""Checkpoints of long commands: where they lie, what Ctrl-C leaves, and how a user goes on."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from ..errors import Interrupted
from .options import writable, write_atomically


def printed(text: str) -> None:
    """A line as it is: a path may have brackets, and a command to type must not be wrapped."""
    typer.echo(text)


def command_line(*more: str) -> str:
    """The command that was typed, with more options, as a line for a shell."""
    program = sys.argv[0]
    found = shutil.which("flicker")
    if Path(program).name != "flicker" or (found is not None and Path(found).resolve() == Path(program).resolve()):
        program = "flicker"
    words = sys.argv[1:]
    return shlex.join([program, *words, *(option for option in more if option not in words)])


class Checkpoint:
    """The file that a command keeps its state in: one that the user gives, or one beside the result, which goes when that is written.

    with checkpoint.interruptible(): says at Ctrl-C what was kept. save: writes the state; what: says what it has in it.
    """

    def __init__(self, path: Path, own: bool, save: Callable[[Path], None], what: Callable[[], str]) -> None:
        self.path = path
        self._own, self._save, self._what = own, save, what
        self._kept: str | None = None

    def begin(self, resume: bool, restore: Callable[[Path], None]) -> bool:
        """Whether there was a state to continue from; a line on one that is overwritten, or that is not there."""
        there = self.path.exists()
        if resume and there:
            restore(self.path)
            self._kept = self._what()
        elif resume:
            printed(f"{self.path}: no checkpoint there: begins anew")
        elif there:
            printed(f"{self.path}: of a run that was interrupted, is overwritten; --resume continues it")
        return resume and there

    def keep(self) -> None:
        """Write the state, whole or not at all."""
        write_atomically(self.path, self._save)
        self._kept = self._what()

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        try:
            yield
        except KeyboardInterrupt:
            if self._kept is None:
                raise
            raise Interrupted(f"{self.path} keeps {self._kept}; to go on: {command_line('--resume')}") from None

    def finish(self) -> None:
        """The result is written."""
        if self._own:
            self.path.unlink(missing_ok=True)


def checkpoint_path(given: Path | None, out: Path) -> Path:
    """Where a state goes: as the user says, else beside the result. FlickerError where it cannot be written."""
    path = out.with_name(out.name + ".checkpoint.npz") if given is None else given
    writable(path, "--out" if given is None else "--checkpoint")
    return path
