"""Where numba keeps compiled kernels: in a folder for each state of the module that a kernel stands in and of all that this imports.

Numba itself looks at the kernel's own file alone, not at the functions and constants that it takes from others. numba loads `Locator` when the first kernel
is made (NUMBA_CACHE_LOCATOR_CLASSES, which the package sets); third parties' kernels are left to numba.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
from pathlib import Path

from numba.core import config
from numba.core.caching import UserProvidedCacheLocator

PACKAGE = Path(__file__).resolve().parent
ROOT = PACKAGE.parents[1]
_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+(\.*[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))", re.M)


def _file(folder: Path, name: str) -> Path | None:
    """File of the module or package `name` of a folder."""
    at = folder / name
    if (at / "__init__.py").is_file():
        return at / "__init__.py"
    return at.with_suffix(".py") if at.with_suffix(".py").is_file() else None


def _resolved(folder: Path, dotted: str) -> set[Path]:
    """Files that an import of a dotted name below a folder runs: packages on the way, and the module."""
    found: set[Path] = set()
    for name in filter(None, dotted.split(".")):
        path = _file(folder, name)
        if path is None:
            break
        found.add(path)
        folder = folder / name
    return found


@functools.cache
def _imported(path: Path) -> frozenset[Path]:
    """Our modules that a file imports: of the package, or beside a file that is not of it."""
    packages = (folder / "__init__.py" for folder in path.parents if folder == PACKAGE or PACKAGE in folder.parents)
    found = {package for package in packages if package.is_file()} - {path}
    for base, names, plain in _IMPORT.findall(path.read_text()):
        if plain:
            pairs = [("", word.split()[0]) for word in plain.split(",") if word.strip()]
        else:
            pairs = [(base, word) for word in re.findall(r"\w+", re.sub(r"\bas\s+\w+|#[^\n]*", "", names))]
        for module, name in pairs:
            dots = len(module) - len(module.lstrip("."))
            if dots:
                folder = path.parent
                for _ in range(dots - 1):
                    folder = folder.parent
                found |= _resolved(folder, f"{module[dots:]}.{name}" if module[dots:] else name)
            else:
                dotted = f"{module}.{name}" if module else name
                found |= _resolved(PACKAGE.parent, dotted) if dotted.split(".")[0] == PACKAGE.name else _resolved(path.parent, dotted)
    return frozenset(found)


@functools.cache
def closure(path: Path) -> tuple[Path, ...]:
    """A file with all of our modules that it imports, and that these import; in the order of their names."""
    found, pending = set[Path](), [path]
    while pending:
        one = pending.pop()
        if one not in found:
            found.add(one)
            pending += _imported(one)
    return tuple(sorted(found))


@functools.cache
def _content(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


@functools.cache
def digest(path: Path) -> str:
    """Of a file and all that it imports; the same in every checkout."""
    total = hashlib.sha256()
    for one in closure(path):
        total.update(os.path.relpath(one, ROOT).encode() + b"\0" + _content(one))
    return total.hexdigest()[:16]


class Locator(UserProvidedCacheLocator):
    """Places of the kernels in this checkout's files."""

    def __init__(self, py_func, py_file: str) -> None:
        super().__init__(py_func, py_file)
        path = Path(py_file).resolve()
        self._digest = digest(path)
        self._cache_path = os.path.join(config.CACHE_DIR, f"{path.stem}-{self._digest}")  # type: ignore[attr-defined]

    def get_source_stamp(self) -> str:
        return self._digest

    @classmethod
    def from_function(cls, py_func, py_file: str):
        path = Path(py_file)
        if not path.is_file() or not path.resolve().is_relative_to(ROOT) or ".venv" in path.parts:
            return None
        return super().from_function(py_func, py_file)
