"""`make docs PART=delivery`: sorting and delivery alone, each as fast as it goes, for whole lists and for what cores take of them, in
docs/results/delivery.md."""

from __future__ import annotations

import numpy as np

from flicker.chip.dram import DramConfig
from flicker.chip.tile_lists import TileLists
from flicker.golden.front.frame import run_front
from flicker.golden.front.memory import front_memory
from flicker.golden.render import render_golden
from flicker.golden.walk import borders
from flicker.markdown import table
from flicker.params import RenderConfig
from flicker.perf.long_lists import BEGIN, MEMORY
from flicker.perf.sorting import latency, list_cycles
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat
from flicker.sim.delivery import deliver

from .common import Say, titled_views

UNITS = 4


def _sorting(lists: TileLists) -> int:
    """Cycles of the sorting unit that has most to do, lists back to back."""
    cycles = np.zeros(UNITS, np.int64)
    for t, n in enumerate(np.diff(lists.start)):
        last = lists.batch_start[t + 1] - 1
        again = BEGIN + MEMORY + lists.batch_given[last] + latency(int(lists.batch_size[last])) if n > lists.capacity else 0
        cycles[t % UNITS] += list_cycles(int(n)) + (latency(lists.capacity) + again if again else 0)
    return int(cycles.max())


def tables(say: Say) -> dict[str, str]:
    rows = []
    for title, view in titled_views(say):
        front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
        lists = TileLists.of(front, front_memory(front))
        say(f"{title}: what cores take")
        finished = lists.by_tile(render_golden(lists.lists, RenderConfig()).needed)
        say(f"{title}: delivery")
        arrays, touching = (lists.start, lists.record, lists.mask), borders(lists.cols // 2, lists.rows)
        whole, until = deliver(*arrays, borders=touching), deliver(*arrays, finished, borders=touching)
        slow = deliver(*arrays, finished, borders=touching, timing=DramConfig().timing)
        rows.append((title, len(lists.record), int((np.diff(lists.start) > lists.capacity).sum()), _sorting(lists), whole.cycles, whole.lines, until.cycles,
                     until.lines, slow.cycles))
    return {"alone": table(
        ["view", "entries", "lists of more than 2,048", "sorting: cycles", "delivery: cycles", "lines", "until cores are finished: cycles", "lines",
         "with LPDDR4: cycles"], [(title, *(f"{n:,}" for n in numbers)) for title, *numbers in rows],
    )}
