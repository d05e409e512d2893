"""Pages: what they name exists, links lead to all of them, they are short and of their folder's kind, in the field's words; the site can be built.

Commands of pages are run by tb/model/test_commands.py, tables are held by tb/test_docs.py. Every check is a function of text or of a tree of pages and is
seen to fail here on one that is wrong. Not covered: whether what a page says of a block is right, but for what other tests compare.
"""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import check_pages
import pytest
from flicker_tb.doc_commands import commands_of, words_of

from flicker.toolchain import ROOT

PAGES = check_pages.pages()
IDS = [page.relative_to(ROOT).as_posix() for page in PAGES]
KINDS = ("guide", "reference", "results", "decisions")
LONGEST = {"guide": 200, "reference": 200, "decisions": 80}  # lines of a page
WRITTEN = 4_000  # lines of guide, reference and decisions together, without what commands write between marks
COLUMNS = 260  # of a line of prose; rows of tables are as long as they are
GENERATED = re.compile(r"^<!-- make (?:docs|generate)\b.*?-->\n.*?^<!-- end(?: of \w+)? -->$", re.M | re.S)
CODE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
SECTIONS = ("Figure", "Stages", "Ports", "Parameters", "Limits", "Verification")  # of reference pages, in this order where they are there

# Words that no page has: those of a diary, and those of our own with what the field says (docs/glossary.md).
DIARY = (
    r"(?:was|were) tried", r"tried (?:once|beside|and stopped)", r"before it did", r"used to (?:be|have|do)", r"no longer(?! than)", r"measured once",
    r"once,? by", r"previously", r"formerly", r"nowadays", r"so far,", r"has been changed",
)
PRIVATE = {
    r"answer(?:s|ed|ing)?": "response, respond", r"ask(?:s|ed)? for": "request", r"patience": "starvation limit", r"(?:a|the|its) watch": "watchdog, time-out",
    r"rooms": "packages", r"told": "reported, notified", r"(?:preprocessing|front[- ]end) lanes?": "preprocessing core",
}

# What somebody who has never seen the repository wants to know: the page that says it, and words that are on it.
QUESTIONS = (
    ("How do I get a first picture?", "docs/guide/first_frame.md", "make demo"),
    ("Which module sorts the tile lists, and where is its page?", "docs/reference/inventory.md", "[`flk_sorting_unit`"),
    ("How do I draw a scene from Python?", "docs/reference/api/index.md", "Drawing(Engine.GOLDEN"),
    ("How many KB of memory does the chip have?", "docs/results/chip_memory.md", "| chip | all |"),
    ("What happens when the memory responds with SLVERR?", "docs/reference/chip_ports.md", "SLVERR and DECERR end the frame with an error"),
    ("How do I add a mask generator?", "docs/guide/extending.md", "one entry in `GENERATORS`"),
    ("Why are lanes the default?", "docs/decisions/010-lanes-by-default.md", "Cycles alone favour large builds"),
    ("What does the paper's configuration cost on flowers?", "docs/results/frames.md", "| `faithful` | FLICKER as in the paper |"),
    ("What does software do after a time-out?", "docs/guide/programming.md", "`flk_reset`"),
    ("How do I run the tests of one unit?", "docs/guide/testing.md", "`make sim UNIT=stream_cells`"),
)


def kind_of(page: Path) -> str:
    """The folder below docs/, also of a page in a folder of that one; none of other pages."""
    return next((kind for kind in KINDS if (ROOT / "docs" / kind) in page.parents), "")


def written(text: str) -> str:
    """A page without what commands write between marks."""
    return GENERATED.sub("", text)


def prose(text: str) -> str:
    """What a person wrote in sentences: no generated text, no fenced blocks, no code."""
    return CODE.sub("code", "\n".join(line for _, line in check_pages.prose(written(text))))


def code_of(text: str) -> Iterator[str]:
    """Inline code outside of what commands write."""
    for _, line in check_pages.prose(written(text)):
        yield from CODE.findall(line)


# ---- links ----------------------------------------------------------------------------------------


def test_links_lead_somewhere() -> None:
    assert check_pages.broken_links() == []
    assert check_pages.unlisted() == []
    assert check_pages.unreachable() == []
    assert check_pages.misnamed() == []


TREE = {
    "README.md": "[a](docs/a.md) [b](docs/b.md#two-words) ![c](docs/c.png)\n", "docs/a.md": "# A\n`[x](none.md)`\n```\n[y](none.md)\n```\n[up](../README.md)\n",
    "docs/b.md": "# B\n## Two `words`\n## A, b: (c)\n[here](#a-b-c)\n", "docs/c.png": "", "mkdocs.yml": "nav: [project.md, {Rest: [a.md, {B: b.md}]}]\n",
}


def tree(root: Path, changes: Mapping[str, str]) -> Path:
    for name, text in {**TREE, **changes}.items():
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(text)
    return root


def test_links_of_a_right_tree(tmp_path: Path) -> None:
    root = tree(tmp_path, {})
    assert check_pages.broken_links(root) == check_pages.unlisted(root) == check_pages.unreachable(root) == []


@pytest.mark.parametrize("check,changes,finding", [
    ("broken_links", {"docs/a.md": "[x](none.md)\n"}, "docs/a.md:1: no file none.md"),
    ("broken_links", {"docs/a.md": "[x](b.md#three)\n"}, "docs/a.md:1: no heading for b.md#three"),
    ("broken_links", {"docs/a.md": "![x](d.png)\n"}, "docs/a.md:1: no file d.png"),
    ("broken_links", {"docs/a.md": "a [two\nwords](none.md)\n"}, "docs/a.md:2: no file none.md"),
    ("unlisted", {"docs/d.md": "\n"}, "mkdocs.yml: nav lacks d.md"),
    ("unlisted", {"mkdocs.yml": "nav: [project.md, a.md, b.md, d.md]\n"}, "mkdocs.yml: nav names d.md, which is not there"),
    ("unreachable", {"docs/d.md": "[x](a.md)\n"}, "docs/d.md: no links lead here from README.md"),
    ("misnamed", {"rtl/x.sv": "// docs/a.md\n// (docs/d.md)\n"}, "rtl/x.sv:2: no page docs/d.md"),
])
def test_broken_links_are_found(check: str, changes: dict[str, str], finding: str, tmp_path: Path) -> None:
    assert getattr(check_pages, check)(tree(tmp_path, changes)) == [finding]


def test_questions_are_answered_within_three_links() -> None:
    assert len(QUESTIONS) == 10
    far = check_pages.distances()
    for question, page, words in QUESTIONS:
        assert words in (ROOT / page).read_text(), question
        assert far[ROOT / page] <= 3, (question, far[ROOT / page])


@pytest.mark.slow
def test_site_is_built(tmp_path: Path) -> None:
    """Strict: mkdocs finds nothing; the pages outside docs/ are in it and search knows them."""
    done = subprocess.run([Path(sys.executable).parent / "mkdocs", "build", "--strict", "--site-dir", tmp_path], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    made = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.html")}
    assert {"index.html", "project.html", "contributing.html", "driver.html", "guide/first_frame.html"} <= made
    assert len(made) > len(PAGES) - 1
    assert "flk_sorting_unit" in (tmp_path / "search" / "search_index.json").read_text()
    assert 'href="docs/' not in (tmp_path / "project.html").read_text()
    assert 'id="flicker.front.view.load_view"' in (tmp_path / "reference" / "api" / "pictures.html").read_text()


API = re.compile(r"^::: flicker((?:\.\w+)+)$", re.M)


def without_docstring(source: str) -> list[str]:
    """Public functions, classes and methods of a module, and the module, that have none."""
    tree = ast.parse(source)
    found = [] if ast.get_docstring(tree) else ["module"]
    for node in (inner for outer in tree.body for inner in (outer, *(outer.body if isinstance(outer, ast.ClassDef) and outer.name[0] != "_" else ()))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_") and not ast.get_docstring(node):
            found.append(node.name)
    return found


@pytest.mark.parametrize("name", sorted({name for page in PAGES for name in API.findall(page.read_text())}))
def test_api_has_docstrings(name: str) -> None:
    """What a page of the API shows says what it is: mkdocstrings leaves out what has no docstring."""
    path = ROOT / "model" / "flicker" / Path(*name.split(".")[1:])
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    assert without_docstring(source.read_text()) == []


def test_missing_docstrings_are_found() -> None:
    assert without_docstring('"""m."""\ndef f():\n    """d."""\ndef g(): pass\ndef _h(): pass\nclass C:\n    def i(): pass\n') == ["g", "C", "i"]
    assert without_docstring("x = 1\n") == ["module"]


# ---- what pages name exists -------------------------------------------------------------------------


FOLDERS = "rtl|model|tb|scripts|sw|soc|docs|formal|lint"


def missing_paths(text: str) -> list[str]:
    """Paths of the repository in inline code that are not there; with a placeholder nothing is said of them."""
    found = []
    for code in code_of(text):
        for word in code.split():
            if re.fullmatch(rf"(?:{FOLDERS})/[\w./*-]+", word):
                path = word.rstrip("/")
                if not (list(ROOT.glob(path)) if "*" in path else (ROOT / path).exists()):
                    found.append(word)
    return found


@cache
def names_in(path: Path) -> set[str]:
    """Names that a Python file defines at any depth or imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.ImportFrom | ast.Import):
            found |= {alias.asname or alias.name for alias in node.names}
    return found


def resolves(dotted: str) -> bool:
    """A package, a module, or a name in one."""
    root, *rest = dotted.split(".")
    at = ROOT / ("model" if root == "flicker" else "tb") / root
    while rest:
        if (at / rest[0]).is_dir():
            at = at / rest.pop(0)
        elif (at / f"{rest[0]}.py").exists():
            at, rest = at / f"{rest[0]}.py", rest[1:]
            break
        else:
            at = at / "__init__.py"
            break
    return not rest or (at.suffix == ".py" and at.exists() and all(name in names_in(at) for name in rest))


def missing_modules(text: str) -> list[str]:
    """`flicker.x.y` and `flicker_tb.x`, and imports in blocks of Python, that name nothing."""
    found = []
    for dotted in re.findall(r"(?<![\w/.-])flicker(?:_tb)?(?:\.[A-Za-z_]\w*)+", written(text)):
        if dotted.rpartition(".")[2] not in ("core", "lib", "md", "mp4", "webm") and not resolves(dotted):
            found.append(dotted)
    for block in re.findall(r"^```python\n(.*?)^```", text, re.M | re.S):
        for module, names in re.findall(r"^from (flicker(?:_tb)?[\w.]*) import ([\w, ]+)", block, re.M):
            found += [f"{module}.{name}" for name in names.replace(" ", "").split(",") if not resolves(f"{module}.{name}")]
    return found


@cache
def sources() -> str:
    """Everything that may define a name of the hardware, of its benches or of the driver."""
    folders = (ROOT / "rtl", ROOT / "sw", ROOT / "soc", ROOT / "formal", ROOT / "tb" / "top")
    files = [path for folder in folders for path in sorted(folder.rglob("*")) if path.suffix in (".sv", ".h", ".c", ".rdl")]
    return "\n".join(path.read_text() + path.stem for path in files)


@cache
def hardware_names() -> frozenset[str]:
    return frozenset(re.findall(r"\bflk_\w+", sources()))


def missing_hardware(text: str) -> list[str]:
    """`flk_...` in inline code that neither RTL nor driver nor proofs have; as the beginning of a name with * or _."""
    found = []
    for code in code_of(text):
        for name in re.findall(r"\bflk_\w+", code):
            begins = name.endswith("_")
            if not (any(known.startswith(name) for known in hardware_names()) if begins else name in hardware_names()):
                found.append(name)
    return found


@cache
def targets() -> frozenset[str]:
    return frozenset(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.M))


@cache
def options() -> dict[str, frozenset[str]]:
    """Options of every command of `flicker`, by command."""
    from typer.main import get_command

    from flicker.cli.main import app

    return {
        name: frozenset(o for p in command.params for o in (*p.opts, *p.secondary_opts) if o.startswith("-")) | {"--help"}
        for name, command in get_command(app).commands.items()
    }


# Options in inline code that are not those of `flicker`, and whose they are.
OTHERS = {
    "--version": "flicker", "--slow": "pytest", "--target": "FuseSoC", "--cores-root": "FuseSoC", "--Stage": "FuseSoC", "--json-only": "Verilator",
    "--lint-only": "Verilator", "--list": "scripts/docs.py", "--check": "scripts/gen_*.py", "--unit": "scripts", "--config": "scripts", "--jobs": "scripts",
}


def missing_commands(text: str) -> list[str]:
    """Targets of make, commands of `flicker` and options that there are not, in commands and in inline code."""
    found = []
    typed = {part.strip() for code in code_of(text) for part in code.split("&&")}
    for command in {*commands_of(text), *(code for code in typed if re.match(r"(?:make|flicker) ", code))}:
        try:
            words = words_of(command)
        except ValueError:
            words = command.split()
        name = Path(words[0]).name
        if name == "make":
            found += [f"make {word}" for word in words[1:] if "=" not in word and word[0] != "[" and word not in targets()]
        elif name == "flicker" and len(words) > 1 and not words[1].startswith("-"):
            if words[1] not in options():
                found.append(f"flicker {words[1]}")
                continue
            given = [word.partition("=")[0] for word in words[2:] if re.fullmatch(r"--[a-z]\S*", word)]
            found += [f"flicker {words[1]} {option}" for option in given if option not in options()[words[1]]]
    every = {option for there in options().values() for option in there} | OTHERS.keys()
    for code in code_of(text):
        found += [option for option in re.findall(r"(?<![\w-])--[A-Za-z][\w-]*", code) if re.match(r"--", code) and option not in every]
    return found


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_what_a_page_names_exists(page: Path) -> None:
    text = page.read_text()
    assert missing_paths(text) == [], "paths"
    assert missing_modules(text) == [], "modules"
    assert missing_hardware(text) == [], "hardware"
    assert missing_commands(text) == [], "commands"


def test_what_is_missing_is_found() -> None:
    assert missing_paths("`rtl/flk_none.sv` `rtl/flk_top.sv` `rtl/*/flk_ctu.sv` `tb/<unit>.py` `rtl/none*`") == ["rtl/flk_none.sv", "rtl/none*"]
    text = "`flicker.params.RenderConfig` `flicker.none.x` `flicker.cli.none` `flicker_tb.bench.config()` `flicker.sweep`\n"
    text += "```python\nfrom flicker.params import Nothing\n```\n"
    assert missing_modules(text) == ["flicker.none.x", "flicker.cli.none", "flicker.sweep", "flicker.params.Nothing"]
    assert missing_hardware("`flk_top` `flk_none` `flk_probe` `flk_fp_*` `flk_zz_*`") == ["flk_none", "flk_zz_"]
    text = "`make none` `make demo` `flicker none x` `flicker render SCENE --nonesuch` `--lanes 32` `--notthere`\n```\nflicker view scene.ply --wrong 1\n```\n"
    assert sorted(missing_commands(text)) == ["--notthere", "flicker none", "flicker render --nonesuch", "flicker view --wrong", "make none"]


def test_every_option_is_on_a_page() -> None:
    """Commands of `flicker` and their options."""
    text = "\n".join(page.read_text() for page in PAGES)
    for command, there in options().items():
        assert f"`flicker {command}" in text, command
        for option in there - {"--help"}:
            assert not option.startswith("--") or re.search(rf"(?<![\w-]){option}(?![\w-])", text), (command, option)


# ---- everything has its page ------------------------------------------------------------------------


def test_every_module_and_package_has_its_page() -> None:
    """Modules of rtl/ are in the inventory, its folders and the packages of model/ on the page of the architecture."""
    inventory, architecture = ((ROOT / "docs" / name).read_text() for name in ("reference/inventory.md", "architecture.md"))
    modules = {path.stem for path in (ROOT / "rtl").rglob("*.sv")}
    assert modules - set(re.findall(r"\bflk_\w+", inventory)) == set()
    folders = {path.name for path in (ROOT / "rtl").iterdir() if path.is_dir()}
    assert folders == set(re.findall(r"`rtl/(\w+)/`", architecture))
    package = ROOT / "model" / "flicker"
    packages = {path.stem for path in package.iterdir() if (path / "__init__.py").exists() or (path.suffix == ".py" and path.stem != "__init__")}
    assert packages - set(re.findall(r"`flicker\.(\w+)", architecture)) == set()
    assert "flk_render_stage" in architecture and "flk_lane_stage" in architecture


def test_numbers_of_the_readme() -> None:
    """Each is a link to a page that has it."""
    rows = [line for line in (ROOT / "README.md").read_text().splitlines() if re.match(r"\| \[[\d.,]+\]", line)]
    assert len(rows) == 5 and all(row.strip("| ").split(" | ")[-1] for row in rows)
    for number, page in re.findall(r"\[([\d.,]+)\]\((\S+?)\)", "\n".join(rows)):
        assert re.search(rf"(?<![\d.,]){re.escape(number)}(?![\d.]|,\d)", (ROOT / page).read_text()), (number, page)


def test_readme_fits_two_screens() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 100


# ---- kinds of pages -----------------------------------------------------------------------------------


@pytest.mark.parametrize("page", [page for page in PAGES if kind_of(page) in LONGEST], ids=lambda page: f"{page.parent.name}/{page.name}")
def test_length(page: Path) -> None:
    assert len(page.read_text().splitlines()) <= LONGEST[kind_of(page)]


def test_length_of_all() -> None:
    assert sum(len(written(page.read_text()).splitlines()) for page in PAGES if kind_of(page) in LONGEST) <= WRITTEN


def long_lines(text: str) -> list[str]:
    return [line[:60] for _, line in check_pages.prose(written(text)) if len(line) > COLUMNS and not line.startswith(("|", "!["))]


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_lines_can_be_read(page: Path) -> None:
    assert long_lines(page.read_text()) == []


def by_hand(text: str) -> list[str]:
    """Rows of tables that no command writes."""
    return [line[:60] for line in written(text).splitlines() if line.startswith("|")]


@pytest.mark.parametrize("page", [page for page in PAGES if kind_of(page) == "results"], ids=lambda page: page.name)
def test_results_are_generated(page: Path) -> None:
    """Tables under marks, and how they come about: a command and sentences."""
    text = page.read_text()
    assert by_hand(text) == [] and GENERATED.search(text) and "make docs PART=" in written(text)


def out_of_order(text: str) -> list[str]:
    """Fixed sections of a reference page behind one that should follow them."""
    there = [match[1] for match in re.finditer(r"^## (.+?)$", text, re.M) if match[1] in SECTIONS]
    return [b for a, b in zip(there, there[1:]) if SECTIONS.index(b) < SECTIONS.index(a)]


@pytest.mark.parametrize("page", [page for page in PAGES if kind_of(page) == "reference"], ids=lambda page: page.name)
def test_sections_of_reference(page: Path) -> None:
    assert out_of_order(page.read_text()) == []


def lacking(text: str) -> list[str]:
    """Sections that a decision lacks."""
    return [name for name in ("Context", "Options", "Choice", "Consequence") if not re.search(rf"^## {name}s?$", text, re.M)]


@pytest.mark.parametrize("page", [page for page in PAGES if kind_of(page) == "decisions"], ids=lambda page: page.name)
def test_sections_of_decisions(page: Path) -> None:
    assert re.fullmatch(r"\d{3}-[a-z0-9-]+\.md", page.name) and lacking(page.read_text()) == []


def test_numbers_of_decisions_are_unique() -> None:
    numbers = [page.name[:3] for page in PAGES if kind_of(page) == "decisions"]
    assert len(set(numbers)) == len(numbers)


def test_wrong_pages_are_found() -> None:
    assert by_hand("| a |\n<!-- make docs PART=x -->\n| b |\n<!-- end -->\n") == ["| a |"]
    assert out_of_order("## Figure\n## Ports\n## Formats\n## Stages\n## Limits\n") == ["Stages"]
    assert lacking("## Context\n## Options\n## Choice\n") == ["Consequence"]
    assert long_lines("a" * 300 + "\n| " + "b" * 300 + "\n```\n" + "c" * 300 + "\n```\n") == ["a" * 60]


# ---- words ----------------------------------------------------------------------------------------------


def wrong_words(text: str) -> list[str]:
    """Words of a diary or of our own, with what to say instead."""
    said = prose(text)
    found = [f"{match[0]}: no diary" for words in DIARY for match in re.finditer(rf"\b(?:{words})", said, re.I)]
    return found + [f"{match[0]}: {better}" for words, better in PRIVATE.items() for match in re.finditer(rf"\b(?:{words})\b", said, re.I)]


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "glossary.md"], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_words(page: Path) -> None:
    assert wrong_words(page.read_text()) == []


def test_words_of_figures() -> None:
    for figure in sorted((ROOT / "docs" / "figures").glob("*.fig")):
        assert wrong_words(figure.read_text()) == [], figure.name


def test_wrong_words_are_found() -> None:
    text = "It was tried, and before it did. The memory answers; the watch told the Rooms. Not longer: no longer than 3. `answer`\n```\nwatch the answer\n```\n"
    assert [found.split(":")[0] for found in wrong_words(text)] == ["was tried", "before it did", "answers", "the watch", "Rooms", "told"]
    assert wrong_words("<!-- make docs PART=x -->\n| answer |\n<!-- end -->\n") == []
    assert all(shlex.split(better) for better in PRIVATE.values())
