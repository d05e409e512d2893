#!/usr/bin/env python3
"""Writes every generated table and chart of README.md and docs/: `make docs [PART=name]`.

    scripts/docs.py [PART ...] [--list]

PARTS is the list of parts. A page takes a table between `<!-- make docs PART=name place -->` and `<!-- end -->` (scripts/pages.py), so that each table
says what writes it. Without PART all parts are written in the order of the list; those whose inputs are missing are skipped with a line that says what
is missing. A part that is named must be possible: else exit 1, as for any error.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import pages
from doc_parts import (
    areas,
    budget,
    chip,
    chip_hardware,
    chip_lanes,
    chip_memory,
    chip_sizes,
    chips,
    commands,
    configurations,
    cuts,
    delivery,
    energy,
    exploration,
    families,
    formal,
    fpga,
    frame_energy,
    frames,
    front,
    front_hardware,
    instance,
    kept_colours,
    lane_stage,
    lanes,
    late,
    lists,
    long_lists,
    meanings,
    modules,
    motion,
    mutants,
    order,
    packing,
    parameters,
    photographs,
    pictures,
    proofs,
    quality,
    record_cache,
    rendering_hardware,
    scale,
    scale_hardware,
    sh_bits,
    shared,
    soc,
    speed,
    stability,
    subnormals,
    synthesis,
    system,
    through,
    view,
)
from doc_parts.common import Say, scenes_missing
from rich.console import Console

from flicker.errors import FlickerError, Interrupted
from flicker.progress import undivided
from flicker.toolchain import ROOT


def nothing_missing() -> str | None:
    return None


@dataclass(frozen=True)
class Part:
    """Places of pages that one command writes.

    name: of PART. what: for --list. places: second words of the marks; ("",): the only place of the part. tables: text by place, called with a function
    that shows what is being done. missing: why the part cannot be written now, in one line; None when it can. before: writes files that are not pages
    and the tables rest on; returns what it did. cheap: made in seconds from files in the repository, so that tb/test_docs.py holds the pages against it.
    """

    name: str
    what: str
    places: tuple[str, ...]
    tables: Callable[[Say], dict[str, str]]
    missing: Callable[[], str | None] = nothing_missing
    before: Callable[[Say], str] | None = None
    cheap: bool = False


PARTS = (
    Part("parameters", "constants and counters of params.py", ("constants", "counters"), parameters.tables, cheap=True),
    Part("modules", "every module: page, purpose, tests, parameters; what tests of units cover",
         ("inventory", "parameters", "tests", "pipelines"), modules.tables, cheap=True),
    Part("shared", "sizes of memories, modes, packed structs, operations on ff numbers", ("memories", "modes", "structs", "ff"), shared.tables, cheap=True),
    Part("meanings", "what modules of the model say that they do", tuple(meanings.MODULES), meanings.tables, cheap=True),
    Part("heads", "what modules say of their ports and timing", tuple(modules.HEADS), modules.heads, cheap=True),
    Part("configurations", "list of configurations and groups", ("list", "groups"), configurations.tables, cheap=True),
    Part("commands", "options of every command of flicker", commands.PLACES, commands.tables, cheap=True),
    Part("areas", "areas.csv from make synth; areas and energies that follow from it", ("stages", "generators", "events", "constants"), areas.tables,
         areas.missing, before=areas.save, cheap=True),
    Part("instance", "instantiation templates, port duties, accesses of memory", ("", "chip", "axi", "duties", "managers"), instance.tables, cheap=True),
    Part("constants", "constants of the chip model", ("",), chip.constant_tables, cheap=True),
    Part("dram", "access patterns on the DRAM model", ("",), chip.dram_tables),
    Part("synthesis", "tables of make synth", ("units", "summary"), synthesis.tables, synthesis.missing),
    Part("chip_list", "the chips of chips.toml", ("list",), chips.parameters, cheap=True),
    Part("chips", "chips by name: area, memory, frames of the demo scene", ("",), chips.tables),
    Part("chip_sizes", "which chip a scene needs: frames a second by size of the chip, with chart", ("rates", "needs"), chip_sizes.tables, scenes_missing),
    Part("chip_memory", "memories of the chip, unit by unit", ("", "sizes"), chip_memory.tables),
    Part("fpga", "chips on FPGAs, and how full boards are", ("boards", "units", "known"), fpga.tables),
    Part("floorplan", "a rendering stage placed and routed on an ECP5", ("stages", "path"), fpga.floorplan),
    Part("library", "another cell library beside our own", ("",), synthesis.library_tables, synthesis.library_missing),
    Part("proofs", "what is proved", ("",), proofs.tables, cheap=True),
    Part("families", "families of the stability suite", ("still", "moving"), families.tables, cheap=True),
    Part("formal", "results of make formal", ("",), formal.tables, formal.missing),
    Part("mutants", "who kills the mutants of the hardware", ("",), mutants.tables, mutants.missing),
    Part("energy", "energy of a frame by part", ("",), energy.tables, scenes_missing),
    Part("frame_energy", "energy of whole frames, DRAM and all, over GSCore's", ("",), frame_energy.tables, scenes_missing),
    Part("frames", "few configurations on real views; from the default to lanes, step by step", ("summary", "ablation", "deeper"), frames.tables,
         scenes_missing),
    Part("stability", "where configurations break", ("",), stability.tables),
    Part("stability_front", "where front ends break: records of 16 and 32 bytes, number formats", ("records", "formats"), stability.front_tables),
    Part("stability_moving", "what flickers at which speed of the camera", ("",), stability.moving_tables),
    Part("subnormals", "subnormal numbers flushed to zero", ("",), subnormals.tables, scenes_missing),
    Part("pictures", "pictures, work and misses of mask generators", ("work", "slots"), pictures.tables, scenes_missing),
    Part("quality", "every mode, format and form of the RTL", ("factored", "conic", "coordinates"), quality.tables, scenes_missing),
    Part("chip", "whole frames: culling, memory, lists, sorting",
         ("counts", "culling", "frames", "traffic", "schemes", "variations", "broadcast", "formats", "keys"), chip.tables, scenes_missing),
    Part("budget", "real scenes to budgets, step by step; half an hour, can be interrupted", ("results", "alone", "steps"), budget.tables, scenes_missing,
         before=budget.draw),
    Part("photographs", "Table 1 against photographs: fitted, pruned, fine-tuned; an hour, can be interrupted", ("",), photographs.tables, scenes_missing),
    Part("through", "every mode before and after fine-tuning through its contribution test; an hour, can be interrupted", ("",), through.tables,
         scenes_missing, before=through.draw),
    Part("packing", "memory images in every format, and choices in making chunks", ("alternatives", "alone"), packing.tables, scenes_missing),
    Part("sh_bits", "SH codes of fewer bits: bytes, cycles and pictures", ("",), sh_bits.tables, scenes_missing),
    Part("kept_colours", "frames that keep colours: clusters, bytes, cycles, pictures", ("",), kept_colours.tables, scenes_missing),
    Part("path_hardware", "paths through larger chips in RTL, beside GSCore; half an hour", ("",), kept_colours.chip_tables, scenes_missing),
    Part("path_sizes", "larger pictures through a larger chip in RTL; half an hour", ("",), kept_colours.size_tables, scenes_missing),
    Part("kept_hardware", "such frames in the whole chip's RTL; an hour", ("cycles", "spent", "rows"), kept_colours.hardware_tables, scenes_missing),
    Part("front", "bit-true front end: pictures, what becomes of Gaussians, number formats",
         ("pictures", "outcomes", "formats", "cells", "fixed", "opacity"), front.tables, scenes_missing),
    Part("front_hardware", "front end's RTL: cycles and bytes", ("cycles", "traffic"), front_hardware.tables, scenes_missing),
    Part("rendering_hardware", "rendering half's RTL beside the chip model", ("cycles",), rendering_hardware.tables, scenes_missing),
    Part("chip_hardware", "frames of the whole chip in RTL beside the chip model", ("cycles", "traffic", "waits"), chip_hardware.tables, scenes_missing),
    Part("system", "rendering stages in whole chips", ("",), system.tables, scenes_missing),
    Part("chip_lanes", "frames of the whole chip with lanes in RTL", ("cycles",), chip_lanes.tables, scenes_missing),
    Part("chip_queues", "the rendering half with lanes by the depth of its queues", ("",), chip_lanes.queue_tables, scenes_missing),
    Part("record_cache", "lines that the record cache reads", ("sizes", "walks"), record_cache.tables, scenes_missing),
    Part("delivery", "sorting and delivery alone", ("alone",), delivery.tables, scenes_missing),
    Part("lanes", "lanes in the log domain: number formats, masks, where the dB go",
         ("breakdown", "formats", "families", "masks", "counts", "stability"), lanes.tables, scenes_missing,
         before=lanes.draw),
    Part("lane_stage", "the lanes' RTL: cycles and areas; cycles of cores that take more", ("cycles", "feeds", "area"), lane_stage.tables, scenes_missing),
    Part("lists", "layouts of tile lists in DRAM", ("entries", "formats", "layouts", "flight"), lists.tables, scenes_missing),
    Part("long_lists", "ways to sort lists longer than a sorting unit", ("sizes", "early", "real", "means"), long_lists.tables, scenes_missing),
    Part("scale", "how a frame grows with the scene and the picture, with the chart", ("scene", "degree", "picture"), scale.tables, scenes_missing),
    Part("scale_hardware", "long lists and grown scenes in the whole chip's RTL; half an hour", ("", "spent"), scale_hardware.tables, scenes_missing),
    Part("motion", "speed against stability: what pictures do from frame to frame, with chart, strip and clip; half an hour, can be interrupted",
         ("cycles", "pan", "shake", "walk"), motion.tables, scenes_missing, before=motion.draw),
    Part("late", "frames that miss their slot, and enormous Gaussians near the camera; half an hour, can be interrupted", ("paths", "giants"), late.tables,
         scenes_missing),
    Part("cuts", "where lists end, and the pixels of lanes that jump for it", ("",), cuts.tables, scenes_missing),
    Part("order", "splats by depth and by distance while the camera turns on the spot", ("",), order.tables, scenes_missing),
    Part("soc", "a processor boots and renders with the chip, in simulation", ("",), soc.tables, soc.missing),
    Part("speed", "engines timed on one frame", ("engines", "rtl", "model"), speed.tables, scenes_missing),
    Part("view", "the viewer in a headless browser: its picture, how fast it is", ("",), view.tables, view.missing, before=view.draw),
    Part("exploration", "all configurations of the report on real views, with the chart", ("explored", "halves"), exploration.tables, scenes_missing,
         before=exploration.draw),
)


def texts(part: Part, say: Say) -> dict[pages.Place, str]:
    """Text of every place of a part."""
    found = part.tables(say)
    if found.keys() != set(part.places):
        raise FlickerError(f"docs: part {part.name} gave {', '.join(found)}, not {', '.join(part.places)}")
    return {(part.name, place): text.strip() for place, text in found.items()}


def write(part: Part, console: Console) -> None:
    """Make a part and put it into its pages; a line on the terminal says what has changed and how long it took."""
    began = time.monotonic()
    with console.status(f"{part.name}: {part.what}") as status:
        def say(text: str) -> None:
            status.update(f"{part.name}: {text}")

        done = [part.before(say)] if part.before is not None else []
        made = texts(part, say)
        with undivided():  # all its pages or none
            changed = pages.put(made)
    done.append(", ".join(str(page.relative_to(ROOT)) for page in changed) or "no page changed")
    console.print(f"docs: {part.name}: {'; '.join(done)} ({time.monotonic() - began:.0f} s)", highlight=False, soft_wrap=True)


def chosen(names: list[str]) -> list[Part]:
    """Parts by name, in the order of PARTS; all without a name. Raises FlickerError."""
    known = {part.name for part in PARTS}
    for name in names:
        if name not in known:
            raise FlickerError(f"PART: no part '{name}'; there are {', '.join(part.name for part in PARTS)}")
    return [part for part in PARTS if not names or part.name in names]


def main(arguments: list[str] | None = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", nargs="*")
    parser.add_argument("--list", action="store_true", help="list the parts with what each lacks, write nothing")
    options = parser.parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 180)
    wrong, parts = 0, chosen(options.part)
    ended: list[Part] = []
    try:
        for part in parts:
            wrong += _one(part, bool(options.part), options.list, console)
            ended.append(part)
    except KeyboardInterrupt:
        raise Interrupted(_kept(ended, parts[len(ended) :], bool(options.part))) from None
    return 1 if wrong else 0


def _kept(ended: list[Part], left: list[Part], asked: bool) -> str:
    """What Ctrl-C in the first of the parts `left` leaves, and how to go on. asked: the parts were named; else those that lack something are skipped."""
    written = [part.name for part in ended if part.missing() is None]
    rest = [part.name for part in left if asked or part.missing() is None]
    kept = f", {', '.join(written)} {'are' if len(written) > 1 else 'is'} written" if written else ""
    return f"{left[0].name} is not finished{kept}; to go on: make docs PART={shlex.quote(' '.join(rest))}"


def _one(part: Part, asked: bool, listed: bool, console: Console) -> int:
    """Write or list a part; 1 where it was asked for and could not be written, 0 else."""
    reason = part.missing()
    if listed:
        console.print(f"{part.name:15} {part.what}" + (f" [missing: {reason}]" if reason else ""), highlight=False, soft_wrap=True, markup=False)
        return 0
    if reason:
        console.print(f"docs: {part.name}: {'not written' if asked else 'skipped'}, {reason}", highlight=False, soft_wrap=True, markup=False)
        return int(asked)
    try:
        write(part, console)
    except FlickerError as error:
        console.print(f"docs: {part.name}: {error}", highlight=False, soft_wrap=True, markup=False)
        return 1
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"docs: {error}")
    except KeyboardInterrupt as kept:
        print(f"docs: interrupted{f': {kept}' if isinstance(kept, Interrupted) else ''}", file=sys.stderr)
        sys.exit(130)
