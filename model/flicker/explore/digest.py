"""What results depend on, as hashes: the code, and the content of files."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

# Rooms of the package that no stored result depends on: they run results, show them, or belong to the RTL.
_NOT_IN_RESULTS = ("cli", "report", "sim", "pipeline.py", "toolchain.py", "markdown.py")


@cache
def code_digest() -> str:
    """Of the package's code and tables."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package)
        if path.suffix in (".py", ".csv") and inside.parts[0] not in _NOT_IN_RESULTS:
            digest.update(str(inside).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def file_digest(path: Path) -> str:
    """Of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def key(*parts: object) -> str:
    """Name of a result from all that it depends on."""
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()[:24]
