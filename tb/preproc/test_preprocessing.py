"""The whole front end in RTL against the golden model: memory after the frame, byte by byte, and the counters.

State space: formats, list kinds, records of 16 and of 32 bytes, memories (perfect, LPDDR4 with pauses on all channels), frames one after the other, clusters
all culled, one Gaussian, pictures of 4096x4096, 4096x1 and 1x4096, a Gaussian over the whole of the largest (SLOW=1), a camera inside a cluster, errors of the
memory by address, list memory that runs out, a table that points beyond the records. Registers and memories begin random; bytes that no one should write are
compared too. Parameter space: records of 16 bytes in four lanes; with SLOW=1 of 32 in a slow one, and others of lanes and list writers, and real scenes.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from flicker_tb.bench import rounds
from flicker_tb.elaboration import refused
from flicker_tb.real import real_views
from flicker_tb.runner import seed

from flicker.chip.dram import DramConfig
from flicker.chip.preprocessing import traffic as chip_traffic
from flicker.chip.preprocessing import unit_cycles
from flicker.front.view import DEMO, View, load_view
from flicker.golden.front.frame import FrontFrame, ListKind, run_front
from flicker.golden.front.memory import front_memory
from flicker.golden.front.record import RecordKind
from flicker.golden.lists import ListError
from flicker.params import Form, RenderConfig, SortOrder
from flicker.pipeline import Front, FrontOptions, bit_true_front, packed_scene
from flicker.progress import Steps
from flicker.scene import packing
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.packed import HEADER_BYTES, SH_BITS, PackedFormat, PackedScene, decode
from flicker.scene.packing import Recipe, pack
from flicker.scene.real import RealView, real_scenes
from flicker.sim.half import MemoryOptions
from flicker.sim.memory import PortConfig
from flicker.sim.preprocessing import ERRORS, LIST_ERROR, PORTS, Regions, RtlFront, front_frame
from flicker.sim.preprocessing import front_rtl as any_front_rtl

QUICK = MemoryOptions()
SLOW = pytest.mark.slow
KINDS = [pytest.param(kind, id=f"{kind.bytes} bytes", marks=[SLOW] * (kind is RecordKind.CONIC32)) for kind in RecordKind]  # a build of its own
# Preprocessing lanes, list writers and interval of the front end that each kind is tested in.
UNITS = {RecordKind.FACTORED16: {"lanes": 4, "writers": 4, "interval": 2}, RecordKind.CONIC32: {"lanes": 1, "writers": 1, "interval": 4}}


def front_rtl(*args, kind: RecordKind = RecordKind.FACTORED16, **options) -> RtlFront:
    """A frame that hangs says so within minutes."""
    return any_front_rtl(*args, **{"kind": kind, "limit": 1_000_000, **UNITS[kind], **options})


def lpddr4(stalls: bool = True) -> MemoryOptions:
    """DRAM behind ports that pause."""
    shares = {"AR": 0.2, "R": 0.2, "AW": 0.2, "W": 0.2, "B": 0.2} if stalls else {}
    config = PortConfig(max_reads=64, max_writes=64, latency=20, stall=shares)
    return MemoryOptions(DramConfig().timing, {n: dataclasses.replace(config, seed=seed() + k) for k, n in enumerate(PORTS)})


@cache
def demo() -> View:
    return load_view(DEMO, 0, (320, 180))


def check(
    packed: PackedScene, camera: Camera, lists: ListKind = ListKind.ELLIPSE, memory: MemoryOptions = QUICK, frames: int = 1,
    kind: RecordKind = RecordKind.FACTORED16, order: SortOrder = SortOrder.DEPTH, **units: int,
) -> tuple[FrontFrame, RtlFront]:
    """A frame of both, compared. units: other ones than UNITS has for the kind."""
    lanes, writers = (units.get(name, UNITS[kind][name]) for name in ("lanes", "writers"))
    golden = run_front(packed, camera, lists, kind, order=order)
    image = front_memory(golden)
    rtl = front_rtl(
        packed, camera, lists, kind=kind, chunks=image.lists.chunks, memory=memory, frames=frames, seed=seed(), order=order, **units,
    )
    assert rtl.error == 0 and "value beyond FP16 clamped" not in golden.adjusted
    assert rtl.waits == {name: rtl.counters[name] for name in rtl.waits}
    written = image.written
    assert np.array_equal(rtl.records[written], image.records[written])
    lines = np.unique(np.concatenate([w for w in image.lists.writes])) if image.lists.chunks else np.zeros(0, np.int64)
    assert np.array_equal(rtl.memory[lines], image.lists.memory[lines])
    assert np.array_equal(rtl.pointers, image.lists.pointers)
    untouched(rtl, written, lines)
    count, out = rtl.counters, golden.outcomes
    assert [int(count[n]) for n in ("culled_gaussians", "too_near", "outside", "faint", "unlisted")] == [
        out["in a culled cluster"], out["nearer than 0.2"], out["3-sigma box outside the picture"], out["opacity below 1/510"],
        out["opacity below 1/510"] + out["ellipse holds no pixel"],
    ]
    assert count["survivors"] == len(golden.gaussian) and count["culled_clusters"] == len(packed.table) - golden.clusters_kept
    assert count["saturated"] == golden.adjusted.get("mean beyond 2^22 pixels", 0) and count["clipped"] == golden.adjusted.get("colour above 2 clipped", 0)
    assert np.array_equal(count["taken"], image.lists.taken)
    for name in ("entries", "lines", "evicted"):  # a writer has every `writers`th bank
        banks = getattr(image.lists, name)
        assert list(count[name]) == [banks[w::writers].sum() if w < writers else 0 for w in range(4)], name
    traffic = {n: (c.read_beats, c.write_beats) for n, c in rtl.traffic.items()}
    per = lambda n: frames * int(count[n])  # noqa: E731
    for name in ("header", "geometry", "colour"):
        assert traffic["headers" if name == "header" else name] == (per(f"{name}_beats"), 0)
    assert traffic["records"] == (0, per("record_beats")) and traffic["lists"][1] == frames * int(np.sum(count["lines"]))
    for name, moved in (("spilled", image.lists.spilled), ("fetched", image.lists.fetched)):
        assert count[name] == moved.sum(), name
    beats = dict.fromkeys(traffic, (0, 0))
    for b in chip_traffic(golden, image, lanes):
        read, written = beats[b.name]
        beats[b.name] = (read, written + frames * len(b.beat)) if b.write else (read + frames * len(b.beat), written)
    assert beats == traffic
    return golden, rtl


def untouched(rtl: RtlFront, written: np.ndarray, lines: np.ndarray) -> None:
    """What the frame does not write is what was there."""
    rest = np.setdiff1d(np.arange(len(rtl.memory)), lines)
    records, memory = rtl.before
    assert np.array_equal(rtl.records[~written], records[~written]) and np.array_equal(rtl.memory[rest], memory[rest])


@pytest.mark.parametrize(("form", "lists", "kind"), [
    (PackedFormat.CHUNK, ListKind.ELLIPSE, RecordKind.FACTORED16), (PackedFormat.FP16_LOCAL, ListKind.BOX, RecordKind.FACTORED16),
    pytest.param(PackedFormat.CHUNK, ListKind.ELLIPSE, RecordKind.CONIC32, marks=SLOW),
    pytest.param(PackedFormat.FP16, ListKind.BOX, RecordKind.CONIC32, marks=SLOW),  # the paper's
])
def test_demo_scene(form: PackedFormat, lists: ListKind, kind: RecordKind) -> None:
    view = demo()
    golden, rtl = check(pack(view.scene, form).packed, view.camera, lists, kind=kind, **UNITS[RecordKind.FACTORED16])
    assert len(golden.gaussian) > 50_000
    assert abs(unit_cycles(golden).all / rtl.cycles - 1) <= 0.1  # the chip model's estimate


def some(count: int, **changes) -> Scene:
    """Gaussians in front of `plain_camera`; fields as given, broadcast."""
    rng = np.random.default_rng(5)
    values = {
        "means": np.stack([*rng.uniform(-2, 2, (2, count)), rng.uniform(1.0, 6.0, count)], axis=1), "scales": rng.uniform(0.01, 0.2, (count, 3)),
        "quats": rng.normal(size=(count, 4)), "opacities": rng.uniform(0.01, 1.0, count), "sh": rng.normal(scale=0.3, size=(count, 16, 3)),
    }
    for name, value in changes.items():
        values[name] = np.broadcast_to(value, (count, *np.shape(values[name])[1:])).astype(np.float64)
    return Scene(**values)


def mixed_bits(scene: Scene, start: np.ndarray) -> np.ndarray:
    """Bits of SH codes by cluster: all that there are, in turn."""
    return np.resize(SH_BITS, len(start))


def plain_camera(width: int = 200, height: int = 120) -> Camera:
    return Camera(width, height, 150.0, 150.0, np.zeros(3), np.eye(3))


@pytest.mark.parametrize("coefficients", [4, 9, 16])
def test_sh_codes_of_fewer_bits(coefficients: int) -> None:
    """Clusters of each number of bits, in the same picture."""
    scene = some(256 * 2 * len(SH_BITS))
    packed = pack(dataclasses.replace(scene, sh=scene.sh[:, :coefficients]), recipe=Recipe(cuts=0, sh_bits=mixed_bits)).packed
    assert set(packed.sh_bits) == set(SH_BITS) and (packed.degrees == int(coefficients**0.5) - 1).all()
    golden, _ = check(packed, plain_camera(), memory=lpddr4())
    assert len(golden.gaussian) > 1000


def turned(camera: Camera, degrees: float) -> Camera:
    """On the spot, about its vertical axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return dataclasses.replace(camera, rotation=camera.rotation @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16])
def test_order_by_distance(form: PackedFormat, kind: RecordKind) -> None:
    """Lists by distance with pauses of the memory, and their keys: other than those of depths, in the order of float64's distances, and the same bits where the
    camera turns on the spot."""
    packed = pack(some(1500), form).packed
    golden, _ = check(packed, plain_camera(), memory=lpddr4(), kind=kind, order=SortOrder.DISTANCE)
    by_depth = run_front(packed, plain_camera(), kind=kind)
    assert np.array_equal(golden.records, by_depth.records) and (golden.key != by_depth.key).mean() > 0.9
    away = np.linalg.norm(decode(packed).means[golden.gaussian], axis=1)
    assert (np.diff(away[np.argsort(golden.key, kind="stable")]) > -1e-4).all()
    after, _ = check(packed, turned(plain_camera(), 7.0), memory=lpddr4(), kind=kind, order=SortOrder.DISTANCE)
    both, before, now = np.intersect1d(golden.gaussian, after.gaussian, return_indices=True)
    assert len(both) > 700 and np.array_equal(golden.key[before], after.key[now])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_degrees_and_a_slow_memory(degree: int, kind: RecordKind) -> None:
    """DRAM behind ports with pauses, two frames one after the other; of degrees 2 and 3 antialiased, with the principal point off the middle."""
    rng = np.random.default_rng(degree)
    scene = some(3000, sh=rng.normal(scale=0.3, size=(3000, 16, 3)))
    sh = scene.sh[:, : (degree + 1) ** 2]
    form = PackedFormat.CHUNK if degree % 2 else PackedFormat.FP16
    features, camera = degree >= 2, plain_camera()
    if features:
        camera = dataclasses.replace(camera, cx=rng.uniform(0, 150), cy=rng.uniform(-20, 200))
    packed = pack(dataclasses.replace(scene, sh=sh, antialiased=features), form).packed
    golden, rtl = check(packed, camera, memory=lpddr4(), frames=2, kind=kind)
    if features:
        plain = run_front(dataclasses.replace(packed, antialiased=False), camera, kind=kind)
        assert (golden.splats().opacity < plain.splats().opacity).mean() > 0.3 and len(golden.entry_tile) < len(plain.entry_tile)
    if kind is RecordKind.FACTORED16:  # four lanes
        assert all(rtl.counters[f"{name}_waits"] > 0 for name in ("cluster", "colour", "entry", "merged", "line", "beat")) and rtl.counters["group_missing"] > 0
        assert rtl.counters["place_waits"] + rtl.counters["request_waits"] > 0


def test_survivors_of_one_lane(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every fourth Gaussian of a row lies behind the near plane, the others before it: one lane has all survivors, and groups wait for it. Packed as they
    come."""
    count = 3000
    number = np.arange(count)
    means = np.stack([np.linspace(-0.05, 0.05, count), np.zeros(count), np.where(number % 4 == 0, 0.25, 0.15)], axis=1)
    monkeypatch.setattr(packing, "cluster_order", lambda means, size, reach: (np.arange(len(means)), np.arange(0, len(means), size), 0))
    scene = some(count, means=means, scales=0.005)
    golden, rtl = check(pack(dataclasses.replace(scene, sh=scene.sh[:, :1]), PackedFormat.FP16).packed, plain_camera())
    assert rtl.counters["lane_waits"] > 100 and len(golden.gaussian) < count / 3


@pytest.mark.parametrize("kind", KINDS)
def test_mixed_degrees(kind: RecordKind) -> None:
    """Clusters of all degrees and sizes, one after the other."""
    scene = some(2000)
    sh = scene.sh.copy()
    place = np.argsort(scene.means[:, 0])
    for k, part in enumerate(np.array_split(place, 12)):
        sh[part, (k % 4 + 1) ** 2 :] = 0
    check(pack(dataclasses.replace(scene, sh=sh), PackedFormat.CHUNK).packed, plain_camera(), memory=lpddr4(), kind=kind)


CASES = {
    "one": some(1), "behind": some(300, means=[0.0, 0.0, -5.0]), "near": some(300, means=[0.0, 0.0, 0.1]), "outside": some(300, means=[90.0, 0.0, 4.0]),
    "inside a cluster": some(600, means=np.random.default_rng(1).uniform(-3, 3, (600, 3))), "one tile": some(256, means=[0.01, 0.02, 4.0], scales=0.001),
    "large": some(300, scales=5.0), "equal depths": some(400, means=np.c_[np.random.default_rng(2).uniform(-1, 1, (400, 2)), np.full(400, 4.0)]),
    "faint": some(400, opacities=np.random.default_rng(3).choice([1 / 255, 1.4 / 255, 2 / 255], 400)),
    "degenerate": some(300, scales=np.random.default_rng(4).choice([1e-7, 1.0], (300, 3))),
    "bright": some(300, sh=np.random.default_rng(6).normal(scale=4.0, size=(300, 16, 3))),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CASES)
def test_cases(name: str, kind: RecordKind) -> None:
    golden, rtl = check(pack(CASES[name], PackedFormat.CHUNK).packed, plain_camera(), kind=kind)
    assert len(golden.gaussian) > 0 or name in ("behind", "near", "outside")
    if name == "bright":  # FP16 holds all colours
        assert (rtl.counters["clipped"] > 0) == (kind is RecordKind.FACTORED16) and golden.splats().rgb.max() > 1023 / 512 - 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_opacities_of_nothing(kind: RecordKind, monkeypatch: pytest.MonkeyPatch) -> None:
    """Opacities that a record rounds to 0, in no list of either kind. `pack` leaves them out; another packer may not."""
    monkeypatch.setattr(packing, "VISIBLE", 0.0)
    scene = some(400, opacities=np.random.default_rng(3).choice([0.4 / 255, 1 / 255, 0.3], 400))
    for lists in ListKind:
        golden, rtl = check(pack(scene, PackedFormat.FP16).packed, plain_camera(), lists, kind=kind)
        assert rtl.counters["faint"] > 50 and len(golden.entry_tile) > 100


@SLOW
def test_three_beats_of_a_group() -> None:
    """Two records in a beat: a cluster's last four survivors fill the open beat and another one and leave a third, which is told when the next cluster's
    first group could come."""
    scene = some(8000, scales=0.01)  # the picture's sides go through many clusters
    packed = pack(dataclasses.replace(scene, sh=scene.sh[:, :1]), PackedFormat.CHUNK).packed
    golden, _ = check(packed, plain_camera(), kind=RecordKind.CONIC32, **UNITS[RecordKind.FACTORED16])
    cluster = packed.cluster[golden.gaussian]
    survivors = np.bincount(cluster, minlength=len(packed.table))
    group = (np.arange(len(packed)) - np.searchsorted(packed.cluster, packed.cluster)) // 4
    last = np.bincount(cluster[group[golden.gaussian] == (packed.counts[cluster] - 1) // 4], minlength=len(packed.table))
    assert np.count_nonzero((survivors % 2 == 1) & (last == 4)) > 2


@SLOW
def test_one_gaussian_over_the_largest_picture() -> None:
    """65,536 tiles of a picture of 4096x4096."""
    packed = pack(some(1, means=[0.0, 0.0, 1.0], scales=100.0, opacities=0.9), PackedFormat.FP16).packed
    golden, rtl = check(packed, plain_camera(4096, 4096))
    assert len(golden.entry_tile) == 65536 and rtl.counters["entries"].sum() == 65536


def wide(count: int = 400, **changes) -> tuple[PackedScene, Camera]:
    """Gaussians all over a picture just above those whose pointers are held, and its camera."""
    width, height = changes.pop("size", (2080, 1104))
    rng = np.random.default_rng(seed())
    z = rng.uniform(1.0, 6.0, count)
    means = np.stack([rng.uniform(-0.6, 0.6, count) * z, rng.uniform(-0.6, 0.6, count) * height / width * z, z], axis=1)
    scene = some(count, means=means, scales=rng.uniform(0.005, 0.05, (count, 3)), **changes)
    return pack(scene, PackedFormat.CHUNK).packed, Camera(width, height, width, width, np.zeros(3), np.eye(3))


FEWER = [(1, 1, 4), (2, 2, 2), (4, 1, 4), (1, 4, 2)]


@SLOW
@pytest.mark.parametrize(("lanes", "writers", "interval"), FEWER)
def test_fewer_lanes_and_writers(lanes: int, writers: int, interval: int) -> None:
    """The same bytes: the demo scene, groups of one to four Gaussians and all degrees behind a slow memory, lines of pointers that move."""
    view = demo()
    golden, rtl = check(pack(view.scene, PackedFormat.CHUNK).packed, view.camera, lanes=lanes, writers=writers, interval=interval)
    assert abs(unit_cycles(golden, lanes=lanes, writers=writers, interval=interval).all / rtl.cycles - 1) <= 0.1
    sizes = some(2000)
    for degree, form in enumerate((PackedFormat.FP16, PackedFormat.CHUNK, PackedFormat.FP16, PackedFormat.CHUNK)):
        scene = dataclasses.replace(sizes, sh=sizes.sh[:, : (degree + 1) ** 2])
        check(pack(scene, form).packed, plain_camera(), memory=lpddr4(), frames=2, lanes=lanes, writers=writers, interval=interval)
    packed, camera = wide()
    check(packed, camera, memory=lpddr4(), lanes=lanes, writers=writers, interval=interval)
    packed, camera = wide(150, size=(4096, 4096))
    check(packed, camera, lanes=lanes, writers=writers, interval=interval)


@SLOW
def test_one_slow_lane() -> None:
    """All survive, with entries and four parts of a colour each: the lane's queue is full, and so is the order of stored and computed colours beside it."""
    count, rng = 2000, np.random.default_rng([seed(), 6])
    z = rng.uniform(2.0, 6.0, count)
    means = np.stack([rng.uniform(-0.3, 0.3, count) * z, rng.uniform(-0.2, 0.2, count) * z, z], axis=1)
    packed = pack(some(count, means=means, scales=np.full((count, 3), 0.15)), PackedFormat.CHUNK).packed
    for memory in (QUICK, lpddr4()):
        golden, rtl = check(packed, plain_camera(), memory=memory, kind=RecordKind.CONIC32)
        assert len(golden.number) == count and rtl.counters["lane_waits"] > 0


@SLOW
def test_front_of_a_configuration() -> None:
    """--front rtl is the front end of the configuration: its lanes, list writers and interval."""
    view, units = demo(), UNITS[RecordKind.CONIC32]
    config = RenderConfig(Form.CONIC, preproc_lanes=units["lanes"], list_writers=units["writers"], preproc_interval=units["interval"])
    found, stats = bit_true_front(view, config, Front.RTL, FrontOptions(), Steps())
    packed = packed_scene(view, PackedFormat.CHUNK)
    want, rtl = front_frame(packed, view.camera, kind=RecordKind.CONIC32, **units)
    assert np.array_equal(found.records, want.records) and stats["front_cycles"] == rtl.cycles > 2 * len(packed)


@SLOW
@pytest.mark.parametrize(("lanes", "writers", "interval"), FEWER[:2])
def test_fewer_writers_out_of_list_memory(lanes: int, writers: int, interval: int) -> None:
    """Each bank ends by itself, in pictures with all pointers held and with more."""
    for packed, camera in ((pack(some(2000), PackedFormat.CHUNK).packed, plain_camera()), wide()):
        frame = run_front(packed, camera)
        full = front_memory(frame).lists
        image = front_memory(frame, (int(full.taken.min()) + int(full.taken.max())) // 2).lists
        rtl = front_rtl(packed, camera, chunks=image.chunks, seed=seed(), lanes=lanes, writers=writers, interval=interval)
        assert image.failed.any() and rtl.error == 1 << ERRORS.index("out of list memory") and np.array_equal(rtl.counters["taken"], image.taken)
        lines = np.unique(np.concatenate(image.writes))
        assert np.array_equal(rtl.memory[lines], image.memory[lines])
        assert np.array_equal(np.delete(rtl.memory, lines, axis=0), np.delete(rtl.before[1], lines, axis=0))
        for bank in np.flatnonzero(image.failed == 0):
            assert np.array_equal(rtl.pointers.reshape(-1, 4, 16)[:, bank], image.pointers.reshape(-1, 4, 16)[:, bank])


@pytest.mark.parametrize("parameters", [{"PreprocLanes": 3}, {"ListWriters": 3}], ids=str)
def test_illegal_parameters(parameters: dict[str, int]) -> None:
    refused("flk_preprocessing", parameters, f"{next(iter(parameters))} must be 1, 2 or 4")


@pytest.mark.parametrize("interval", [1, 3, 8])
def test_illegal_interval(interval: int) -> None:
    refused("flk_preprocessing", {"PreprocInterval": interval}, "PreprocInterval must be 2 or 4")


@pytest.mark.parametrize("memory", [pytest.param(QUICK, id="perfect"), pytest.param(lpddr4(), id="lpddr4", marks=SLOW)])
def test_pointers_beyond_those_held(memory: MemoryOptions) -> None:
    """Lines of pointers go to their table and come back; two frames one after the other."""
    packed, camera = wide()
    _, rtl = check(packed, camera, memory=memory, frames=2)
    assert rtl.counters["spilled"] > 100 and rtl.counters["fetched"] > 50


def test_the_largest_picture() -> None:
    """4096x4096 pixels, of a scene that is listed everywhere."""
    packed, camera = wide(rounds(60, 150), size=(4096, 4096))
    golden, rtl = check(packed, camera)
    least = rounds(5_000, 20_000)
    assert len(golden.entry_tile) > least and rtl.counters["spilled"] > least // 20 and rtl.counters["fetched"] > least // 40


@pytest.mark.parametrize(("width", "height"), [(4096, 1), (1, 4096)])
def test_the_narrowest_pictures(width: int, height: int) -> None:
    """A row and a column of pixels, as long as there are: Gaussians on all of it and beside it."""
    rng, count = np.random.default_rng(seed()), 300
    z = rng.uniform(1.0, 6.0, count)
    means = np.stack([rng.uniform(-0.6, 0.6, count) * z * size / 4096 for size in (width, height)] + [z], axis=1)
    packed = pack(some(count, means=means, scales=rng.uniform(0.0005, 0.01, (count, 3))), PackedFormat.CHUNK).packed
    golden, _ = check(packed, Camera(width, height, 4096.0, 4096.0, np.zeros(3), np.eye(3)))
    assert {0, 255} <= set(golden.entry_tile.tolist())


def test_out_of_list_memory_after_pointers_have_moved() -> None:
    packed, camera = wide()
    frame = run_front(packed, camera)
    full = front_memory(frame).lists
    image = front_memory(frame, int(full.taken.min()) - 20).lists
    rtl = front_rtl(packed, camera, chunks=image.chunks, seed=seed())
    assert image.failed.all() and image.fetched.all() and rtl.error == 1 << ERRORS.index("out of list memory")
    assert rtl.counters["spilled"] == image.spilled.sum() and rtl.counters["fetched"] == image.fetched.sum()
    lines = np.unique(np.concatenate(image.writes))
    assert np.array_equal(rtl.memory[lines], image.memory[lines]) and np.array_equal(rtl.counters["lines"], image.lines)
    for writer in range(4):
        spilled = np.unique(image.moves[writer][:, 1])
        spilled = spilled[spilled >= 0]
        assert np.array_equal(rtl.pointers.reshape(-1, 4, 16)[spilled, writer], image.pointers.reshape(-1, 4, 16)[spilled, writer])


@pytest.mark.parametrize("channel", ["read", "write"])
def test_errors_where_pointers_move(channel: str) -> None:
    """A line of pointers that cannot be written, or only not be read back: the frame ends with a code, writes nothing outside of its regions, and the next
    one is right."""
    packed, camera = wide()
    image = front_memory(run_front(packed, camera)).lists
    regions = Regions.of(packed, camera, image.chunks)
    line = int(next(get for _, _, get in image.moves[0] if get >= 0)) * 4
    memory = MemoryOptions(**{"fail_reads" if channel == "read" else "fail": [(regions.pointers + 64 * line, 64)]}, mended=True)
    rtl = front_rtl(packed, camera, chunks=image.chunks, memory=memory, frames=2, seed=seed())
    code = 1 << ERRORS.index(f"a {channel} failed")
    assert rtl.errors[0] & code and rtl.errors[1] == 0
    if channel == "read":
        assert rtl.errors[0] & ~(1 << LIST_ERROR) == code  # lists that begin anew may take more chunks
    lines = np.unique(np.concatenate(image.writes))
    assert np.array_equal(rtl.memory[lines], image.memory[lines]) and np.array_equal(rtl.pointers, image.pointers)


def test_out_of_list_memory() -> None:
    """The frame ends with a code; writers with memory enough have written all of theirs."""
    packed = pack(some(2000), PackedFormat.CHUNK).packed
    camera = plain_camera()
    least = front_memory(run_front(packed, camera)).lists.chunks
    image = front_memory(run_front(packed, camera), least - 1).lists
    rtl = front_rtl(packed, camera, chunks=least - 1, seed=seed())
    assert image.error is ListError.OUT_OF_MEMORY and rtl.error == 1 << ERRORS.index("out of list memory")
    lines = np.unique(np.concatenate(image.writes))
    assert np.array_equal(rtl.memory[lines], image.memory[lines])
    assert np.array_equal(rtl.counters["lines"], image.lines)
    assert np.array_equal(np.delete(rtl.memory, lines, axis=0), np.delete(rtl.before[1], lines, axis=0))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part", ["table", "headers", "geometry", "geometry's end", "colour", "colour's end", "records", "lists", "pointers"])
def test_errors_of_the_memory(part: str, kind: RecordKind) -> None:
    """The frame ends, with a code; nothing is written outside of the regions, which the memory would refuse. The next frame, of a mended memory, is right."""
    packed = pack(some(1500), PackedFormat.CHUNK).packed
    camera = plain_camera()
    golden = front_memory(run_front(packed, camera, kind=kind))
    chunks = golden.lists.chunks
    regions = Regions.of(packed, camera, chunks, kind)
    name, _, end = part.partition("'")
    base = {"records": regions.records, "lists": regions.lists, "pointers": regions.pointers}
    at = regions.image + HEADER_BYTES
    for section, data in zip(("table", "headers", "geometry", "colour"), packed.sections().values()):
        base[section] = at + (-(-len(data) // 64) * 64 - 2048 if end else 0)
        at += len(data)
    memory = MemoryOptions(fail=[(base[name], 2048)], mended=True)
    rtl = front_rtl(packed, camera, kind=kind, chunks=chunks, memory=memory, frames=2, seed=seed())
    assert rtl.errors == [1 << ERRORS.index("a write failed" if name in ("records", "lists", "pointers") else "a read failed"), 0]
    assert np.array_equal(rtl.records[golden.written], golden.records[golden.written])
    lines = np.unique(np.concatenate(golden.lists.writes))
    assert np.array_equal(rtl.memory[lines], golden.lists.memory[lines])
    assert np.array_equal(rtl.pointers, golden.lists.pointers)
    assert rtl.counters["survivors"] == golden.written.sum()


@pytest.mark.parametrize("kind", KINDS)
def test_records_beyond_their_region(kind: RecordKind) -> None:
    """Clusters whose records have no place write nothing, and the frame says so; all others write theirs."""
    packed = pack(some(1500), PackedFormat.CHUNK).packed
    camera = plain_camera()
    golden = run_front(packed, camera, kind=kind)
    image = front_memory(golden)
    regions = Regions.of(packed, camera, image.lists.chunks, kind)
    places = int(packed.first[-1])  # of all clusters but the last
    less = dataclasses.replace(regions, record_bytes=kind.bytes * places)
    rtl = front_rtl(packed, camera, kind=kind, chunks=image.lists.chunks, regions=less, seed=seed())
    assert rtl.error == 1 << ERRORS.index("a cluster's records lie beyond their region")
    assert image.written[places:].any()
    written = image.written[:places]
    assert np.array_equal(rtl.records[written], image.records[:places][written])
    assert rtl.counters["survivors"] == written.sum()


def test_the_last_record_at_the_end_of_its_region() -> None:
    """The last Gaussian's record alone would be in a further beat: without that beat its cluster has no place, with it all is right."""
    last = lambda packed: int(packed.first[-1]) + int(packed.counts[-1]) - 1  # noqa: E731
    packed = next(p for n in range(236, 256) if last(p := pack(some(n), PackedFormat.CHUNK).packed) % 4 == 0)
    camera, kind, full = plain_camera(), RecordKind.FACTORED16, last(packed) // 4
    image = front_memory(run_front(packed, camera, kind=kind))
    regions = Regions.of(packed, camera, image.lists.chunks, kind)
    for beats, error in ((full, 1 << ERRORS.index("a cluster's records lie beyond their region")), (full + 1, 0)):
        rtl = front_rtl(packed, camera, kind=kind, chunks=image.lists.chunks, regions=dataclasses.replace(regions, record_bytes=64 * beats), seed=seed())
        assert rtl.error == error and rtl.counters["survivors"] == image.written[: int(packed.first[-1]) if error else None].sum()


def test_a_table_that_points_beyond_the_image() -> None:
    """The memory refuses the read, which ends the frame; nothing is written outside of the regions."""
    packed = pack(some(1500), PackedFormat.CHUNK).packed
    camera = plain_camera()
    chunks = front_memory(run_front(packed, camera)).lists.chunks
    table = packed.table.copy()
    table["first"][-1] += 1 << 18
    image = packed.image()
    image = image[:256] + table.tobytes() + image[256 + len(table.tobytes()) :]
    rtl = front_rtl(packed, camera, chunks=chunks, image=image, seed=seed())
    assert rtl.error & 1 << ERRORS.index("a read failed")


@pytest.mark.parametrize("part", ["table", "headers"])
def test_a_damaged_scene(part: str) -> None:
    """Bounds, or numbers of a header, that are not finite: the frame ends with a code; the scene and all outside of the regions are untouched."""
    packed = pack(some(1500), PackedFormat.CHUNK).packed
    camera = plain_camera()
    chunks = front_memory(run_front(packed, camera)).lists.chunks
    image = bytearray(packed.image())
    places = range(len(packed.table)) if part == "headers" else [0]  # of culled clusters no header is read
    for k in places:
        at = HEADER_BYTES + (len(packed.table.tobytes()) + k * packed.format.header.itemsize if part == "headers" else 0)
        image[at : at + 4] = np.float32(np.nan).tobytes()  # low of the first cluster, or origins
    rtl = front_rtl(packed, camera, chunks=chunks, image=bytes(image), seed=seed())
    assert rtl.error == 1 << ERRORS.index("the cluster table is damaged" if part == "table" else "a cluster's header is damaged")
    assert rtl.counters["survivors"] == 0 and np.array_equal(rtl.memory, rtl.before[1])


@pytest.mark.parametrize("kind", KINDS)
def test_frame_read_back_from_memory(kind: RecordKind) -> None:
    """What `--front rtl` hands to the rendering stage is what `--front golden` does."""
    packed = pack(some(1500), PackedFormat.CHUNK).packed
    golden = run_front(packed, plain_camera(), kind=kind).subtile_lists()
    frame, _ = front_frame(packed, plain_camera(), kind=kind, **UNITS[kind])
    lists = frame.subtile_lists()
    assert lists.form is golden.form and np.array_equal(lists.start, golden.start) and np.array_equal(lists.mean, golden.mean)
    assert np.array_equal(lists.gauss[lists.entry], golden.gauss[golden.entry]) and np.array_equal(lists.spiky[lists.entry], golden.spiky[golden.entry])


@SLOW
def test_sixteen_million() -> None:
    """As many Gaussians as numbers of records reach, seen from outside through a long lens: most clusters go, those that stay have numbers up to the end."""
    rng, n, side = np.random.default_rng(seed()), 16_700_000, 400.0
    packed = pack(Scene(
        rng.uniform(-side, side, (n, 3)).astype(np.float32), 0.02 * np.exp2(rng.uniform(-1, 1, (n, 1)).astype(np.float32)).repeat(3, 1),
        np.tile(np.array([1, 0, 0, 0], np.float32), (n, 1)), rng.uniform(0.2, 0.9, n).astype(np.float32), rng.normal(size=(n, 1, 3)).astype(np.float32),
    ), PackedFormat.CHUNK).packed
    camera = Camera(640, 360, 3000.0, 3000.0, np.array([0.0, 0.0, -side - 1.0]), np.eye(3))
    golden, _ = check(packed, camera)
    assert len(packed) == n and golden.number.max() > 15 << 20


@SLOW
@pytest.mark.parametrize("real", real_views())
@pytest.mark.parametrize("size", [(640, 360), (320, 180)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_real_scenes(real: RealView, size: tuple[int, int]) -> None:
    """At 640x360, and at 320x180, where many Gaussians of kept clusters lie beside the picture or have no pixel."""
    folder = real_scenes()
    if folder is None:
        pytest.skip("FLICKER_SCENES is not set")
    view = load_view(real.path(folder), real.number, size)
    check(packed_scene(view, None), view.camera)
