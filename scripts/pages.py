"""Parts of the documentation that scripts write: `<!-- NAME -->` to the next `<!-- end -->`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flicker.errors import FlickerError

END = "<!-- end -->"


def put(page: Path, name: str, text: str) -> None:
    """Replace the part `name` of a page. Raises FlickerError if it is not there once."""
    begin = f"<!-- {name} -->"
    pieces = page.read_text().split(begin)
    if len(pieces) != 2 or END not in pieces[1]:
        raise FlickerError(f"{page}: not one part {begin} ... {END}")
    page.write_text(f"{pieces[0]}{begin}\n{text.strip()}\n{END}{pieces[1].split(END, 1)[1]}")


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (heads, ["---"] * len(heads), *rows))
