"""`flicker view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import FlickerError
from .options import RichSteps, check_scene, check_there, console, parse_size

MAX_PIXELS = 3840 * 2160


def view(
    scene: Annotated[str, typer.Argument(help="scene file, or demo")],
    cameras: Annotated[Path | None, typer.Option(help="INRIA cameras.json (default: beside the scene, else an orbit)")] = None,
    number: Annotated[int, typer.Option("--view", help="number of the camera to begin with")] = 0,
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    size: Annotated[str, typer.Option(help="WxH of the pictures; scales the focal lengths")] = "640x360",
    folder: Annotated[Path, typer.Option("--dir", help="where still pictures and their cameras.json go")] = Path("build/view"),
    host: Annotated[str, typer.Option(help="address to listen on; 0.0.0.0: all of this machine's")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="port to listen on; 0: any that is free", min=0, max=65535)] = 8080,
) -> None:
    """Look at a scene in a browser, rendered by the engines, with what it costs."""
    wanted = parse_size(size)
    assert wanted is not None
    if wanted[0] * wanted[1] > MAX_PIXELS:
        raise FlickerError(f"--size: {size} is more than {MAX_PIXELS:,} pixels")
    if folder.exists() and not folder.is_dir():
        raise FlickerError(f"--dir: {folder}: not a folder")
    check_scene(scene)
    check_there(cameras)
    steps = RichSteps()
    with steps.step("starting"):
        from ..front.view import DEMO, load_view
        from ..scene.camera import find_cameras
        from ..scene.demo import demo_cameras
        from ..view.server import Viewer, port_free
    for option, given in (("cameras", cameras), ("up", up)):
        if scene == DEMO and given is not None:
            raise FlickerError(f"--{option}: not for the demo scene, which has its own cameras")
    port_free(host, port)  # before the scene is loaded
    with steps.step("loading the scene"):
        loaded = load_view(scene, number, wanted, cameras, up)
    found = demo_cameras() if scene == DEMO else find_cameras(loaded.scene, cameras, up)
    with steps.step("rendering the first frame (compiling on the first run)"):
        viewer = Viewer(loaded, found, folder, host, port)
        viewer.prepare()
    console.print(f"{scene}: {viewer.url}", highlight=False, soft_wrap=True)
    try:
        viewer.serve()
    except KeyboardInterrupt:
        console.print("stopped")
    finally:
        viewer.stop()
