#!/usr/bin/env python3
"""Measure the viewer in a headless browser and draw its picture for docs/guide/view.md; `make docs PART=view` does both.

    scripts/view_page.py [--picture FILE]

Measured on view 0 of flowers at 640x360 (FLICKER_SCENES; else the demo scene): seconds from the loaded scene to the first picture sent to the browser, and
pictures a second while the mouse drags. The kernels are compiled before, in another process.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import benchmark
import browser

from flicker import markdown
from flicker.errors import FlickerError
from flicker.front.view import DEMO, load_view
from flicker.params import RECOMMENDED, RenderConfig
from flicker.scene.camera import find_cameras
from flicker.scene.demo import demo_cameras
from flicker.toolchain import ROOT
from flicker.view.frames import Choice, Renderer
from flicker.view.server import Session, Viewer

PICTURE = ROOT / "docs" / "images" / "view.png"
SIZE = (640, 360)
WINDOW = (1280, 800)
DRAG = 10.0  # seconds
STAGES = {"lanes": RECOMMENDED, "channels": RenderConfig()}


def compile_kernels(scene: str) -> None:
    view = load_view(scene, 0, SIZE)
    renderer = Renderer(view)
    for config in STAGES.values():
        list(renderer.numbers(renderer.frame(view.camera, Choice(config=config, overlay="cycles"))))
        renderer.frame(view.camera, Choice(config=config), 2)


@contextmanager
def served(scene: str) -> Iterator[tuple[Viewer, float]]:
    """A viewer of a scene and the time at which the scene was loaded."""
    view = load_view(scene, 0, SIZE)
    loaded = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        viewer = Viewer(view, demo_cameras() if scene == DEMO else find_cameras(view.scene), Path(folder), port=0)

        def serve() -> None:
            viewer.prepare()
            viewer.serve()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield viewer, loaded
        finally:
            viewer.stop()
            thread.join()


def until(true: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            raise FlickerError("view: the browser's picture does not come")
        time.sleep(0.05)


def rested(viewer: Viewer) -> Session:
    """The browser's session, once it shows all there is."""
    until(lambda: viewer.sessions)
    session = next(iter(viewer.sessions.values()))
    until(lambda: session.pace.shown_divisor == 1 and session.more is None and not session.tasks and session.pace.due(time.monotonic())[0] == 0)
    return session


def dragged(page, session: Session) -> list[tuple[float, int]]:
    """What was sent while the mouse dragged in circles."""
    page.mouse.move(400, 400)
    page.mouse.down()
    began = time.monotonic()
    while (at := time.monotonic() - began) < DRAG:
        page.mouse.move(400 + 150 * (at % 2 - 1), 400 + 40 * (at % 3 - 1.5))
        time.sleep(0.03)
    sent = [entry for entry in session.sent if entry[0] > began]
    page.mouse.up()
    return sent


def tables(say: Callable[[str], None]) -> dict[str, str]:
    """The measured numbers."""
    scene = benchmark.default_scene()
    say("compiling")
    process = multiprocessing.get_context("spawn").Process(target=compile_kernels, args=(scene,))
    process.start()
    process.join()
    rows = []
    say("loading")
    with browser.opened(WINDOW) as page, served(scene) as (viewer, loaded):
        say("first picture")
        page.goto(viewer.url)
        until(lambda: any(session.sent for session in viewer.sessions.values()))
        session = next(iter(viewer.sessions.values()))
        rows.append(["first picture, seconds after the scene was loaded", f"{session.sent[0][0] - loaded:.1f}"])
        for stage, config in STAGES.items():
            say(f"moving, {stage}")
            session.a.stage.value = stage
            session.changed()
            until(lambda: session.frames[0].choice.config == config)
            rested(viewer)
            sent = dragged(page, session)
            coarsest = max((divisor for _, divisor in sent), default=1)
            rows.append([f"golden engine, {stage}: pictures a second while moving", f"{len(sent) / DRAG:.1f}, down to 1/{coarsest} of the size"])
            rested(viewer)
            rows.append([f"golden engine, {stage}: full frame at rest, seconds", f"{session.frames[0].seconds:.2f}"])
    about = f"{Path(scene).name}, view 0, {SIZE[0]}x{SIZE[1]}. Processor cores used: {os.cpu_count()}, the browser's drawing included."
    return {"": f"{about}\n\n{markdown.table(['what', 'measured'], rows)}"}


def draw(path: Path = PICTURE) -> str:
    """A picture of the viewer with the demo scene: lanes beside channels, these with the Gaussians that are visited."""
    with browser.opened((WINDOW[0], 960)) as page, served(DEMO) as (viewer, _):
        page.goto(viewer.url)
        session = rested(viewer)
        session.b.overlay.value, session.b.stage.value = "visited", "channels"
        session.comparing.value = True
        session.b.show()
        session.compare()
        until(lambda: len(session.frames) == 2 and session.frames[1].overlay is not None)
        rested(viewer)
        for note in page.locator(".mantine-Notification-closeButton").all():  # on drawing without a GPU
            note.click()
        time.sleep(2.0)  # the browser draws
        page.screenshot(path=path)
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    if reason := browser.missing():
        raise FlickerError(reason)
    if options.picture:
        print(draw(options.picture.resolve()))
    else:
        print(tables(lambda text: print(text, file=sys.stderr, flush=True))[""])
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        print(f"view_page: {error}", file=sys.stderr)
        sys.exit(2)
