"""The `flicker` command inside the test's process: starting one of its own takes 1.5 s, mostly imports."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
import warnings
from unittest import mock

from flicker.cli.main import main


def flicker(*args: object) -> subprocess.CompletedProcess:
    """Run the command; exit code and what it wrote, as of a process. An exception that a user would see as a traceback is raised."""
    words = ["flicker", *map(str, args)]
    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    with (
        contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), mock.patch.object(sys, "argv", words),
        warnings.catch_warnings(), mock.patch.object(warnings, "showwarning"),
    ):
        warnings.simplefilter("default")
        try:
            main()
        except SystemExit as exit:
            code = exit.code
    return subprocess.CompletedProcess(words, code if isinstance(code, int) else int(code is not None), out.getvalue(), err.getvalue())
