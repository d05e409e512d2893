"""`make docs PART=chip_memory`: memories of the chip, unit by unit, from the plan of its synthesis (no unit is synthesised for it)."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields

from flicker import markdown
from flicker.cost.chip_area import UM2_PER_BIT
from flicker.cost.stamp import LIBERTY, rtl_stamp
from flicker.cost.synth.run import Runner
from flicker.cost.synth.units import MEMORIES
from flicker.errors import FlickerError
from flicker.params import CHIP_MEMORIES, ChipMemories, RenderConfig

from .common import Say

TOP = "flk_top"
PAPER_KB = 288
# Cells that only hold something for the unit that has them.
HOLDERS = {"flk_pair_fifo", "flk_record_queue", "flk_sram_fifo", "flk_delay_ram", "flk_axi_fetch"}
# Instances of the top, and what they are called.
SIDES = {"i_front": "front end", "i_rendering": "rendering", "": "top"}
SHAPES = 4  # so many kinds of memories are listed in a row


def memories(runner: Runner, key: str, side: str = "", owner: str = TOP) -> Counter[tuple[str, str, str, int, int]]:
    """Of a planned unit: (side, unit, module, words, bits of a word) to their number."""
    found: Counter[tuple[str, str, str, int, int]] = Counter()
    for instance, child in runner.tasks[key]["children"].items():
        job = runner.tasks[child]
        below = side or (instance if instance in SIDES else "")
        if job["top"] in MEMORIES:
            found[below, owner, job["top"], job["parameters"]["Depth"], job["parameters"]["Width"]] += 1
        else:
            found += memories(runner, child, below, owner if job["top"] in HOLDERS else job["top"])
    return found


def _shapes(kinds: list[tuple[int, int, int]]) -> str:
    if len(kinds) <= SHAPES:
        return ", ".join(f"{count} of {words} x {bits}" for count, words, bits in kinds)
    (least, narrow), (most, wide) = min((w, b) for _, w, b in kinds), max((w, b) for _, w, b in kinds)
    return f"{sum(count for count, _, _ in kinds)} of {least} x {narrow} to {most} x {wide}"


def tables(say: Say) -> dict[str, str]:
    say("plan of flk_top")
    runner = Runner(LIBERTY)
    found = memories(runner, runner.add(TOP, {}))
    rows, sums = [], Counter[str]()
    units = sorted({(side, unit, module) for side, unit, module, _, _ in found}, key=lambda x: (list(SIDES).index(x[0]), *x[1:]))
    for side, unit, module in units:
        kinds = sorted((count, words, bits) for (*holder, words, bits), count in found.items() if holder == [side, unit, module])
        total = sum(count * words * bits for count, words, bits in kinds)
        sums[side] += total
        rows.append([SIDES[side], f"`{unit}`", _shapes(kinds), MEMORIES[module], *_sizes(total)])
    for side, total in sums.items():
        rows.append([SIDES[side], "all", "", "", *_sizes(total)])
    rows.append(["chip", "all", f"{sum(found.values())} memories", "", *_sizes(sum(sums.values()))])
    planned = {name: memories(runner, runner.add(TOP, RenderConfig(memories=name).top_parameters())) for name in CHIP_MEMORIES if name != "default"}
    bits = {name: sum(words * width * count for (*_, words, width), count in of.items()) for name, of in {"default": found, **planned}.items()}
    sizes = [
        [f"`{name}`", *(f"{value:,}" for value in vars(CHIP_MEMORIES[name]).values()), *_sizes(bits[name])] for name in CHIP_MEMORIES
    ]
    head = f"Planned from RTL {rtl_stamp()}.\n\n"
    if bits["small"] > PAPER_KB * 8192:
        raise FlickerError(f"small memories: {bits['small']:,} bits, more than the paper's {PAPER_KB} KB")
    names = ["memories", *(f.name.replace("_", " ") for f in fields(ChipMemories)), "bits", "KB", "mm2"]
    return {"sizes": markdown.table(names, sizes), "": head + markdown.table(["half", "unit", "memories, words x bits", "ports", "bits", "KB", "mm2"], rows)
            + f"\n\nThe paper: {PAPER_KB} KB of feature buffers and others, {PAPER_KB * 8192:,} bits."}


def _sizes(bits: int) -> list[str]:
    return [f"{bits:,}", f"{bits / 8192:.1f}", f"{bits * UM2_PER_BIT / 1e6:.3f}"]
