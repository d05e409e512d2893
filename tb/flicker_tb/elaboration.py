"""Elaboration in this process, by slang: which parameters a design refuses, in milliseconds.

A design refuses parameters with `$error` in a generate block. Verilator says the same in a run of its own (`tb/test_tooling.py` holds that both agree).
"""

from __future__ import annotations

import functools
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyslang

from flicker import toolchain


@functools.cache
def _tree(path: Path) -> pyslang.syntax.SyntaxTree:
    return pyslang.syntax.SyntaxTree.fromFile(str(path))


def _compilation(top: str, parameters: Mapping[str, str | int], sources: Sequence[Path] | None) -> pyslang.ast.Compilation:
    options = pyslang.ast.CompilationOptions()
    options.topModules = {top}
    options.paramOverrides = [f"{name}={toolchain.literal(value)}" for name, value in parameters.items()]
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for path in toolchain.sources_of(top) if sources is None else sources:
        compilation.addSyntaxTree(_tree(path))
    return compilation


def refusals(top: str, parameters: Mapping[str, str | int], sources: Sequence[Path] | None = None) -> list[str]:
    """What the `$error` of generate blocks say in ``top`` and all below it.

    sources: default those of ``top`` in rtl/flk.f. Other errors, such as a width of 0 behind a refused parameter, are left out.
    """
    compilation = _compilation(top, parameters, sources)
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


def instances(top: str, parameters: Mapping[str, str | int]) -> dict[str, list[dict[str, int]]]:
    """By module, the parameters of each of its instances in ``top``, those that are numbers."""
    found: dict[str, list[dict[str, int]]] = defaultdict(list)

    def see(symbol: object) -> bool:
        if isinstance(symbol, pyslang.ast.InstanceSymbol):
            values = {p.name: p.value.value for p in symbol.body.parameters if isinstance(p, pyslang.ast.ParameterSymbol)}
            found[symbol.definition.name].append({name: int(value) for name, value in values.items() if isinstance(value, pyslang.SVInt)})
        return True

    _compilation(top, parameters, None).getRoot().visit(see)
    return found
