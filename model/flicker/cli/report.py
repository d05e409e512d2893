"""`flicker report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from ..errors import FlickerError, Interrupted
from ..output import check_folder
from .options import check_there, console, parse_size


def report(
    scenes: Annotated[list[str] | None, typer.Argument(
        help="scenes as for flicker render: FILE, FILE:VIEW, FILE:FIRST-LAST or FILE:all [default: demo]",
    )] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="folder for index.html, summary.csv, figures")] = Path("build/report"),
    size: Annotated[str | None, typer.Option(
        help="WxH of every view, as --size of flicker render [default: the camera's where there is a photograph, else 1280x720]",
    )] = None,
    photos: Annotated[str | None, typer.Option(help="folder of photographs by img_name, or none [default: those found beside cameras.json]")] = None,
    background: Annotated[str, typer.Option(help="black, white or r,g,b from 0 to 1: as the scene was fitted")] = "black",
    configs: Annotated[str | None, typer.Option(help="configurations, or patterns, separated by commas [default: those of the report]")] = None,
    store: Annotated[Path | None, typer.Option(help="results of single points, shared with sweeps [default: build/sweep/points]")] = None,
    budget: Annotated[list[Path] | None, typer.Option(help="what flicker budget --json wrote, for the figure of budgets; may be repeated")] = None,
    frames: Annotated[int, typer.Option(min=0, metavar="N", help="of each motion, in the section on stability over time; 0: without that section")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="seed of the stability suite")] = 1,
    show: Annotated[bool, typer.Option("--list", help="list the configurations, run nothing")] = False,
) -> None:
    """Measure configurations on every view; write tables and figures as one page."""
    if not show:
        from ..report.named import named

        check_folder(out)
        for text in scenes or ():
            named(text)
        check_there(*(budget or ()))
    wanted = parse_size(size)
    with console.status("starting"):
        from ..explore.configurations import CONFIGURATIONS
        from ..explore.store import DEFAULT
        from ..report.write import check, write_report
        from ..scene.photos import parse_background
    if show:
        for c in CONFIGURATIONS.values():
            title = f"  {c.title}{' (model only)' if c.model_only else ''}"
            console.print(Text.assemble((c.name, "bold"), title), soft_wrap=True, highlight=False)
        return
    names = None if configs is None else [n.strip() for n in configs.split(",")]
    if names is not None and not all(names):
        raise FlickerError(f"--configs: an empty name in '{configs}'")
    try:
        behind = parse_background(background)
    except FlickerError as error:
        raise FlickerError(f"--{error}") from None
    job = check(scenes or [], out, wanted, names, store or DEFAULT, photos, behind, budget or (), frames)
    for line in dict.fromkeys(f"{target.scene.path}: cameras: {target.scene.cameras_from}" for target in job.targets):
        console.print(line, highlight=False, soft_wrap=True)
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    with Progress(
        BarColumn(), TextColumn("{task.completed}/{task.total}"), TimeElapsedColumn(), TextColumn("{task.description}", markup=False), console=console,
        transient=True, disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("", total=None)
        try:
            written = write_report(job, seed, lambda done, total, text: bar.update(task, completed=done, total=total, description=text))
        except KeyboardInterrupt:
            raise Interrupted(f"what is measured is kept in {job.store}, and the same command goes on from there; no page was written") from None
    for verdict in written.verdicts:
        colour = {"yes": "green", "no": "red", "partly": "yellow", "open": "dim"}[verdict.kind]
        outcome = verdict.verdict.split(" (")[0].split(", because")[0]
        console.print(Text.assemble((verdict.figure, "bold"), f" {verdict.claim}: ", (outcome, colour)), soft_wrap=True, highlight=False)
    console.print(f"{written.page}, {written.summary}; seed {seed}", soft_wrap=True)
