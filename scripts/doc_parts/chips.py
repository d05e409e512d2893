"""`make docs PART="chips chip_list"`: the chips of chips.toml: parameters, area and memory, frames a second of the demo scene by the model."""

from __future__ import annotations

from dataclasses import fields

from flicker import markdown
from flicker.chip.compare import frame_cost
from flicker.chip.constants import CLOCK_HZ
from flicker.chip.drawing import Drawing
from flicker.chips import Chip, chips
from flicker.cost.area import parts
from flicker.cost.chip_area import UM2_PER_BIT
from flicker.cost.synth.units import chip_row
from flicker.front.view import DEMO, load_view
from flicker.params import RenderConfig
from flicker.pipeline import Engine

from .common import Say
from .fpga import mapped

BOARD_HZ = 150_000_000  # of a chip on an FPGA
SIZES = ((160, 90),)


def parameters(say: Say) -> dict[str, str]:
    """What the table says: names, purpose, status, fields that are not the default."""
    usual = {field.name: field.default for field in fields(RenderConfig)}
    rows = []
    for chip in chips().values():
        values = {name: getattr(chip.config, name) for name in usual}
        own = ", ".join(f"`{name}` {getattr(value, 'name', value)}".lower() for name, value in values.items() if name == "stage" or value != usual[name])
        rows.append([f"`{chip.name}`", chip.purpose, chip.status, own])
    return {"list": markdown.table(["chip", "for", "status", "parameters, of those that are not the default's"], rows)}


def _area(chip: Chip) -> list[str]:
    found = parts().get(chip_row(chip))
    if found is None:
        return ["not synthesised", "", ""]
    return [f"{found.ge:,.0f}", f"{found.sram_bits / 8192:.0f}", f"{found.sram_bits * UM2_PER_BIT / 1e6:.2f}"]


def _on_fpga(chip: Chip) -> list[str]:
    """LUTs with memories in LUTs, DSPs, blocks of RAM."""
    found = mapped().get((chip.name, "xcup"))
    if found is None:
        return ["not mapped", "", ""]
    all_ = found["all"]
    return [f"{all_['lut'] + all_['lutram']:,}", f"{all_['dsp']:,}", f"{all_['bram']:,.1f}"]


def tables(say: Say) -> dict[str, str]:
    """Area, memories, what UltraScale+ needs, cycles. A chip without a row of make synth or without make fpga says so."""
    rows = []
    for chip in chips().values():
        row = [f"`{chip.name}`", chip.status, str(chip.config.port_bits), *_area(chip), *_on_fpga(chip)]
        for size in SIZES:
            say(f"frame of {chip.name}, {size[0]}x{size[1]}")
            cost = frame_cost(load_view(DEMO, 0, size), Drawing(Engine.CHIP, chip.config))
            row += [f"{cost['front_cycles']:,}", f"{cost['render_cycles']:,}", f"{CLOCK_HZ / cost['cycles']:,.0f}", f"{BOARD_HZ / cost['cycles']:,.0f}"]
        rows.append(row)
    head = ["chip", "status", "port, bits", "GE", "memory, KB", "memory, mm2", "LUT6 with memory", "DSP", "BRAM36"]
    for width, height in SIZES:
        head += [f"{width}x{height}: front end, cycles", "rendering, cycles", "frames a second at 1 GHz", "at 150 MHz"]
    return {"": markdown.table(head, rows)}
