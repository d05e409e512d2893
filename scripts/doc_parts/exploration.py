"""`make docs PART=exploration`: every explored configuration on the real views, half of GSCore's cycles, and the charts of speed against accuracy.

All configurations of the report are needed, since the chart shows them: about 20 minutes the first time, later out of the store that
`flicker report` and sweeps share.
"""

from __future__ import annotations

from flicker import markdown
from flicker.cost.area import lane_stage_parts
from flicker.explore.configurations import EXPLORED, get_configuration, group
from flicker.perf.lane_stage import LaneStage
from flicker.report.collect import ViewResult
from flicker.report.figures import speed_accuracy, speed_area_accuracy
from flicker.scene.real import REAL_VIEWS

from .common import Measured, Rows, Say, measure, save_charts, significant

PLAIN = 58.0  # dB: what is no worse than this counts as as good as GSCore


def explored(views: Rows) -> str:
    """Area, and of each view PSNR, cycles, share of the bound, energy."""
    rows = []
    for theme in EXPLORED:
        rows.append([f"**{theme}**", *[""] * (2 + len(views))])
        for name in group(theme):
            configuration = get_configuration(name)
            cells = [
                f"{row['psnr_db']:.1f} / {significant(row['cycles'] / 1e6, 3)} / {row['bound_share']:.0%} / {significant(row['energy_uj'], 2)}"
                for row in (found[name] for found in views.values())
            ]
            rows.append([f"`{name}`", configuration.title, significant(configuration.area() / 1e6, 3), *cells])
    return markdown.table(["configuration", "what", "MGE", *views], rows)


def lanes_that_fit(area: float) -> int:
    """How many lanes of four pixels with FIFOs of depth 4 an area has room for, beside mask generators, counters and arbiters."""
    parts = lane_stage_parts(LaneStage(), get_configuration("lanes-64").generator.area(), 64, 4, get_configuration("lanes-64").stage.accumulator)
    return int((area - sum(parts.values())) // ((parts["VRUs"] + parts["feature FIFOs"]) / 64)) + 64


def halves(views: Rows) -> str:
    """Half of GSCore's cycles at its area: what it takes, what is reached."""
    heads = [
        "view", "GSCore, M cycles", "half", "VRUs that half needs, all busy with what contributes", "the same with what lanes-64 visits", "lanes that fit",
        "fastest configuration that fits", "M cycles", "reached",
    ]
    lines = []
    area = get_configuration("gscore").area()
    for view, rows in views.items():
        cycles = rows["gscore"]["cycles"]
        half = cycles / 2
        fitting = {
            name: row["cycles"] for name, row in rows.items()
            if get_configuration(name).area() <= area and row["psnr_db"] >= PLAIN and not get_configuration(name).generator.free
            and not (get_configuration(name).stage.idealised and get_configuration(name).family != "baseline")
        }
        best = min(fitting, key=lambda name: fitting[name], default=None)
        lanes = rows["lanes-64"]
        visits = lanes["vru_utilisation"] * lanes["cycles"] * 64
        lines.append([
            view, f"{cycles / 1e6:.3f}", f"{half / 1e6:.3f}", f"{lanes['pixels_contributing'] / half:.1f}", f"{visits / half:.1f}", str(lanes_that_fit(area)),
            *(["none", "", "no"] if best is None else [
                f"`{best}`, {significant(get_configuration(best).area() / 1e6, 3)} MGE", f"{fitting[best] / 1e6:.3f}", "yes" if fitting[best] <= half else "no",
            ]),
        ])
    return markdown.table(heads, lines)


def draw(say: Say) -> str:
    """The charts of the report, of the real views."""
    names = group("report")
    views = [ViewResult(measured.target, measured.rows(names, say)) for measured in map(Measured, REAL_VIEWS)]
    figures = [speed_accuracy(views), speed_area_accuracy(views)]
    return save_charts(figures)


def tables(say: Say) -> dict[str, str]:
    views = measure(group("report"), say)
    return {"explored": explored(views), "halves": halves(views)}
