#!/usr/bin/env python3
"""Writes the instantiation template of the rendering stage into docs/integration.md from the module's own ports; ``--check`` only compares."""

from __future__ import annotations

import argparse
import re
import sys

import pyslang
from pages import get, put

from flicker.errors import FlickerError
from flicker.toolchain import ROOT, filelist

TOP = "flk_render_stage"
PAGE = ROOT / "docs" / "integration.md"
PART = "scripts/instance_template.py"


def elaborate(extra: str = "") -> tuple[list[str], dict[str, pyslang.ast.InstanceSymbol]]:
    """Errors of slang and top modules by name; ``extra`` is SystemVerilog text behind the sources of rtl/flk.f."""
    compilation = pyslang.ast.Compilation()
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
    errors, tops = elaborate()
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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit with 1 if the page has another template")
    text = f"```systemverilog\n{template()}\n```\n"
    if not parser.parse_args().check:
        put(PAGE, PART, text)
    elif get(PAGE, PART) != text:
        print(f"docs/integration.md: the template is not that of {TOP}: run scripts/instance_template.py")
        return 1
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"instance_template: {error}")
