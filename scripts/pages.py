"""Parts of the documentation that scripts write: `<!-- NAME -->` to the next `<!-- end -->`."""

from __future__ import annotations

from pathlib import Path

from flicker.errors import FlickerError

END = "<!-- end -->"


def _split(page: Path, name: str) -> tuple[str, str, str]:
    """Text before, in and after a part."""
    pieces = page.read_text().split(f"<!-- {name} -->\n")
    if len(pieces) != 2 or END not in pieces[1]:
        raise FlickerError(f"{page}: not one part <!-- {name} --> ... {END}")
    return (pieces[0], *pieces[1].split(END, 1))


def get(page: Path, name: str) -> str:
    """The part `name` of a page. Raises FlickerError if it is not there once."""
    return _split(page, name)[1]


def put(page: Path, name: str, text: str) -> None:
    """Replace the part `name` of a page. Raises FlickerError if it is not there once."""
    before, _, after = _split(page, name)
    page.write_text(f"{before}<!-- {name} -->\n{text.strip()}\n{END}{after}")
