"""`make docs PART=front_hardware`: cycles and bytes of the front end's RTL, in docs/results/front_end.md. Bytes that differ from the golden model's are
an error."""

from __future__ import annotations

import time

import numpy as np

from flicker.chip.dram import DramConfig, Refresh
from flicker.chip.preprocessing import estimate
from flicker.errors import FlickerError
from flicker.golden.front.frame import run_front
from flicker.golden.front.memory import front_memory
from flicker.markdown import table
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat
from flicker.sim.half import BEAT, MemoryOptions
from flicker.sim.memory import PortConfig
from flicker.sim.preprocessing import PORTS, PURPOSES, build, front_rtl

from .common import Say, titled_views

PORT = PortConfig(max_reads=128, max_writes=256, latency=20, hazards=False)
MEMORIES = {
    "perfect, latency 20": None,
    "LPDDR4, 20 cycles on top": DramConfig(),
    "LPDDR4, refresh bank by bank": DramConfig(refresh=Refresh.PER_BANK),
    "LPDDR4, reads and writes in one queue": DramConfig(write_places=0),
}


def tables(say: Say) -> dict[str, str]:
    rows, traffic = [], []
    build()
    for title, view in titled_views(say):
        packed = packed_scene(view, PackedFormat.CHUNK)
        golden = run_front(packed, view.camera)
        due = front_memory(golden)
        lines = np.unique(np.concatenate(due.lists.writes))
        for name, dram in MEMORIES.items():
            say(f"{title}: {name}")
            begin = time.process_time()
            memory = MemoryOptions(dram.timing if dram else None, dict.fromkeys(PORTS, PORT))
            rtl = front_rtl(packed, view.camera, chunks=due.lists.chunks, memory=memory)
            seconds = time.process_time() - begin
            if not (np.array_equal(rtl.records[due.written], due.records[due.written]) and np.array_equal(rtl.memory[lines], due.lists.memory[lines])
                    and np.array_equal(rtl.pointers, due.lists.pointers)):
                raise FlickerError(f"{title}: memory differs from the golden model's")
            model = estimate(golden, due, dram)
            if {n: BEAT * (c.read_beats + c.write_beats) for n, c in rtl.traffic.items()} != model.bytes:
                raise FlickerError(f"{title}: bytes differ from the chip model's")
            if abs(model.cycles / rtl.cycles - 1) > 0.1:
                raise FlickerError(f"{title}: the chip model's cycles are more than 10 % off")
            rows.append((title, name, f"{len(packed):,}", f"{len(golden.entry_tile):,}", f"{rtl.cycles:,}", f"{rtl.efficiency:.0%}" if rtl.efficiency else "",
                         f"{model.cycles:,}", f"{model.cycles / rtl.cycles - 1:+.1%}", f"{rtl.cycles / seconds:,.0f}"))
        traffic.append((title, *(f"{64 * (c.read_beats + c.write_beats) / 1e6:.2f}" for c in (rtl.traffic[p] for p in PURPOSES)),
                        f"{64 * sum(c.read_beats + c.write_beats for c in rtl.traffic.values()) / 1e6:.2f}"))
    return {
        "cycles": table(
            ["view", "memory", "Gaussians", "list entries", "cycles", "of the memory's peak rate", "chip model", "off by",
             "simulated cycles a second of processor time"], rows,
        ),
        "traffic": table(["view, MB", *PURPOSES, "all"], traffic),
    }
