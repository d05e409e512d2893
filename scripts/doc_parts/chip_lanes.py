"""`make docs PART=chip_lanes` and `PART=chip_queues`: frames of the verilated chip with lanes, in docs/results/chip.md: what the lanes wait for.

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
from flicker.params import CORES, STAGES, ChipMemories, RenderConfig
from flicker.perf.lanes import LaneCycles, lane_work, simulate_lanes
from flicker.pipeline import packed_scene
from flicker.scene.packed import SLOT_LIMIT, PackedFormat
from flicker.scene.real import REAL_VIEWS
from flicker.sim.chip import ChipFrame, ChipSession
from flicker.sim.half import MemoryOptions
from flicker.sim.rendering import rendering_rtl

from .chip_hardware import four_frames
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
        stage = simulate_lanes(work, config.with_(in_width=config.delivered), leave=True)
        for memory, dram in MEMORIES.items():
            say(f"{real.title}: {lanes} lanes, memory of {memory}, four frames back to back")
            with ChipSession(packed, config, memory=MemoryOptions(dram.timing)) as chip:
                done = [row.frame for row in four_frames(chip, view.camera, CHUNKS)]
            if any(frame.error or not np.array_equal(frame.buffer, golden) for frame in done):
                raise FlickerError(f"{real.title}: the picture differs from the golden model's")
            rows.append((str(lanes), memory, *_row(done, config, stage)))
    return {"cycles": table(
        ["lanes", "memory", "front end, cycles", "rendering, cycles", "the stage alone", "cores take", "wait for their lanes, alone", "have no record",
         "a sorting unit's entries at most", "interval back to back", "FPS at 1 GHz"], rows,
    )}


def _row(done: list[ChipFrame], config: RenderConfig, stage: LaneCycles) -> tuple[str, ...]:
    """Of four frames: the last one, which is rendered with no front end beside it; the interval up to the third, as in a longer row."""
    last, names = done[-1], STAGES[config.stage].counters
    rendering = last.stamps["rendering_done"] - last.stamps["rendering_start"]
    interval = done[2].stamps["rendering_done"] - done[1].stamps["rendering_done"]
    busy, stalled = (int(last.stage[:, names.index(name)].sum()) / (CORES * rendering) for name in ("busy", "stalled"))
    return (
        f"{last.stamps['front_done'] - last.stamps['taken']:,}", f"{rendering:,}", f"{stage.cycles:,}",
        f"{busy:.1%}", f"{stalled:.1%}, {stage.stall_rate:.1%}", f"{1 - busy - stalled:.1%}",
        f"{int(np.max(last.rendering['entries'])):,}", f"{interval:,}", f"{1e9 / interval:,.0f}",
    )


ENTRY_BITS = (SLOT_LIMIT - 1).bit_length() + CORES + 1  # number, mask, and the bit that marks an end
RECORD_BITS = 8 * RecordKind.FACTORED16.bytes + 1
DEFAULT = {"Entries": ChipMemories().sorted_ahead, "Queue": ChipMemories().queued_records, "Pairs": ChipMemories().pairs, "InWidth": 1}
# Entries that each sorting unit's buffer holds, records that each core's queue holds, pairs of tiles in the frame writer, records a cycle; the memory.
HELD: tuple[tuple[dict[str, int], DramConfig | None], ...] = (
    ({"Entries": 4}, None), ({}, None), ({"InWidth": 2}, None), ({"Queue": 64}, None), ({"Entries": 1024, "Queue": 256}, None), ({"Pairs": 8}, None),
    ({}, MEMORIES["51.2 GB/s"]),
)


def queue_tables(say: Say) -> dict[str, str]:
    """The rendering half alone, by what waits before and behind the record cache, and behind the stage."""
    real = next(view for view in REAL_VIEWS if view.folder == VIEW)
    view = load(real)
    front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
    image, config = front_memory(front), RenderConfig(stage="lanes", lanes=LANES[-1])
    golden, rows = render_chip(front_lists(front), config).buffer, []
    for change, dram in HELD:
        held = DEFAULT | change
        say(f"{real.title}: {held}, memory {'of 51.2 GB/s' if dram else 'without limits'}")
        rtl = rendering_rtl(image, view.camera, config, parameters=held, **({"memory": MemoryOptions(dram.timing)} if dram else {}))
        if any(rtl.errors) or not np.array_equal(rtl.buffer[:, : golden.shape[1]], golden):
            raise FlickerError(f"{real.title}: the picture differs from the golden model's")
        bits = UNITS * held["Entries"] * ENTRY_BITS + CORES * held["Queue"] * RECORD_BITS
        rows.append((*(str(n) for n in held.values()), f"{bits:,}", "LPDDR4" if dram else "perfect", f"{rtl.cycles:,}", f"{rtl.counters['lines']:,}"))
    return {"": table(
        ["entries in a buffer", "records in a queue", "pairs of tiles", "records a cycle and core", "bits of both", "memory", "rendering half, cycles",
         "lines of records"], rows,
    )}
