"""The rendering half of the chip, from lists and records in memory to a frame buffer: every byte as in the golden model. All frames with SLOW=1: by default
tb/frames/test_chip_frames.py has the half in the whole chip.

State space: the demo scene and the middle of it, both pixel formats, a background, strides with a gap, pauses on every channel, DRAM timing,
frames one after the other, an odd number of tiles in a row and of sub-tiles in a column, errors of the memory in every region with a right frame behind.
Sub-tiles that finish early: what each core gets is enough, and what is left out is no more than what finishes; the automatic mode loses nothing.
Parameter space: channels with every mode; one and two sorting units, small memories, one and four VRUs, no contribution test, and 32, 64 and 128
lanes, one core and two. `faithful` wants records of 32 bytes, which only the golden front end
makes. Not covered: resets within a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from flicker_tb.elaboration import refusals, refused
from flicker_tb.runner import seed

from flicker.chip.dram import DramConfig
from flicker.errors import FlickerError
from flicker.front.view import DEMO, load_view
from flicker.golden.chip import render_chip
from flicker.golden.delivery import may_be_given
from flicker.golden.frame_buffer import PAIR, PixelFormat, least_stride
from flicker.golden.front.frame import FrontFrame, run_front
from flicker.golden.front.memory import FrontImage, front_memory
from flicker.golden.lanes.lists import front_lists
from flicker.golden.list_reader import read_tile
from flicker.golden.long_lists import sort_long
from flicker.golden.sorting import CAPACITY
from flicker.params import TILE, CatMode, ChipMemories, RenderConfig
from flicker.pipeline import packed_scene
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.packed import PackedFormat
from flicker.scene.packing import pack
from flicker.sim.half import MemoryOptions
from flicker.sim.memory import PortConfig
from flicker.sim.rendering import ERRORS, PORTS, PURPOSES, RtlRendering, regions, rendering_rtl

LIMIT = 1_000_000  # a frame that hangs says so within minutes
CONFIG = RenderConfig()
LANES = RenderConfig(stage="lanes")
LAYERS = 6000


@cache
def view_of(width: int, height: int, scene: str = "some") -> tuple[FrontFrame, FrontImage]:
    """The demo scene, whose splats are as many at any size, or the `middle` of it at 96x54; `some` Gaussians in front of the camera or `behind` it; opaque
    `layers` that cover the picture."""
    if scene in ("demo", "middle"):
        view = load_view(DEMO, 0, (width, height) if scene == "demo" else (96, 54))
        front = run_front(packed_scene(view, PackedFormat.CHUNK), replace(view.camera, width=width, height=height, cx=None, cy=None))
    else:
        layers, haze = scene == "layers", scene == "haze"
        rng, n = np.random.default_rng(seed()), LAYERS if layers else 2300 if haze else 500
        made = Scene(
            means=np.stack([*rng.uniform(-1.5, 1.5, (2, n)), rng.uniform(1.0, 6.0, n) * (-1 if scene == "behind" else 1)], axis=1),
            scales=rng.uniform(2.0, 3.0, (n, 3)) if layers or haze else rng.uniform(0.01, 0.1, (n, 3)), quats=rng.normal(size=(n, 4)),
            opacities=rng.uniform(*((0.9, 1.0) if layers else (0.006, 0.01) if haze else (0.01, 1.0)), n), sh=rng.normal(scale=0.3, size=(n, 4, 3)),
        )
        front = run_front(pack(made, PackedFormat.CHUNK).packed, Camera(width, height, 80.0, 80.0, np.zeros(3), np.eye(3)))
    return front, front_memory(front)


def paused(shares: dict[str, float], first: int = 0) -> dict[str, PortConfig]:
    """Ports that pause on every channel, each with a seed of its own."""
    return {name: replace(config, stall=shares, seed=seed() + first + k) for k, (name, config) in enumerate(PORTS.items())}


@dataclass
class Lists:
    """Of a picture: its lists, their lines, and lines of the runs of those that a sorting unit does not hold: written, and read again when no tile ends
    early."""

    lists: int = 0
    lines: int = 0
    runs: int = 0


def lists_read(image: FrontImage, capacity: int) -> Lists:
    """A list of more than `capacity` entries is sorted in runs."""
    lists, found = image.lists, Lists()
    for y in range(lists.rows):
        for x in range(lists.cols):
            elements = read_tile(lists.memory, lists.pointers, lists.cols, x, y, lists.chunks).lines
            entries = [entry for line in elements for entry in line.unpacked()]
            runs = sort_long(np.array(entries, np.uint64), capacity).lines if len(entries) > capacity else 0
            found = Lists(found.lists + 1, found.lines + (len(elements) if entries else 0), found.runs + runs)
    return found


def check(size: tuple[int, int], config: RenderConfig = CONFIG, format_: PixelFormat = PixelFormat.RGB8, gap: int = 0, background=(0, 0, 0),
          scene: str = "some", **options) -> RtlRendering:
    """A frame of both, compared, with what it moves."""
    front, image = view_of(*size, scene)
    row = least_stride(size[0], format_)
    golden = render_chip(front_lists(front) if config.by_lanes else front.subtile_lists(), config, format_, background, row + 32 * gap)
    rtl = rendering_rtl(image, front.camera, config, format_=format_, background=background, stride=row + 32 * gap, seed=seed(), limit=LIMIT, **options)
    assert rtl.errors[-1] == 0
    assert np.array_equal(rtl.buffer[:, :row], golden.buffer[:, :row])
    assert rtl.waits == {name: rtl.counters[name] for name in rtl.waits}
    if len(front.entry_tile):
        assert np.ptp(golden.buffer[:, :row].reshape(-1, row), axis=0).any(), "a picture of one colour"
    if not options.get("memory", MemoryOptions()).fail:
        frames, pairs, rows = options.get("frames", 1), -(-size[0] // PAIR), -(-size[1] // TILE)
        tiles = 2 * pairs * rows
        due = lists_read(image, config.chip_memories.sorted_entries)
        starts = np.arange(rows * TILE) * (golden.buffer.shape[1] // 32) % 2  # a row of RGBA16F that begins within a beat has one more
        written = pairs * (2 * len(starts) if format_ is PixelFormat.RGB8 else (4 + starts).sum())
        lengths = np.diff(golden.frame.lists.start)
        whole = config.cat == CatMode.AUTO and config.mask_generator == "ctu" and not config.by_lanes
        assert may_be_given(rtl.given, lengths, golden.frame.needed, whole).all(), "a core lacks records that its pixels need"
        entries, readings = rtl.counters["entries"].sum(), rtl.counters["readings"].sum() - (tiles - due.lists)
        lines = rtl.traffic["lists"].read_beats / frames
        if whole or (golden.frame.needed == lengths).all():
            assert entries == len(front.entry_tile) and not rtl.counters["dropped"].any()
            assert lines == due.lines + due.runs
        else:
            assert entries + rtl.counters["dropped"].sum() == len(front.entry_tile)
            assert due.lines <= lines <= due.lines + due.runs
        assert readings == due.lists and rtl.traffic["lists"].write_beats == frames * due.runs
        own = np.bincount(front.entry_tile, minlength=1)  # entries of each tile's list
        assert rtl.counters["sorted_again"] == own[own > config.chip_memories.sorted_entries].sum()
        assert {n: (c.read_beats, c.write_beats) for n, c in rtl.traffic.items() if n != "lists"} == {
            "pointers": (frames * tiles, 0), "frame": (0, frames * written),
            # A sub-tile that finishes elsewhere in time makes a frame of other lookups.
            "records": (rtl.traffic["records"].read_beats if frames > 1 else rtl.counters["lines"], 0),
        }
        assert rtl.traffic["pointers"].read_bytes == 32 * frames * tiles
        assert rtl.traffic["frame"].dram_masked_bytes == 0
    return rtl


def left_out(rtl: RtlRendering, front: FrontFrame) -> float:
    """Share of the sub-tiles' records that no core got."""
    return 1 - rtl.given.sum() / len(front.subtile_lists().entry)


@pytest.mark.slow
def test_demo_scene() -> None:
    rtl = check((40, 24), scene="middle")
    assert left_out(rtl, view_of(40, 24, "middle")[0]) > 0.2


@pytest.mark.slow
def test_demo_scene_whole() -> None:
    rtl = check((96, 54), scene="demo")
    assert left_out(rtl, view_of(96, 54, "demo")[0]) > 0.14 and rtl.counters["dropped"].any()  # 0.195 come behind the last pixel


@pytest.mark.slow
def test_opaque_layers() -> None:
    """Lists of thousands of opaque splats: few are looked up, and of the runs of long lists few lines are read."""
    rtl = check((32, 32), scene="layers")
    front, image = view_of(32, 32, "layers")
    due = lists_read(image, CAPACITY)
    assert left_out(rtl, front) > 0.9 and rtl.counters["lines"] < 0.2 * len(front.number)
    assert due.runs and rtl.traffic["lists"].read_beats < due.lines + 0.5 * due.runs


@pytest.mark.slow
@pytest.mark.parametrize("format_", list(PixelFormat), ids=lambda f: f.name)
def test_formats(format_: PixelFormat) -> None:
    """Sub-tiles that the picture lacks; rows with a gap, a background."""
    check((96, 54), format_=format_, gap=3, background=(10, 200, 30))


@pytest.mark.slow
def test_odd_number_of_tiles() -> None:
    """A row of five tiles: the sixth is empty and background. Two frames of 18 tiles, no multiple of the units' number."""
    check((80, 40), background=(1, 2, 3), frames=2)


@pytest.mark.slow
def test_nothing_visible() -> None:
    """All Gaussians behind the camera: no list, no record, a picture of the background."""
    rtl = check((80, 40), background=(7, 8, 9), scene="behind")
    assert (rtl.buffer.reshape(-1, 3) == (7, 8, 9)).all() and rtl.counters["lines"] == 0


@pytest.mark.slow
def test_modes() -> None:
    """Every mode of the contribution test, the automatic one over sub-tiles that the picture lacks too."""
    for mode in CatMode:
        check((80, 40), CONFIG.with_(cat=mode))


@pytest.mark.slow
def test_automatic_mode() -> None:
    """Its decisions rest on whole lists, of finished sub-tiles too, and begin anew with a frame."""
    check((24, 16), CONFIG.with_(cat=CatMode.AUTO), scene="middle", frames=2)


@pytest.mark.slow
@pytest.mark.parametrize("memories", ["small", "records"])
def test_other_memories(memories: str) -> None:
    """Lists of more entries than the sorting unit takes in one reading, a last step of eight runs, a reader of few chunks, a frame writer of two pairs, twice
    the lines of records; DRAM behind ports that pause."""
    config = CONFIG.with_(memories=memories)
    tiles = 4
    assert (np.bincount(view_of(32, 32, "haze")[0].entry_tile) > config.chip_memories.sorted_entries).sum() == tiles
    rtl = check((32, 32), config, scene="haze")
    assert rtl.counters["sorted_waits"] > 0
    assert rtl.traffic["lists"].write_beats > 0 and check((32, 32), scene="haze").traffic["lists"].write_beats > 0
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2}
    check((96, 54), config, memory=MemoryOptions(DramConfig().timing, paused(shares)), frames=2)


@pytest.mark.slow
@pytest.mark.parametrize("config", [
    CONFIG.with_(vrus_per_channel=1), CONFIG.with_(vrus_per_channel=4), CONFIG.with_(mask_generator="all", cat=CatMode.OFF),
    LANES, LANES.with_(lanes=64), LANES.with_(lanes=128, memories="large"), LANES.with_(cores=1, lanes=8), LANES.with_(cores=2, lanes=16, delivered=2),
], ids=lambda c: "-".join(map(str, c.chip_parameters().values())))
def test_stages(config: RenderConfig) -> None:
    """Other stages: pixels leave in another order, sub-tiles finish at other times."""
    rtl = check((96, 54), config, scene="demo")
    assert left_out(rtl, view_of(96, 54, "demo")[0]) > 0.14
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2}
    check((80, 40), config, PixelFormat.RGBA16F, gap=1, memory=MemoryOptions(DramConfig().timing, paused(shares)), frames=2)
    check((32, 32), config, scene="layers")


@pytest.mark.slow
def test_two_records_a_cycle() -> None:
    """Lanes that get two records of a list together: the same picture, sub-tiles that finish early, frames one after the other behind ports that pause."""
    wide = LANES.with_(delivered=2)
    rtl = check((96, 54), wide, scene="demo")
    assert left_out(rtl, view_of(96, 54, "demo")[0]) > 0.14 and rtl.counters["dropped"].any()
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2}
    check((80, 40), wide, PixelFormat.RGBA16F, gap=1, memory=MemoryOptions(DramConfig().timing, paused(shares)), frames=2)
    check((32, 32), wide, scene="layers")


@pytest.mark.slow
@pytest.mark.parametrize("units", [1, 2])
def test_fewer_sorting_units(units: int) -> None:
    """The same picture and as many lines; lists that are left early, runs, an odd number of tiles, frames one after the other behind ports that pause."""
    few = LANES.with_(sort_units=units)
    rtl = check((96, 54), few, scene="demo")
    assert left_out(rtl, view_of(96, 54, "demo")[0]) > 0.14 and rtl.counters["dropped"].any()
    assert all((rtl.counters[name] > 0).tolist() == [k < units for k in range(4)] for name in ("entries", "readings"))
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2}
    check((80, 40), few, PixelFormat.RGBA16F, gap=1, memory=MemoryOptions(DramConfig().timing, paused(shares)), frames=2)
    check((32, 32), few, scene="layers")
    check((32, 32), few.with_(memories="small"), scene="haze")


@pytest.mark.slow
def test_pauses_and_dram() -> None:
    """DRAM behind ports that pause; two frames one after the other."""
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2}
    memory = MemoryOptions(DramConfig().timing, paused(shares))
    rtl = check((96, 54), memory=memory, frames=2)
    assert all(rtl.counters[f"{name}_waits"] > 0 for name in ("list", "entry", "queue", "cache", "record")) and rtl.counters["entry_missing"] > 0


@pytest.mark.slow
def test_slow_writes() -> None:
    """A memory that takes a line now and then: cores wait with their tiles for places in the frame writer, which holds four pairs."""
    slow = {**PORTS, "write": replace(PORTS["write"], stall={"W": 0.95}, seed=seed())}
    rtl = check((320, 32), memory=MemoryOptions(None, slow))
    assert rtl.counters["pair_waits"] > 0 and rtl.counters["frame_waits"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("part", PURPOSES)
def test_errors_of_the_memory(part: str) -> None:
    """The frame ends with a code; the next one, of a mended memory, is right."""
    _, image = view_of(96, 54)
    base = regions(image, 0)[part]
    # Of the lists one chunk alone, of a tile in an odd column, which the first reader does not take.
    fail = (base + 512, 512) if part == "lists" else (base, 2048)
    rtl = check((96, 54), memory=MemoryOptions(fail=[fail], mended=True), frames=2)
    code = {"lists": 0, "pointers": 0, "records": 1, "frame": 2}[part]
    assert rtl.errors == [1 << code, 0], ERRORS[code]


@pytest.mark.slow
def test_demo_scene_larger() -> None:
    """At 320x180 with five seeds of pauses."""
    for k in range(5):
        shares = {"AR": 0.1 * k, "R": 0.1 * k, "AW": 0.3, "W": 0.1 * k, "B": 0.3}
        check((320, 180), scene="demo", memory=MemoryOptions(None, paused(shares, 10 * k)))


def test_number_of_units() -> None:
    refused("flk_rendering", {"SortUnits": 3}, "SortUnits must be 1, 2 or 4")


def test_number_of_record_lines() -> None:
    """The least and the most are built; what is beyond them, or between powers of two, is not."""
    for lines in (32, 65_536):
        assert refusals("flk_rendering", {"RecordLines": lines}) == []
        assert ChipMemories(record_lines=lines).rendering_parameters()["RecordLines"] == lines
    for lines in (0, 16, 48, 131_072):
        refused("flk_rendering", {"RecordLines": lines}, "RecordLines must be a power of two, 32 to 65536")
        with pytest.raises(FlickerError, match="record_lines must be"):
            ChipMemories(record_lines=lines)


@pytest.mark.parametrize("parameters", [{"SortStages": 8}, {"MergeLines": 256}], ids=str)
def test_runs_beyond_their_region(parameters: dict[str, int]) -> None:
    """A chip that would write more runs than drivers leave room for is not built."""
    refused("flk_rendering", parameters, "drivers hold 64 runs of 228 lines")
