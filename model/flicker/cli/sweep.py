"""`flicker sweep`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.table import Table

from ..errors import FlickerError, Interrupted
from .options import check_there, console
from .tables import decibels

TABLE_ROWS = 60  # longer results are in the file only


def sweep(
    config: Annotated[Path, typer.Argument(help="YAML: scenes, views, size, configurations (docs/guide/report.md)")],
    cluster: Annotated[str | None, typer.Option(help="address of a Dask scheduler [default: processes of this machine]")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="local processes [default: number of cores, 2 at most]")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="folder for results [default: build/sweep]")] = None,
) -> None:
    """Run scenes x views x configurations on Dask; results in Parquet, resumed where an earlier run has stopped."""
    if cluster is not None and workers is not None:
        raise FlickerError("--cluster: has its own workers, so it cannot be combined with --workers")
    check_there(config)
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from ..explore.sweep.config import load_sweep
    from ..explore.sweep.run import run_sweep

    wanted = load_sweep(config)
    if cluster is not None:
        wanted = replace(wanted, address=cluster, workers=None)
    if workers is not None:
        wanted = replace(wanted, workers=workers, address=None)
    if out is not None:
        wanted = replace(wanted, out=out)
    for line in dict.fromkeys(f"{target.scene.path}: cameras: {target.scene.cameras_from}" for target in wanted.targets):
        console.print(line, highlight=False, soft_wrap=True)
    with Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TextColumn("points"), TimeElapsedColumn(), TimeRemainingColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("sweep", total=len(wanted.points))

        def report(done: int, total: int, event: dict) -> None:
            name = f"{event['row']['scene']} {event['row']['view']}" if event else "sweep"
            progress.update(task, completed=done, total=total, description=name)

        try:
            result = run_sweep(wanted, on_point=report)
        except KeyboardInterrupt:
            done = int(progress.tasks[task].completed)
            raise Interrupted(f"{done} of {len(wanted.points)} points are kept in {wanted.store}; the same command continues") from None
    if len(result.rows) <= TABLE_ROWS:
        console.print(summary(result.rows))
    note = f", {result.lost} workers lost" if result.lost else ""
    console.print(f"{wanted.folder / 'results.parquet'}: {len(result.rows)} points, {result.computed} computed, {result.resumed} resumed{note}",
                  soft_wrap=True)


Columns = tuple[tuple[str, Literal["left", "right"]], ...]
MOVED: Columns = (("temporal dB", "right"), ("jumps %", "right"), ("worst frame", "right"), ("cycles p50, p99, worst", "right"), ("late", "right"))


def _moved(row: dict) -> tuple[str, ...]:
    """Cells of a path; of a still none."""
    if not row.get("path"):
        return ("",) * len(MOVED)
    temporal = ("", "", "") if row["temporal_psnr_db"] is None else (
        decibels(row["temporal_psnr_db"], unit=""), f"{100 * row['jumps']:.3f}", f"{row['worst_frame']}: {decibels(row['worst_frame_db'], unit='')}",
    )
    return *temporal, f"{row['cycles_p50']:,.0f}, {row['cycles_p99']:,.0f}, {row['cycles_worst']:,}", f"{row['late']:.1%}"


def summary(rows: list[dict]) -> Table:
    """One row per point; with columns of paths where there are some."""
    table = Table()
    columns: Columns = (
        ("scene", "left"), ("view", "right"), ("configuration", "left"), ("cycles", "right"), ("PSNR dB", "right"), ("SSIM", "right"), ("FLIP", "right"),
        ("photo dB", "right"), ("GE", "right"), ("uJ", "right"),
    )
    moves = any(row.get("path") for row in rows)
    for name, justify in (*columns, *(MOVED if moves else ())):
        table.add_column(name, justify=justify)

    def text(value, form: str) -> str:
        return "" if value is None else format(value, form)

    for row in rows:
        table.add_row(
            row["scene"], ", ".join(filter(None, (str(row["view"]), row.get("path")))), row["config"], text(row["cycles"], ",.0f"),
            decibels(row["psnr_db"], unit=""), text(row["ssim"], ".4f"), text(row["flip"], ".4f"),
            "" if row["photo_psnr_db"] is None else decibels(row["photo_psnr_db"], unit=""),
            text(row["area_ge"], ",.0f"), text(row["energy_uj"], ".1f"), *(_moved(row) if moves else ()),
        )
    return table
