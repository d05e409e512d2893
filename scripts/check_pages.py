#!/usr/bin/env python3
"""Checks the pages: every link and anchor leads somewhere, every page of docs/ is in `nav` of mkdocs.yml, links lead to every page from README.md, and pages
that comments of sources name are there.

Pages are README.md, CONTRIBUTING.md, sw/README.md and docs/**.md. Anchors are those of headings as GitHub and the site make them. Addresses of other
machines are not looked at. Part of `make lint`; the site itself is built by `make site`.
"""

from __future__ import annotations

import re
import sys
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from flicker.toolchain import ROOT

OUTSIDE = ("README.md", "CONTRIBUTING.md", "sw/README.md")  # pages that are not below docs/
VIRTUAL = {"project.md": "README.md", "contributing.md": "CONTRIBUTING.md", "driver.md": "sw/README.md"}  # their names in the site (scripts/site_hooks.py)
LINK = re.compile(r"!?\[(?:[^\]\[\n]|\n(?!\n))*\]\(([^)\s]+)\)")
SOURCES = {"rtl": ".sv .rdl", "model": ".py .cpp .hpp .vlt", "scripts": ".py", "tb": ".py .sv .toml", "formal": ".sv .toml", "sw": ".c .h", "lint": ".toml"}
NAMED = re.compile(r"(?<![\w/])docs/[\w/-]+\.md\b")
HEADING = re.compile(r"#{1,6} +(.+?) *#*$")


def pages(root: Path = ROOT) -> list[Path]:
    """Every page, README.md first."""
    return [*(root / name for name in OUTSIDE if (root / name).exists()), *sorted((root / "docs").rglob("*.md"))]


def prose(text: str) -> Iterator[tuple[int, str]]:
    """Lines outside fenced blocks, with their numbers."""
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            inside = not inside
        elif not inside:
            yield number, line


def links_of(text: str) -> Iterator[tuple[int, str]]:
    """Line and target of every link and picture, whose words may go over the end of a line; what stands in code is no link."""
    lines = [""] * (text.count("\n") + 1)
    for number, line in prose(text):
        lines[number - 1] = re.sub(r"`[^`]*`", "code", line)
    whole = "\n".join(lines)
    for match in LINK.finditer(whole):
        yield whole.count("\n", 0, match.start(1)) + 1, match[1]


def slug(heading: str) -> str:
    """Anchor of a heading."""
    words = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").replace("*", "")
    return re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")


def anchors_of(text: str) -> set[str]:
    """Anchors of a page; a heading that comes again has a number behind its anchor."""
    seen: dict[str, int] = {}
    found = set()
    for _, line in prose(text):
        if match := HEADING.match(line):
            anchor = slug(match[1])
            found.add(f"{anchor}-{seen[anchor]}" if anchor in seen else anchor)
            seen[anchor] = seen.get(anchor, 0) + 1
    return found


def is_outer(target: str) -> bool:
    return re.match(r"[a-z]+:", target) is not None


def leads_to(page: Path, target: str) -> Path:
    """The file that a link names."""
    path = target.partition("#")[0]
    return (page.parent / path).resolve() if path else page


def broken_links(root: Path = ROOT) -> list[str]:
    """Links to files and anchors that are not there."""
    texts = {page.resolve(): page.read_text() for page in pages(root)}
    anchors = {page: anchors_of(text) for page, text in texts.items()}
    found = []
    for page, text in texts.items():
        for number, target in links_of(text):
            if is_outer(target):
                continue
            where, aim, anchor = f"{page.relative_to(root)}:{number}", leads_to(page, target), target.partition("#")[2]
            if not aim.exists() or not aim.is_relative_to(root) or aim.is_dir():
                found.append(f"{where}: no file {target}")
            elif anchor and anchor not in anchors.get(aim, set()):
                found.append(f"{where}: no heading for {target}")
    return found


def listed(nav: object) -> Iterator[str]:
    """Pages that a nav of mkdocs.yml names."""
    if isinstance(nav, str):
        yield nav
    for inner in nav.values() if isinstance(nav, Mapping) else nav if isinstance(nav, list) else ():
        yield from listed(inner)


def unlisted(root: Path = ROOT) -> list[str]:
    """Pages that nav lacks, and names in nav without a page."""
    names = list(listed(yaml.safe_load((root / "mkdocs.yml").read_text())["nav"]))
    there = {page.relative_to(root / "docs").as_posix() for page in (root / "docs").rglob("*.md")} | {n for n, p in VIRTUAL.items() if (root / p).exists()}
    found = [f"mkdocs.yml: nav lacks {name}" for name in sorted(there - set(names))]
    found += [f"mkdocs.yml: nav names {name}, which is not there" for name in sorted(set(names) - there)]
    return found + [f"mkdocs.yml: nav names {name} twice" for name in sorted({name for name in names if names.count(name) > 1})]


def distances(root: Path = ROOT) -> dict[Path, int]:
    """Number of links from README.md to each page that links lead to."""
    known = {page.resolve() for page in pages(root)}
    far = {root / "README.md": 0}
    waiting = deque(far)
    while waiting:
        page = waiting.popleft()
        for _, target in links_of(page.read_text()):
            aim = leads_to(page, target)
            if not is_outer(target) and aim in known and aim not in far:
                far[aim] = far[page] + 1
                waiting.append(aim)
    return far


def unreachable(root: Path = ROOT) -> list[str]:
    far = distances(root)
    return [f"{page.relative_to(root)}: no links lead here from README.md" for page in pages(root) if page.resolve() not in far]


def misnamed(root: Path = ROOT) -> list[str]:
    """Pages that sources name and that are not there; tests of these checks have pages of their own."""
    found = []
    for folder, suffixes in SOURCES.items():
        for source in sorted((root / folder).rglob("*")):
            if source.suffix in suffixes.split() and source.name not in ("test_pages.py", "test_docs.py"):
                for number, line in enumerate(source.read_text().splitlines(), 1):
                    missing = [name for name in NAMED.findall(line) if not (root / name).exists()]
                    found += [f"{source.relative_to(root)}:{number}: no page {name}" for name in missing]
    return found


def main() -> int:
    findings = [*broken_links(), *unlisted(), *unreachable(), *misnamed()]
    for finding in findings:
        print(finding)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
