"""`make docs PART=chip_lanes` and `PART=chip_queues`: frames of the verilated chip with lanes, in docs/chip.md: what the lanes wait for.

An error: a frame buffer that differs from the golden model's.
"""

from __future__ import annotations

import numpy as np

from flicker.chip.dram import DramConfig
from flicker.errors import FlickerError
from flicker.golden.chip import render_chip
from flicker.golden.delivery import UNITS
from flicker.golden.front.frame import run_front
from flicker.golden.front.memory import front_memory
from flicker.golden.front.record import RecordKind
from flicker.golden.lanes.lists import front_lists
from flicker.markdown import table
from flicker.params import CORES, STAGES, RenderConfig
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS
from flicker.sim.chip import ChipFrame, ChipSession, pointers_for
from flicker.sim.half import MemoryOptions
from flicker.sim.rendering import rendering_rtl

from .chip_hardware import back_to_back
from .common import Say, load

VIEW = "flowers"
LANES = (32, 64)
CHUNKS = 24_000  # of a list writer: enough for this view
MEMORIES = {"51.2 GB/s": DramConfig(), "four times as fast": DramConfig(channels=4 * DramConfig().channels)}


def tables(say: Say) -> dict[str, str]:
    real = next(view for view in REAL_VIEWS if view.folder == VIEW)
    view = load(real)
    packed = packed_scene(view, PackedFormat.CHUNK)
    lists = front_lists(run_front(packed, view.camera))
    work, rows = lane_work(lists), []
    for lanes in LANES:
        config = RenderConfig(stage="lanes", lanes=lanes)
        golden = render_chip(lists, config).buffer
        stage = simulate_lanes(work, config.with_(in_width=1), leave=True).cycles
        for memory, dram in MEMORIES.items():
            say(f"{real.title}: {lanes} lanes, memory of {memory}, three frames back to back")
            with ChipSession(packed, config, pointers=pointers_for(view.camera), memory=MemoryOptions(dram.timing)) as chip:
                done = back_to_back(chip, view.camera, CHUNKS)
            if any(frame.error or not np.array_equal(frame.buffer, golden) for frame in done):
                raise FlickerError(f"{real.title}: the picture differs from the golden model's")
            rows.append((str(lanes), memory, *_row(done, config, stage)))
    return {"cycles": table(
        ["lanes", "memory", "front end, cycles", "rendering, cycles", "the stage alone", "cores without a record", "a sorting unit's entries at most",
         "interval back to back", "FPS at 1 GHz"], rows,
    )}


def _row(done: list[ChipFrame], config: RenderConfig, stage: int) -> tuple[str, ...]:
    """Of three frames: the last one, which is rendered with no front end beside it."""
    last = done[2]
    rendering = last.stamps["rendering_done"] - last.stamps["rendering_start"]
    idle = int(last.stage[:, STAGES[config.stage].counters.index("idle")].sum())
    interval = done[2].stamps["rendering_done"] - done[1].stamps["rendering_done"]
    return (
        f"{last.stamps['front_done'] - last.stamps['taken']:,}", f"{rendering:,}", f"{stage:,}", f"{idle / (CORES * rendering):.1%}",
        f"{int(np.max(last.rendering['entries'])):,}", f"{interval:,}", f"{1e9 / interval:,.0f}",
    )


ENTRY_BITS = 28 + 1  # record number, mask, and the bit that marks an end
RECORD_BITS = 8 * RecordKind.FACTORED16.bytes + 1
# Entries that each sorting unit's buffer holds, records that each core's queue holds.
HELD = ((4, 64), (512, 64), (512, 128))


def queue_tables(say: Say) -> dict[str, str]:
    """The rendering half alone, with a memory that answers everything at once, by what waits before and behind the record cache."""
    real = next(view for view in REAL_VIEWS if view.folder == VIEW)
    view = load(real)
    front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
    image, config = front_memory(front), RenderConfig(stage="lanes", lanes=LANES[-1])
    golden, rows = render_chip(front_lists(front), config).buffer, []
    for entries, queue in HELD:
        say(f"{real.title}: buffers of {entries}, queues of {queue}")
        rtl = rendering_rtl(image, view.camera, config, parameters={"Entries": entries, "Queue": queue})
        if any(rtl.errors) or not np.array_equal(rtl.buffer[:, : golden.shape[1]], golden):
            raise FlickerError(f"{real.title}: the picture differs from the golden model's")
        bits = UNITS * entries * ENTRY_BITS + CORES * queue * RECORD_BITS
        rows.append((str(entries), str(queue), f"{bits:,}", f"{rtl.cycles:,}", f"{rtl.counters['lines']:,}"))
    return {"": table(["entries in a buffer", "records in a queue", "bits of all", "rendering half, cycles", "lines of records"], rows)}
