"""What a command prints, as a terminal of some width shows it."""

from __future__ import annotations

import io
import re

from flicker.cli.tables import Terminal

_ANSI = re.compile(r"\x1b\[[0-9;]*m")


class Screen(io.StringIO):
    """Text that goes to a terminal."""

    def isatty(self) -> bool:
        return True


def figures(text: str) -> list[str]:
    """Numbers of a text, with their separators."""
    return re.findall(r"\d[\d,]*(?:\.\d+)?", text)


def on_screen(thing: object, width: int | None) -> str:
    """What is printed of a table or a text at a width; None: in a pipe."""
    file = io.StringIO() if width is None else Screen()
    console = Terminal(file=file, width=width, height=None if width is None else 25)
    console.print(thing)
    return _ANSI.sub("", file.getvalue())
