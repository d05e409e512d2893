"""What a test reads: the files that its outcome can depend on, found in its source and in all that this uses.

`inputs(path)` of a test file holds, each with all that it uses in turn:

- Python modules that it imports, anywhere in its text, or names as text (`"flicker.scene.demo.generate"`), and the conftest.py above it
- files beside it that it names: cocotb modules, harnesses, benches; of a module that uses `__file__`, all data of its folder
- RTL that it names, with every module and package below, and the file list
- `ROOT / "docs" / "x.md"`: that file or all of that folder; `ROOT` in any other use, and `filelist()` of all sources: everything under version control, or rtl/

It is a superset, but for what a program builds of parts at run time; `flicker_tb.passed` holds it against what is opened.
"""

from __future__ import annotations

import ast
import functools
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flicker import toolchain

ROOT = toolchain.ROOT
TB = ROOT / "tb"
RTL = ROOT / "rtl"
# They work for whoever calls them: what they read, callers name. Their own text is still an input.
SERVANTS = {ROOT / "model/flicker/toolchain.py", ROOT / "model/flicker/kernels.py", *(TB / "flicker_tb" / f"{name}.py" for name in (
    "inputs", "passed", "durations", "progress", "runner", "elaboration", "four_state", "bench", "signal_view"))}
MODEL = ROOT / "model"
BUILDERS = tuple(MODEL / "flicker" / name for name in ("sim", "cost"))  # packages that build RTL; others of the model only speak of it
# Imports that only another kind of run follows, for which nothing is kept (`passed.KINDS`).
ELSEWHERE = {TB / "flicker_tb" / "runner.py": {"flicker.cost.synth.gates"}}
_ROOTS = {"ROOT": "", "TB": "tb", "RTL": "rtl"}


@dataclass(frozen=True)
class Text:
    """What one Python file says. names: modules it may import, dotted, absolute. words: in its strings. paths: below the checkout, "" for all of it.
    prefixes: of RTL names that are put together. beside: all data of its folder. functions, arguments: names of those that it
    defines."""

    names: frozenset[str]
    words: frozenset[str]
    paths: frozenset[str]
    prefixes: frozenset[str]
    beside: bool
    functions: frozenset[str]
    arguments: frozenset[str]


@functools.cache
def tree() -> frozenset[Path]:
    """Files under version control and those that git does not ignore; of a copy without git, all but what is built."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode or not done.stdout:
        found = [path for path in ROOT.rglob("*") if not {"build", ".venv", ".git", "__pycache__"} & set(path.relative_to(ROOT).parts)]
    else:
        found = [ROOT / name for name in done.stdout.split("\0") if name]
    return frozenset(path for path in found if path.is_file())


@functools.cache
def rtl() -> dict[str, Path]:
    return {path.stem: path for path in toolchain.filelist()}


@functools.cache
def _python() -> dict[str, Path]:
    """Files of our modules by the name under which they are imported; folders of tests and scripts are on the path."""
    found: dict[str, Path] = {}
    for path in tree():
        if path.suffix != ".py":
            continue
        relative = path.relative_to(ROOT)
        parts = list(relative.with_suffix("").parts)
        if parts[0] == "model" or parts[:2] == ["tb", "flicker_tb"] or parts[:2] == ["scripts", "doc_parts"]:
            parts = parts[1:]
        else:
            parts = parts[-1:]
        if parts[-1] == "__init__":
            parts = parts[:-1]
        if parts and parts != ["conftest"]:
            found[".".join(parts)] = path
    return found


@functools.cache
def _inside(path: Path, folder: Path) -> bool:
    return str(path).startswith(f"{folder}/")


@functools.cache
def _names() -> dict[Path, str]:
    return {path: name for name, path in _python().items()}


def _constant(node: ast.AST) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _path_of(node: ast.AST) -> tuple[str, bool] | None:
    """Path below the checkout that `ROOT / "a" / "b"` begins with, and whether that is all of it; None for another expression."""
    if isinstance(node, ast.Name) and node.id in _ROOTS:
        return _ROOTS[node.id], True
    if isinstance(node, ast.Attribute) and node.attr == "ROOT":
        return "", True
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and (left := _path_of(node.left)) is not None:
        right = _constant(node.right)
        return (f"{left[0]}/{right}".strip("/"), True) if left[1] and right is not None else (left[0], False)
    return None


class _Reader(ast.NodeVisitor):
    def __init__(self, module: str, package: bool) -> None:
        self.module, self.package = module, package
        self.names, self.words, self.paths, self.prefixes, self.beside = set[str](), set[str](), set[str](), set[str](), False
        self.functions, self.arguments = set[str](), set[str]()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.functions.add(node.name)
        self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> None:
        self.arguments.add(node.arg)
        self.generic_visit(node)

    def visit_Import(self, node: ast.Import) -> None:
        self.names |= {alias.name for alias in node.names}

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        base = node.module or ""
        if node.level:
            above = self.module.split(".")[: None if self.package and node.level == 1 else (1 if self.package else 0) - node.level]
            base = ".".join([*above, *([base] if base else [])])
        self.names |= {base, *(f"{base}.{alias.name}" for alias in node.names)}

    def visit_BinOp(self, node: ast.BinOp) -> None:
        found = _path_of(node)
        if found is None:
            self.generic_visit(node)
        else:
            self.paths.add(found[0])
            while isinstance(node, ast.BinOp):  # what stands between may name more
                if not isinstance(node.right, ast.Constant):
                    self.visit(node.right)
                node = node.left  # type: ignore[assignment]

    def visit_Name(self, node: ast.Name) -> None:
        if node.id in _ROOTS:
            self.paths.add(_ROOTS[node.id])
        elif node.id == "__file__":
            self.beside = True
        elif node.id in ("filelist", "FILELIST"):
            self.paths.add("rtl")

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if node.attr == "ROOT":
            self.paths.add("")
        elif node.attr in ("filelist", "FILELIST"):
            self.paths.add("rtl")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if isinstance(node.func, ast.Attribute) and node.func.attr in ("relative_to", "is_relative_to"):  # reads nothing
            self.visit(node.func.value)
        else:
            self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        # ROOT = toolchain.ROOT and the like: what counts is its use.
        if all(isinstance(target, ast.Name) and target.id in _ROOTS for target in node.targets):
            return
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if _constant(node.value) is None:  # a docstring
            self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        for part, then in zip(node.values, [*node.values[1:], None]):
            text = _constant(part)
            if text is None:
                self.visit(part)
            elif then is not None and (begun := re.search(r"(flk_\w*)$", text)):
                self.prefixes.add(begun[1])
            self.words |= set(re.findall(r"[\w.]+", text or ""))

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, str):
            self.words |= set(re.findall(r"[\w.]+", node.value))


@functools.cache
def text_of(path: Path) -> Text:
    """What a Python file says."""
    name = _names().get(path, path.stem)
    reader = _Reader(name, path.name == "__init__.py")
    reader.visit(ast.parse(path.read_text()))
    names, functions, arguments = (frozenset(part) for part in (reader.names, reader.functions, reader.arguments))
    if path in SERVANTS:
        return Text(names, frozenset(), frozenset(), frozenset(), False, functions, arguments)
    return Text(names, *(frozenset(part) for part in (reader.words, reader.paths, reader.prefixes)), reader.beside, functions, arguments)


@functools.cache
def _modules(name: str) -> frozenset[Path]:
    """Files that an import of a dotted name runs: of the longest part of it that is a module, and the packages above."""
    found: set[Path] = set()
    parts = name.split(".")
    for end in range(1, len(parts) + 1):
        if (path := _python().get(".".join(parts[:end]))) is not None:
            found.add(path)
    return frozenset(found)


@functools.cache
def imports(path: Path) -> frozenset[Path]:
    """Our modules that a Python file imports itself, or names in its strings."""
    text = text_of(path)
    elsewhere = {f"{name}{end}" for name in ELSEWHERE.get(path, ()) for end in ("", ".sources")}
    names = text.names - elsewhere | {word for word in text.words if word.startswith(("flicker.", "flicker_tb."))}
    return frozenset(found for name in names for found in _modules(name)) - {path}


@functools.cache
def _beside(folder: Path) -> dict[str, list[Path]]:
    """Files of a folder of tests by name and by stem."""
    found: dict[str, list[Path]] = {}
    for path in tree():
        if path.parent == folder:
            for name in {path.name, path.stem}:
                found.setdefault(name, []).append(path)
    return found


@functools.cache
def below(path: str) -> frozenset[Path]:
    """Files of the tree at or below a path."""
    at = ROOT / path
    return frozenset(other for other in tree() if other == at or _inside(other, at)) if path else tree()


@functools.cache
def _sources(module: str) -> frozenset[Path]:
    return frozenset(toolchain.sources_of(module))


@functools.cache
def words(path: Path) -> frozenset[str]:
    """Words of a file that may name another one: of Python those in its strings, of others all but comments."""
    return text_of(path).words if path.suffix == ".py" else frozenset(re.findall(r"[\w.]+", re.sub(r"//.*", "", path.read_text())))


def _used(path: Path) -> Iterator[Path]:
    """Files that a file of the tree uses itself."""
    text = text_of(path) if path.suffix == ".py" else None
    said = words(path)
    if text is not None:
        yield from imports(path)
        for at in text.paths:
            yield from below(at)
        for prefix in text.prefixes if not _inside(path, MODEL) else ():
            yield from (source for name, source in rtl().items() if name.startswith(prefix))
        if text.beside:
            yield from (other for other in below(path.parent.relative_to(ROOT).as_posix()) if other.suffix != ".py" and path.parent == other.parent)
    if _inside(path, TB) and path not in SERVANTS:
        yield from (other for word in said & _beside(path.parent).keys() for other in _beside(path.parent)[word])
    if (named := said & rtl().keys()) and (not _inside(path, MODEL) or any(_inside(path, folder) for folder in BUILDERS)):
        yield toolchain.FILELIST
        for name in named:
            yield from _sources(name)


@functools.cache
def used(path: Path) -> frozenset[Path]:
    """Files that a file of the tree uses itself, RTL with all below it."""
    return frozenset(_used(path)) - {path}


@functools.cache
def inputs(test: Path) -> frozenset[Path]:
    """All files that the outcome of a test file depends on, itself among them."""
    above = [folder / "conftest.py" for folder in test.parents if TB == folder or TB in folder.parents]
    found: set[Path] = {path for path in above if path.is_file()}
    # What a conftest.py imports, only tests with its fixtures need.
    pending = [test, *(other for path in found if text_of(path).functions & text_of(test).arguments for other in used(path))]
    while pending:
        path = pending.pop()
        if path not in found and path.is_file():
            found.add(path)
            if path.suffix in (".py", ".sv", ".cpp", ".hpp", ".h") and not _inside(path, RTL):
                pending += used(path) - found
    return frozenset(found)


@functools.cache
def test_files() -> tuple[Path, ...]:
    """All test files."""
    return tuple(sorted(path for path in tree() if _inside(path, TB) and path.name.startswith("test_") and path.suffix == ".py"))
