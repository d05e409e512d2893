"""Frames of a path through the verilated chip, back to back as a host runs them, each beside that of the chip's golden model."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from ..chip.run import counted, frame_image
from ..errors import FlickerError
from ..front.view import View
from ..params import RenderConfig
from ..pipeline import Engine, packed_scene
from ..scene import Scene
from ..scene.camera import Camera
from ..sim.chip import ChipSession
from ..sim.half import MemoryOptions
from ..sim.row import RowFrame, back_to_back, differs
from .frames import KeptColours, Made, Wanted, make


def _facts(done: RowFrame, config: RenderConfig) -> dict[str, Any]:
    """Columns of a frame that the chip has drawn."""
    seen, phases = counted(done.frame, config), done.frame.phases
    return {
        "visible": seen["visible"], "tile_entries": seen["list_entries"], "subtile_entries": seen["subtile_pairs"],
        **({} if done.interval is None else {"cycles": done.interval}),
        "latency_cycles": done.frame.cycles, "front_cycles": phases["front end"], "render_cycles": phases["rendering"],
        **{f"bytes_{purpose}": count for purpose, count in done.moved.items()},
    }


def chip_frames(scene: Scene, cameras: Sequence[Camera], wanted: Wanted, first: int = 0) -> Iterator[Made]:
    """Frames `first` to the last one of a path, in one simulation; the first one that is made has no `cycles`. FlickerError where the chip ends a frame with
    an error or draws another picture than its golden model."""
    drawing = wanted.drawing
    golden = replace(wanted, drawing=replace(drawing, engine=Engine.CHIP_GOLDEN), cycles=False)
    packed = packed_scene(View(cameras[first], scene), drawing.options.format, drawing.options.rechunk)
    with ChipSession(packed, drawing.config, memory=MemoryOptions(drawing.dram.timing)) as chip:
        background = [round(255 * float(v)) for v in wanted.background]
        store = None if wanted.tolerance is None else chip.store(wanted.tolerance)
        kept = KeptColours(golden)
        row = back_to_back(chip, cameras[first:], background=background, lists=drawing.options.lists, order=wanted.order, store=store)
        for number in range(first, len(cameras)):
            made = make(scene, golden, number, cameras[number], kept)
            began = time.perf_counter()
            done = next(row)
            image = frame_image(done.frame.buffer, cameras[number])
            if wrong := differs(image, made.image):
                raise FlickerError(f"frame {number}: the chip's picture is not that of its golden model: {wrong}")
            facts = made.facts | _facts(done, drawing.config) | {"made_s": made.facts["made_s"] + time.perf_counter() - began}
            yield replace(made, image=image, facts=facts)
