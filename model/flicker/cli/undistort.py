"""`flicker undistort`: photographs without the distortion of their lenses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import RichSteps, console


def undistort(
    dataset: Annotated[Path, typer.Argument(help="folder with transforms.json, or the file")],
    out: Annotated[Path, typer.Option("--out", "-o", help="new folder: images/ and transforms.json")],
    size: Annotated[int | None, typer.Option(help="longer side of the pictures in pixels; larger ones are averaged", min=16)] = None,
) -> None:
    """Take lens distortion and an off-centre principal point out of posed photographs, for `flicker fit`."""
    from ..fit.undistort import undistort as write

    with RichSteps().bar("photographs") as report:
        sizes = write(dataset, out, size, report)
    smallest, largest = min(sizes), max(sizes)
    console.print(f"{out}: {len(sizes)} photographs, {smallest[0]}x{smallest[1]}" + (f" to {largest[0]}x{largest[1]}" if smallest != largest else ""))
