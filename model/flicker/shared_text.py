"""One text for all instances of a module, in the C++ that Verilator wrote.

Verilator writes a function for each instance of a module that it does not inline, and keeps one where their texts agree. Concurrent assertions keep
them from agreeing: what they sampled is a variable named after the instance, and their messages hold its name; and so do the functions of a design, whose local
variables have a number of the whole design in their names. Here such variables get one name in all instances, messages take the name from the object, and
functions whose texts are then equal become calls of the first. What a function does stays as it was; the
compiler has less to read, and a cycle of simulation less to fetch. Texts that agree in no other way are left alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

_INSTANCE = re.compile(r"^    (Vtop_\w+)\s+(TOP__\w+);", re.M)  # class and object, in Vtop__Syms.h
_SAMPLED = re.compile(r"\b(TOP__\w+)\.__Vsampled_\1__(\w+)")
_MESSAGE = re.compile(r"vlSymsp->name\(\),\"([^\"\n]+)\"")
_FUNCTION = re.compile(r"^(?P<head>(?:VL_\w+ )*(?:void|bool|CData) (?P<name>Vtop_\w+?)\((?P<self>Vtop_\w+)\* vlSelf\)) \{\n(?P<body>.*?)^\}\n", re.M | re.S)
_LOCAL = re.compile(r"(?<![.>])\b(__Vfunc_\w+__)(\d+)(__\w+)")  # of a function of the design: its name, a number, the variable
_TRACE = re.compile(r"^    VL_DEBUG_IF\(VL_DBG_MSGF\(.*\n", re.M)  # the function's own name, in debug builds


def _plain(scope: str) -> str:
    """Name of an instance as messages have it: `TOP__top__DOT__gen__BRA__0__KET____DOT__i_unit` is `top.gen[0].i_unit`."""
    scope = scope.removeprefix("TOP__").replace("__BRA__", "[").replace("__KET__", "]").replace("__DOT__", ".")
    return scope.replace("__", ".")


def _one_name(text: str, scope: str) -> str:
    """A text of an instance's function with variables and messages that do not name the instance."""
    numbers: dict[tuple[str, str], int] = {}
    text = _LOCAL.sub(lambda found: f"{found[1]}{numbers.setdefault((found[1], found[2]), len(numbers))}{found[3]}", text)
    text = text.replace(f"vlSelfRef.__Vsampled_{scope}__", "vlSelfRef.__Vsampled_self__")
    if "vlSymsp" in text:  # what is sampled once for all belongs to one instance: the others reach it so
        text = text.replace("vlSelfRef.__Vsampled_TOP__", f"vlSymsp->{scope}.__Vsampled_TOP__")
    path = _plain(scope)

    def message(found: re.Match[str]) -> str:
        name = found[1]
        if name != path and not name.startswith(f"{path}."):
            return found[0]
        return f'vlSelf->vlNamep,"{name[len(path) + 1:]}"'

    return _MESSAGE.sub(message, text)


def _scope(name: str, scopes: set[str]) -> str | None:
    """The instance that a function is written for: its name is class, kind, scope and number."""
    at = name.find("__TOP__")
    scope = re.sub(r"__\d+$", "", name[at + 2 :]) if at >= 0 else ""
    return scope if scope in scopes else None


def _members(text: str, scopes: list[str]) -> Iterator[str]:
    """Lines of a class with the sampled variables of one instance, under one name."""
    seen: set[str] = set()
    longest = sorted(scopes, key=len, reverse=True)
    for line in text.splitlines(keepends=True):
        for scope in longest:
            if f" __Vsampled_{scope}__" in line:
                line = line.replace(f"__Vsampled_{scope}__", "__Vsampled_self__")
                break
        if "__Vsampled_self__" in line:
            if line in seen:
                continue
            seen.add(line)
        yield line


def share(folder: Path) -> None:
    """Rewrite the C++ of a build, prefix Vtop, before it is compiled."""
    objects: dict[str, list[str]] = {}
    for kind, scope in _INSTANCE.findall((folder / "Vtop__Syms.h").read_text()):
        objects.setdefault(kind, []).append(scope)
    shared = {kind: scopes for kind, scopes in objects.items() if len(scopes) > 1}
    if not shared:
        return
    scopes_of = {scope: kind for kind, scopes in shared.items() for scope in scopes}
    for kind, scopes in shared.items():
        path = folder / f"{kind}.h"
        path.write_text("".join(_members(path.read_text(), scopes)))
    for path in sorted(folder.glob("Vtop*.cpp")):
        path.write_text(_SAMPLED.sub(lambda found: f"{found[1]}.__Vsampled_self__{found[2]}" if found[1] in scopes_of else found[0], path.read_text()))
    for kind, scopes in shared.items():
        names = set(scopes)
        first: dict[tuple[str, str], str] = {}  # head without the name, and body: the function that keeps them

        def one(found: re.Match[str]) -> str:
            name, body = found["name"], found["body"]
            if found["self"] != kind:
                return found[0]
            if (scope := _scope(name, names)) is None:  # of the class: variables of all instances, reset one after the other
                for each in scopes:
                    body = body.replace(f"vlSelf->__Vsampled_{each}__", "vlSelf->__Vsampled_self__")
                return f"{found['head']} {{\n{body}}}\n"
            body = _one_name(body, scope)
            kept = first.setdefault((found["head"].replace(name, ""), _TRACE.sub("", body, count=1)), name)
            if kept == name:
                return f"{found['head']} {{\n{body}}}\n"
            call = f"return {kept}(vlSelf);" if not found["head"].split(name)[0].strip().endswith("void") else f"{kept}(vlSelf);"
            return f"{found['head'].replace(name, kept)};\n{found['head']} {{\n    {call}\n}}\n"

        for path in sorted(folder.glob(f"{kind}__*.cpp")):
            path.write_text(_FUNCTION.sub(one, path.read_text()))
