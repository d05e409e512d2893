"""Driver of the proofs: what it refuses, and that a proof without teeth is reported. The proofs themselves: `scripts/formal.py --fast`.

Parameter space: bad arguments, mutants that survive, do not compile or no longer fit, logs of SymbiYosys without a trace, every entry of
proofs.toml against the sources, with all its parameters. Not covered: time-outs.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pages
import pyslang
import pytest

from flicker.toolchain import ROOT

SCRIPT = ROOT / "scripts" / "formal.py"
PROOF = """
[[proof]]
name = "pipe_reg"
method = "induction"
cover_depth = 4
mutant_depth = 5
"""
MUTANT = """
[[proof.mutant]]
file = "flk_pipe_reg"
find = "{find}"
replace = "{replace}"
"""


@pytest.fixture(scope="module")
def formal() -> ModuleType:
    spec = importlib.util.spec_from_file_location("formal_driver", SCRIPT)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def drive(*arguments: object) -> subprocess.CompletedProcess:
    command = [sys.executable, SCRIPT, *map(str, arguments)]
    return subprocess.run(command, text=True, capture_output=True)


def test_unknown_proof_is_one_line() -> None:
    done = drive("--unit", "nosuch")
    assert done.returncode == 1 and not done.stdout
    assert re.fullmatch(r"formal: no proof 'nosuch'; there are [^\n]*fifo[^\n]*\n", done.stderr)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nonsense", "cannot be read"),
        (PROOF, "proof pipe_reg: no mutant"),
        (PROOF + 'colour = "red"\n' + MUTANT, "proof pipe_reg: unknown key colour"),
        (PROOF.replace("induction", "hope") + MUTANT, "method must be"),
    ],
)
def test_bad_list_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "proofs.toml"
    path.write_text(text)
    done = drive("--proofs", path)
    assert done.returncode == 1 and message in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.slow
def test_proof_without_teeth_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "proofs.toml"
    path.write_text(
        PROOF
        + MUTANT.format(find="in_valid_i || !in_ready_o)", replace="in_valid_i || !(in_ready_o))")
        + MUTANT.format(find="in_valid_i || !in_ready_o)", replace="in_valid_i ||)")
        + MUTANT.format(find="no such text", replace="")
        + MUTANT.format(find="in_valid_i || !in_ready_o)", replace="in_valid_i)")
    )
    done = drive("--proofs", path, "--jobs", 1)
    assert done.returncode == 1, done.stdout
    assert "PASS, must be FAIL" in done.stdout  # survives
    assert re.search("ERROR, must be FAIL.*log.txt", done.stdout)  # does not compile
    assert "'no such text' occurs 0 times" in done.stdout
    assert "6 tasks, 3 wrong" in done.stdout  # proof, cover and the last mutant are in order


def test_failure_needs_a_trace(formal: ModuleType) -> None:
    proof = formal.read_proofs()[0]
    task = formal.Task(proof, "mutant", {}, proof.mutants[0])
    done = "DONE (FAIL, rc=2)"
    assert formal.verdict(task, 2, done)[0] == "ERROR"
    log = f"Assert failed in fv_x: a_data\ncounterexample trace: x.vcd\n{done}"
    assert formal.verdict(task, 2, log) == ("FAIL", "fv_x.a_data")
    assert formal.verdict(task, 1, log)[0] == "ERROR"  # another exit status than the log says
    assert formal.verdict(formal.Task(proof, "cover", {}), 0, "DONE (PASS, rc=0)")[0] == "ERROR"


def test_every_task_fits_the_sources(formal: ModuleType) -> None:
    """Mutants, stand-ins and files; also that no mutation touches a comment only."""
    for proof in formal.read_proofs():
        for task in formal.tasks_of(proof, fast=False):
            files = formal.sources_of(task)
            if task.mutant:
                name = f"{task.mutant.file}.sv"
                original = next(ROOT.glob(f"rtl/**/{name}")).read_text()
                assert re.sub("//.*", "", files[name]) != re.sub("//.*", "", original), (proof.name, task.mutant)


def broken(formal: ModuleType, task: object) -> list[str]:
    """What slang refuses in a task: a path into the hardware that is no longer there, a port, a parameter."""
    options = pyslang.ast.CompilationOptions()
    options.topModules, options.paramOverrides = {task.proof.top}, [f"{name}={value}" for name, value in task.parameters.items()]
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for text in formal.sources_of(task).values():
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromText(text))
    return [f"{one.code} {[str(arg) for arg in one.args]}" for one in compilation.getAllDiagnostics() if one.isError()]


def test_every_proof_elaborates(formal: ModuleType) -> None:
    """With each set of parameters, those that make test does not prove too; a register that is called otherwise is found."""
    for proof in formal.read_proofs():
        for parameters in proof.parameters:
            assert broken(formal, formal.Task(proof, "proof", parameters)) == [], (proof.name, parameters)
    proof = next(proof for proof in formal.read_proofs() if proof.name == "axi_read")
    moved = formal.Mutant("flk_axi_read", "i_under_way (", "i_elsewhere (", 1, {})
    assert any("i_under_way" in line for line in broken(formal, formal.Task(proof, "mutant", {}, moved)))


def test_fast_tasks_are_of_the_whole_run(formal: ModuleType) -> None:
    """make test proves nothing that make formal does not: a cover that only one set of parameters reaches stays with it."""
    for proof in formal.read_proofs():
        whole, fast = formal.tasks_of(proof, fast=False), formal.tasks_of(proof, fast=True)
        assert all(task in whole for task in fast), proof.name
        assert {task.kind for task in fast} == {task.kind for task in whole}, proof.name


def test_docs_table_is_complete(formal: ModuleType) -> None:
    text = pages.get(("formal", ""))
    listed = {cells[0]: cells for line in text.splitlines()[2:] if len(cells := line.strip("| ").split(" | ")) == 6}
    proofs = {proof.name: proof for proof in formal.read_proofs() if not proof.long}
    assert listed.keys() == proofs.keys()
    for name, proof in proofs.items():
        assert listed[name][2] == f"{len(proof.parameters)}/{len(proof.parameters)}", name
        assert listed[name][4] == f"{len(proof.mutants)}/{len(proof.mutants)}", name
