"""Figures and tables of the report: each one a picture (PNG, SVG) and its numbers (CSV)."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.colors import LogNorm, Normalize  # noqa: E402
from matplotlib.figure import Figure as Canvas  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # noqa: E402

from ..budget.curve import Curve  # noqa: E402
from ..cost.area import in_table  # noqa: E402
from ..cost.chip_area import CHIPS, PAPER_MM2, UM2_PER_BIT, UM2_PER_GE, components, in_all, square_millimetres  # noqa: E402
from ..explore.configurations import CONFIGURATIONS  # noqa: E402
from ..explore.facts import MAPS, TILE_SIZES  # noqa: E402
from ..explore.stability.run import Stability  # noqa: E402
from ..output import write_atomically, write_csv  # noqa: E402
from .claims import (  # noqa: E402
    DENSE,
    FAITHFUL,
    FLOAT64,
    GSCORE,
    NARROW,
    NO_CTU,
    NO_CTU_64,
    PAPER_PRUNED_PSNR,
    PAPER_VANILLA_PSNR,
    SMOOTH,
    SPARSE,
    SPIKY,
    VANILLA,
    WIDE,
    test_loss,
)
from .collect import FIFO_SWEPT, ViewResult  # noqa: E402

STYLE: dict[Any, Any] = {
    "font.size": 8, "axes.titlesize": 9, "axes.spines.top": False, "axes.spines.right": False, "svg.fonttype": "none", "svg.hashsalt": "flicker",
    "figure.dpi": 110,
}
COLOURS = ("#3b6fb6", "#d1772d", "#4a9a5b", "#b5484f", "#8465a8", "#7d6248", "#c979ab", "#6e6e6e")
MODES = {"Uniform-Dense": DENSE, "Uniform-Sparse": SPARSE, "Smooth-Focused": SMOOTH, "Spiky-Focused": SPIKY}
INTERSECTIONS = {"AABB 16x16": VANILLA, "AABB 8x8": NO_CTU, "OBB 8x8": GSCORE, "Mini-Tile CAT": DENSE}
PRECISIONS = {"full FP16": WIDE, "mixed": SMOOTH, "full FP8": NARROW}
BUILDS = {"no CTU, 32 VRUs": NO_CTU, "no CTU, 64 VRUs": NO_CTU_64, "GSCore, 64 VRUs": GSCORE, "FLICKER, 32 VRUs": FAITHFUL, "Uniform-Sparse": SPARSE}


@dataclass
class Figure:
    """One figure. name: of its files. of: figure of the paper it stands beside, or "". bitmap: the page shows the PNG, not the SVG."""

    name: str
    title: str
    of: str
    note: str
    header: list[str]
    rows: list[list]
    canvas: Canvas | None = None
    bitmap: bool = False
    written: dict[str, bytes] = field(default_factory=dict)

    def write(self, folder: Path) -> None:
        """NAME.csv, NAME.png, NAME.svg; the picture's bytes stay in `written`. Raises FlickerError."""
        write_csv(folder / f"{self.name}.csv", [self.header, *([_cell(v) for v in row] for row in self.rows)])
        if self.canvas is not None:
            engine = self.canvas.get_layout_engine()
            if engine is not None:
                with plt.rc_context(STYLE):
                    engine.execute(self.canvas)
            self.canvas.set_layout_engine("none")  # laid out once, not for each format
            for kind, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
                buffer = io.BytesIO()
                with plt.rc_context(STYLE):
                    self.canvas.savefig(buffer, format=kind, metadata=metadata, dpi=110)
                data = self.written[kind] = buffer.getvalue()
                write_atomically(folder / f"{self.name}.{kind}", lambda path: path.write_bytes(data))
            plt.close(self.canvas)

    @property
    def image(self) -> str:
        """The picture as a data URL."""
        kind, mime = ("png", "image/png") if self.bitmap else ("svg", "image/svg+xml")
        return f"data:{mime};base64,{base64.b64encode(self.written[kind]).decode()}" if kind in self.written else ""


def _cell(value):
    if isinstance(value, float):
        return f"{value:.6g}"
    return "" if value is None else value


def _axes(count: int = 1, width: float = 4.2, height: float = 2.7):
    figure, axes = plt.subplots(1, count, figsize=(width * count, height), layout="constrained", squeeze=False)
    return figure, list(axes[0])


def _bars(axes, views: Sequence[str], series: dict[str, Sequence[float]], label: str, form: str = "{:.2f}", paper: dict[str, float] | None = None) -> None:
    """Groups of bars, one group per view and one more with the paper's values."""
    groups = list(views) + (["paper"] if paper else [])
    step = 0.84 / len(series)
    for k, (name, values) in enumerate(series.items()):
        values = list(values) + ([paper.get(name, math.nan)] if paper else [])
        at = np.arange(len(groups)) - 0.42 + (k + 0.5) * step
        bars = axes.bar(at, np.nan_to_num(values), step * 0.92, label=name, color=COLOURS[k % len(COLOURS)])
        axes.bar_label(bars, ["" if math.isnan(v) else form.format(v) for v in values], fontsize=5.5, rotation=90 if len(series) * len(groups) > 10 else 0, padding=2)
    axes.set_xticks(range(len(groups)), groups, rotation=20 if len(groups) > 3 else 0, ha="right" if len(groups) > 3 else "center")
    axes.set_ylabel(label)
    axes.margins(y=0.22)


def _with(views: Sequence[ViewResult], *names: str) -> list[ViewResult]:
    """Views that have all the configurations."""
    return [v for v in views if all(n in v.rows for n in names)]


def _titles(views: Sequence[ViewResult]) -> list[str]:
    return [v.target.title for v in views]


def _finite(value: float, top: float = 120.0) -> float:
    return min(value, top)


def sampling_modes(views: Sequence[ViewResult]) -> Figure | None:
    """Figure 3a."""
    views = _with(views, NO_CTU, *MODES.values())
    if not views:
        return None
    rows = []
    for v in views:
        for mode, name in MODES.items():
            row = extra = v.rows[name]
            rows.append([v.target.scene.name, v.target.view, mode, name, row["psnr_db"], v.rows[NO_CTU]["psnr_db"], test_loss(v, name, NO_CTU, PAPER_VANILLA_PSNR),
                         "measured" if v.photographed else f"assumed at {PAPER_VANILLA_PSNR} dB", extra["evaluations"], extra["leaders_per_element"]])
    figure, (a, b, c) = _axes(3, 3.8)
    _bars(a, _titles(views), {m: [_finite(v.rows[n]["psnr_db"]) for v in views] for m, n in MODES.items()}, "PSNR against float64, dB", "{:.1f}")
    _bars(b, _titles(views), {m: [test_loss(v, n, NO_CTU, PAPER_VANILLA_PSNR) for v in views] for m, n in MODES.items()},
          "loss against photographs, dB" if all(v.photographed for v in views) else "loss (photographs assumed), dB", "{:.3f}", {"Uniform-Dense": 0.08})
    _bars(c, _titles(views), {m: [v.rows[n]["leaders_per_element"] for v in views] for m, n in MODES.items()}, "leader pixels per stream element", "{:.1f}")
    a.legend(fontsize=6, ncols=2, loc="lower center")
    return Figure(
        "fig3a_modes", "Sampling modes: PSNR and leader pixels", "3a",
        "Conic form, mixed precision. Loss: of PSNR against the photograph, from the same VRU without a test. Where there is no photograph: of a picture that is "
        f"{PAPER_VANILLA_PSNR} dB from it, assuming that the error is uncorrelated with that distance.",
        ["scene", "view", "mode", "config", "psnr_db", "psnr_db_without_test", "loss_db", "loss_is", "leader_pixels", "leader_pixels_per_element"], rows, figure,
    )


def intersection(views: Sequence[ViewResult]) -> Figure | None:
    """Figure 4."""
    views = _with(views, *INTERSECTIONS.values())
    if not views:
        return None
    rows = []
    for v in views:
        for title, name in INTERSECTIONS.items():
            extra = v.rows[name]
            rows.append([v.target.scene.name, v.target.view, "gaussians_per_pixel", title, extra["visited_per_pixel"], extra["listed_per_pixel"],
                         extra["visited_per_pixel"] / v.rows[VANILLA]["visited_per_pixel"]])
        for size in TILE_SIZES:
            pairs = v.facts["duplicates"]
            rows.append([v.target.scene.name, v.target.view, "duplicates", f"{size}x{size}", pairs[str(size)], None, pairs[str(size)] / pairs["16"]])
    figure, (a, b) = _axes(2, 5)
    _bars(a, _titles(views), {t: [v.rows[n]["visited_per_pixel"] for v in views] for t, n in INTERSECTIONS.items()}, "Gaussians processed per pixel", "{:.0f}")
    for k, v in enumerate(views):
        pairs = v.facts["duplicates"]
        b.plot(TILE_SIZES, [pairs[str(s)] / pairs["16"] for s in TILE_SIZES], "o-", color=COLOURS[k % len(COLOURS)], label=v.target.title)
    b.plot([4, 16], [4, 1], "k^", label="paper", markersize=5, fillstyle="none")
    b.set(xscale="log", yscale="log", xlabel="tile size, pixels", ylabel="Gaussian-tile pairs, 16x16 = 1")
    b.set_xticks(TILE_SIZES, [str(s) for s in TILE_SIZES])
    b.minorticks_off()
    a.legend(fontsize=6)
    b.legend(fontsize=6)
    return Figure(
        "fig4_intersection", "Gaussians per pixel for each intersection method, duplicates for tile sizes", "4",
        "Left: Gaussians a pixel goes through before it is finished; Mini-Tile CAT with four leaders a mini-tile (Uniform-Dense, conic, mixed). "
        "Right: pairs of Gaussian and tile with per-axis 3-sigma boxes.",
        ["scene", "view", "what", "method_or_tile", "value", "listed_per_pixel", "relative_to_16x16"], rows, figure,
    )


CROP = 96  # pixels


def _worst_crop(view: ViewResult) -> tuple[int, int, int]:
    """Left, top and side of the square in which FP8 differs most from full FP16."""
    side = min(CROP, *view.reference.shape[:2])
    error = np.abs(view.pictures[NARROW].astype(np.float64) - view.pictures[WIDE]).sum(axis=2)
    total = np.pad(error.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    box = total[side:, side:] - total[:-side, side:] - total[side:, :-side] + total[:-side, :-side]
    top, left = np.unravel_index(int(box.argmax()), box.shape)
    return int(left), int(top), side


def precision(views: Sequence[ViewResult]) -> Figure | None:
    """Figure 7c."""
    views = [v for v in _with(views, *PRECISIONS.values()) if all(n in v.pictures for n in PRECISIONS.values())]
    if not views:
        return None
    rows = [[v.target.scene.name, v.target.view, t, n, *(v.rows[n][k] for k in ("psnr_db", "ssim", "flip"))] for v in views for t, n in PRECISIONS.items()]
    figure, axes = plt.subplots(len(views), 4, figsize=(8.8, 2.35 * len(views)), layout="constrained", squeeze=False)
    for line, v in zip(axes, views):
        left, top, side = _worst_crop(v)
        pictures = {"float64": (v.reference, None)} | {t: (v.pictures[n], v.rows[n]["psnr_db"]) for t, n in PRECISIONS.items()}
        for a, (title, (picture, value)) in zip(line, pictures.items()):
            a.imshow(picture[top : top + side, left : left + side], interpolation="nearest")
            a.set_xticks([])
            a.set_yticks([])
            a.set_title(title if value is None else f"{title}: {value:.1f} dB")
        line[0].set_ylabel(f"{v.target.title}\n({left}, {top})")
    return Figure(
        "fig7c_precision", "Precision schemes", "7c", f"Smooth-Focused, conic form. PSNR of the whole picture against float64; crops of {CROP} pixels where full FP8 "
        "differs most from full FP16.", ["scene", "view", "scheme", "config", "psnr_db", "ssim", "flip"], rows, figure, bitmap=True,
    )


def rendering_stage(views: Sequence[ViewResult]) -> Figure | None:
    """Figure 8."""
    views = _with(views, *BUILDS.values())
    if not views:
        return None
    rows = []
    for v in views:
        for title, name in BUILDS.items():
            row, base = v.rows[name], v.rows[NO_CTU]
            rows.append([v.target.scene.name, v.target.view, title, name, row["cycles"], base["cycles"] / row["cycles"], row["energy_uj"],
                         _ratio(base["energy_uj"], row["energy_uj"]), row["area_ge"]])
    figure, (a, b) = _axes(2, 5.4)
    _bars(a, _titles(views), {t: [v.rows[NO_CTU]["cycles"] / v.rows[n]["cycles"] for v in views] for t, n in BUILDS.items()}, "speed, no CTU with 32 VRUs = 1", "{:.2f}",
          {"no CTU, 32 VRUs": 1, "GSCore, 64 VRUs": 4, "FLICKER, 32 VRUs": 4, "Uniform-Sparse": 4.4})
    _bars(b, _titles(views), {t: [_ratio(v.rows[GSCORE]["energy_uj"], v.rows[n]["energy_uj"]) or math.nan for v in views] for t, n in BUILDS.items()},
          "energy efficiency, GSCore = 1", "{:.2f}", {"GSCore, 64 VRUs": 1, "FLICKER, 32 VRUs": 1.6})
    a.legend(fontsize=6, ncols=2)
    return Figure(
        "fig8_rendering_stage", "Rendering stage: speed and energy against GSCore and builds without CTU", "8",
        "Conic form everywhere. GSCore's work unit is a whole sub-tile, its cycles are a closed form without latencies. The paper's bar of energy is its maximum.",
        ["scene", "view", "build", "config", "cycles", "speed_vs_no_ctu_32", "energy_uj", "efficiency_vs_no_ctu_32", "area_ge"], rows, figure,
    )


def _ratio(a: float | None, b: float | None) -> float | None:
    return None if not a or not b else a / b


def fifo_depth(views: Sequence[ViewResult]) -> Figure | None:
    """Figure 9."""
    views = [v for v in views if "fifo" in v.facts]
    if not views:
        return None
    rows = []
    figure, (a, b) = _axes(2, 4.6)
    for k, v in enumerate(views):
        fifo = v.facts["fifo"]
        speed = [fifo["cycles"][0] / c for c in fifo["cycles"]]
        rows += [[v.target.scene.name, v.target.view, *values] for values in zip(fifo["depth"], fifo["cycles"], speed, fifo["stall_rate"], fifo["utilisation"])]
        a.plot(fifo["depth"], speed, "o-", color=COLOURS[k % len(COLOURS)], label=v.target.title)
        b.plot(fifo["depth"], [100 * r for r in fifo["stall_rate"]], "o-", color=COLOURS[k % len(COLOURS)])
    a.plot([1, 16, 128], [1, 0.96 * 1.36, 1.36], "k^", label="paper", markersize=5, fillstyle="none")
    for axes in (a, b):
        axes.set(xscale="log", xlabel="FIFO depth")
        axes.set_xticks(views[0].facts["fifo"]["depth"], [str(d) for d in views[0].facts["fifo"]["depth"]])
        axes.minorticks_off()
    a.set_ylabel("speed, depth 1 = 1")
    b.set_ylabel("CTU stalled, % of cycles")
    b.set_ylim(bottom=0)
    a.legend(fontsize=6)
    return Figure(
        "fig9_fifo_depth", "Speed and CTU stall rate against the depth of the feature FIFOs", "9", f"Configuration {FIFO_SWEPT}, by the cycle model that equals the RTL.",
        ["scene", "view", "fifo_depth", "cycles", "speed", "ctu_stall_rate", "vru_utilisation"], rows, figure,
    )


# Facts of a configuration in a whole chip, in this order (`chip.compare.chip_estimates`).
SYSTEM = ("front_cycles", "render_cycles", "dram_cycles", "interval_cycles", "latency_cycles", "bottleneck", "dram_bytes")


def whole_system(views: Sequence[ViewResult]) -> Figure | None:
    """Figure 10."""
    views = [v for v in views if GSCORE in v.facts.get("chip", {})]
    if not views:
        return None
    names = [n for n in views[0].facts["chip"] if all(n in v.facts["chip"] for v in views)]
    rows = []
    for v in views:
        base = v.facts["chip"][GSCORE]
        for name, fact in v.facts["chip"].items():
            rows.append([v.target.scene.name, v.target.view, name, *(fact[key] for key in SYSTEM),
                         base["interval_cycles"] / fact["interval_cycles"], fact["energy_uj"], _ratio(base["energy_uj"], fact["energy_uj"])])
    figure, (a, b) = _axes(2, 5.4)
    chip = [v.facts["chip"] for v in views]
    _bars(a, _titles(views), {n: [c[GSCORE]["interval_cycles"] / c[n]["interval_cycles"] for c in chip] for n in names}, "frames a second, GSCore = 1", "{:.2f}",
          {GSCORE: 1, FAITHFUL: 1.1})
    _bars(b, _titles(views), {n: [_ratio(c[GSCORE]["energy_uj"], c[n]["energy_uj"]) or math.nan for c in chip] for n in names}, "energy efficiency, GSCore = 1", "{:.2f}",
          {GSCORE: 1, FAITHFUL: 2.6})
    a.legend(fontsize=6, ncols=2)
    return Figure(
        "fig10_whole_system", "Whole system", "10", "The chip that exists as RTL, by the models of its halves that are held to it (docs/results/chip.md), around each rendering "
        "stage. Stages in conic form have the paper's front end (FP16 scene, 3-sigma boxes, 32-byte records; GSCore lists by its oriented boxes), the others the "
        "default one (chunks, ellipses, 16 bytes). Cycles between frames; energy of the rendering stage and of DRAM traffic (front end and sorting have no energy "
        "model). The paper's speed is its average, its energy its maximum. Jetson XNX: published only, 1/14.4 of FLICKER's speed on average.",
        ["scene", "view", "config", *SYSTEM, "speed_vs_gscore", "energy_uj", "efficiency_vs_gscore"],
        rows, figure,
    )


def contribution_test(views: Sequence[ViewResult]) -> Figure | None:
    """Table 1, its last step."""
    views = _with(views, NO_CTU, FAITHFUL)
    if not views:
        return None
    rows = [[
        v.target.scene.name, v.target.view, *(v.rows[n][k] for n in (NO_CTU, FAITHFUL) for k in ("psnr_db", "ssim", "flip")),
        *(v.rows[FAITHFUL]["reference_" + k] for k in PHOTO), *(v.rows[n][k] for n in (NO_CTU, FAITHFUL) for k in PHOTO),
        test_loss(v, FAITHFUL, NO_CTU, PAPER_PRUNED_PSNR), test_loss(v, NO_CTU, FLOAT64, PAPER_PRUNED_PSNR),
        "measured" if v.photographed else f"assumed at {PAPER_PRUNED_PSNR} dB",
    ] for v in views]
    return Figure(
        "table1_contribution_test", "Table 1, last step: the contribution test against the same model without it", "Table 1",
        "Conic form. The first columns are against float64, those with photo against the photographs. Loss of PSNR by the test and by the VRU's FP16: against the photographs; where there "
        f"are none, of a picture that is {PAPER_PRUNED_PSNR} dB from its photograph, assuming uncorrelated errors. The paper: 0.11 dB on average.",
        ["scene", "view", "psnr_db_without", "ssim_without", "flip_without", "psnr_db_with", "ssim_with", "flip_with", "photo_psnr_db_float64", "photo_ssim_float64",
         "photo_psnr_db_without", "photo_ssim_without", "photo_psnr_db_with", "photo_ssim_with", "loss_db_by_test", "loss_db_by_vru", "loss_is"], rows,
    )


def area(areas: dict[tuple[str, str], float]) -> Figure:
    """Table 2."""
    note = (
        f"Square millimetres here: {UM2_PER_GE} um2 per GE and {UM2_PER_BIT:.3f} um2 per bit of SRAM, estimates without wires (docs/reference/synthesis.md). "
        "Feature buffer and others: all of the chip but the units above."
    )
    chips = {chip: components(chip, in_table) for chip in CHIPS} if areas else {}
    if not areas:
        note += " No areas of this repository."
    rows = [
        [name, published, *(value for parts in chips.values() for value in (*parts[name], square_millimetres(*parts[name])))]
        for name, published in PAPER_MM2.items()
    ]
    total = [(sum(p[0] for p in parts.values()), sum(p[1] for p in parts.values()), in_all(parts)) for parts in chips.values()]
    rows.append(["In all", sum(PAPER_MM2.values()), *(value for values in total for value in values)])
    columns = [f"{chip}_{what}" for chip in chips for what in ("ge", "sram_bits", "mm2_estimate")]
    return Figure("table2_area", "Table 2: area", "Table 2", note, ["component", "paper_mm2", *columns], rows)


def stability_table(result: Stability) -> Figure:
    """Where configurations fail."""
    rows = []
    for name in result.configurations:
        for family in result.families:
            point = result.breaks(family, name)
            lowest = min(p.psnr_db for p in result.sweep(family, name))
            rows.append([family, name, None if point is None else point.value, None if point is None else point.psnr_db,
                         None if point is None else point.max_error, lowest])
    return Figure(
        "stability", "Where configurations fail", "", "Quick stability suite: first, middle and last step of each family (docs/reference/stability.md). First step with a PSNR below 40 dB, an error above "
        "0.25 or a NaN, PSNR there in brackets; `-`: never broken, lowest PSNR of the sweep.",
        ["family", "config", "breaks_at", "psnr_db", "max_error", "lowest_psnr_db"], rows,
    )


def heat(view: ViewResult) -> Figure | None:
    """Heat maps of one view: a line per configuration, columns with a common scale."""
    names = [n for n in view.rows if n in view.maps]
    if not names:
        return None
    height, width = view.reference.shape[:2]
    figure, axes = plt.subplots(len(names), 4, figsize=(13, (13 / 4 * height / width + 0.45) * len(names)), layout="constrained", squeeze=False)
    rows = []
    for column, (key, scale) in enumerate(MAPS.items()):
        shown = [view.maps[n][key] for n in names if key in view.maps[n]]
        low, high = scale.limits(shown)
        for a, name in zip(axes[:, column], names):
            a.set_xticks([])
            a.set_yticks([])
            values = view.maps[name].get(key)
            if values is None:
                a.text(0.5, 0.5, "cycles are a closed form", ha="center", va="center", transform=a.transAxes)
            else:
                norm = LogNorm(low, high, clip=True) if scale.logarithmic else Normalize(low, high)
                drawn = a.imshow(values, cmap=scale.colours, norm=norm, interpolation="nearest", aspect="auto")
                figure.colorbar(drawn, ax=a, shrink=0.8)
                rows.append([view.target.scene.name, view.target.view, name, key, float(np.nanmean(values)), float(np.nanpercentile(values, 99)), float(np.nanmax(values))])
            a.set_title(f"{name}: {scale.title}")
    return Figure(
        f"heat_{view.target.scene.name}_{view.target.view}", f"Heat maps, {view.target.title}", "", "Gaussians that VRUs visit before a pixel is finished; cycles from the end of a sub-tile to the "
        "end of the next in the same core; pixels visited by the busiest channel over the mean of four; FLIP against float64. Common scale per column, cut at the 99.5 % quantile, the first two logarithmic.",
        ["scene", "view", "config", "map", "mean", "percentile_99", "max"], rows, figure, bitmap=True,
    )


PHOTO = ("photo_psnr_db", "photo_ssim")  # of a row: against the photograph, None where there is none
AXES = {  # name in the row: label, higher is better
    "cycles": ("cycles", False), "psnr_db": ("PSNR, dB", True), "ssim": ("SSIM", True), "flip": ("FLIP", False), "area_ge": ("area, GE", False),
    "energy_uj": ("energy, uJ", False),
}


def pareto(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of points (cost, gain) that no other one beats: none has at most the cost and at least the gain, and one of them better."""
    order = sorted(range(len(points)), key=lambda i: (points[i][0], -points[i][1]))
    front, best = [], -math.inf
    for i in order:
        if points[i][1] > best:
            front.append(i)
            best = points[i][1]
    return front


def overall(views: Sequence[ViewResult]) -> list[dict]:
    """One point per configuration over all views: geometric mean of cycles and energy relative to `relative_to`, mean PSNR, SSIM, FLIP."""
    names = [n for n in views[0].rows if all(n in v.rows for v in views)]
    points = []
    for name in names:
        rows = [v.rows[name] for v in views]
        energies = [r["energy_uj"] for r in rows]
        points.append({
            "scene": "all", "view": "", "config": name, "title": rows[0]["title"], "model_only": rows[0]["model_only"], "area_ge": rows[0]["area_ge"],
            "cycles": math.exp(sum(math.log(max(r["cycles"], 1)) for r in rows) / len(rows)),
            "psnr_db": sum(_finite(r["psnr_db"]) for r in rows) / len(rows),
            "ssim": sum(r["ssim"] for r in rows) / len(rows), "flip": sum(r["flip"] for r in rows) / len(rows),
            **{key: sum(r[key] for r in rows) / len(rows) if all(r.get(key) is not None for r in rows) else None for key in PHOTO},
            "energy_uj": None if None in energies else math.exp(sum(math.log(max(e, 1e-9)) for e in energies) / len(rows)),
        })
    return points


def is_bound(name: str) -> bool:
    """Whether a configuration has its masks for free: what could be had at best, not a design; it is left out of Pareto fronts."""
    configuration = CONFIGURATIONS.get(name)
    return configuration is not None and configuration.generator.free


# What the charts of all configurations draw: label, marker, colour, which points.
KINDS = (
    ("RTL exists", "o", COLOURS[0], lambda p: not p["model_only"]),
    ("model only", "^", COLOURS[1], lambda p: p["model_only"] and not is_bound(p["config"])),
    ("bound: masks for free", "x", COLOURS[7], lambda p: is_bound(p["config"])),
)
NAMED = ("vanilla", "gscore", "no-ctu-32", "faithful", "flicker", "log-lanes", "log-lanes-128")  # written beside their points, besides the front's


def _cycles(point: dict) -> float:
    return float(point["cycles"])


def _cycles_area(point: dict) -> float:
    return point["cycles"] * point["area_ge"] / 1e6


def logarithmic_ticks(axes: Axes, unit: float = 1.0) -> None:
    """Labels at 1, 2 and 5 of each decade of a logarithmic x axis, in units of `unit`."""
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / unit:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _cloud(views: Sequence[ViewResult], name: str, title: str, note: str, cost: Callable[[dict], float], label: str) -> Figure:
    """Every configuration a point: a cost against accuracy, Pareto fronts of everything and of what exists as RTL, per view and over all.

    cost: of a row of results; label: of its axis, for millions of it.
    """
    groups = {v.target.title: list(v.rows.values()) for v in views}
    if len(views) > 1:
        groups["all views"] = overall(views)
    columns = min(3, len(groups))
    lines = -(-len(groups) // columns)
    figure, grid = plt.subplots(lines, columns, figsize=(4.8 * columns, 3.8 * lines), layout="constrained", squeeze=False)
    for a in grid.flat[len(groups) :]:
        a.axis("off")
    rows = []
    for a, (head, points) in zip(grid.flat, groups.items()):
        values = [(cost(p), _finite(float(p["psnr_db"]))) for p in points]
        for kind, marker, colour, choose in KINDS:
            chosen = [v for v, p in zip(values, points) if choose(p)]
            a.plot([v[0] for v in chosen], [v[1] for v in chosen], marker, color=colour, markersize=4, alpha=0.8, label=kind)
        built = [i for i, p in enumerate(points) if not is_bound(p["config"])]
        front = [built[k] for k in pareto([values[i] for i in built])]
        real = [i for i in built if not points[i]["model_only"]]
        real_front = [real[k] for k in pareto([values[i] for i in real])]
        a.plot([values[i][0] for i in front], [values[i][1] for i in front], "-", color="black", linewidth=0.8, label="Pareto front")
        a.plot([values[i][0] for i in real_front], [values[i][1] for i in real_front], "-", color=COLOURS[0], linewidth=0.8, label="of the RTL")
        named = {points[i]["config"]: i for i in built if points[i]["config"] in NAMED} | {points[i]["config"]: i for i in (*front[:1], *front[-1:])}
        for config, i in named.items():
            a.annotate(config, values[i], fontsize=6, xytext=(3, 4 if i == front[0] else -7), textcoords="offset points")
        a.set(xscale="log", xlabel=label, ylabel="PSNR against float64, dB", title=head)
        logarithmic_ticks(a, 1e6)
        rows += [[head, p["config"], p["cycles"], p["psnr_db"], p["ssim"], p["flip"], p["area_ge"], p["energy_uj"], p["model_only"], i in front, i in real_front]
                 for i, p in enumerate(points)]
    grid.flat[0].legend(fontsize=6)
    header = ["group", "config", "cycles", "psnr_db", "ssim", "flip", "area_ge", "energy_uj", "model_only", "pareto", "pareto_of_rtl"]
    return Figure(name, title, "", f"{note} Over all views: geometric mean of cycles and energy, mean of PSNR, SSIM and FLIP.".strip(), header, rows, figure)


def speed_accuracy(views: Sequence[ViewResult]) -> Figure:
    """Cycles against accuracy."""
    return _cloud(views, "speed_accuracy", "Speed against accuracy", "", _cycles, "cycles, millions")


def speed_area_accuracy(views: Sequence[ViewResult]) -> Figure:
    """Cycles times area against accuracy, so that builds of different size compare."""
    note = "The area that a frame keeps busy for how long: half the cycles on twice the area is no gain."
    return _cloud(views, "speed_area_accuracy", "Cycles times area against accuracy", note, _cycles_area, "cycles times area, million cycles of a million GE")


def budget_curves(curves: Sequence[Curve]) -> Figure:
    """What scenes lose by `flicker budget`."""
    with plt.rc_context(STYLE):
        figure, axes = _axes(3, 3.6)
        rows: list[list] = []
        for k, curve in enumerate(curves):
            points, colour = sorted(curve.points, key=lambda p: (p.kept, p.decibels)), COLOURS[k % len(COLOURS)]
            decibels = [p.decibels for p in points]
            axes[0].plot([100 * p.kept for p in points], decibels, "o-", markersize=3, color=colour, label=curve.title)
            axes[1].plot([p.cost.bytes / 1e6 for p in points], decibels, "o-", markersize=3, color=colour, label=curve.title)
            axes[2].plot([p.cost.cycles / 1e6 for p in points], decibels, "o-", markersize=3, color=colour, label=curve.title)
            lanes = [(p.cost.lane_cycles / 1e6, p.decibels) for p in points if p.cost.lane_cycles]
            axes[2].plot([x for x, _ in lanes], [y for _, y in lanes], "o:", markersize=3, color=colour, fillstyle="none")
            rows += [[curve.title, p.kept, p.decibels, p.cost.bytes, p.cost.cycles, p.cost.lane_cycles, p.cost.image_bytes] for p in points]
        for axis, label in zip(axes, ("Gaussians kept, %", "MB a frame", "million cycles; dotted: lanes alone")):
            axis.set_xlabel(label)
            axis.set_ylabel("PSNR on held-out views, dB")
            axis.grid(alpha=0.3)
        axes[0].legend(frameon=False)
        return Figure(
            "budget", "Scenes to a budget", "", "Mean PSNR against the full scene on views that were not fitted to, by what is kept; frames on the chip's models: "
            "the slower half with channels, the stage of lanes alone.",
            ["scene", "kept", "psnr_db", "frame_bytes", "cycles", "lane_cycles", "packed_bytes"], rows, figure,
        )


@dataclass(frozen=True)
class Move:
    """What a change of the scene does to a machine. before, after: cycles and dB."""

    name: str
    before: tuple[float, float]
    after: tuple[float, float]


def moves(name: str, title: str, found: Sequence[Move], gain: str) -> Figure:
    """Cycles against dB, from the one place to the other."""
    with plt.rc_context(STYLE):
        figure, (axes,) = _axes(1, 5.0, 3.2)
        for k, move in enumerate(found):
            colour = COLOURS[k % len(COLOURS)]
            x, y = ([1e-3 * p[0] for p in (move.before, move.after)], [p[1] for p in (move.before, move.after)])
            axes.annotate("", (x[1], y[1]), (x[0], y[0]), arrowprops={"arrowstyle": "->", "color": colour})
            axes.plot(x[:1], y[:1], "o", color=colour, fillstyle="none")
            axes.plot(x[1:], y[1:], "o", color=colour, label=move.name)
        axes.set_xlabel("thousand cycles of a frame")
        axes.set_ylabel(gain)
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
        rows = [[move.name, *move.before, *move.after] for move in found]
        return Figure(name, title, "", "From the open circle to the full one.", ["machine", "cycles", "psnr_db", "cycles_after", "psnr_db_after"], rows, figure)


def paper_figures(views: Sequence[ViewResult], areas: dict[tuple[str, str], float]) -> list[Figure]:
    """Those of the paper that this run's configurations allow, in its order."""
    with plt.rc_context(STYLE):
        made = [make(views) for make in (sampling_modes, intersection, precision, rendering_stage, fifo_depth, whole_system, contribution_test)]
        return [f for f in made if f is not None] + [area(areas)]


def own_figures(views: Sequence[ViewResult]) -> tuple[list[Figure], list[Figure]]:
    """Speed, and speed times area, against accuracy; and the heat maps of every view."""
    with plt.rc_context(STYLE):
        return [speed_accuracy(views), speed_area_accuracy(views)], [f for f in map(heat, views) if f is not None]
