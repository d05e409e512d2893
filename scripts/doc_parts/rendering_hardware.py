"""`make docs PART=rendering_hardware`: cycles and bytes of the rendering half's RTL beside the chip model's, in docs/results/rendering.md.

An error: a frame buffer that differs from the golden model's; bytes of lists, pointers or frame buffer that differ, or more than 2 % of the records' lines,
whose number rests on the timing; cycles that are more than 10 % off.
"""

from __future__ import annotations

import time

import numpy as np

from flicker.chip.dram import DramConfig
from flicker.chip.rendering import estimate
from flicker.chip.tile_lists import TileLists
from flicker.errors import FlickerError
from flicker.front.view import DEMO, load_view
from flicker.golden.chip import render_chip
from flicker.golden.delivery import may_be_given
from flicker.golden.frame_buffer import PixelFormat, least_stride
from flicker.golden.front.frame import run_front
from flicker.golden.front.memory import front_memory
from flicker.markdown import table
from flicker.params import RenderConfig
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS
from flicker.sim.half import BEAT, MemoryOptions
from flicker.sim.rendering import PORT, PURPOSES, build, rendering_rtl

from .common import Say, folder_of_scenes

SIZE = (640, 360)
VIEWS = ("guitar", "stpeter")
MEMORIES = {"perfect, latency 20": None, "LPDDR4, 20 cycles on top": DramConfig()}
LIMIT, LINES_LIMIT = 0.1, 0.02


def tables(say: Say) -> dict[str, str]:
    rows = []
    config = RenderConfig()
    build(config)
    views = [(f"{DEMO} 0", DEMO, 0), *((v.title, v.path(folder_of_scenes()), v.number) for v in REAL_VIEWS if v.folder in VIEWS)]
    for title, path, number in views:
        view = load_view(path, number, SIZE)
        front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
        image = front_memory(front)
        golden = render_chip(front.subtile_lists(), config)
        row = least_stride(view.camera.width, PixelFormat.RGB8)
        lists = TileLists.of(front, image)
        lengths = np.diff(golden.frame.lists.start)
        for name, dram in MEMORIES.items():
            say(f"{title}: {name}")
            begin = time.process_time()
            rtl = rendering_rtl(image, front.camera, config, memory=MemoryOptions(dram.timing if dram else None))
            seconds = time.process_time() - begin
            if not np.array_equal(rtl.buffer[:, :row], golden.buffer[:, :row]) or not may_be_given(rtl.given, lengths, golden.frame.needed, False).all():
                raise FlickerError(f"{title}: the picture differs from the golden model's")
            model = estimate(lists, config, dram, PORT.latency, PORT.max_reads)
            moved = {n: BEAT * c.write_beats + c.read_bytes for n, c in rtl.traffic.items()}
            if any(moved[n] != model.bytes[n] for n in PURPOSES if n != "records"):
                raise FlickerError(f"{title}: bytes differ from the chip model's: {moved}, {model.bytes}")
            lines = model.bytes["records"] / max(moved["records"], 1) - 1
            if abs(lines) > LINES_LIMIT:
                raise FlickerError(f"{title}: the chip model's record lines are {lines:+.1%} off")
            if abs(model.cycles / rtl.cycles - 1) > LIMIT:
                raise FlickerError(f"{title}: the chip model's cycles are {model.cycles / rtl.cycles - 1:+.1%} off")
            rows.append((
                title, name, f"{rtl.cycles:,}", f"{model.cycles:,}", f"{model.cycles / rtl.cycles - 1:+.1%}", *(f"{moved[n] / 1e6:.2f}" for n in PURPOSES),
                f"{lines:+.1%}", f"{rtl.given.sum():,} of {lengths.sum():,}", f"{rtl.cycles / seconds:,.0f}",
            ))
    return {"cycles": table(
        ["view", "memory", "cycles", "chip model", "off by", *(f"{n}, MB" for n in PURPOSES), "records' model off by", "records given to cores",
         "simulated cycles a second of processor time"], rows,
    )}
