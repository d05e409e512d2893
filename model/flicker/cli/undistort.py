"""`flicker undistort`: photographs without the distortion of their lenses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .kept import printed
from .options import RichSteps


def undistort(
    dataset: Annotated[Path, typer.Argument(help="folder with transforms.json, or the file")],
    out: Annotated[Path, typer.Option("--out", "-o", help="new folder: images/ and transforms.json")],
    size: Annotated[int | None, typer.Option(help="longer side of the pictures in pixels; larger ones are averaged", min=16)] = None,
) -> None:
    """Take lens distortion and an off-centre principal point out of posed photographs, for `flicker fit`."""
    from ..fit.undistort import undistort as write

    with RichSteps().bar("photographs") as report:
        shots = write(dataset, out, size, report)
    sizes = sorted({(shot.camera.width, shot.camera.height) for shot in shots})
    models = sorted({shot.lens.model for shot in shots if shot.lens is not None})
    printed(f"{out}: {len(shots)} photographs ({', '.join(models)}), {' to '.join(f'{w}x{h}' for w, h in dict.fromkeys((sizes[0], sizes[-1])))}")
    for count, text in (
        (sum(bool(shot.turned) for shot in shots), "were turned upright, as EXIF says"),
        (sum(shot.masked for shot in shots), "have a mask, in masks/"),
        (sum(shot.solid() is not None for shot in shots), "had transparent parts, which are black"),
    ):
        if count:
            printed(f"{count} of them {text}")
