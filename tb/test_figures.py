"""Block diagrams: the pictures in docs/images/ are those of docs/figures/, each is on a page, and text that is wrong is refused in one line.

Not covered: whether a figure shows what the RTL does; names of modules in it are checked.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import check_pages
import gen_figures
import pytest

from flicker.errors import FlickerError
from flicker.toolchain import ROOT

SMALL = """title: Small
grid:
  a  b  c
  .  d  c
box a = flk_fifo | first
box b *4 = B & C
plain c = outside
box d = D
group g = Both: b d
a -> b: label
b -> d
a -> d: bent
c <-> b
"""


def test_pictures_are_those_of_the_figures() -> None:
    assert gen_figures.stale(gen_figures.pictures()) == []


def test_every_picture_is_on_a_page() -> None:
    shown = {check_pages.leads_to(page, target) for page in check_pages.pages() for _, target in check_pages.links_of(page.read_text())}
    assert gen_figures.pictures().keys() - shown == set()


def test_names_in_figures_are_modules() -> None:
    modules = {path.stem for path in (ROOT / "rtl").rglob("*.sv")}
    for path in gen_figures.SOURCES.glob("*.fig"):
        for name in re.findall(r"\bflk_\w+\*?", path.read_text()):
            assert any(m.startswith(name[:-1]) for m in modules) if name.endswith("*") else name in modules, (path.name, name)


def test_small_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figure = gen_figures.read(SMALL, "small.fig")
    rects, width, height = gen_figures.rectangles(figure)
    assert rects["a"].x1 < rects["b"].x0 and rects["b"].y1 < rects["d"].y0 and rects["c"].y1 == rects["d"].y1
    assert rects["g"].x0 < rects["d"].x0 and rects["g"].y0 < rects["b"].y0
    assert all(0 < r.x0 < r.x1 < width and 0 < r.y0 < r.y1 < height for r in rects.values())
    root = ET.fromstring(gen_figures.draw(figure, "small.fig"))
    texts = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
    assert set(texts) == {"flk_fifo", "first", "B & C", "outside", "D", "Both", "label", "bent"}
    assert len(list(root.iter("{http://www.w3.org/2000/svg}polyline"))) == 4
    assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) == 5  # heads; one stream has two
    monkeypatch.setattr(gen_figures, "PICTURES", tmp_path)
    assert gen_figures.stale({tmp_path / "small.svg": "x"}) == ["small.svg"]
    (tmp_path / "small.svg").write_text("x")
    assert gen_figures.stale({tmp_path / "small.svg": "x"}) == [] and gen_figures.stale({}) == ["small.svg"]


@pytest.mark.parametrize("change, message", [
    (("title: Small\n", ""), "f:1: a figure has a title and a grid"),
    (("  .  d  c", "  .  d"), "f:4: 2 columns, not 3"),
    (("  .  d  c", "  .  e  c"), "f:4: no box e"),
    (("  .  d  c", "  c  d  c"), "f:7: c is no rectangle of the grid"),
    (("box d = D\n", ""), "f:4: no box d"),
    (("box d = D\n", "box d = D\nbox d = E\n"), "f:9: d is there twice"),
    (("box d = D\n", "box d = D\nbox e = E\n"), "f:9: e is not in the grid"),
    (("Both: b d", "Both: b x"), "f:9: no x before this line"),
    (("b -> d", "b -> x"), "f:11: no box x"),
    (("b -> d", "b => d"), "f:11: not understood: b => d"),
])
def test_wrong_figures(change: tuple[str, str], message: str) -> None:
    text = SMALL.replace(*change)
    assert text != SMALL
    with pytest.raises(FlickerError) as caught:
        gen_figures.read(text, "f")
    assert str(caught.value) == message


def test_line_through_a_box() -> None:
    with pytest.raises(FlickerError, match=r"^docs/figures/f:14: the line runs through b$"):
        gen_figures.draw(gen_figures.read(SMALL + "a -> c\n", "f"), "f")
