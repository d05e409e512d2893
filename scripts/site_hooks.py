"""Hooks of mkdocs (`make site`): pages outside docs/ become part of the site, links between files of the repository become links of the site.

README.md, CONTRIBUTING.md and sw/README.md are pages with the names of `check_pages.VIRTUAL`; other files that pages link to are copied.
"""

from __future__ import annotations

import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from pymdownx.slugs import slugify

sys.path.insert(0, str(Path(__file__).resolve().parent))
import check_pages  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]


def on_config(config: Any) -> Any:
    """Anchors as GitHub makes them."""
    config["mdx_configs"].setdefault("toc", {})["slugify"] = slugify(case="lower")
    return config


def site_name(path: str) -> str | None:
    """Name in the site of a file of the repository; None where it has none."""
    for name, source in check_pages.VIRTUAL.items():
        if path == source:
            return name
    return path.removeprefix("docs/") if path.startswith("docs/") else None


def repository_name(uri: str) -> str:
    """File of the repository that a page of the site is made of."""
    return check_pages.VIRTUAL.get(uri, f"docs/{uri}")


def copied() -> dict[str, str]:
    """Files that are no pages and lie outside docs/, to which pages link: name in the site."""
    found = {}
    for page in check_pages.pages(ROOT):
        for _, target in check_pages.links_of(page.read_text()):
            aim = check_pages.leads_to(page, target)
            if not check_pages.is_outer(target) and aim.is_file() and site_name(path := aim.relative_to(ROOT).as_posix()) is None:
                found[path] = f"files/{path}" if "." in aim.name else f"files/{path}.txt"
    return found


def on_files(files: Files, config: Any) -> Files:
    for name, source in check_pages.VIRTUAL.items():
        files.append(File.generated(config, name, content=(ROOT / source).read_text()))
    for path, name in copied().items():
        files.append(File.generated(config, name, content=(ROOT / path).read_bytes()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links by names of the site; blank lines where Python-Markdown wants them and GitHub does not."""
    uri = page.file.src_uri
    here, others = Path(repository_name(uri)), copied()

    def name_in_site(match: re.Match[str]) -> str:
        target, hash_, anchor = match[2].partition("#")
        if not target or check_pages.is_outer(match[2]):
            return match[0]
        path = posixpath.normpath((here.parent / target).as_posix())
        name = site_name(path) or others.get(path, path)
        return f"{match[1]}({posixpath.relpath(name, posixpath.dirname(uri) or '.')}{hash_}{anchor})"

    lines: list[str] = []
    inside = False
    for line in markdown.splitlines():
        fence = line.lstrip().startswith("```")
        if not inside and not fence:
            line = re.sub(r"(\])\(([^)\s]+)\)", name_in_site, line)
            before = lines[-1] if lines else ""
            starts_list = re.match(r"\s*([-*]|\d+\.) ", line) and before.strip() and not re.match(r"\s*([-*]|\d+\.) |\s{2,}", before)
            if starts_list or before.startswith("<!--") or (line.startswith("<!--") and before.strip()):
                lines.append("")
            indent = re.match(r" {2,3}(?=\S)", line)
            if indent and not line.startswith("    "):
                line = "    " + line.lstrip()
        elif fence and not inside and lines and lines[-1].strip():
            lines.append("")
        inside ^= fence
        lines.append(line)
    return "\n".join(lines) + "\n"
