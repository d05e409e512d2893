"""Commands that the pages tell people to type: `flicker`, `make`, scripts, pytest, the compiler."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from flicker.toolchain import ROOT

_COMMAND = re.compile(r"((?:\w+=\S+ +)*)(flicker|make|cc|pytest|python3?|\.venv/bin/[\w-]+|scripts/\w+\.(?:py|sh))(?= )")
_CODE = re.compile(r"(?<!`)`([^`]+)`(?!`)")

# What stands for something of the reader's, as whole words; a path of the sandbox of tb/model/test_commands.py takes its place.
PLACEHOLDERS = {
    "SCENE": "scene.ply", "CONFIG.yaml": "sweep.yaml", "DATASET": "lego", "FOLDER": "made", "IN": "scene.ply", "OUT": "made.spz",
    "N": "1", "WxH": "48x32", "path": "cells.lib", "folder": "scenes",
    "<unit>": "fifo", "name": "fifo", "[options]": None, "[SCENES...]": None, "[PART=name]": None, "UNIT=": "UNIT=fifo",
}


def pages() -> list[Path]:
    """Where commands are looked for."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "sw" / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def _texts(page: str) -> Iterator[str]:
    """Lines of fenced blocks that hold no program, and inline code."""
    language: str | None = None
    for line in page.splitlines():
        if line.startswith("```"):
            language = line[3:].strip() if language is None else None
        elif language in ("", "sh", "console"):
            yield line.strip().removeprefix("$ ")
        elif language is None and not line.startswith("<!--"):
            yield from _CODE.findall(line)


def commands_of(page: str) -> Iterator[str]:
    """Commands with arguments, as written, without their remarks."""
    for text in _texts(page):
        for part in re.sub(r"\s#.*", "", text).split("&&"):
            command = " ".join(part.split())
            if _COMMAND.match(command):
                yield command


def all_commands() -> dict[str, list[str]]:
    """Every command of the pages: the pages that have it."""
    found: dict[str, list[str]] = {}
    for page in pages():
        for command in commands_of(page.read_text()):
            places = found.setdefault(command, [])
            name = page.relative_to(ROOT).as_posix()
            if name not in places:
                places.append(name)
    return found


def words_of(command: str) -> list[str]:
    """The words of a command, placeholders filled in."""
    words = []
    for word in shlex.split(command):
        name, equals, value = word.partition("=")
        if word in PLACEHOLDERS and not (len(words) == 1 and words[0].endswith("flicker")):  # `flicker path` is a command
            if (word := PLACEHOLDERS[word]) is None:
                continue
        elif equals and value in PLACEHOLDERS:
            word = f"{name}={PLACEHOLDERS[value]}"
        words.append(word)
    return words
