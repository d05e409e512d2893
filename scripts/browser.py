"""A headless chromium of the system, for tests and pictures of the viewer."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import sync_playwright

CHROMIUM = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]  # WebGL without a GPU


def missing() -> str | None:
    """Why there is no browser, in one line; None where there is one."""
    return None if CHROMIUM else "no chromium (Debian: chromium)"


@contextmanager
def opened(size: tuple[int, int]) -> Iterator[Any]:
    """An empty page of playwright in a window of a size (width, height)."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        try:
            yield browser.new_page(viewport={"width": size[0], "height": size[1]})
        finally:
            browser.close()
