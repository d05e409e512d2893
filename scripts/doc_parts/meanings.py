"""`make docs PART=meanings`: what modules of the model say that they do, on the pages of the units that do the same."""

from __future__ import annotations

import ast
import re
import textwrap

from flicker.errors import FlickerError
from flicker.toolchain import ROOT

from .common import Say

# Pages of docs/reference/ and the modules of flicker whose docstrings they show.
MODULES = {
    "front_end": "golden.front.cull golden.front.splat golden.front.reach golden.front.colour",
    "colour_store": "golden.front.reuse",
    "lanes": "golden.lanes.lane golden.lanes.mask",
    "ff": "arithmetic.ff_tables",
    "mask_bounds": "explore.generators.exact explore.generators.rows",
    "list_sorter": "golden.long_lists",
}
COLUMNS = 200


def markdown_of(text: str, page: str) -> str:
    """A docstring as Markdown: paragraphs filled, what is indented as it stands. It does not name the page that it is on."""
    text = re.sub(rf"\s\(docs/reference/{page}\.md[^)]*\)|(?<=\.)\s[^.]*docs/reference/{page}\.md\.", "", text)
    blocks: list[list[str]] = [[]]
    for line in text.splitlines():
        code = line.startswith("    ")
        if not line:
            blocks.append([])
        elif blocks[-1] and blocks[-1][-1].startswith("    ") != code:
            blocks.append([line])
        else:
            blocks[-1].append(line)
    out: list[str] = []
    for block in filter(None, blocks):
        if block[0].startswith("    "):
            out.append("```\n" + textwrap.dedent("\n".join(block)) + "\n```")
        else:
            words = re.sub(r"(?<![`\w./-])((?:flicker|rtl|docs)[./][\w./]*\w|[a-z]+_\w+)(?![\w`/])", r"`\1`", " ".join(" ".join(block).split()))
            words = re.sub(r"`docs/reference/(\w+\.md)`", r"[\1](\1)", words).replace("|", "\\|").replace("<", "&lt;")
            out.append("\n".join(textwrap.wrap(words, COLUMNS, break_long_words=False, break_on_hyphens=False)))
    return "\n\n".join(out)


def tables(say: Say) -> dict[str, str]:
    found = {}
    for page, names in MODULES.items():
        texts = []
        for name in names.split():
            text = ast.get_docstring(ast.parse((ROOT / "model" / "flicker" / f"{name.replace('.', '/')}.py").read_text()), clean=False)
            if text is None:
                raise FlickerError(f"flicker.{name}: no docstring")
            texts.append(f"**`flicker.{name}`** " + markdown_of(text.strip(), page))
        found[page] = "\n\n".join(texts)
    return found
