"""Table, CSV and pictures of a stability run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
from rich.table import Table

from ... import markdown, output
from .families import FAMILIES
from .front_ends import IMAGES, RECORDS, WIDE, WIDE_IMAGE, FrontEnd
from .run import BROKEN_ERROR, BROKEN_PSNR, Point, Stability


def _db(x: float) -> str:
    return "equal" if x == np.inf else f"{x:.0f}"


def _value(x: float) -> str:
    return f"{x:g}"


def break_table(result: Stability) -> Table:
    """Where each configuration breaks: one row for all with the same list of families, value and PSNR there."""
    groups: dict[str, list[str]] = {}
    for name in result.configurations:
        broken = [(f, result.breaks(f, name)) for f in result.families]
        text = ", ".join(f"{f} {_value(p.value)} ({p.psnr_db:.0f})" for f, p in broken if p is not None)
        groups.setdefault(text or "nowhere", []).append(name)
    table = Table(
        title=f"First step with PSNR < {BROKEN_PSNR:g} dB or an error > {BROKEN_ERROR:g}; seed {result.seed}",
        caption=f"family, value (PSNR in dB); {len(result.families)} families: {', '.join(result.families)}",
    )
    table.add_column("configurations", overflow="fold")
    table.add_column("break at")
    for text, names in groups.items():
        table.add_row("\n".join(names), text)
        table.add_section()
    return table


def _shown(result: Stability) -> list[str]:
    return [m for m in LINES if m in result.configurations] or result.configurations


def markdown_table(result: Stability) -> str:
    """Chosen configurations (LINES), families as rows: where each breaks, or its lowest PSNR."""
    shown = _shown(result)
    rows = []
    for family in result.families:
        cells = []
        for name in shown:
            point = result.breaks(family, name)
            lowest = min(p.psnr_db for p in result.sweep(family, name))
            cells.append(f"- ({_db(lowest)})" if point is None else f"**{_value(point.value)}** ({point.psnr_db:.0f}, {point.max_error:.2f})")
        rows.append([family, *cells])
    return markdown.table(["family", *(f"`{m}`" for m in shown)], rows)


def _first_and_lowest(result: Stability, family: str, front: FrontEnd) -> str:
    point = result.breaks(family, front.name)
    lowest = min(p.psnr_db for p in result.sweep(family, front.name))
    return f"{'-' if point is None else f'**{_value(point.value)}**'} ({_db(lowest)})"


def _breaks_earlier(result: Stability, family: str, front: FrontEnd, other: FrontEnd) -> bool:
    """Whether `front` breaks at an earlier step than `other`."""
    a, b = (result.breaks(family, f.name) for f in (front, other))
    return a is not None and (b is None or a.step < b.step)


def record_table(result: Stability) -> str:
    """Records of 16 against 32 bytes, families as rows: first broken step and lowest PSNR, behind those of packing alone; where 16 bytes break earlier."""
    rows = []
    for family in result.families:
        cells, earlier = [], []
        for image in IMAGES:
            cells += [_first_and_lowest(result, family, FrontEnd(image, record)) for record in (None, *RECORDS)]
            if _breaks_earlier(result, family, *(FrontEnd(image, record) for record in RECORDS)):
                earlier.append(f"`{image.value}`")
        rows.append([family, *cells, ", ".join(earlier) or "-"])
    columns = [f"`{image.value}`, {what}" for image in IMAGES for what in ("packed", *(f"{record.bytes} bytes" for record in RECORDS))]
    return markdown.table(["family", *columns, "16 bytes earlier"], rows)


def format_table(result: Stability) -> str:
    """Number formats of the front end, families as rows: first broken step and lowest PSNR, the largest loss at a step, and where the default breaks
    earlier."""
    rows, columns = [], []
    for record in RECORDS:
        fronts = FrontEnd(WIDE_IMAGE, record), FrontEnd(WIDE_IMAGE, record, WIDE)
        columns += [*(f"{record.bytes} bytes, {front.precision}" for front in fronts), "largest loss, dB"]
    for family in result.families:
        cells, earlier = [], []
        for record in RECORDS:
            fronts = FrontEnd(WIDE_IMAGE, record), FrontEnd(WIDE_IMAGE, record, WIDE)
            cells += [_first_and_lowest(result, family, front) for front in fronts]
            steps = [(b.psnr_db - a.psnr_db, a.psnr_db) for a, b in zip(*(result.sweep(family, front.name) for front in fronts)) if np.isfinite(b.psnr_db)]
            loss, at = max(steps)
            cells.append(f"{max(loss, 0.0):.1f} (to {at:.0f})")
            if _breaks_earlier(result, family, *fronts):
                earlier.append(f"{record.bytes} bytes")
        rows.append([family, *cells, ", ".join(earlier) or "-"])
    return markdown.table(["family", *columns, "breaks earlier"], rows)


FRONT_TABLES: dict[str, Callable[[Stability], str]] = {"records": record_table, "formats": format_table}


def write_csv(result: Stability, path: Path) -> None:
    """One line per point. Raises FlickerError when the file cannot be written."""
    names = [f.name for f in fields(Point)] + ["broken"]
    rows = ([int(v) if isinstance(v, bool) else f"{v:.6g}" if isinstance(v, float) else v for v in (getattr(p, n) for n in names)] for p in result.points)
    output.write_csv(path, [names, *rows])


def _save(figure, path: Path) -> None:
    import matplotlib.pyplot as plt

    try:
        output.write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=110))
    finally:
        plt.close(figure)


def write_pictures(result: Stability, folder: Path) -> list[Path]:
    """Heat map of the lowest PSNR and lines per family: stability_heat.png, stability_lines.png."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    lowest = np.array([[min(p.psnr_db for p in result.sweep(f, m)) for f in result.families] for m in result.configurations])
    lowest = np.clip(lowest, 0, 80)
    figure, axes = plt.subplots(figsize=(2 + 0.55 * len(result.families), 1.5 + 0.19 * len(result.configurations)), layout="constrained")
    image = axes.imshow(lowest, aspect="auto", cmap="RdYlGn", vmin=10, vmax=70)
    axes.set_xticks(range(len(result.families)), result.families, rotation=60, ha="right", fontsize=7)
    axes.set_yticks(range(len(result.configurations)), result.configurations, fontsize=6)
    if lowest.size <= 2500:
        for y, row in enumerate(lowest):
            for x, v in enumerate(row):
                axes.text(x, y, f"{v:.0f}", ha="center", va="center", fontsize=5)
    figure.colorbar(image, label="lowest PSNR of the sweep, dB", shrink=0.5)
    axes.set_title("Stability: PSNR against float64", fontsize=9)
    heat = folder / "stability_heat.png"
    _save(figure, heat)

    columns = 4
    count = -(-len(result.families) // columns)
    figure, grid = plt.subplots(count, columns, figsize=(4 * columns, 2.6 * count), layout="constrained", squeeze=False)
    for axes in grid.flat[len(result.families) :]:
        axes.axis("off")
    shown = [m for m in LINES if m in result.configurations] or result.configurations[:8]
    for axes, family in zip(grid.flat, result.families):
        for name in shown:
            sweep = result.sweep(family, name)
            axes.plot([p.step for p in sweep], [min(max(p.psnr_db, 0.0), 100.0) for p in sweep], marker=".", label=name)
        sweep = result.sweep(family, shown[0])
        axes.set_xticks([p.step for p in sweep], [_value(p.value) for p in sweep], fontsize=6, rotation=45)
        axes.axhline(BROKEN_PSNR, color="grey", linewidth=0.6)
        axes.set_title(FAMILIES[family].title, fontsize=8)
        axes.set_xlabel(sweep[0].parameter, fontsize=7)
        axes.set_ylabel("PSNR, dB", fontsize=7)
    figure.legend(*grid.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7)
    lines = folder / "stability_lines.png"
    _save(figure, lines)
    return [heat, lines]


LINES = (
    "vanilla", "no-ctu-32", "no-ctu-32-conic", "seele", "faithful", "flicker", "flicker-dense-fp16-factored",
    "exact-e4m3", "rows", "rows-ellipse-acc14", "no-ctu-32@absolute",
)
