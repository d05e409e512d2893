"""Elaboration in this process, by slang: which parameters a design refuses, in milliseconds.

A design refuses parameters with `$error` in a generate block. Verilator says the same in a run of its own (`tb/test_tooling.py` holds that both agree).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyslang

from flicker import toolchain


@functools.cache
def _tree(path: Path) -> pyslang.syntax.SyntaxTree:
    return pyslang.syntax.SyntaxTree.fromFile(str(path))


def refusals(top: str, parameters: Mapping[str, str | int], sources: Sequence[Path] | None = None) -> list[str]:
    """What the `$error` of generate blocks say in ``top`` and all below it.

    sources: default those of ``top`` in rtl/flk.f. Other errors, such as a width of 0 behind a refused parameter, are left out.
    """
    options = pyslang.ast.CompilationOptions()
    options.topModules = {top}
    options.paramOverrides = [f"{name}={toolchain.literal(value)}" for name, value in parameters.items()]
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for path in toolchain.sources_of(top) if sources is None else sources:
        compilation.addSyntaxTree(_tree(path))
    found = compilation.getAllDiagnostics()
    tops = compilation.getRoot().topInstances
    assert [instance.name for instance in tops] == [top], f"{top}: slang does not elaborate it"
    unknown = parameters.keys() - {parameter.name for parameter in tops[0].body.parameters}
    assert not unknown, f"{top}: no parameter {', '.join(sorted(unknown))}"
    return [str(one.args[0]).removeprefix(": ") for one in found if one.isError() and one.code == pyslang.Diags.ErrorTask]


def refused(top: str, parameters: Mapping[str, str | int], *messages: str, sources: Sequence[Path] | None = None) -> None:
    """Fails unless ``top`` refuses ``parameters`` with all ``messages`` (parts of lines); the units inside may have something to say, too."""
    said = refusals(top, parameters, sources)
    missing = [message for message in messages if not any(message in line for line in said)]
    assert messages and not missing, f"{top} {dict(parameters)}: not refused with {missing}, but with {said}"
