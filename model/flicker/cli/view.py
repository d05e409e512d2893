"""`flicker view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import FlickerError
from ..params import SortOrder
from .options import (
    BACKGROUND_HELP,
    CAMERAS_HELP,
    ORDER_HELP,
    SIZE_HELP,
    RichSteps,
    background_of,
    check_scene,
    check_there,
    console,
    parse_size,
    say_source,
    writable_folder,
)

MAX_PIXELS = 3840 * 2160


def view(
    scene: Annotated[str, typer.Argument(help="scene as for flicker render, or demo")],
    cameras: Annotated[Path | None, typer.Option(help=CAMERAS_HELP)] = None,
    number: Annotated[int, typer.Option("--view", help="number of the camera to begin with")] = 0,
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    size: Annotated[str, typer.Option(help=SIZE_HELP)] = "640x360",
    background: Annotated[str, typer.Option(help=BACKGROUND_HELP)] = "black",
    order: Annotated[SortOrder, typer.Option(help=ORDER_HELP)] = SortOrder.DEPTH,
    folder: Annotated[Path, typer.Option("--dir", help="where still pictures and their cameras.json go")] = Path("build/view"),
    host: Annotated[str, typer.Option(help="address to listen on; 0.0.0.0: all of this machine's")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="port to listen on; 0: any that is free", min=0, max=65535)] = 8080,
) -> None:
    """Look at a scene in a browser, rendered by the engines, with what it costs."""
    wanted = parse_size(size)
    assert wanted is not None
    if wanted[0] * wanted[1] > MAX_PIXELS:
        raise FlickerError(f"--size: {size} is more than {MAX_PIXELS:,} pixels")
    writable_folder(folder, "--dir")
    behind = background_of(background)
    check_scene(scene)
    check_there(cameras)
    steps = RichSteps()
    with steps.step("starting"):
        from ..front.view import view_of
        from ..scene.sources import open_scene
        from ..view.server import Viewer, port_free
    port_free(host, port)  # before the scene is loaded
    with steps.step("loading the scene"):
        source = open_scene(scene, cameras, up)
        loaded = view_of(source, number, wanted, behind, order=order)
    with steps.step("rendering the first frame (compiling on the first run)"):
        viewer = Viewer(loaded, source.cameras, folder, host, port)
        viewer.prepare()
    say_source(source.file, source.cameras_from)
    console.print(f"{scene}: {viewer.url}", highlight=False, soft_wrap=True)
    try:
        viewer.serve()
    except KeyboardInterrupt:
        console.print("stopped")
    finally:
        viewer.stop()
