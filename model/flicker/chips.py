"""Chips by name: `chips.toml` in the root of the repository, or a file of one's own (docs/reference/chips.md).

    chip_of("tiny").config                     # RenderConfig
    chip_of("mine", "my_chips.toml").config

Nothing but the standard library is used, so that other tools can read the table.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum, IntEnum
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from .errors import FlickerError
from .params import CHIP_MEMORIES, CatMode, ChipMemories, Coords, Form, Precision, RenderConfig
from .toolchain import ROOT

TABLE = ROOT / "chips.toml"
STATUS = ("verified", "built", "untested")
_ENUMS: dict[str, type[Enum]] = {"form": Form, "precision": Precision, "cat": CatMode, "coords": Coords}


@dataclass(frozen=True)
class Chip:
    """A line of the table. purpose: what it is for. status: one of STATUS. config: its parameters."""

    name: str
    purpose: str
    status: str
    config: RenderConfig

    @property
    def parameters(self) -> dict[str, int]:
        """Of flk_top, those that are not its defaults."""
        return self.config.top_parameters()


def chips(file: str | Path | None = None) -> dict[str, Chip]:
    """All chips of a table by name, in its order. file: None: `TABLE`. FlickerError, one line with file, chip and field, for what is wrong in it."""
    path = TABLE if file is None else Path(file)
    try:
        return _read(path, path.read_text())
    except OSError as error:
        raise FlickerError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise FlickerError(f"{path}: is no text in UTF-8") from None


def chip_of(name: str, file: str | Path | None = None) -> Chip:
    """One chip of a table; those of `TABLE` are there beside a file's own. FlickerError names the others."""
    known = chips(file) if file is None else chips() | chips(file)
    if name not in known:
        raise FlickerError(f"chip: one of {', '.join(known)}, not {name}" + ("" if file is None else f" (file {file})"))
    return known[name]


def name_of(config: RenderConfig) -> str | None:
    """The name in `TABLE` of a configuration; None where it has none."""
    return next((chip.name for chip in chips().values() if chip.config == config), None)


@cache
def _read(path: Path, text: str) -> dict[str, Chip]:
    try:
        found = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FlickerError(f"{path.name}: {error}") from None
    if not found:
        raise FlickerError(f"{path.name}: has no chip")
    for name, line in found.items():
        if not isinstance(line, dict):
            raise FlickerError(f"{path.name}: {name} stands outside of a chip's table, as [tiny]")
    return {name: _chip(path.name, name, line) for name, line in found.items()}


def _chip(file: str, name: str, line: Mapping[str, Any]) -> Chip:
    def wrong(text: str) -> NoReturn:
        raise FlickerError(f"{file}: chip {name}: {text}")

    line = dict(line)
    purpose, status = line.pop("purpose", None), line.pop("status", None)
    if not isinstance(purpose, str) or not purpose.strip():
        wrong("purpose must be a text")
    if status not in STATUS:
        wrong(f"status must be {_either(STATUS)}" + ("" if status is None else f", not {status}"))
    known = {field.name: field for field in fields(RenderConfig)}
    values: dict[str, Any] = {}
    for field, value in line.items():
        if field not in known:
            near = difflib.get_close_matches(field, [*known, "purpose", "status"], 1)
            wrong(f"unknown field {field}" + (f", is {near[0]} meant?" if near else ""))
        if field in _ENUMS:
            values[field] = _member(_ENUMS[field], field, value, wrong)
        elif field == "memories" and isinstance(value, dict):
            values[field] = _sizes(f"{file}: {name}", value, wrong)
        elif type(value) is not type(known[field].default):
            wrong(f"{field} must be a {'whole number' if isinstance(known[field].default, int) else 'text'}, not {value!r}")
        else:
            values[field] = value
    try:
        return Chip(name, purpose, status, RenderConfig(**values))
    except FlickerError as error:
        wrong(str(error).removeprefix("configuration: "))


def _member(enum: type[Enum], field: str, value: Any, wrong: Any) -> Enum:
    names = {str(member.name if isinstance(member, IntEnum) else member.value).lower(): member for member in enum}
    if value not in names:
        wrong(f"{field} must be {_either(tuple(names))}, not {value}")
    return names[value]


def _sizes(owner: str, value: Mapping[str, Any], wrong: Any) -> str:
    """Sizes of memories of a chip's own: the name under which `CHIP_MEMORIES` has them from now on."""
    known = [field.name for field in fields(ChipMemories)]
    for field, size in value.items():
        if field not in known:
            near = difflib.get_close_matches(field, known, 1)
            wrong(f"unknown field memories.{field}" + (f", is {near[0]} meant?" if near else ""))
        if type(size) is not int or size < 1:
            wrong(f"memories.{field} must be a whole number from 1 on, not {size!r}")
    try:
        sizes = ChipMemories(**value)
    except FlickerError as error:
        wrong(str(error))
    for name, other in CHIP_MEMORIES.items():
        if other == sizes:
            return name
    CHIP_MEMORIES[owner] = sizes
    return owner


def _either(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}"
