"""Words of identifiers: public names of Python and ports and parameters of the RTL are in the field's words (docs/glossary.md), but for those that
lint/words.toml lists. That list only gets shorter: a name that is gone leaves it.

Not covered: local names, comments, and names of modules.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator

from flicker.toolchain import ROOT

# Words of our own, with what the field says.
PRIVATE = {
    "answer": "response", "answers": "responses", "answered": "acknowledged", "ask": "request", "asks": "requests", "asked": "requested", "tell": "report",
    "told": "reported", "gone": "released", "went": "evicted", "watch": "watchdog", "patience": "starvation limit", "room": "space", "rooms": "packages",
    "place": "slot", "places": "slots",
}
LIST = ROOT / "lint" / "words.toml"
PORT = re.compile(r"^\s*(?:(?:input|output)\b[^;]*?(\w+_n?[io])\b\s*,?|parameter\b[^=/]*?(\w+)\s*=.*?)\s*(?://.*)?$", re.M)


def private(name: str) -> bool:
    """A part of a name is a word of our own."""
    return any(part.lower() in PRIVATE for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name))


def names_of_python(text: str) -> Iterator[str]:
    """Functions, classes, their fields and methods, constants; arguments as function.argument. Those that begin with _ are not public."""
    def inside(body: list[ast.stmt]) -> Iterator[str]:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                if node.name.startswith("_"):
                    continue
                yield node.name
                if isinstance(node, ast.ClassDef):
                    yield from inside(node.body)
                else:
                    yield from (f"{node.name}.{a.arg}" for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs))
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                    if isinstance(target, ast.Name) and not target.id.startswith("_"):
                        yield target.id

    yield from inside(ast.parse(text).body)


def names_of_rtl(text: str) -> set[str]:
    """Ports and parameters."""
    return {port or parameter for port, parameter in PORT.findall(text)}


def wrong(names: Iterator[str] | set[str]) -> set[str]:
    """An argument counts by its own name alone."""
    return {name for name in names if private(name.rpartition(".")[2])}


def test_identifiers_are_in_words_of_the_field() -> None:
    listed = tomllib.loads(LIST.read_text())
    python = {name for folder in ("model", "scripts") for path in (ROOT / folder).rglob("*.py") for name in wrong(names_of_python(path.read_text()))}
    rtl = {name for path in (ROOT / "rtl").rglob("*.sv") for name in wrong(names_of_rtl(path.read_text()))}
    for kind, found in (("python", python), ("rtl", rtl)):
        old = set(listed[kind])
        assert found - old == set(), f"new names of {kind} in words of our own; the field's: {PRIVATE}"
        assert old - found == set(), f"{LIST.name}: {kind}: these names are gone, take them from the list"


PYTHON = """
ROOMS = 1
X: int = 2
_ASKED = 3
def tell(who, at_place): ...
def _told(): ...
class Answer:
    slots: int
    def ask(self): ...
class Placement: ...
"""
RTL = """
  parameter  int unsigned Patience = 16,  // places
  parameter  int unsigned Width    = 3    // a room
  input  logic       answered_i,
  output logic [3:0] out_place_o   // told
  output logic [Patience-1:0] count_o
"""


def test_wrong_names_are_found() -> None:
    assert wrong(names_of_python(PYTHON)) == {"ROOMS", "tell", "tell.at_place", "Answer", "ask"}
    assert names_of_rtl(RTL) == {"Patience", "Width", "answered_i", "out_place_o", "count_o"}
    assert wrong(names_of_rtl(RTL)) == {"Patience", "answered_i", "out_place_o"}
