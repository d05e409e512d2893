"""The rendering half of the chip, from lists and records in memory to a frame buffer: every byte as in the golden model.

State space: the demo scene, both pixel formats, a background, strides with a gap, pauses on every channel, DRAM timing, frames one after the other, an odd
number of tiles in a row and of sub-tiles in a column, errors of the memory in every region with a right frame behind.
Parameter space: the default stage; `faithful` wants records of 32 bytes, which only the golden front end makes.
Not covered: early end of tiles (delivery is not told yet), resets within a frame.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from flicker_tb.runner import seed

from flicker.chip.dram import DramConfig
from flicker.front.view import DEMO, load_view
from flicker.golden.chip import render_chip
from flicker.golden.frame_buffer import PixelFormat, least_stride
from flicker.golden.front.frame import FrontFrame, run_front
from flicker.golden.front.memory import FrontImage, front_memory
from flicker.params import CatMode, RenderConfig
from flicker.pipeline import packed_scene
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.packed import PackedFormat
from flicker.scene.packing import pack
from flicker.sim.memory import PortConfig
from flicker.sim.preprocessing import MemoryOptions
from flicker.sim.rendering import ERRORS, PORTS, PURPOSES, RtlRendering, rendering_rtl

LIMIT = 1_000_000  # a frame that hangs says so within minutes
CONFIG = RenderConfig()


@cache
def view_of(width: int, height: int, demo: bool = False) -> tuple[FrontFrame, FrontImage]:
    """The demo scene, whose splats are as many at any size, or 500 Gaussians."""
    if demo:
        view = load_view(DEMO, 0, (width, height))
        front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
    else:
        rng, n = np.random.default_rng(seed()), 500
        scene = Scene(
            means=np.stack([*rng.uniform(-1.5, 1.5, (2, n)), rng.uniform(1.0, 6.0, n)], axis=1),
            scales=rng.uniform(0.01, 0.1, (n, 3)), quats=rng.normal(size=(n, 4)), opacities=rng.uniform(0.01, 1.0, n), sh=rng.normal(scale=0.3, size=(n, 4, 3)),
        )
        front = run_front(pack(scene, PackedFormat.CHUNK).packed, Camera(width, height, 80.0, 80.0, np.zeros(3), np.eye(3)))
    return front, front_memory(front)


def port(name: str, **options) -> PortConfig:
    return PortConfig(max_reads=64, max_writes=64, latency=20, hazards=False, data_bits=256 if name == "record" else 512, **options)


def check(size: tuple[int, int], config: RenderConfig = CONFIG, format_: PixelFormat = PixelFormat.RGB8, gap: int = 0, background=(0, 0, 0),
          demo: bool = False, **options) -> RtlRendering:
    """A frame of both, compared, with what it moves."""
    front, image = view_of(*size, demo)
    row = least_stride(size[0], format_)
    golden = render_chip(front.subtile_lists(), config, format_, background, row + 32 * gap)
    rtl = rendering_rtl(image, front.camera, config, format_=format_, background=background, stride=row + 32 * gap, seed=seed(), limit=LIMIT, **options)
    assert rtl.errors[-1] == 0
    assert np.array_equal(rtl.buffer[:, :row], golden.buffer[:, :row])
    frames = options.get("frames", 1)
    if not options.get("memory", MemoryOptions()).fail:
        assert rtl.counters["entries"].sum() == len(front.entry_tile) and not rtl.counters["dropped"].any()
        traffic = {n: (c.read_beats, c.write_beats) for n, c in rtl.traffic.items()}
        assert traffic["records"] == (frames * rtl.counters["lines"], 0)
        assert traffic["lists"][0] % frames == 0 and traffic["lists"][1] == 0
        assert rtl.traffic["frame"].dram_masked_bytes == 0
    return rtl


def test_demo_scene() -> None:
    check((96, 54), demo=True)


@pytest.mark.parametrize("format_", list(PixelFormat), ids=lambda f: f.name)
def test_formats(format_: PixelFormat) -> None:
    """Sub-tiles that the picture lacks; rows with a gap, a background."""
    check((96, 54), format_=format_, gap=3, background=(10, 200, 30))


def test_odd_number_of_tiles() -> None:
    """A row of five tiles: the sixth is empty and background."""
    check((80, 40), background=(1, 2, 3))


def test_modes() -> None:
    """Every mode of the contribution test, the automatic one over sub-tiles that the picture lacks too."""
    for mode in CatMode:
        check((80, 40), CONFIG.with_(cat=mode))


def test_pauses_and_dram() -> None:
    """DRAM behind ports that pause; two frames one after the other."""
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2}
    memory = MemoryOptions(DramConfig().timing, {n: port(n, stall=shares, seed=seed() + k) for k, n in enumerate(PORTS)})
    check((96, 54), memory=memory, frames=2)


@pytest.mark.parametrize("part", PURPOSES)
def test_errors_of_the_memory(part: str) -> None:
    """The frame ends with a code; the next one, of a mended memory, is right."""
    _, image = view_of(96, 54)
    sizes = {"lists": image.lists.memory.nbytes, "pointers": image.lists.pointers.nbytes, "records": image.records.nbytes}
    base = 1 << 28
    for name in PURPOSES:
        if name == part:
            break
        base += -(-sizes[name] // 4096) * 4096
    rtl = check((96, 54), memory=MemoryOptions(fail=[(base, 2048)], mended=True), frames=2)
    code = {"lists": 0, "pointers": 0, "records": 1, "frame": 2}[part]
    assert rtl.errors == [1 << code, 0], ERRORS[code]


@pytest.mark.slow
def test_demo_scene_larger() -> None:
    """At 320x180 with five seeds of pauses."""
    for k in range(5):
        shares = {"AR": 0.1 * k, "R": 0.1 * k, "AW": 0.3, "W": 0.1 * k, "B": 0.3}
        ports = {n: port(n, stall=shares, seed=seed() + 10 * k + i) for i, n in enumerate(PORTS)}
        check((320, 180), demo=True, memory=MemoryOptions(None, ports))
