"""The verilated rendering half: records and lists in memory, a frame, and the frame buffer that it leaves (docs/rendering.md).

    frame = rendering_rtl(front_memory(front), camera, config)
    frame.buffer  # to be compared with golden.chip.render_chip
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from ..golden.frame_buffer import PAIR, PixelFormat, least_stride
from ..golden.front.memory import FrontImage
from ..golden.lists import CHUNK_LINES, LINE_BYTES, WRITERS
from ..params import TILE, RenderConfig
from ..scene.camera import Camera
from ..toolchain import verilate
from .memory import HEADERS, PortConfig, PurposeCounts, Timing, _Config
from .preprocessing import PAGE, MemoryOptions, _library, _load, _read

HERE = Path(__file__).parent
BEAT = 64
PORTS = ("list", "record", "write")
PURPOSES = ("lists", "pointers", "records", "frame")
ERRORS = ("lists could not be read", "records could not be read", "a write failed")

# Of flk_rendering_pkg, the first field in the highest bits.
_COUNTERS = (("cycles", 1), ("entries", 4), ("readings", 4), ("dropped", 4), ("lines", 1))
REGISTER_BITS = 3 + 1 + 24 + 8 + 9 + 16 + 34 + 25 + 34 + 34 + 34 + 12


@dataclass(eq=False)
class RtlRendering:
    """What a frame left. buffer: uint8 (rows of pixels, stride); bytes that it did not write are noise. errors: of each frame. traffic: by purpose."""

    buffer: np.ndarray
    counters: dict[str, int | np.ndarray]
    errors: list[int]
    traffic: dict[str, PurposeCounts]
    efficiency: float

    @property
    def cycles(self) -> int:
        return int(self.counters["cycles"])


def build(config: RenderConfig) -> Path:
    """Shared library of the simulator, with the design's assertions; cached by content."""
    return verilate(
        "flk_rendering",
        parameters=config.rtl_parameters(),
        args=["--x-assign", "unique", "--x-initial", "unique", "-fno-table", "--assert"],
        cpp=[HERE / "frame_harness.cpp"],
        depends=HEADERS,
        settings=[HERE / "render_stage.vlt"],
        cflags=f"-DVL_USER_STOP -DVL_USER_FATAL -DFLK_RENDERING -I{HERE}",
        opt="-O1",
        shared=True,
        kind="sim",
        name="rendering",
    )


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
) -> RtlRendering:
    """Run frames of one memory through the RTL. FlickerError where one does not end within `limit` cycles, an assertion fails or a rule of AXI is broken."""
    lib, memory = _library(build(config)), memory or MemoryOptions()
    configs = (_Config * len(PORTS))()
    for k, name in enumerate(PORTS):
        port = memory.ports.get(name, PortConfig(max_reads=64, max_writes=64, latency=20, hazards=False, data_bits=256 if name == "record" else 512))
        configs[k] = port.structure()  # type: ignore[call-overload]
    timing = memory.timing or Timing(*[1] * len(Timing._fields_))
    sim = lib.flk_front_new(ctypes.byref(timing), memory.timing is None, configs, seed)
    if not sim:
        raise FlickerError(f"rendering: {lib.flk_front_failure().decode()}")
    stride = stride or least_stride(camera.width, format_)
    pairs, rows = -(-camera.width // PAIR), -(-camera.height // TILE)
    lists, records = image.lists.memory.tobytes(), image.records.tobytes()
    pointers = image.lists.pointers.tobytes()
    sizes = (len(lists), len(pointers), len(records), stride * rows * TILE)
    at, base = 1 << 28, []
    try:
        for purpose, (size, data) in enumerate(zip(sizes, (lists, pointers, records, b""))):
            base.append(at)
            _load(lib, sim, at, -(-max(size, 1) // BEAT) * BEAT, data, purpose)
            at += -(-max(size, 1) // PAGE) * PAGE
        for first, size in memory.fail:
            lib.flk_front_fail(sim, first, size)
        chunks = len(lists) // (WRITERS * CHUNK_LINES * LINE_BYTES)
        word = 0
        for value, width in (
            (int(config.cat), 3), (int(format_), 1), (background[0] | background[1] << 8 | background[2] << 16, 24), (pairs, 8), (rows, 9),
            (pairs * rows, 16), (base[0] // BEAT, 34), (chunks, 25), (base[1] // BEAT, 34), (base[2] // BEAT, 34), (base[3] // BEAT, 34), (stride // 32, 12),
        ):
            assert 0 <= value < 1 << width
            word = word << width | value
        count = -(-REGISTER_BITS // 32)
        given = np.frombuffer(word.to_bytes(4 * count, "little"), np.uint32).copy()
        out = np.zeros(sum(n for _, n in _COUNTERS), np.uint32)
        error = ctypes.c_uint32()
        errors = []
        for frame in range(frames):
            if memory.mended and frame == frames - 1:
                lib.flk_front_mend(sim)
            done = lib.flk_front_frame(sim, given.ctypes.data, count, limit, out.ctypes.data, len(out), ctypes.byref(error))
            if done < 0:
                raise FlickerError(f"rendering: {lib.flk_front_failure().decode()} (seed {seed})")
            if not done:
                raise FlickerError(f"rendering: no end within {limit} cycles (seed {seed})")
            errors.append(error.value)
        traffic = {}
        for number, name in enumerate(PURPOSES):
            counts = PurposeCounts()
            lib.flk_front_counts(sim, number, ctypes.byref(counts))
            traffic[name] = counts
        words = out[::-1].astype(np.int64)
        counters: dict[str, int | np.ndarray] = {}
        k = 0
        for name, n in _COUNTERS:
            counters[name] = int(words[k]) if n == 1 else words[k : k + n][::-1].copy()
            k += n
        buffer = _read(lib, sim, base[3], sizes[3]).reshape(rows * TILE, stride)
        return RtlRendering(buffer, counters, errors, traffic, lib.flk_front_efficiency(sim))
    finally:
        lib.flk_front_delete(sim)
