"""`flicker grow`: a larger scene that looks much the same."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .convert import told
from .options import RichSteps, check_apart, check_scene, console, writable, write_atomically

SIZE = (640, 360)  # of the picture that is compared


def grow(
    scenes: Annotated[list[Path], typer.Argument(help="scene as for flicker render, or demo; several are put side by side")],
    out: Annotated[Path, typer.Option("--out", "-o", help="file to write, as for flicker convert")],
    times: Annotated[float, typer.Option(help="Gaussians for each of the scenes, split along their longest axis")] = 1.0,
    degree: Annotated[int | None, typer.Option(min=0, max=3, help="spherical harmonics: cut, or small ones added", show_default="as in the scene")] = None,
    seed: Annotated[int, typer.Option(min=0, help="which Gaussians are split once more where TIMES is no power of two, or get harmonics")] = 0,
) -> None:
    """Make a scene of more Gaussians, to measure how a frame grows with them; says how much the picture changed."""
    for scene in scenes:
        check_scene(scene)
    steps = RichSteps()
    with steps.step("starting"):
        from ..errors import FlickerError
        from ..front.projection import project
        from ..front.reference import render_reference
        from ..front.view import load_view
        from ..scene.grow import grown, joined, with_degree
        from ..scene.metrics import psnr
        from ..scene.write import Written, write_scene, writer_of
    suffix = writer_of(out)
    writable(out, "--out")
    for scene in scenes:
        check_apart(out, "--out", scene)
    views = []
    for scene in scenes:
        with steps.step(f"loading {scene}"):
            views.append(load_view(scene, 0, SIZE))
    before = views[0].scene if len(views) == 1 else joined([view.scene for view in views])
    with steps.step("splitting"):
        try:
            after = grown(before, times, seed)
        except FlickerError as error:
            raise FlickerError(f"--times: {error}") from error
        if degree is not None:
            after = with_degree(after, degree, seed)
    written: list[Written] = []
    with steps.step(f"writing {out.name}"):
        write_atomically(out, lambda path: written.append(write_scene(after, path, suffix)))
    with steps.step("comparing pictures"):
        camera = views[0].camera
        pictures = [render_reference(project(scene, camera), camera) for scene in (before, after)]
    rejected: dict[str, int] = {}
    for view in views:
        for reason, count in view.scene.rejected.items():
            rejected[reason] = rejected.get(reason, 0) + count
    table = told(f"{' '.join(map(str, scenes))} in {out.name}", out, written[0], len(after), rejected, [])
    table.add_row("grown from", f"{len(before):,}", f"Gaussians, seed {seed}")
    if after is not before:
        table.add_row("picture", f"{psnr(*pictures):.1f} dB", f"of view 0 at {SIZE[0]}x{SIZE[1]}, against what it was")
    console.print(table)
