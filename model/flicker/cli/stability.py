"""`flicker stability`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from ..errors import Interrupted
from ..output import check_folder, write_text
from .options import console


def stability(
    family: Annotated[list[str] | None, typer.Option(help="family of inputs, repeatable [default: all]")] = None,
    config: Annotated[list[str] | None, typer.Option(help="configuration, repeatable [default: the suite]")] = None,
    front: Annotated[bool, typer.Option("--front", help="the packed front ends: records of 16 against 32 bytes, number formats")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="three steps of each family, chosen configurations")] = False,
    seed: Annotated[int, typer.Option(min=0, help="seed of the random inputs")] = 1,
    out: Annotated[Path, typer.Option("--out", "-o", help="folder for stability.csv, stability.md and the pictures")] = Path("build/stability"),
    show: Annotated[bool, typer.Option("--list", help="list families and configurations, run nothing")] = False,
) -> None:
    """Run families of hard inputs through every configuration and front end: error against float64, and where each breaks."""
    if not show:
        check_folder(out)
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
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    with Progress(
        TextColumn("stability"), BarColumn(), TextColumn("{task.completed}/{task.total} cases"), TimeElapsedColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("cases", total=None)
        try:
            result = run_stability(
                family, chosen, seed=seed, quick=quick, progress=lambda done, total: bar.update(task, completed=done, total=total),
            )
        except KeyboardInterrupt:
            raise Interrupted(f"nothing was written to {out}; the same command begins anew, --quick and --family make it shorter") from None
    write_csv(result, out / "stability.csv")
    write_text(out / "stability.md", markdown_table(result) + "\n")
    if set(FRONT_ENDS) <= set(result.configurations):
        for name, made in FRONT_TABLES.items():
            write_text(out / f"front_{name}.md", made(result) + "\n")
    pictures = write_pictures(result, out)
    console.print(break_table(result))
    console.print(f"{out / 'stability.csv'}, {', '.join(map(str, pictures))}", soft_wrap=True)
