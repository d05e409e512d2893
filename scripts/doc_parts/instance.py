"""`make docs PART=instance`: the instantiation template of the rendering stage, from the module's own ports."""

from __future__ import annotations

import re

import pyslang

from flicker.errors import FlickerError
from flicker.toolchain import filelist

from .common import Say

TOP = "flk_render_stage"


def elaborate(extra: str = "", tops: set[str] | None = None) -> tuple[list[str], dict[str, pyslang.ast.InstanceSymbol]]:
    """Errors of slang and top modules by name.

    extra: SystemVerilog text behind the sources of rtl/flk.f. tops: None: modules that no other has inside.
    """
    options = pyslang.ast.CompilationOptions()
    options.topModules = tops or set()
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for path in filelist():
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromFile(str(path)))
    if extra:
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromText(extra))
    errors = [str(found.code) for found in compilation.getAllDiagnostics() if found.isError()]
    return errors, {top.name: top for top in compilation.getRoot().topInstances}


def _padded(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows with their columns aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def template() -> str:
    """Declarations of the signals of ``TOP`` and its instance with every parameter at its default."""
    errors, tops = elaborate(tops={TOP})
    if errors:
        raise FlickerError(f"rtl/flk.f: slang finds {errors[0]}")
    body = tops[TOP].body
    signals, connections = [], []
    for port in body.portList:
        name = re.sub(r"_n?[io]$", lambda end: "_n" if "n" in end[0] else "", port.name)
        signals.append((re.sub(r"(?<=\w)\[", " [", str(port.type)) + " ", f"{name};"))
        connections.append((f"  .{port.name} ", f"({name}),"))
    parameters = []
    for parameter in body.parameters:
        if not parameter.isPortParam or parameter.isLocalParam:
            continue
        text = str(parameter.syntax.initializer.expr if hasattr(parameter.syntax, "initializer") else parameter.syntax.assignment.type).strip()
        text = re.sub(r"//.*", "", text).strip()
        package = "flk_param_pkg::" if re.fullmatch(r"[A-Z][A-Z0-9_]*", text) else "flk_pkg::" if re.fullmatch(r"[a-z_0-9]+_t", text) else ""
        parameters.append((f"  .{parameter.name} ", f"({package}{text}),"))
    parameters[-1] = (parameters[-1][0], parameters[-1][1].rstrip(","))
    connections[-1] = (connections[-1][0], connections[-1][1].rstrip(","))
    return "\n".join([
        *_padded(signals), "", f"{TOP} #(", *_padded(parameters), ") i_stage (", *_padded(connections), ");",
    ])


def tables(say: Say) -> dict[str, str]:
    return {"": f"```systemverilog\n{template()}\n```"}
