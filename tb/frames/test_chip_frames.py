"""The chip, `flk_top`, from a packed scene in memory to a frame buffer, through registers and the C driver: every byte as in the golden model.

State space: the demo scene and small ones, both pixel formats, pauses on every channel with answers in every order, DRAM timing, frames back to back with
cameras and modes of their own, overlapped or not; aborts and resets at random times with a right frame behind; errors of the memory in every region; channels
that stop; too little list memory; descriptors and images with faults; registers written in mid-frame; with SLOW=1 more lists than pointers are held.
Parameter space: a stage of 32 lanes; with SLOW=1 8 in one core, with one sorting unit, list writer and preprocessing lane, two cores, channels too, with
modes that travel with their frame, the paper's configuration, with records of 32 bytes, and real scenes (tb/frames/test_rendering.py has the rendering half
with channels); ports of 128 and 256 bits. Units: tb/top, tb/common, tb/preproc, tb/sort; driver: tb/sw.
"""

from __future__ import annotations

import ctypes
import random
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flicker_tb import figures
from flicker_tb.bench import rounds
from flicker_tb.runner import seed

from flicker import params
from flicker.chip import rendering
from flicker.chip.compare import frame_cost
from flicker.chip.dram import DramConfig, Refresh
from flicker.chip.drawing import Drawing
from flicker.chip.run import chip_stats, render_on_chip
from flicker.chip.tile_lists import TileLists
from flicker.chip.whole import halves
from flicker.chip_registers import REGISTERS, ChipCounter, ResultError
from flicker.chips import chip_of
from flicker.errors import FlickerError
from flicker.front.view import DEMO, View, load_view
from flicker.golden.chip import ChipFrame as GoldenFrame
from flicker.golden.chip import chip_walk, render_chip
from flicker.golden.delivery import may_be_given
from flicker.golden.frame_buffer import PixelFormat, late_frame_buffer, least_stride
from flicker.golden.front.frame import OUTCOMES, FrontFrame, ListKind, Outcome, run_front
from flicker.golden.front.memory import front_memory
from flicker.golden.front.record import RecordKind
from flicker.golden.front.reuse import CLUSTER_BEATS, ColourStore, Reuse
from flicker.golden.lanes.lists import front_lists
from flicker.params import CORES, FAITHFUL, CatMode, Form, RenderConfig, SortOrder
from flicker.pipeline import Engine, FrontOptions, packed_scene
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.packed import SH_BITS, PackedFormat, PackedScene, decode
from flicker.scene.packing import Recipe, pack
from flicker.scene.real import REAL_VIEWS, RealView, real_scenes
from flicker.sim import driver
from flicker.sim.chip import PORT, ChipFrame, ChipSession
from flicker.sim.half import MemoryOptions
from flicker.sim.memory import CHANNELS, Order, PortConfig, PurposeCounts, WriteOrder
from flicker.sim.row import back_to_back

LIMIT = 1_000_000  # cycles: a chip that hangs says so within minutes
CONFIG = RenderConfig(stage="lanes")
CHANNELS_CONFIG = RenderConfig()
ALL_CONFIGS = [
    pytest.param(config, id=name, marks=[pytest.mark.slow] * (config is not CONFIG))
    for name, config in (
        ("lanes", CONFIG), ("channels", CHANNELS_CONFIG), ("faithful", FAITHFUL), ("small", CONFIG.with_(memories="small")),
        ("records", CONFIG.with_(memories="records")),
        ("two cores", CONFIG.with_(cores=2, lanes=16, delivered=2)),
    )
]
FEW = chip_of("tiny").config
BLUE = (10, 20, 200)
LARGE = [(real, (320, 180)) for real in REAL_VIEWS] + [
    (real, size) for size, folders in (((640, 360), ("guitar", "stpeter")), ((1280, 720), ("flowers",))) for real in REAL_VIEWS if real.folder in folders
]


def camera(width: int = 96, height: int = 54, x: float = 0.0, away: bool = False) -> Camera:
    """Looks along z, or against it, from x."""
    return Camera(width, height, 80.0, 80.0, np.array([x, 0.0, 0.0]), np.diag([-1.0, 1.0, -1.0]) if away else np.eye(3))


@cache
def small(count: int = 500, recipe: Recipe | None = None) -> PackedScene:
    rng = np.random.default_rng(seed())
    return pack(Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, count)), rng.uniform(1.0, 6.0, count)], axis=1), scales=rng.uniform(0.01, 0.1, (count, 3)),
        quats=rng.normal(size=(count, 4)), opacities=rng.uniform(0.01, 1.0, count), sh=rng.normal(scale=0.3, size=(count, 4, 3)),
    ), PackedFormat.CHUNK, recipe or Recipe()).packed


def golden(
    packed: PackedScene, view: Camera, config: RenderConfig = CONFIG, format_: PixelFormat = PixelFormat.RGB8, lists: ListKind = ListKind.ELLIPSE,
    order: SortOrder = SortOrder.DEPTH,
) -> tuple[FrontFrame, GoldenFrame]:
    front = run_front(packed, view, lists, RecordKind.of(config.form), order=order)
    return front, render_chip(front_lists(front) if config.by_lanes else front.subtile_lists(), config, format_, BLUE)


def session(packed: PackedScene | None = None, **options) -> ChipSession:
    return ChipSession(small() if packed is None else packed, options.pop("config", CONFIG), seed=seed(), **options)


def check(
    chip: ChipSession, view: Camera, format_: PixelFormat = PixelFormat.RGB8, config: RenderConfig = CONFIG, lists: ListKind = ListKind.ELLIPSE,
    order: SortOrder = SortOrder.DEPTH,
) -> ChipFrame:
    """A frame by itself, with its front end's counters."""
    done = chip.render(view, format_, background=BLUE, lists=lists, order=order, limit=LIMIT)
    compare(chip, view, done, format_, config, lists, order)
    return done


def of_cores(values: np.ndarray, cols: int, cores: int) -> np.ndarray:
    """Sums by core of what sub-tiles have, (4,): sub-tile s of a tile, in column s % 2, row s / 2, is of core s % cores."""
    grid, sums = values.reshape(-1, cols), np.zeros(CORES, np.int64)
    for s in range(CORES):
        sums[s % cores] += grid[s // 2 :: 2, s % 2 :: 2].sum()
    return sums


def compare(
    chip: ChipSession, view: Camera, done: ChipFrame, format_: PixelFormat = PixelFormat.RGB8, config: RenderConfig = CONFIG,
    lists: ListKind = ListKind.ELLIPSE, order: SortOrder = SortOrder.DEPTH,
) -> None:
    front, want = golden(chip.packed, view, config, format_, lists, order)
    assert done.error == 0
    assert np.array_equal(done.buffer, want.buffer)
    counts = {name: int(np.sum(value)) for name, value in done.front.items()}
    assert counts["entries"] == len(front.entry_tile)
    assert counts["culled_gaussians"] == front.outcomes.get(OUTCOMES[Outcome.CULLED], 0)
    # A core takes as many splats as its pixels need, and no more than its lists have. An entry of a tile is a splat for up to four sub-tiles; tile i of the
    # walk is of sorting unit i modulo their number, which delivers what the sub-tile that needs most of the tile's list needs.
    counters = params.STAGES[config.stage].counters
    taken, of_frame = done.stage[:, counters.index("gaussians_in")], want.frame.lists
    lengths, needed = (of_cores(values, of_frame.cols, config.cores) for values in (np.diff(of_frame.start), want.frame.needed))
    whole = config.cat == CatMode.AUTO and config.mask_generator == "ctu" and not config.by_lanes
    assert may_be_given(taken, lengths, needed, whole).all(), (taken, needed, lengths)
    delivered = np.asarray(done.rendering["entries"])
    x, y = chip_walk(of_frame)
    least = want.frame.needed.reshape(of_frame.rows // 2, 2, of_frame.cols // 2, 2).max(axis=(1, 3))[y, x]
    units = config.sort_units
    assert all(delivered[k] >= least[k::units].sum() for k in range(units)) and not delivered[units:].any(), (delivered, least)
    assert taken.sum() <= CORES * delivered.sum() and delivered.sum() <= counts["entries"]
    for name in ("blended", "pixels_finished") if config.by_lanes else ("minitiles_sent", "pixels_finished"):
        words = [k for k, counter in enumerate(counters) if counter.split()[-1] == name]
        assert words and done.stage[:, words].sum() == want.frame.total(name), name
    assert done.stamps["taken"] < done.stamps["front_done"] < done.stamps["rendering_start"] < done.stamps["rendering_done"]


def demo(config: RenderConfig) -> tuple[View, PackedScene, ListKind]:
    """The demo scene, small, as a configuration takes it."""
    view = load_view(DEMO, 0, (160, 90))
    format_, lists = (PackedFormat.FP16, ListKind.BOX) if config is FAITHFUL else (PackedFormat.CHUNK, ListKind.ELLIPSE)
    return view, packed_scene(view, format_), lists


@pytest.mark.slow
@pytest.mark.parametrize("bits", [128, 256])
def test_narrow_port(bits: int) -> None:
    """A port of fewer bits than a line: the same bytes and counts as with 512, one beat of the memory for each part; pauses and answers in any order; an error
    of the memory, an abort and a reset with frames behind."""
    config, dram = CONFIG.with_(port_bits=bits), DramConfig(port_bits=bits)
    view, packed, lists = demo(config)
    with session(packed, config=config, memory=MemoryOptions(dram.timing)) as chip:
        done = check(chip, view.camera, config=config, lists=lists)
        assert done.usage is not None and 1 << chip.field("capability", "log2_beat") == bits // 8
        live, traffic = done.usage.live, chip.purposes()
        parts = 512 // bits
        assert traffic["records"].read_beats == max(1, 256 // bits) * done.rendering["lines"] and live["record_beats"] == done.rendering["lines"]
        assert traffic["table"].read_beats == parts * live["table_beats"]
        assert traffic["frame"].write_beats + traffic["lists"].write_beats == parts * (live["frame_written"] + int(done.front["lines"].sum()))
    for number in range(3):
        with session(config=config, port=any_port(random.Random(f"{seed()} {number} narrow"), number)) as chip:
            check(chip, camera(), config=config)
            frame = chip.frame(camera(), chip.place(camera()), background=BLUE, tag=3)
            chip.fail(frame.region.records, frame.region.record_bytes)
            chip.start(frame)
            assert chip.finish(frame, LIMIT).error
            chip.mend()
            chip.start(frame)
            chip.step(3_000 * (number + 1))
            chip.driver.flk_abort(ctypes.byref(chip.device))
            for _ in range(1000):
                if not chip.field("status", "aborting"):
                    break
                chip.step(10)
            assert chip.quiet and chip.field("status", "ready")
            chip.set_register("interrupt", 31)
            check(chip, camera(), config=config)


@pytest.mark.slow
@pytest.mark.parametrize("config", [
    pytest.param(CONFIG.with_(port_bits=128), id="128 bits"), pytest.param(FEW, id="tiny"), pytest.param(chip_of("small").config, id="small"),
    pytest.param(CONFIG.with_(port_bits=256), id="256 bits"),
])
def test_cycles_of_a_narrow_port(config: RenderConfig) -> None:
    """As the model has them, within a tenth."""
    view, packed, lists = demo(config)
    with session(packed, config=config, memory=MemoryOptions(DramConfig(port_bits=config.port_bits).timing)) as chip:
        done = check(chip, view.camera, config=config, lists=lists)
        cost = frame_cost(view, Drawing(Engine.CHIP, config))
        for phase, name in (("front end", "front_cycles"), ("rendering", "render_cycles")):
            assert cost[name] == pytest.approx(done.phases[phase], rel=0.1), phase


@pytest.mark.slow
def test_few_units() -> None:
    """The smallest chip, one core of 8 lanes, one sorting unit, list writer and preprocessing lane with small memories and a port of 128 bits: the picture of
    the default one; the model of the rendering half. A second frame, of a picture that is no whole number of tiles."""
    view = load_view(DEMO, 0, (96, 54))
    packed = packed_scene(view, PackedFormat.CHUNK)
    dram = DramConfig(port_bits=FEW.port_bits)
    with session(packed, config=FEW, memory=MemoryOptions(dram.timing)) as chip:
        done = check(chip, view.camera, config=FEW)
        assert np.ptp(done.buffer.reshape(-1, 3), axis=0).min() > 50
        assert not done.front["entries"][1:].any() and done.front["taken"].all()
        assert done.stage[0].any() and not done.stage[1:].any()
        stats = chip_stats(chip, done, FEW, DramConfig())
        tested, interval = chip.scene.gaussians - int(np.sum(done.front["culled_gaussians"])), FEW.preproc_interval
        assert stats["busy"]["front end"]["lanes"] == pytest.approx(interval * tested / done.phases["front end"]) and stats["busy"]["front end"]["lanes"] <= 1.0
        assert stats["stall_shares"]["sorted entries for buffers"] == stats["stalls"]["sorted entries for buffers"] / stats["cycles"]
        for half, phase in zip(halves(run_front(packed, view.camera), FEW, dram), ("front end", "rendering"), strict=True):
            assert half.cycles == pytest.approx(done.phases[phase], rel=0.1), phase
        check(chip, replace(view.camera, width=40, height=24, cx=None, cy=None), PixelFormat.RGBA16F, FEW)


@pytest.mark.parametrize("config", ALL_CONFIGS)
def test_demo_scene(config: RenderConfig) -> None:
    """The paper's configuration with its format and lists."""
    view, packed, lists = demo(config)
    with session(packed, config=config) as chip:
        assert Form(int(chip.device.form)) is config.form
        done = check(chip, view.camera, config=config, lists=lists)
        assert np.ptp(done.buffer.reshape(-1, 3), axis=0).min() > 50
        traffic = chip.purposes()
        assert traffic["table"].read_bytes and traffic["records"].write_bytes and not any(t.errors for t in traffic.values())
        assert traffic["image header"].read_beats == 0
        assert done.usage is not None
        live_beats(done, traffic)
        assert not done.front["spilled"] and not done.usage.live["pointer_beats"] and not done.usage.live["pointer_written"]


def live_beats(done: ChipFrame, traffic: dict[str, PurposeCounts]) -> None:
    """What the port counted of a frame, and what the memory did."""
    assert done.usage is not None
    live = done.usage.live
    assert live["record_beats"] == done.rendering["lines"]
    assert live["record_beats"] == traffic["records"].read_beats and live["table_beats"] == traffic["table"].read_beats
    assert live["list_beats"] + live["pointer_beats"] == traffic["lists"].read_beats + traffic["pointers"].read_beats
    runs = live["frame_written"] - traffic["frame"].write_beats  # of lists that a sorting unit does not hold
    assert runs >= 0
    assert live["front_written"] + live["pointer_written"] + runs == sum(traffic[name].write_beats for name in ("records", "lists", "pointers"))
    lines = sum(int(done.front["lines"][k]) for k in range(4))
    assert traffic["lists"].write_beats == lines + runs
    assert (live["pointer_written"], live["pointer_beats"]) == (done.front["spilled"], done.front["fetched"])


def large() -> Camera:
    """A picture with more lists than pointers are held."""
    return Camera(2080, 1440, 900.0, 900.0, np.zeros(3), np.eye(3))


def test_sh_codes_of_fewer_bits() -> None:
    """Clusters of each number of bits, through the driver."""
    packed = small(256 * len(SH_BITS), Recipe(cuts=0, sh_bits=lambda scene, start: np.resize(SH_BITS, len(start))))
    with session(packed) as chip:
        check(chip, camera())
    assert set(packed.sh_bits) == set(SH_BITS)


@pytest.mark.slow
def test_pointers_beyond_those_held() -> None:
    """A picture above 1080p, then one below it: lines of pointers go to memory and come back; all is counted."""
    with session() as chip:
        done = check(chip, large())
        front, _ = golden(chip.packed, large())
        lists = front_memory(front).lists
        assert done.front["spilled"] == lists.spilled.sum() > 50 and done.front["fetched"] == lists.fetched.sum() > 20
        live_beats(done, chip.purposes())
        check(chip, camera())


def test_pointers_that_cannot_be_read_back() -> None:
    """An error of the front end, which ends; mended, the next frame is right."""
    with session() as chip:
        view = large()
        frame = chip.frame(view, chip.place(view), background=BLUE, tag=3)
        chip.fail(frame.region.pointers, chip.driver.flk_pointer_bytes(view.width, view.height), writes=False)
        chip.start(frame)
        done = chip.finish(frame, LIMIT)
        assert done.error & ~(1 << ResultError.LIST_MEMORY) == 1 << ResultError.FRONT_READ, done.errors
        chip.mend()
        check(chip, camera())


@pytest.mark.slow
def test_abort_while_pointers_move() -> None:
    """At any time of a move, with pauses; the frame after it is right."""
    rng = random.Random(f"{seed()} moves")
    port = replace(PORT, stall={name: 0.3 for name in CHANNELS}, seed=seed())
    with session(port=port) as chip:
        view = large()
        frame = chip.frame(view, chip.place(view), background=BLUE, tag=1)
        for _ in range(rounds(4, 8)):
            before = chip.usage().live
            chip.start(frame)
            for _ in range(10_000):
                chip.step(20)
                if chip.counter(ChipCounter.LIVE_POINTER_WRITTEN) - before["pointer_written"] > 3:
                    break
            else:
                raise AssertionError("no pointers move")
            chip.step(rng.randrange(200))
            assert chip.field("status", "front_busy")
            chip.driver.flk_abort(ctypes.byref(chip.device))
            for _ in range(1000):
                if not chip.field("status", "aborting"):
                    break
                chip.step(10)
            assert chip.quiet and chip.field("interrupt", "aborted") and chip.field("status", "ready")
            chip.set_register("interrupt", 31)
        check(chip, camera())
        check(chip, view)


def any_port(rng: random.Random, number: int) -> PortConfig:
    """Latency, pauses on every channel and places for transactions by chance; orders by number."""
    return replace(
        PORT, seed=rng.getrandbits(30), latency=rng.randint(1, 60), max_reads=rng.choice([2, 9, 256]), max_writes=rng.choice([1, 5, 128]),
        order=list(Order)[number % 4], urgent=rng.choice([0, 14, 16]), write_order=list(WriteOrder)[number % 3],
        stall={name: rng.choice([0.0, 0.3, 0.7]) for name in CHANNELS}, run={name: rng.randint(1, 8) for name in CHANNELS},
    )


@pytest.mark.parametrize("number", range(5))
def test_memories(number: int) -> None:
    """Five seeds of pauses on every channel; answers in every order; both formats; DRAM in one. In two of an antialiased scene, where the first frame's
    principal point is off the middle. Each has a frame by depth and one by distance."""
    port, features = any_port(random.Random(f"{seed()} {number}"), number), number in (1, 2)
    packed, first = replace(small(), antialiased=features), replace(camera(), cx=20.3, cy=31.0 + number) if features else camera()
    with session(packed, port=port, memory=MemoryOptions(DramConfig().timing if number == 4 else None)) as chip:
        check(chip, first, list(PixelFormat)[number % 2], order=list(SortOrder)[number % 2])
        check(chip, camera(80, 40, x=0.5), list(PixelFormat)[(number + 1) % 2], order=list(SortOrder)[(number + 1) % 2])


def test_order_by_distance() -> None:
    """Frames of one session by depth and by distance while the camera turns on the spot: their pictures differ, and each is the golden model's."""
    with session() as chip:
        for degrees in (0.0, 4.0):
            c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
            view = replace(camera(), rotation=np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))
            by_depth, by_distance = (check(chip, view, order=order) for order in SortOrder)
            assert not np.array_equal(by_depth.buffer, by_distance.buffer)
    seen = View(view, decode(small()), order=SortOrder.DISTANCE)
    done, want = (render_on_chip(seen, engine, config=CONFIG, options=FrontOptions(rechunk=True)) for engine in (Engine.CHIP, Engine.CHIP_GOLDEN))
    assert np.array_equal(done.image, want.image) and done.stats["order"] == "distance"
    plain = render_on_chip(View(view, decode(small())), Engine.CHIP_GOLDEN, config=CONFIG, options=FrontOptions(rechunk=True))
    assert not np.array_equal(done.image, plain.image)


@pytest.mark.slow
@pytest.mark.parametrize("config", ALL_CONFIGS)
@pytest.mark.parametrize("number", range(5))
def test_demo_scene_under_pauses(number: int, config: RenderConfig) -> None:
    """The same on the demo scene, with DRAM."""
    view, packed, lists = demo(config)
    port = any_port(random.Random(f"{seed()} {number} demo"), number)
    with session(packed, config=config, port=port, memory=MemoryOptions(DramConfig().timing)) as chip:
        done = chip.render(view.camera, background=BLUE, lists=lists, limit=10 * LIMIT)
        compare(chip, view.camera, done, config=config, lists=lists)


def test_what_a_frame_tells() -> None:
    """Shares of the DRAM's rate and bytes of the halves add up to those of the frame."""
    dram = DramConfig(refresh=Refresh.PER_BANK)
    with session(memory=MemoryOptions(dram.timing)) as chip:
        stats = chip_stats(chip, chip.render(camera()), CONFIG, dram)
    live, moved = stats["counters"]["live"], stats["dram_bytes"]
    assert [64 * live[f"{name}_beats"] for name in ("table", "geometry", "colour")] == [
        moved["table"][0], moved["headers"][0] + moved["geometry"][0], moved["colour"][0],
    ]
    assert sum(stats["phases"][name] * stats["busy"][name]["DRAM"] for name in stats["phases"]) == pytest.approx(stats["dram_efficiency"] * stats["cycles"])
    assert all(0 < share <= 1 for part in stats["busy"].values() for share in part.values())
    assert stats["bottleneck"].startswith(max(stats["phases"], key=lambda name: stats["phases"][name])) and stats["refresh"] == "per-bank"


def specks(count: int, size: float, spread: float) -> PackedScene:
    """Faint Gaussians of one size, about 1 before the camera, up to spread to its sides."""
    rng = np.random.default_rng(seed())
    return pack(Scene(
        means=np.stack([*rng.uniform(-spread, spread, (2, count)), rng.uniform(0.99, 1.01, count)], axis=1), scales=np.full((count, 3), size),
        quats=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), opacities=np.full(count, 0.02), sh=np.zeros((count, 1, 3)),
    ), PackedFormat.CHUNK).packed


@pytest.mark.parametrize(("part", "count", "size", "width", "channels"), [
    ("rendering: sorting units", 5000, 0.001, 16, 64), ("rendering: delivery", 6000, 0.01, 64, 64), ("rendering: lanes", 400, 0.2, 64, 64),
    ("front end: DRAM", 3000, 0.001, 64, 1),
])
def test_what_holds_a_frame_up(part: str, count: int, size: float, width: int, channels: int) -> None:
    """A list that is sorted twice in one tile, many short ones, large splats, a slow memory."""
    dram = DramConfig(channels=channels)
    view = Camera(width, width, 80.0, 80.0, np.zeros(3), np.eye(3))
    with session(specks(count, size, width / 170), memory=MemoryOptions(dram.timing)) as chip:
        stats = chip_stats(chip, check(chip, view), CONFIG, dram)
        front = run_front(chip.packed, view)
    assert stats["bottleneck"].startswith(part), (stats["bottleneck"], stats["phases"], stats["busy"])
    # The model of the rendering half is that of this chip.
    tables, cycles = TileLists.of(front, front_memory(front)), stats["phases"]["rendering"]
    modelled = rendering.estimate(tables, CONFIG, dram).cycles
    assert modelled == pytest.approx(cycles, rel=0.15)
    if seed() == 1:
        figures.hold(f"RTL, {part}, cycles of the rendering half", cycles)
        figures.hold(f"model over RTL, {part}, cycles of the rendering half", modelled / cycles)
    # Entries of lists that are sorted twice count twice.
    entries = np.diff(tables.start)
    again = entries > CONFIG.chip_memories.sorted_entries
    work = np.where(again, 2, 1) * entries
    assert stats["counters"]["rendering"]["sorted_again"] == entries[again].sum() and again.any() == (part == "rendering: sorting units")
    assert stats["busy"]["rendering"]["sorting units"] * cycles == pytest.approx(max(work[k::4].sum() for k in range(4)), rel=0.01)


def test_opaque_layers() -> None:
    """Lists of thousands of opaque splats: read in part, sorted in part, few records looked up."""
    rng, n = np.random.default_rng(seed()), 6000
    packed = pack(Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, n)), rng.uniform(1.0, 6.0, n)], axis=1), scales=rng.uniform(2.0, 3.0, (n, 3)),
        quats=rng.normal(size=(n, 4)), opacities=rng.uniform(0.9, 1.0, n), sh=rng.normal(scale=0.3, size=(n, 4, 3)),
    ), PackedFormat.CHUNK).packed
    with session(packed) as chip:
        done = check(chip, camera(32, 32))
        assert np.sum(done.rendering["entries"]) < 0.5 * np.sum(done.front["entries"]) and done.rendering["lines"] < 0.5 * n


@pytest.mark.parametrize("overlap", [True, False])
def test_back_to_back(overlap: bool) -> None:
    """Four frames with cameras of their own on two regions: the front end works on the next one, of the other order, while one is rendered."""
    views, orders = [camera(x=0.3 * k) for k in range(4)], [*SortOrder, *SortOrder]
    with session() as chip:
        places = [chip.place(views[0]) for _ in range(2)]
        frames = [chip.frame(view, places[k % 2], background=BLUE, order=orders[k], tag=7 + k) for k, view in enumerate(views)]
        done: list[ChipFrame] = []
        if not overlap:
            for frame in frames:
                chip.start(frame)
                done.append(chip.finish(frame, LIMIT))
        else:
            chip.start(frames[0])
            for k, frame in enumerate(frames):
                if k + 1 < len(frames):
                    while chip.call("flk_ready", ctypes.byref(chip.device)) == "BUSY":
                        chip.step(20)
                    chip.start(frames[k + 1])
                done.append(chip.finish(frame, LIMIT))
        for view, frame, order in zip(views, done, orders):
            compare(chip, view, frame, order=order)
        ahead = [b.stamps["taken"] < a.stamps["rendering_done"] for a, b in zip(done, done[1:])]
        assert all(ahead) if overlap else not any(ahead)
        assert chip.field("frames", "started") == chip.field("frames", "finished") == 4


def test_the_front_end_waits() -> None:
    """Beside a slower rendering half the front end takes longer than alone, of its own will, and nobody waits for it."""
    with session(small(4000), port=replace(PORT, latency=20)) as chip:
        first, *rest = list(back_to_back(chip, [camera(192, 108)] * 3, background=BLUE))
    front, rendering = first.frame.phases["front end"], first.frame.phases["rendering"]
    assert rendering > 2 * front
    for done in rest:
        assert done.frame.phases["front end"] > 1.8 * front and done.interval < 1.02 * rendering


@pytest.mark.parametrize("config", ALL_CONFIGS)
def test_modes_travel_with_their_frame(config: RenderConfig) -> None:
    """Two frames under way, the second one's mode (which lanes do not have), format and background written while the first is rendered."""
    with session(config=config) as chip:
        view = camera()
        first = chip.frame(view, chip.place(view), background=BLUE, tag=1)
        second = chip.frame(view, chip.place(view, PixelFormat.RGBA16F), PixelFormat.RGBA16F, tag=2)
        second.mode = int(CatMode.OFF)
        chip.start(first)
        while not chip.field("status", "render_busy"):
            chip.step(50)
        chip.start(second, first)
        compare(chip, view, chip.finish(first, LIMIT), config=config)
        compare(chip, view, chip.finish(second, LIMIT), PixelFormat.RGBA16F, replace(config, cat=CatMode.OFF))


def test_registers_in_mid_frame() -> None:
    """What is written while a frame is under way is the next frame's; a second waiting start is refused and changes nothing."""
    rng = random.Random(f"{seed()} registers")
    with session() as chip:
        view = camera()
        frames = [chip.frame(view, chip.place(view), background=BLUE, tag=k) for k in range(3)]
        chip.start(frames[0])
        chip.start(frames[1], frames[0])  # waits for the front end
        assert not chip.field("status", "ready")
        chip.set_register("size", 0)  # locked
        chip.set_register("control", 1)
        assert chip.field("interrupt", "refused")
        chip.set_register("interrupt", 1 << 4)
        compare(chip, view, chip.finish(frames[0], LIMIT))
        for _ in range(30):  # free again: noise for a frame that is never started
            chip.set_register("chunks", rng.getrandbits(25))
            assert 0 <= chip.register("status") < 32
        compare(chip, view, chip.finish(frames[1], LIMIT))


@pytest.mark.parametrize("size", [(1, 600), (600, 1), (1, 1)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_narrow_pictures(size: tuple[int, int]) -> None:
    """One pixel wide or high: bands of the walk that go left, and pairs with one tile."""
    with session() as chip:
        check(chip, camera(*size))


def test_nothing_to_see() -> None:
    """Everything behind the camera: culled, a picture of the background."""
    with session() as chip:
        done = check(chip, camera(away=True))
        assert (done.buffer.reshape(-1, 3) == BLUE).all() and done.rendering["lines"] == 0


@pytest.mark.parametrize("size", [30.0, 0.02], ids=["over the whole picture", "around the camera"])
def test_one_gaussian(size: float) -> None:
    """One that covers every tile; one whose middle is the camera's place."""
    at = 3.0 if size > 1 else 0.0
    packed = pack(Scene(
        means=np.array([[0.0, 0.0, at]]), scales=np.full((1, 3), size), quats=np.array([[1.0, 0, 0, 0]]), opacities=np.array([0.9]), sh=np.full((1, 1, 3), 0.4),
    ), PackedFormat.CHUNK).packed
    with session(packed) as chip:
        done = check(chip, camera())
        assert np.sum(done.front["entries"]) == (24 if at else 0)


def test_growing_lists() -> None:
    """Too little list memory is an error that names it, the frame buffer is not touched, and the next frame is right."""
    with session() as chip:
        view = camera()
        place = chip.place(view, chunks=2)
        frame = chip.frame(view, place, background=BLUE, tag=5)
        before = chip.buffer(frame)
        chip.start(frame)
        done = chip.finish(frame, LIMIT)
        assert done.error == 1 << ResultError.LIST_MEMORY and done.errors == ["out of list memory"]
        assert np.array_equal(before, done.buffer) and not done.stage.any()
        check(chip, view)


def test_overflow_beside_a_good_frame() -> None:
    """A frame without list memory between two good ones, all started back to back."""
    with session() as chip:
        views = [camera(x=0.2 * k) for k in range(3)]
        frames = [chip.frame(view, chip.place(view, chunks=1 if k == 1 else None), background=BLUE, tag=k) for k, view in enumerate(views)]
        chip.start(frames[0])
        done = []
        for k in range(3):
            if k < 2:
                while chip.call("flk_ready", ctypes.byref(chip.device)) == "BUSY":
                    chip.step(20)
                chip.start(frames[k + 1])
            done.append(chip.finish(frames[k], LIMIT))
        assert done[1].error == 1 << ResultError.LIST_MEMORY
        compare(chip, views[0], done[0])
        compare(chip, views[2], done[2])


def test_too_small_a_region_of_records() -> None:
    """A region that a cluster's records lie beyond is an error that names it, nothing behind it is written, and the next frame is right."""
    with session() as chip:
        view = camera()
        frame = chip.frame(view, chip.place(view), background=BLUE, tag=5)
        chip._check(chip.call("flk_frame_write", ctypes.byref(chip.device), ctypes.byref(frame), None))
        beats = chip.register("record_beats") // 2
        chip.set_register("record_beats", beats)
        size = frame.region.record_bytes
        before = chip.read(frame.region.records, size)
        chip._check(chip.call("flk_start", ctypes.byref(chip.device), None))
        done = chip.finish(frame, LIMIT)
        assert done.error == 1 << ResultError.RECORD_REGION and done.errors == ["records beyond their region"]
        after = chip.read(frame.region.records, size)
        assert np.array_equal(before[64 * beats :], after[64 * beats :]) and not done.stage.any()
        check(chip, view)


REGION_ERRORS = {
    "table": ResultError.FRONT_READ, "headers": ResultError.FRONT_READ, "geometry": ResultError.FRONT_READ, "colours": ResultError.FRONT_READ,
    "records": ResultError.FRONT_WRITE, "lists": ResultError.FRONT_WRITE, "pointers": ResultError.FRONT_WRITE, "frame_buffer": ResultError.FRAME_WRITE,
}


@pytest.mark.parametrize("region", REGION_ERRORS)
def test_memory_errors(region: str) -> None:
    """An error in each region ends the frame with its bit; mended, the next one is right."""
    with session() as chip:
        view = camera()
        frame = chip.frame(view, chip.place(view), background=BLUE, tag=3)
        parts = dict(zip(("table", "headers", "geometry", "colours"), chip.scene.part))
        at = parts.get(region) or getattr(frame.region, region, 0) or frame.frame_buffer
        chip.fail(at, 4096 if region == "colours" else 64)  # no survivor may have the first colours
        chip.start(frame)
        done = chip.finish(frame, LIMIT)
        assert done.error >> REGION_ERRORS[region] & 1, done.errors
        chip.mend()
        check(chip, view)


def test_unreadable_lists_and_records() -> None:
    """What was written becomes unreadable: the rendering half's errors. The frame ends."""
    with session() as chip:
        view = camera()
        frame = chip.frame(view, chip.place(view), background=BLUE, tag=3)
        for region, error in (("lists", ResultError.LIST_READ), ("pointers", ResultError.LIST_READ), ("records", ResultError.RECORD_READ)):
            chip.start(frame)
            while not chip.field("status", "render_busy"):
                chip.step(5)
            size = {"lists": 64 * 32 * 4 * frame.region.chunks, "pointers": 64 * 4, "records": frame.region.record_bytes}[region]
            chip.fail(getattr(frame.region, region), size)
            done = chip.finish(frame, LIMIT)
            assert done.error >> error & 1, (region, done.errors)
            chip.mend()
        check(chip, view)


def test_scene_that_is_not_there() -> None:
    """Addresses without memory behind them."""
    with session() as chip:
        view = camera()
        frame = chip.frame(view, chip.place(view), background=BLUE)
        chip.scene.part[2] = 1 << 39
        chip.start(frame)
        assert chip.finish(frame, LIMIT).error == 1 << ResultError.FRONT_READ


def test_a_scene_damaged_after_it_was_opened() -> None:
    """A bound that is not a number, which the driver has not seen: an error of its own, nothing rendered; the next frame is right."""
    with session() as chip:
        view = camera()
        table = bytearray(chip.packed.sections()["table"])
        table[4:8] = np.float32(np.nan).tobytes()
        frame = chip.frame(view, chip.place(view), background=BLUE)
        right = chip.scene.part[0]
        chip.scene.part[0] = chip.allocate(len(table), "table", bytes(table))
        before = chip.buffer(frame)
        chip.start(frame)
        done = chip.finish(frame, LIMIT)
        assert done.error == 1 << ResultError.BAD_TABLE and done.errors[0].startswith("the scene is damaged") and np.array_equal(before, done.buffer)
        chip.scene.part[0] = right
        check(chip, view)


def test_refused_descriptors() -> None:
    """Written past the driver: each ends with the error and touches nothing."""
    with session() as chip:
        view = camera()
        frame = chip.frame(view, chip.place(view), background=BLUE, tag=9)
        for register, value in (
            ("frame_buffer_low", frame.frame_buffer + 32), ("table_low", int(chip.scene.part[0]) + 4), ("lists_low", 8), ("size", 54 << 16), ("size", 96),
            ("size", 54 << 16 | 4097), ("size", 4096 << 16 | 4096), ("stride", 287), ("stride", 256), ("clusters", 0), ("frame", 9 | 7 << 16 | 1 << 22),
        ):
            chip._check(chip.call("flk_frame_write", ctypes.byref(chip.device), ctypes.byref(frame), None))
            chip.set_register(register, value)
            before = chip.buffer(frame)
            chip._check(chip.call("flk_start", ctypes.byref(chip.device), None))
            done = chip.finish(frame, LIMIT)
            assert done.error == 1 << ResultError.DESCRIPTOR and np.array_equal(before, done.buffer), register
            assert not any(np.any(value) for value in done.front.values()) and not any(np.any(value) for value in done.rendering.values())
        check(chip, view)


KEPT_PATH = [camera(), camera(), camera(x=0.003), camera(x=0.006), camera(x=0.3), camera(away=True), camera(), camera(x=0.001)]


@pytest.mark.parametrize("config", [CONFIG, pytest.param(CHANNELS_CONFIG, marks=pytest.mark.slow)], ids=["lanes", "channels"])
def test_kept_colours(config: RenderConfig) -> None:
    """Frames back to back, two under way, that keep colours and show those of frames before: each as in the golden model, with what it moves, and the store
    behind the last one."""
    epsilon = 4 / 255
    with session(config=config, port=replace(PORT, stall={name: 0.2 for name in CHANNELS}, seed=seed())) as chip:
        assert chip.device.colour_store
        store, kept = chip.store(epsilon, 7), ColourStore(chip.packed)
        stored = []
        for done, view in zip(back_to_back(chip, KEPT_PATH, background=BLUE, store=store), KEPT_PATH, strict=True):
            front = run_front(chip.packed, view, kind=RecordKind.of(config.form), reuse=Reuse(kept, epsilon, 7))
            want = render_chip(front_lists(front) if config.by_lanes else front.subtile_lists(), config, PixelFormat.RGB8, BLUE)
            assert np.array_equal(done.frame.buffer, want.buffer)
            found = front.reused
            assert (done.frame.front["store_beats"], done.frame.front["store_lines"]) == (found.read_beats, found.written_beats)
            assert done.moved.get("store", 0) == 64 * (found.read_beats + found.written_beats)
            stored.append(found.stored.mean() if len(found.stored) else 0.0)
        assert stored[0] == 0.0 and stored[1] == 1.0 and any(0.0 < s < 1.0 for s in stored)
        assert np.array_equal(chip.read(store.address, store.bytes), kept.image())
        # Frames that keep none, between.
        check(chip, camera(x=0.1), config=config)


def test_kept_colours_from_before() -> None:
    """A session that begins with the colours of frames before it shows them in its first frame; those of another scene are refused."""
    with session() as chip:
        kept, view = ColourStore(chip.packed), KEPT_PATH[0]
        run_front(chip.packed, view, reuse=Reuse(kept, 0.0, 7))
        colours = kept.image().tobytes()
        with pytest.raises(FlickerError, match="kept colours: .* bytes, the scene's take"):
            chip.store(0.0, 7, colours[64:])
        (done,) = back_to_back(chip, [view], background=BLUE, store=chip.store(0.0, 7, colours))
        found = run_front(chip.packed, view, reuse=Reuse(kept, 0.0, 7)).reused
        assert found is not None and found.stored.all() and len(found.rows_read)
        assert (done.frame.front["store_beats"], done.frame.front["store_lines"], done.frame.front["colour_beats"]) == (found.read_beats, 0, 0)
        compare(chip, view, done.frame)


def test_kept_colours_behind_aborts() -> None:
    """Frames that are aborted or late at random times leave no colour that is not its position's: with a tolerance of 0, what follows is what it is without a
    store, from the same position, the one before and another one. Behind a reset it is so in another generation."""
    rng = random.Random(f"{seed()} kept")
    port = replace(PORT, stall={name: 0.2 for name in CHANNELS}, seed=seed())
    with session(port=port) as chip:
        views = [camera(), camera(x=0.05), camera(x=-0.4)]
        pictures = {k: render_chip(front_lists(run_front(chip.packed, view)), CONFIG, PixelFormat.RGB8, BLUE).buffer for k, view in enumerate(views)}
        place, store = chip.place(views[0]), chip.store(0.0)
        cut = 0
        for turn in range(rounds(8, 14)):
            frame = chip.frame(views[turn % 3], place, background=BLUE, tag=turn, store=store)
            late = turn % 2 == 0
            frame.deadline = rng.randint(800, 5000) if late else 0
            chip.start(frame)
            if late:
                cut += chip.finish(frame, LIMIT).error == 1 << ResultError.LATE
            else:
                chip.step(rng.randint(1000, 8000))
                chip.driver.flk_abort(ctypes.byref(chip.device))
                while chip.field("status", "aborting"):
                    chip.step(10)
                chip.set_register("interrupt", 31)
            for k in rng.sample(range(3), 2):
                after = chip.frame(views[k], place, background=BLUE, tag=100 + k, store=store)
                chip.start(after)
                done = chip.finish(after, LIMIT)
                assert done.error == 0 and np.array_equal(done.buffer, pictures[k]), (turn, k)
        assert cut > rounds(1, 3)
        chip.start(chip.frame(views[0], place, background=BLUE, store=store))
        chip.step(5000)
        chip.hold_memory(True)
        chip.driver.flk_reset(ctypes.byref(chip.device))
        chip.step(20)
        chip.hold_memory(False)
        store.generation += 1
        frame = chip.frame(views[0], place, background=BLUE, store=store)
        chip.start(frame)
        assert np.array_equal(chip.finish(frame, LIMIT).buffer, pictures[0])


def test_kept_colours_refused() -> None:
    """By the driver with a code, and past it by the chip; nothing is written."""
    packed, view = small(), camera()
    with session() as chip:
        place, good = chip.place(view), chip.store(0.1)
        write = lambda store: chip.call("flk_frame_write", ctypes.byref(chip.device), ctypes.byref(chip.frame(view, place, store=store)), None)  # noqa: E731
        bad = lambda **fields: driver.CStore(**{name: fields.get(name, getattr(good, name)) for name, _ in driver.CStore._fields_})  # noqa: E731
        for status, store in (
            ("FRAME_STORE", bad(bytes=good.bytes - 64)), ("FRAME_STORE", bad(generation=0)), ("FRAME_ALIGN", bad(address=good.address + 1024)),
            ("FRAME_TOLERANCE", bad(tolerance=-0.1)), ("FRAME_TOLERANCE", bad(tolerance=1.5)), ("FRAME_TOLERANCE", bad(tolerance=float("nan"))),
            ("FRAME_OVERLAP", bad(address=place.region.records)), ("FRAME_OVERLAP", bad(address=int(chip.scene.address))),
            ("FRAME_RANGE", bad(address=(1 << 40) - 2048)), ("OK", good),
        ):
            assert write(store) == status, (status, store.address, store.bytes, store.tolerance)
        before = chip.read(good.address, good.bytes).copy()
        for register, value in (("store_low", good.address + 1024), ("store_beats", CLUSTER_BEATS * len(packed.table) - 1), ("frame", 0)):
            assert write(good) == "OK"
            chip.set_register(register, value)
            chip._check(chip.call("flk_start", ctypes.byref(chip.device), None))
            assert chip.finish(chip.frame(view, place), LIMIT).error == 1 << ResultError.DESCRIPTOR, register
        assert np.array_equal(chip.read(good.address, good.bytes), before)
        check(chip, view)
    with session(pack(decode(packed), PackedFormat.FP16).packed) as chip:
        store = chip.store(0.1)
        assert chip.call("flk_frame_write", ctypes.byref(chip.device), ctypes.byref(chip.frame(view, chip.place(view), store=store)), None) == "FRAME_KEEPS"


def test_damaged_images() -> None:
    """The driver refuses them, and says what is wrong."""
    data = bytearray(small().image())
    for at, text in ((0, "magic|image"), (8, "version"), (300, "table"), (len(data) - 100, "colour")):
        damaged = bytearray(data)
        damaged[at] ^= 1
        with pytest.raises(FlickerError, match=text), session(image=bytes(damaged)):
            pass


def test_abort_and_reset() -> None:
    """At random times, with pauses; the frame after it is right, and memory is quiet when the abort is over."""
    rng = random.Random(f"{seed()} abort")
    port = replace(PORT, stall={name: 0.3 for name in CHANNELS}, seed=seed())
    with session(port=port) as chip:
        view = camera()
        places = [chip.place(view) for _ in range(2)]
        frames = [chip.frame(view, place, background=BLUE, tag=k) for k, place in enumerate(places)]
        for turn in range(12):
            frames[0].deadline = rng.choice([0, rng.randint(1, 12_000)])  # an abort may come while a half is stopped, too
            chip.start(frames[0])
            if turn % 3 == 0:
                chip.start(frames[1], frames[0])
            chip.step(rng.choice([1, 10, 300, 2000, 6000, 15000]) + rng.randrange(200))
            if turn % 2:
                chip.hold_memory(True)
                chip.driver.flk_reset(ctypes.byref(chip.device))
                chip.step(20)
                chip.hold_memory(False)
            else:
                chip.driver.flk_abort(ctypes.byref(chip.device))
                for _ in range(1000):
                    if not chip.field("status", "aborting"):
                        break
                    chip.step(10)
                assert chip.quiet and chip.field("interrupt", "aborted")
                assert chip.field("result", "error") & ~(1 << ResultError.LATE) == 1 << ResultError.ABORTED
                assert chip.field("frames", "started") == chip.field("frames", "finished")
                chip.set_register("interrupt", 31)
            assert chip.field("status", "ready") and not chip.field("status", "dead")
            if turn % 4 == 3:
                chip.set_register("interrupt", 31)
                check(chip, view)
        chip.set_register("interrupt", 31)
        check(chip, view)


@pytest.mark.parametrize("channel", CHANNELS)
def test_silent_memory(channel: str) -> None:
    """A channel stops for good: time-out, nothing but a reset helps, and then the next frame is right."""
    port: PortConfig = replace(PORT, stop_after={channel: 150})
    with session(port=port) as chip:
        view = camera()
        frame = chip.frame(view, chip.place(view), background=BLUE)
        chip.driver.flk_set_timeout(ctypes.byref(chip.device), ctypes.c_uint32(3000))
        chip.start(frame)
        with pytest.raises(FlickerError, match="no interrupt"):
            chip.finish(frame, 15_000)
        assert chip.field("status", "dead") and chip.field("interrupt", "error")
        assert chip.field("result", "error") == 1 << ResultError.TIMED_OUT
        assert chip.field("frames", "finished") == chip.field("frames", "started") == 1  # the frame that was forgotten counts as finished
        assert chip.call("flk_ready", ctypes.byref(chip.device)) == chip.call("flk_poll", ctypes.byref(chip.device), ctypes.c_uint16(1)) == "DEAD"
        chip.set_register("control", 2)  # an abort does not help
        chip.set_register("control", 1)
        chip.step(500)
        assert chip.field("status", "dead")
        chip.driver.flk_interrupt_acknowledge(ctypes.byref(chip.device), chip.driver.flk_interrupt_pending(ctypes.byref(chip.device)))
        assert chip.register("interrupt") == 0
        chip.mend()
        revive(chip)
        assert chip.register("interrupt") == chip.register("result") == 0
        check(chip, view)


def revive(chip: ChipSession) -> None:
    """A reset of the chip and of the memory's side of the port."""
    chip.hold_memory(True)
    chip.driver.flk_reset(ctypes.byref(chip.device))
    chip.step(20)
    chip.hold_memory(False)


def test_time_out_before_a_release() -> None:
    """Between a handler's look at a frame and its release: what the frame left stays until then, and the time-out is told after it."""
    with session() as chip:
        view, device = camera(), ctypes.byref(chip.device)
        frames = [chip.frame(view, chip.place(view), background=BLUE, tag=k) for k in (21, 22)]
        chip.driver.flk_set_timeout(device, ctypes.c_uint32(3000))
        chip.start(frames[0])
        while not chip.field("interrupt", "frame_done"):
            chip.step(100)
        survivors = chip.counter(ChipCounter.SURVIVORS)
        chip.start(frames[1])
        chip.step(500)
        chip.hold_memory(True)
        chip.step(4000)
        assert chip.field("status", "dead") and chip.field("interrupt", "error")
        result = chip.driver.flk_result(device)
        assert (result.tag, result.error) == (21, 0) and chip.counter(ChipCounter.SURVIVORS) == survivors
        assert chip.call("flk_poll", device, ctypes.c_uint16(1)) == "OK"
        chip.driver.flk_release(device)
        assert chip.call("flk_poll", device, ctypes.c_uint16(2)) == "DEAD"
        assert chip.field("interrupt", "error") and chip.driver.flk_result(device).error == 1 << ResultError.TIMED_OUT
        chip.set_register("interrupt", 31)
        revive(chip)
        assert chip.register("interrupt") == 0
        check(chip, view)


OVERRUN = round(0.02 * 1e9 / 90)  # cycles: 2 % of a slot of 1/90 s at 1 GHz
# With the pauses of `test_deadlines`: a pair of tiles, what the memory owes, the counters of both halves. A half that went on would take thousands.
UNDER_WAY = 1000


def live(chip: ChipSession) -> int:
    return chip.counter(ChipCounter.LIVE_CYCLES)


def overrun(chip: ChipSession, begun: int, deadline: int) -> int:
    """Cycles from a deadline until the host is told that the frame has ended; begun: `live` behind its start."""
    chip.driver.flk_interrupt_enable(ctypes.byref(chip.device), ctypes.c_uint32(1 << REGISTERS["interrupt"].fields["frame_done"][0]))
    chip.wait(10 * LIMIT)
    return (live(chip) - begun) % 2**32 - deadline


def test_deadlines() -> None:
    """At random times, with pauses and DRAM, alone and beside a frame that has none: what is written are the first pairs of the walk, whole; the rest of the
    buffer stays; the frame beside it and the next one are right. The overrun is that of what is under way."""
    rng = random.Random(f"{seed()} deadlines")
    port = replace(PORT, stall={name: 0.2 for name in CHANNELS}, seed=seed())
    view, other = camera(160, 90), camera(80, 40, x=0.5)
    with session(port=port, memory=MemoryOptions(DramConfig().timing)) as chip:
        frames = [chip.frame(v, chip.place(v), background=BLUE, tag=k) for k, v in enumerate((view, other))]
        chip.start(frames[0])
        whole = chip.finish(frames[0], LIMIT)
        compare(chip, view, whole)
        assert whole.pairs == 5 * 6
        front = whole.stamps["front_done"] - whole.stamps["taken"]
        all_ = whole.stamps["rendering_done"] - whole.stamps["taken"]
        seen, overruns = set(), []
        for turn in range(rounds(14, 60)):
            frames[0].deadline = rng.choice([rng.randint(1, front), rng.randint(front, all_), rng.randint(front, all_)])
            beside, first = turn % 2, rng.random() < 0.5
            frames[0].frame_buffer = chip.allocate(whole.buffer.size, "frame")
            before = chip.buffer(frames[0])
            order = [0] if not beside else [0, 1] if first else [1, 0]
            done = {}
            chip.start(frames[order[0]])
            begun = live(chip)
            for number in order[1:]:
                while chip.call("flk_ready", ctypes.byref(chip.device)) == "BUSY":
                    chip.step(5)
                chip.start(frames[number], frames[1 - number])
            took = overrun(chip, begun, frames[0].deadline) if order[0] == 0 else 0  # nothing before it
            for number in order:
                done[number] = chip.finish(frames[number], LIMIT)
            late = done[0]
            assert late.error in (0, 1 << ResultError.LATE) and (late.error == 0) == (late.pairs == whole.pairs), late.errors
            assert np.array_equal(late.buffer, late_frame_buffer(before, whole.buffer, late.pairs, 10, 6, PixelFormat.RGB8)), late.pairs
            seen.add((late.error > 0, late.pairs > 0))
            overruns.append(took)
            assert took >= 0 or not late.error or order[0] != 0
            if beside:
                compare(chip, other, done[1])
        print(f"overruns: {sorted(overruns)}")
        assert {(True, True), (True, False)} <= seen and 0 < max(overruns) < UNDER_WAY < front
        frames[0].deadline = 0
        chip.start(frames[0])
        compare(chip, view, chip.finish(frames[0], LIMIT))


@pytest.mark.slow
def test_overrun_on_a_real_scene() -> None:
    """flowers at 640x360 with LPDDR4: in either half within 2 % of a slot of 1/90 s at 1 GHz, whatever the length of its lists."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    real = next(each for each in REAL_VIEWS if each.folder == "flowers")
    view = load_view(real.path(scenes), real.number, (640, 360))
    with session(packed_scene(view, PackedFormat.CHUNK), memory=MemoryOptions(DramConfig().timing)) as chip:
        want = golden(chip.packed, view.camera)[1].buffer
        frame = chip.frame(view.camera, chip.place(view.camera), background=BLUE)
        for deadline, pairs in ((300_000, False), (1_000_000, True), (1_300_000, True)):
            frame.deadline = deadline
            frame.frame_buffer = chip.allocate(want.size, "frame")
            before = chip.buffer(frame)
            chip.start(frame)
            took = overrun(chip, live(chip), deadline)
            late = chip.finish(frame)
            print(f"deadline {deadline:,}: {late.pairs} pairs, {took} cycles later")
            assert late.error == 1 << ResultError.LATE and (late.pairs > 0) == pairs and 0 <= took < OVERRUN
            assert np.array_equal(late.buffer, late_frame_buffer(before, want, late.pairs, 40, 23, PixelFormat.RGB8))


@pytest.mark.slow
@pytest.mark.parametrize("config", [pytest.param(CONFIG, id="lanes"), pytest.param(CHANNELS_CONFIG, id="channels")])
@pytest.mark.parametrize("real,size", LARGE, ids=lambda value: value.folder if isinstance(value, RealView) else f"{value[0]}x{value[1]}")
def test_real_scenes(real: RealView, size: tuple[int, int], config: RenderConfig) -> None:
    """With LPDDR4: all at 320x180, two at 640x360, flowers at 1280x720 (some 15 minutes)."""
    scenes = real_scenes()
    if scenes is None:
        pytest.skip("FLICKER_SCENES does not name the folder of real scenes")
    view = load_view(real.path(scenes), real.number, size)
    with session(packed_scene(view, PackedFormat.CHUNK), config=config, memory=MemoryOptions(DramConfig().timing)) as chip:
        done = chip.render(view.camera, background=BLUE, limit=10 * LIMIT)
        compare(chip, view.camera, done, config=config)


def test_strides_and_places() -> None:
    """A frame buffer with a gap behind each row, which is not written; nothing beside it either."""
    with session() as chip:
        view = camera(80, 40)
        row = least_stride(80, PixelFormat.RGB8)
        place = chip.place(view, stride=row + 64)
        frame = chip.frame(view, place, background=BLUE)
        before = chip.buffer(frame)
        chip.start(frame)
        done = chip.finish(frame, LIMIT)
        assert done.error == 0 and np.array_equal(done.buffer[:, :row], golden(chip.packed, view)[1].buffer)
        assert np.array_equal(done.buffer[:, row:], before[:, row:])
