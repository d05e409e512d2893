"""Says of which hardware a stored result of synthesis is: a digest of the RTL as synthesis sees it, and of the cell library.

Comments, white space and what stands behind `ifndef SYNTHESIS do not count, so a reworded header leaves results valid.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from ..toolchain import FILELIST, ROOT

LIBERTY = ROOT / "scripts" / "cells" / "flicker.lib"

_COMMENT = re.compile(r'("(?:\\.|[^"\\])*")|//[^\n]*|/\*.*?\*/', re.S)
_WORD = re.compile(r'"(?:\\.|[^"\\])*"|[\w$`]+|[^\w\s]')
_SIMULATED = re.compile(r"`ifndef SYNTHESIS\b(?P<simulated>.*?)(?:`else\b(?P<built>.*?))?`endif\b", re.S)
_BUILT = re.compile(r"`ifdef SYNTHESIS\b(?P<built>.*?)(?:`else\b.*?)?`endif\b", re.S)


def words(text: str) -> list[str]:
    """Tokens of a source that synthesis reads, in order. Conditions on SYNTHESIS must not be nested."""
    text = _COMMENT.sub(lambda found: found[1] or " ", text)
    for pattern in (_SIMULATED, _BUILT):
        text = pattern.sub(lambda found: found["built"] or " ", text)
    return _WORD.findall(text)


def digest(sources: Iterable[Path]) -> str:
    """Twelve hexadecimal digits of sources by name and tokens; their order does not matter."""
    total = hashlib.sha256()
    for path in sorted(sources, key=lambda path: path.name):
        total.update("\0".join((path.name, *words(path.read_text()))).encode() + b"\0\0")
    return total.hexdigest()[:12]


def rtl_stamp() -> str:
    """Of everything below rtl/, the generated packages of parameters and tables included, and of the default cell library."""
    return digest([*FILELIST.parent.rglob("*.sv"), LIBERTY])


def stamp_of(text: str) -> str | None:
    """The stamp that a stored result carries, `RTL <digest>`; None where it has none."""
    found = re.search(r"\bRTL ([0-9a-f]{12})\b", text)
    return found[1] if found else None
