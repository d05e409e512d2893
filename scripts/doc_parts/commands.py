"""`make docs PART=commands`: the options of every command of `flicker`, from what `--help` says, on the page that has the command."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pages
from typer.main import get_command

from flicker import markdown
from flicker.cli.main import app
from flicker.errors import FlickerError

from .common import Say

COMMANDS = ("render", "path", "view", "chip", "cost", "convert", "grow", "pack", "fit", "undistort", "budget", "report", "sweep", "stability")
PLACES = ("all", *COMMANDS)
WORDS = {"path": "FILE", "int": "N", "int range": "N", "float": "X", "float range": "X", "str": "TEXT", "bool": ""}
NAMED = {"--size": "WxH", "--frame": "WxH", "--up": "AXIS", "--background": "COLOUR", "--config": "NAME", "--through": "NAME"}  # in place of TEXT
PAGE = re.compile(r"\(docs/(reference|guide)/(\w+\.md)\)")


def tables(say: Say) -> dict[str, str]:
    commands = get_command(app).commands
    shared = {_key(p) for p in commands["render"].params}
    return {"all": overview(commands), **{name: table(commands[name], set() if name == "render" else shared) for name in COMMANDS}}


def overview(commands: dict[str, Any]) -> str:
    """A row for each command, with the page that has its options."""
    where = pages.places()
    rows = []
    for name, command in commands.items():
        page = where.get(("commands", name))
        link = "" if page is None else "[below](#flicker-render)" if name == "render" else f"[{page.name}]({page.name})"
        rows.append([f"`flicker {name}`", command.help.strip().partition("\n")[0].rstrip(".").replace("|", "\\|"), link])
    return markdown.table(["command", "what", "page"], rows)


def table(command: Any, shared: set[tuple[str, str]]) -> str:
    """A row for each option of a command but those that `flicker render` has with the same words, which one row names together."""
    rows, same = [], []
    for parameter in command.params:
        if _key(parameter) in shared:
            same.append(f"`{parameter.opts[0]}`")
        else:
            rows.append([_name(command, parameter), _meaning(command, parameter)])
    if same:
        rows.append([", ".join(same), "as of [`flicker render`](cli.md#flicker-render)"])
    return markdown.table(["option", "meaning"], rows)


def _key(parameter: Any) -> tuple[str, str]:
    return parameter.opts[0], str(parameter.help)


def _values(command: Any, parameter: Any) -> str:
    """What stands behind an option: its choices, or a word for its type."""
    said = parameter.display_type(command.make_context("", [], resilient_parsing=True))
    inner = re.sub(r" \[.*\]$", "", said.strip("<>").removeprefix("list[").removesuffix("]"))
    word = WORDS.get(inner.lower(), inner)
    return NAMED.get(parameter.opts[0], word) if word == "TEXT" else word


def _name(command: Any, parameter: Any) -> str:
    """The option as it is typed; an argument in capitals."""
    if parameter.param_type_name == "argument":
        return f"`{parameter.name.upper()}{'...' if parameter.nargs != 1 else ''}`"
    longest = max(parameter.opts, key=len)
    short = "".join(f", `{name}`" for name in parameter.opts if name != longest)
    return f"`{f'{longest} {_values(command, parameter)}'.strip()}`{short}".replace("|", "\\|")


def _meaning(command: Any, parameter: Any) -> str:
    """The help with its default; pages that it names are links."""
    if not parameter.help:
        raise FlickerError(f"flicker {command.name}: {parameter.opts[0]} has no help")
    text = parameter.help.replace("|", "\\|").replace("*", "\\*")
    text = PAGE.sub(lambda found: f"([{found[2]}]({'../guide/' if found[1] == 'guide' else ''}{found[2]}))", text)
    text = re.sub(r"\[default: (.*)\]$", r"(default: \1)", text)
    default = getattr(parameter.default, "value", parameter.default)
    if parameter.param_type_name == "option" and "default" not in text and isinstance(default, str | int | float | Path) and not isinstance(default, bool):
        text += f" (default: {default:,})" if isinstance(default, int | float) and default >= 1000 else f" (default: {default})"
    return text
