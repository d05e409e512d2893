"""`make docs PART=chip_sizes`: frames a second of the chips with lanes on the real views, and the least chip for a display, by the models, in
docs/results/chips.md."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt

from flicker.chip.constants import CLOCK_HZ
from flicker.chip.dram import DramConfig
from flicker.chip.whole import WholeFrame, first_half, whole_frame
from flicker.chips import Chip, chips
from flicker.cost.area import parts
from flicker.cost.chip_area import square_millimetres
from flicker.cost.energy import DRAM_PJ_PER_BIT
from flicker.cost.synth.units import chip_row
from flicker.front.view import View
from flicker.golden.front.frame import run_front
from flicker.golden.lanes.lists import front_lists
from flicker.golden.lanes.render import render_lanes
from flicker.markdown import table
from flicker.params import Form
from flicker.pipeline import packed_scene
from flicker.report.figures import Figure
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS

from .chips import BOARD_HZ
from .common import Say, load, save_charts

SIZES = ((1280, 720), (1920, 1080))
DISPLAYS = (30, 72, 90)  # Hz
CLOCKS = {"1 GHz": CLOCK_HZ, "150 MHz": BOARD_HZ}


@dataclass(frozen=True, eq=False)
class Of:
    """A view at a size. decibels: of the lanes' picture, which every chip draws, to the reference. frames: by the chips' names."""

    title: str
    decibels: float
    frames: dict[str, WholeFrame]

    def fps(self, name: str, clock: float) -> float:
        return clock / self.frames[name].interval


def _measured(say: Say, table_: list[Chip]) -> list[Of]:
    found = []
    for real in REAL_VIEWS:
        loaded = load(real)
        for size in SIZES:
            view = View(loaded.camera.resized(*size), loaded.scene, name=loaded.name)
            title = f"{real.title}, {size[0]}x{size[1]}"
            say(title)
            front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
            decibels = psnr(render_lanes(front_lists(front)).image(), view.reference)
            frames = {}
            for chip in table_:
                dram = DramConfig(port_bits=chip.config.port_bits)
                frames[chip.name] = whole_frame(*first_half(front, chip.config, dram), chip.config, dram)
            found.append(Of(title, decibels, frames))
    return found


def _least(of: Of, table_: list[Chip], fps: float, clock: float) -> str:
    return next((f"`{chip.name}`" for chip in table_ if of.fps(chip.name, clock) >= fps), f"none ({of.fps(table_[-1].name, clock):.0f})")


def _chart(found: list[Of], table_: list[Chip], areas: dict[str, float]) -> Figure:
    fig, axes = plt.subplots(1, len(SIZES), figsize=(9.0, 4.4), sharey=True, layout="constrained")
    rows = []
    for axis, size in zip(axes, SIZES):
        own = [of for of in found if of.title.endswith(f"{size[0]}x{size[1]}")]
        for k, of in enumerate(own):
            fps = [of.fps(chip.name, CLOCK_HZ) for chip in table_]
            axis.plot([areas[chip.name] for chip in table_], fps, "-o", color=f"C{k}", markersize=4, label=of.title.split(",")[0])
            rows += [[of.title, chip.name, areas[chip.name], of.frames[chip.name].interval] for chip in table_]
        for hz in DISPLAYS:
            axis.axhline(hz * CLOCK_HZ / BOARD_HZ, color="0.6", linestyle=":", linewidth=1)
            axis.annotate(f"{hz} Hz at 150 MHz", (0.99, hz * CLOCK_HZ / BOARD_HZ), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
        axis.set_yscale("log")
        axis.set_xlabel("area, mm²")
        axis.set_title(f"{size[0]}x{size[1]}", fontsize=10)
        axis.grid(alpha=0.3)
        for chip in table_:
            axis.annotate(chip.name, (areas[chip.name], 0.02), xycoords=("data", "axes fraction"), rotation=90, ha="right", va="bottom", fontsize=7)
    axes[0].set_ylabel("frames a second at 1 GHz")
    axes[0].legend(fontsize=8, frameon=False)
    return Figure("chip_sizes", "Frames a second by size of the chip", "", "", ["view", "chip", "mm2", "cycles"], rows, fig)


def tables(say: Say) -> dict[str, str]:
    known = parts()
    table_ = [chip for chip in chips().values() if chip.config.form is Form.FACTORED and chip.config.by_lanes]
    areas = {chip.name: square_millimetres(part.ge, part.sram_bits) for chip in table_ for part in [known[chip_row(chip)]]}
    table_.sort(key=lambda chip: areas[chip.name])
    found = _measured(say, table_)
    say(save_charts([_chart(found, table_, areas)]))
    rates, needs = [], []
    for of in found:
        row = [of.title, f"{of.decibels:.1f}"]
        for chip in table_:
            frame = of.frames[chip.name]
            row.append(f"{of.fps(chip.name, CLOCK_HZ):,.0f}, {of.fps(chip.name, BOARD_HZ):.0f}: {frame.bottleneck}")
        moved = sum(of.frames[table_[-1].name].bytes.values())
        rates.append((*row, f"{moved / 1e6:.1f}", f"{8 * moved * DRAM_PJ_PER_BIT / 1e9:.2f}"))
        needs.append((of.title, *(_least(of, table_, hz, clock) for clock in CLOCKS.values() for hz in DISPLAYS)))
    return {
        "rates": table(["view", "dB", *(f"`{chip.name}`, {areas[chip.name]:.2f} mm2" for chip in table_), "MB a frame", "mJ of the DRAM"], rates),
        "needs": table(["view", *(f"{hz} Hz at {name}" for name in CLOCKS for hz in DISPLAYS)], needs),
    }
