"""`flicker stability`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from ..errors import FlickerError, Interrupted
from ..output import check_folder, write_text
from ..params import SortOrder
from .options import ORDER_HELP, console


def stability(
    family: Annotated[list[str] | None, typer.Option(help="family of inputs, repeatable [default: all]")] = None,
    config: Annotated[list[str] | None, typer.Option(help="configuration, repeatable [default: the suite]")] = None,
    front: Annotated[bool, typer.Option("--front", help="the packed front ends: records of 16 against 32 bytes, number formats")] = False,
    moving: Annotated[bool, typer.Option("--moving", help="families that move: what flickers at which speed of the camera")] = False,
    order: Annotated[SortOrder | None, typer.Option(help=f"with --moving: {ORDER_HELP} [default: depth]")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="three steps of each family, chosen configurations; two speeds")] = False,
    seed: Annotated[int, typer.Option(min=0, help="seed of the random inputs")] = 1,
    out: Annotated[Path, typer.Option("--out", "-o", help="folder for stability.csv, stability.md and the pictures")] = Path("build/stability"),
    show: Annotated[bool, typer.Option("--list", help="list families and configurations, run nothing")] = False,
) -> None:
    """Run families of hard inputs through every configuration and front end: error against float64, and where each breaks."""
    if moving and front:
        raise FlickerError("--moving: has front ends of its own, so it cannot be combined with --front")
    if order is not None and not moving:
        raise FlickerError("--order: for --moving only")
    if not show:
        check_folder(out)
    if moving:
        _moving(family, config, order or SortOrder.DEPTH, quick, seed, out, show)
        return
    with console.status("starting"):
        from ..explore.stability.families import FAMILIES
        from ..explore.stability.front_ends import FRONT_ENDS
        from ..explore.stability.run import run_stability, suite
        from ..explore.stability.write import FRONT_TABLES, break_table, markdown_table, write_csv, write_pictures
    if show:
        for f in FAMILIES.values():
            console.print(Text.assemble((f.name, "bold"), f"  {f.title}: {f.parameter} {', '.join(f'{v:g}' for v in f.values)}"), soft_wrap=True)
        for name in suite():
            console.print(name, highlight=False)
        return
    chosen = [*(config or []), *(FRONT_ENDS if front else [])]
    with _bar(out) as progress:
        result = run_stability(family, chosen, seed=seed, quick=quick, progress=progress)
    write_csv(result, out / "stability.csv")
    write_text(out / "stability.md", markdown_table(result) + "\n")
    if set(FRONT_ENDS) <= set(result.configurations):
        for name, made in FRONT_TABLES.items():
            write_text(out / f"front_{name}.md", made(result) + "\n")
    pictures = write_pictures(result, out)
    console.print(break_table(result))
    console.print(f"{out / 'stability.csv'}, {', '.join(map(str, pictures))}", soft_wrap=True)


@contextmanager
def _bar(out: Path) -> Iterator[Callable[[int, int], None]]:
    """A bar of cases; Ctrl-C within says that nothing was written."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    with Progress(
        TextColumn("stability"), BarColumn(), TextColumn("{task.completed}/{task.total} cases"), TimeElapsedColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("cases", total=None)
        try:
            yield lambda done, total: bar.update(task, completed=done, total=total)
        except KeyboardInterrupt:
            raise Interrupted(f"nothing was written to {out}; the same command begins anew, --quick and --family make it shorter") from None


def _moving(family: list[str] | None, config: list[str] | None, order: SortOrder, quick: bool, seed: int, out: Path, show: bool) -> None:
    """Families that move."""
    with console.status("starting"):
        from ..explore.stability.moving import MACHINES, MOVING, SPEEDS, moving_rows, run_moving, write_moving
    if show:
        for f in MOVING.values():
            console.print(Text.assemble((f.name, "bold"), f"  {f.title}"), soft_wrap=True)
        for name in MACHINES:
            console.print(name, highlight=False)
        return
    with _bar(out) as progress:
        points = run_moving(family, config, SPEEDS[2:5:2] if quick else SPEEDS, seed=seed, order=order, progress=progress)
    write_moving(points, out)
    heads, rows = moving_rows(points)
    table = Table(title="first speed, pixels a frame, at which a configuration flickers (lowest temporal PSNR, dB, most jumps, %)", title_justify="left")
    table.add_column(heads[0])
    for head in heads[1:]:
        table.add_column(head, justify="right")  # families: on a narrow terminal the table is cut between them
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(f"{out / 'moving.csv'}, {out / 'moving.md'}", soft_wrap=True)
