"""The `flicker` command: its sub-commands, and what a failure looks like."""

from __future__ import annotations

import functools
import os
import sys
import warnings
from typing import Annotated, Any

import typer

from ..errors import FlickerError, FlickerWarning, Interrupted, one_line
from .budget import budget
from .chip import chip
from .convert import convert
from .cost import cost
from .fit import fit
from .grow import grow
from .pack import pack
from .path import path
from .render import demo, render
from .report import report
from .stability import stability
from .sweep import sweep
from .undistort import undistort
from .view import view

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Render 3D Gaussian Splatting scenes with the FLICKER hardware, its golden model or the float64 reference.")
for command in (render, path, demo, view, convert, grow, pack, chip, cost, fit, undistort, budget, report, stability, sweep):
    app.command()(command)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"flicker {version('flicker')}")
        raise typer.Exit


@app.callback()
def flicker(version: Annotated[bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)] = False) -> None:
    """What stands before the name of a command."""


_show_others = warnings.showwarning


def _show_warning(message: Any, category: Any, *rest: Any) -> None:
    """Warnings of our own are one line on standard error; those of libraries are for who asks (`python -W`, `PYTHONWARNINGS`)."""
    if issubclass(category, FlickerWarning):
        print(f"flicker: warning: {message}", file=sys.stderr)
    elif sys.warnoptions:
        _show_others(message, category, *rest)


@functools.cache
def _commands() -> Any:
    """All of them, made once for a process that runs several: a tenth of a second each time."""
    return typer.main.get_command(app)


def _run(words: list[str]) -> int:
    """The command that the words name; its exit code. Typer's own `main` would take Ctrl-C without what it says."""
    code = 0
    try:
        with _commands().make_context("flicker", words) as context:
            context.command.invoke(context)
    except typer.Exit as exit:
        code = exit.exit_code
    sys.stdout.flush()  # a full disk behind it is an error of this command
    return code


def _no_more_output() -> None:
    """Nobody reads what is still to be written: Python must not fail again when it flushes at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno())  # type: ignore[union-attr]


def main() -> None:
    """Entry point: bad input is one line on standard error and exit code 2; Ctrl-C is one line and 130."""
    warnings.showwarning = _show_warning  # type: ignore[assignment]  # the rest is handed on as it comes
    try:
        sys.exit(_run(sys.argv[1:]))
    except FlickerError as error:
        message = str(error)
    except typer.exceptions.TyperException as error:  # wrong use of the command line
        message = error.format_message()
        if not message:  # help was asked for by giving no arguments, and printed
            sys.exit(2)
        context = getattr(error, "ctx", None)
        message += f" (see '{context.command_path if context else 'flicker'} --help')"
    except BrokenPipeError:
        _no_more_output()
        sys.exit(1)
    except OSError as error:  # what no command has put into words, such as a full disk behind standard output
        message = f"{error.filename or 'standard output'}: {error.strerror or one_line(error)}"
        if error.filename is None:
            _no_more_output()
    except Interrupted as kept:
        print(f"flicker: interrupted: {kept}", file=sys.stderr)
        sys.exit(130)
    except (KeyboardInterrupt, typer.Abort):
        print("flicker: interrupted", file=sys.stderr)
        sys.exit(130)
    print(f"flicker: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
