"""Parts of the documentation that `make docs` writes: `<!-- make docs PART=name place -->` to the next `<!-- end -->`.

The place tells several parts of one name apart; a part with a single place has none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from flicker.errors import FlickerError
from flicker.output import write_text
from flicker.toolchain import ROOT

END = "<!-- end -->"
# Any comment that names the command is a mark; what does not read on as one is an error, not text.
END_LINE = re.compile(f"^{END}$", re.M)
MARK = re.compile(r"^<!-- make docs PART=(?P<rest>.*?) ?-->$", re.M)

Place = tuple[str, str]  # part, place


def all_pages(root: Path = ROOT) -> list[Path]:
    """Where marks may stand."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def mark(place: Place) -> str:
    """The line before a place."""
    return f"<!-- make docs PART={' '.join(filter(None, place))} -->"


def _pieces(text: str, page: Path) -> list[tuple[Place, int, int]]:
    """(place, begin, end) of the text between marks."""
    found = []
    for match in MARK.finditer(text):
        words = match["rest"].split()
        end = END_LINE.search(text, match.end())
        following = MARK.search(text, match.end())
        if not 1 <= len(words) <= 2 or end is None or (following is not None and following.start() < end.start()):
            raise FlickerError(f"{page}: {match[0]}: must name a part and at most a place, and end with {END}")
        found.append(((words[0], words[1] if len(words) == 2 else ""), match.end() + 1, end.start()))
    return found


def places(root: Path = ROOT) -> dict[Place, Path]:
    """Page of every place. Raises FlickerError for a place that is there twice or has no end."""
    found: dict[Place, Path] = {}
    for page in all_pages(root):
        for place, _, _ in _pieces(page.read_text(), page):
            if place in found:
                raise FlickerError(f"{page}: {mark(place)} is also in {found[place]}")
            found[place] = page
    return found


def get(place: Place, root: Path = ROOT) -> str:
    """Text of a place, without the line feed at its end. Raises FlickerError if there is no such place."""
    for page in all_pages(root):
        text = page.read_text()
        for other, begin, end in _pieces(text, page):
            if other == place:
                return text[begin:end].rstrip("\n")
    raise FlickerError(f"docs: no page has {mark(place)}")


def put(texts: Mapping[Place, str], root: Path = ROOT) -> list[Path]:
    """Replace the text of places; returns the pages that changed. Raises FlickerError, before anything is written, for a place that no page has."""
    where = places(root)
    for place in texts:
        if place not in where:
            raise FlickerError(f"docs: no page has {mark(place)}")
    changed = []
    for page in dict.fromkeys(where[place] for place in texts):
        old = text = page.read_text()
        for place, begin, end in reversed(_pieces(text, page)):
            if place in texts:
                text = f"{text[:begin]}{texts[place].strip()}\n{text[end:]}"
        if text != old:
            write_text(page, text)
            changed.append(page)
    return changed
