"""The `flicker` command: its sub-commands, and what a failure looks like."""

from __future__ import annotations

import sys
import warnings
from typing import Any

import typer

from ..errors import FlickerError, FlickerWarning
from .budget import budget
from .chip import chip
from .convert import convert
from .cost import cost
from .fit import fit
from .pack import pack
from .render import demo, render
from .report import report
from .stability import stability
from .sweep import sweep
from .undistort import undistort
from .view import view

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Render 3D Gaussian Splatting scenes with the FLICKER hardware, its golden model or the float64 reference.")
for command in (render, demo, view, convert, pack, chip, cost, fit, undistort, budget, report, stability, sweep):
    app.command()(command)


_show_others = warnings.showwarning


def _show_warning(message: Any, category: Any, *rest: Any) -> None:
    """Warnings of our own are one line on standard error."""
    if issubclass(category, FlickerWarning):
        print(f"flicker: warning: {message}", file=sys.stderr)
    else:
        _show_others(message, category, *rest)


def main() -> None:
    """Entry point: bad input is one line on standard error and exit code 2."""
    warnings.showwarning = _show_warning  # type: ignore[assignment]  # the rest is handed on as it comes
    try:
        sys.exit(app(standalone_mode=False) or 0)
    except FlickerError as error:
        message = str(error)
    except typer.exceptions.TyperException as error:  # wrong use of the command line
        message = error.format_message()
        if not message:  # help was asked for by giving no arguments, and printed
            sys.exit(2)
        message += " (see 'flicker --help')"
    except BrokenPipeError:
        sys.exit(1)
    except (KeyboardInterrupt, typer.Abort):
        print("flicker: interrupted", file=sys.stderr)
        sys.exit(130)
    print(f"flicker: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
