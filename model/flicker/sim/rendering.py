"""The verilated rendering half: records and lists in memory, a frame, and the frame buffer that it leaves (docs/reference/rendering.md).

    frame = rendering_rtl(front_memory(front), camera, config)
    frame.buffer  # to be compared with golden.chip.render_chip
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..chip_counters import RENDERING
from ..golden.frame_buffer import PAIR, PixelFormat, least_stride
from ..golden.front.memory import FrontImage
from ..golden.lists import CHUNK_LINES, LINE_BYTES, WRITERS
from ..golden.long_lists import region_bytes
from ..golden.walk import tile_walk
from ..params import CORES, TILE, RenderConfig
from ..scene.camera import Camera
from . import half
from .half import BEAT, PAGE, Half, MemoryOptions
from .memory import PortConfig, PurposeCounts

PORT = PortConfig(max_reads=64, max_writes=64, latency=20, hazards=False)
PORTS = dict.fromkeys(("list", "record", "write"), PORT)
PURPOSES = ("lists", "pointers", "records", "frame")
ERRORS = ("lists could not be read", "records could not be read", "a write failed")


@dataclass(eq=False)
class RtlRendering:
    """What a frame left. buffer: uint8 (rows of pixels, stride); bytes that it did not write are noise. errors: of each frame. traffic: by purpose.
    given: int64 (S,), records that a core got of each sub-tile in the last frame; S as in `golden.chip.whole_pairs`. waits: stalls, as the harness counts
    them, those that it can."""

    buffer: np.ndarray
    counters: dict[str, int | np.ndarray]
    errors: list[int]
    traffic: dict[str, PurposeCounts]
    given: np.ndarray
    waits: dict[str, int]
    efficiency: float

    @property
    def cycles(self) -> int:
        return int(self.counters["cycles"])


def build(config: RenderConfig, parameters: Mapping[str, int] | None = None) -> Path:
    """Shared library of the simulator, with the design's assertions; cached by content. parameters: of `flk_rendering`, further ones."""
    settings = [half.HERE / f"{name}.vlt" for name in ("render_stage", "lanes", "rendering", "rendering_watched")]
    values = {"InWidth": 1} | config.chip_parameters() | dict(parameters or {})
    define = f"-DFLK_RENDERING={values['InWidth']} -DFLK_CORES={config.cores} -DFLK_SORT_UNITS={config.sort_units}"
    return half.build("flk_rendering", values, settings, define=define)


def rendering_rtl(
    image: FrontImage,
    camera: Camera,
    config: RenderConfig,
    *,
    format_: PixelFormat = PixelFormat.RGB8,
    background: tuple[int, int, int] = (0, 0, 0),
    stride: int | None = None,
    memory: MemoryOptions | None = None,
    frames: int = 1,
    seed: int = 1,
    limit: int = 20_000_000,
    parameters: Mapping[str, int] | None = None,
) -> RtlRendering:
    """Run frames of one memory through the RTL. FlickerError where one does not end within `limit` cycles, an assertion fails or a rule of AXI is broken."""
    stride = stride or least_stride(camera.width, format_)
    pairs, rows = -(-camera.width // PAIR), -(-camera.height // TILE)
    parts = (image.lists.memory.tobytes(), image.lists.pointers.tobytes(), image.records.tobytes(), b"")
    chunks = len(parts[0]) // (WRITERS * CHUNK_LINES * LINE_BYTES)
    base = regions(image, stride * rows * TILE)
    with Half("rendering", build(config, parameters), PORTS, memory or MemoryOptions(), seed) as sim:
        for purpose, (name, data) in enumerate(zip(PURPOSES, parts)):
            size = stride * rows * TILE if name == "frame" else len(data) + region_bytes() if name == "lists" else max(len(data), BEAT)
            sim.load(base[name], -(-size // BEAT) * BEAT, data, purpose)
        counters, errors = sim.run((
            (int(config.cat), 3), (int(format_), 1), (background[0] | background[1] << 8 | background[2] << 16, 24), (pairs, 8), (rows, 9),
            (pairs * rows, 16), (base["lists"] // BEAT, 34), (chunks, 25), (base["pointers"] // BEAT, 34), (base["records"] // BEAT, 34),
            (base["frame"] // BEAT, 34), (stride // 32, 12),
        ), RENDERING, frames, limit)
        buffer = sim.read(base["frame"], stride * rows * TILE).reshape(rows * TILE, stride)
        given = np.zeros((2 * rows, 4 * pairs), np.int64)
        x, y = tile_walk(pairs, rows)
        for k in range(CORES):
            given[2 * y + k // 2, 2 * x + k % 2] = sim.given(k, len(x))
        return RtlRendering(buffer, counters, errors, sim.traffic(PURPOSES), given.ravel(), sim.waits(RENDERING), sim.efficiency)


def regions(image: FrontImage, frame_bytes: int) -> dict[str, int]:
    """Where what is read and written lies, by purpose."""
    at, out = 1 << 28, {}
    for name, size in zip(PURPOSES, (image.lists.memory.nbytes + region_bytes(), image.lists.pointers.nbytes, image.records.nbytes, frame_bytes)):
        out[name] = at
        at += -(-max(size, 1) // PAGE) * PAGE
    return out
