"""`make docs PART=view`: the viewer in a headless browser (scripts/view_page.py), in docs/results/view.md, with the picture of docs/guide/view.md."""

from __future__ import annotations

import browser
import view_page

from .common import Say, scenes_missing


def missing() -> str | None:
    return browser.missing() or scenes_missing()


def draw(say: Say) -> str:
    say("picture")
    return view_page.draw()


def tables(say: Say) -> dict[str, str]:
    return view_page.tables(say)
