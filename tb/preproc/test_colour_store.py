"""Colours that are kept from frame to frame, front end in RTL against the golden model: records, the store byte by byte, and what is moved, frame by frame.

State space: cameras that stay, turn, walk and jump, so that clusters' colours last, do not last, lose and gain survivors; tolerances of 0, some and 1; clusters
of 1 to 256 Gaussians, all SH degrees, few bits, antialiased scenes, images without slopes; generations that change; memories (perfect, LPDDR4 with
pauses on all channels); errors of the memory in heads and rows, with the frames behind; a store of noise. Colours never differ by more than the tolerance from
those of the frame's own camera, and the slopes of the table hold for every direction. With SLOW=1 also the demo scene, more than 2^14 clusters; parameter
space: one and two lanes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
import pytest
from flicker_tb.runner import seed
from test_preprocessing import QUICK, demo, lpddr4

from flicker.chip.preprocessing import bytes_of, traffic
from flicker.errors import FlickerError
from flicker.front import projection
from flicker.golden.front.frame import FrontFrame, run_front
from flicker.golden.front.memory import front_memory
from flicker.golden.front.record import RecordKind
from flicker.golden.front.reuse import CLUSTER_BEATS, ColourStore, Reuse, limit_of
from flicker.scene import packing
from flicker.scene.camera import Camera
from flicker.scene.gaussians import Scene
from flicker.scene.packed import BEAT, HEADER_BYTES, SH_BITS, PackedFormat, PackedScene, decode
from flicker.scene.packing import Recipe, pack
from flicker.scene.slopes import largest_slopes, slope_of
from flicker.sim.half import MemoryOptions
from flicker.sim.preprocessing import ERRORS, Regions, front_path

LIMIT = 1_000_000
STEP = 2.0**-9  # of a colour in a record


@cache
def scene(degree: int = 3, bits: int | None = None, antialiased: bool = False) -> PackedScene:
    """Clusters of 256 Gaussians and of few, a wall of them before the camera and some around it."""
    rng, count = np.random.default_rng([seed(), 5]), 2500
    means = np.stack([rng.uniform(-3.0, 3.0, count), rng.uniform(-1.5, 1.5, count), rng.uniform(-0.5, 6.0, count)], axis=1)
    k = (degree + 1) ** 2
    packed = pack(Scene(
        means, rng.uniform(0.01, 0.06, (count, 3)), rng.normal(size=(count, 4)), rng.uniform(0.02, 1.0, count),
        rng.normal(size=(count, k, 3)) * np.where(np.arange(k) > 0, rng.choice([0.05, 0.2, 0.6], (count, 1)), 1.0)[..., None] * 0.5,
        antialiased=antialiased,
    ), PackedFormat.CHUNK, Recipe(sh_bits=bits)).packed
    assert packed.counts.min() < 40 and packed.counts.max() == 256
    return packed


def camera(x: float = 0.0, z: float = 0.0, turn: float = 0.0) -> Camera:
    """At (x, 0, z), turned by degrees."""
    a = np.radians(turn)
    rotation = np.array([[np.cos(a), 0.0, np.sin(a)], [0.0, 1.0, 0.0], [-np.sin(a), 0.0, np.cos(a)]])
    return Camera(160, 96, 110.0, 110.0, np.array([x, 0.0, z]), rotation)


# Stays; walks, by steps of all sizes; turns on the spot and back; jumps; comes back.
PATH = [
    camera(), camera(), camera(0.002), camera(0.004, 0.003), camera(0.004, 0.003, 12.0), camera(0.004, 0.003, -25.0), camera(0.004, 0.003, 4.0),
    camera(0.1, 0.05), camera(0.1, 0.05, 30.0), camera(2.0, 1.0, 90.0), camera(),
]


def golden_path(
    packed: PackedScene, cameras: Sequence[Camera], epsilon: float, generations: Sequence[int] | None = None, store: ColourStore | None = None,
) -> Iterator[tuple[FrontFrame, np.ndarray]]:
    """Frame and store behind it, of each camera."""
    store = store or ColourStore(packed)
    for number, view in enumerate(cameras):
        frame = run_front(packed, view, reuse=Reuse(store, epsilon, generations[number] if generations else 1))
        yield frame, store.image()


def check(
    packed: PackedScene, cameras: Sequence[Camera] = PATH, epsilon: float = 8 / 255, memory: MemoryOptions = QUICK, lanes: int = 4,
    generations: Sequence[int] | None = None,
) -> list[FrontFrame]:
    """A path of both, compared frame by frame."""
    golden = list(golden_path(packed, cameras, epsilon, generations))
    images = [front_memory(frame) for frame, _ in golden]
    chunks = max(image.lists.chunks for image in images)
    images = [front_memory(frame, chunks) for frame, _ in golden]
    before = np.zeros(2, np.int64)
    rtl = front_path(packed, cameras, epsilon, chunks=chunks, memory=memory, seed=seed(), limit=LIMIT, lanes=lanes, generations=generations)
    for (frame, store), image, got in zip(golden, images, rtl, strict=True):
        assert got.error == 0
        assert np.array_equal(got.records[image.written], image.records[image.written])
        assert np.array_equal(got.store, store)
        assert np.array_equal(got.pointers, image.lists.pointers)
        found = frame.reused
        count = got.counters
        moved = np.array([got.traffic["store"].read_beats, got.traffic["store"].write_beats], np.int64)
        assert (moved - before).tolist() == [found.read_beats, found.written_beats] == [count["store_beats"], count["store_lines"]]
        before = moved
        model = bytes_of([b for b in traffic(frame, image, lanes) if b.name in ("store", "colour")])
        assert model == {"colour": BEAT * count["colour_beats"], "store": BEAT * (found.read_beats + found.written_beats)}
    return [frame for frame, _ in golden]


def colours(frame: FrontFrame) -> np.ndarray:
    """int64 (R, 3): codes of the records."""
    high = np.ascontiguousarray(frame.records).view("<i8")[:, 1]
    return high[:, None] >> np.array([33, 43, 53]) & 1023


@pytest.mark.parametrize("memory", [pytest.param(QUICK, id="perfect", marks=pytest.mark.slow), pytest.param(lpddr4(), id="lpddr4")])
def test_a_path(memory: MemoryOptions) -> None:
    """Every kind of frame, and every kind of cluster in one."""
    frames = check(scene(), memory=memory)
    found = [frame.reused for frame in frames]
    shares = [f.stored.mean() for f in found]
    assert shares[0] == 0.0 and shares[1] == 1.0 and all(0.0 < s < 1.0 for s in (shares[2], shares[5], shares[8]))
    assert any(len(f.cleared) for f in found) and any(len(f.rows_written) and not len(f.cleared) for f in found[1:])
    assert any(0.0 < f.lasting.mean() < 1.0 for f in found)


@pytest.mark.parametrize("degree", [0, pytest.param(1, marks=pytest.mark.slow), 2])
def test_degrees(degree: int) -> None:
    """Of degree 0 the slope is least: a step changes no colour but where it is large beside the distance."""
    frames = check(scene(degree), memory=lpddr4())
    if degree == 0:
        assert all(frame.reused.stored.mean() > 0.9 for frame in frames[1:4])


@pytest.mark.parametrize(("bits", "antialiased"), [(4, False), (SH_BITS[0], True)])
def test_images(bits: int, antialiased: bool) -> None:
    """Few bits; opacities that change with the camera, while the store has the image's."""
    check(scene(2, bits, antialiased), PATH[3:9], memory=lpddr4())


@pytest.mark.parametrize("epsilon", [0.0, 1.0])
def test_tolerances(epsilon: float) -> None:
    """0: the same position alone. 1: whatever has a position near enough."""
    frames = check(scene(), epsilon=epsilon)
    assert [bool(frame.reused.lasting.any()) for frame in frames][1:4] == [True, epsilon > 0, epsilon > 0]


@pytest.mark.parametrize("count", [1, 12, 13, 256])
def test_one_cluster(count: int) -> None:
    """The row that a frame reads last is the one that the next frame reads first: it is read anew."""
    rng = np.random.default_rng([seed(), count])
    means = np.stack([rng.uniform(-0.5, 0.5, count), rng.uniform(-0.3, 0.3, count), rng.uniform(3.0, 3.2, count)], axis=1)
    packed = pack(Scene(
        means, np.full((count, 3), 0.03), rng.normal(size=(count, 4)), np.full(count, 0.8), rng.normal(size=(count, 4, 3)) * 0.3,
    ), PackedFormat.CHUNK, Recipe(cuts=0)).packed
    assert packed.counts.tolist() == [count]
    frames = check(packed, [camera()] * 3 + [camera(turn=2.0), camera(0.001), camera(0.5), camera(0.5)])
    assert [frame.reused.stored.mean() for frame in frames] == [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0]


def test_images_without_slopes() -> None:
    """Of a writer that knows none: colours last as long as the camera stays where it is."""
    packed = dataclasses.replace(scene(), table=scene().table.copy())
    packed.table["flags"] &= 3
    frames = check(packed, PATH[:6], epsilon=1.0)
    assert [frame.reused.lasting.any() for frame in frames] == [False, True, False, False, True, True]


def test_generations() -> None:
    """What another generation has left is nothing. Its heads lose their bits before a row is written, so that the first generation may come back whenever
    the second one's frame ends."""
    generations = [1, 1, 2, 2, 1, (1 << 32) - 1]
    frames = check(scene(), [camera()] * 6, generations=generations, memory=lpddr4())
    assert [frame.reused.lasting.any() for frame in frames] == [False, True, False, True, False, False]
    assert [len(frame.reused.cleared) > 0 for frame in frames] == [False, False, True, False, True, True]


def test_noise() -> None:
    """What the memory holds before is of no generation; and where it is by chance, a position that is no number is none."""
    packed, views = scene(), [camera(), camera(0.001)]
    rng = np.random.default_rng([seed(), 8])
    noise = rng.integers(0, 256, (len(packed.table), CLUSTER_BEATS, BEAT), np.uint8)
    noise[:, 0, 12:16] = np.frombuffer(np.uint32(1).tobytes(), np.uint8)
    noise[:, 0, :12] = np.array([0.5, np.inf, 0.0], "<f4").view(np.uint8)
    noise[1::3, 0, :12] = np.array([np.nan, 0.0, 1.0], "<f4").view(np.uint8)
    noise[2::3, 0, 12:16] = 0
    before = ColourStore(packed)
    before.there = np.unpackbits(noise[:, 0, 32:], axis=1, bitorder="little")[packed.cluster, np.arange(len(packed)) - packed.start[packed.cluster]] > 0
    golden = list(golden_path(packed, views, 0.5, store=before))
    chunks = max(front_memory(frame).lists.chunks for frame, _ in golden)
    rtl = front_path(packed, views, 0.5, chunks=chunks, seed=seed(), limit=LIMIT, store=noise.tobytes())
    for (frame, store), got in zip(golden, rtl, strict=True):
        image = front_memory(frame, chunks)
        assert got.error == 0 and np.array_equal(got.records[image.written], image.records[image.written])
        assert got.counters["store_lines"] == frame.reused.written_beats
        heads = [data.reshape(noise.shape)[frame.reused.kept, 0] for data in (got.store, store)]
        assert np.array_equal(*heads)
    assert len(golden[0][0].reused.cleared) == len(golden[0][0].reused.kept)


@pytest.mark.slow
def test_demo_scene() -> None:
    """As the formats have it, with the camera's own path: what lasts is most of it."""
    view = demo()
    packed = pack(view.scene).packed
    away = float(np.median(np.linalg.norm((packed.table["low"] + packed.table["high"]) / 2 - view.camera.position, axis=1)))
    path = [dataclasses.replace(view.camera, position=view.camera.position + view.camera.rotation[:, 2] * away * 0.001 * k) for k in range(4)]
    frames = check(packed, path, epsilon=2 / 255, memory=lpddr4(False))
    assert all(frame.reused.stored.mean() > 0.5 for frame in frames[1:])


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [1, 2])
def test_fewer_lanes(lanes: int) -> None:
    for memory in (QUICK, lpddr4()):
        check(scene(), memory=memory, lanes=lanes)


@pytest.mark.slow
def test_many_clusters(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a Gaussian each, so that those with a survivor have numbers of more than the lower half of a slot's."""
    rng, count, few = np.random.default_rng([seed(), 9]), 16_600, 200
    means = np.stack([rng.uniform(-0.5, 0.5, count), rng.uniform(-0.3, 0.3, count), np.full(count, -3.0)], axis=1)
    means[4:12, 2] = means[-few:, 2] = 3.0
    monkeypatch.setattr(packing, "cluster_order", lambda means, size, reach: (np.arange(len(means)), np.arange(len(means)), 0))
    packed = pack(Scene(
        means, np.full((count, 3), 0.03), rng.normal(size=(count, 4)), np.full(count, 0.8), rng.normal(size=(count, 4, 3)) * 0.3,
    ), PackedFormat.CHUNK, Recipe(cuts=0)).packed
    frames = check(packed, [camera(), camera(), camera(0.5)])
    assert (packed.counts == 1).all() and frames[1].reused.stored.all()
    assert {4, 7, 8, 11, count - few, count - 1} <= set(frames[1].reused.kept.tolist()) and count - few > 1 << 14


def golden_views(packed: PackedScene, cameras: Sequence[Camera]) -> tuple[list[FrontFrame], int, Regions]:
    """Of a path whose memory fails: frames, chunks of the lists, where things lie."""
    golden = [frame for frame, _ in golden_path(packed, cameras, 0.5)]
    chunks = max(front_memory(frame).lists.chunks for frame in golden)
    return golden, chunks, Regions.of(packed, cameras[0], chunks)


@pytest.mark.parametrize("part", ["table", "headers", "geometry", "colour", "head", "row, written"])
def test_errors_of_the_memory(part: str) -> None:
    """A frame ends with a code; the next one, of a mended memory, is right, as if nothing had been kept: after reads that failed without a word, after writes
    in another generation."""
    packed, view = scene(), camera()
    golden, chunks, regions = golden_views(packed, [view, view])
    cluster, row = next((c, r) for c, r in golden[1].reused.rows_read.tolist() if c > 3 and r > 2)
    at, size, written = regions.store + BEAT * CLUSTER_BEATS * cluster, BEAT, "written" in part
    if written:
        at += BEAT * (1 + row)
    elif part != "head":
        sections = packed.sections()
        names = list(sections)
        size = len(sections[part])
        at = regions.image + HEADER_BYTES + sum(len(sections[name]) for name in names[: names.index(part)])
        at, size = at + size // 2 // BEAT * BEAT, size // 4
    memory = MemoryOptions(**{"fail" if written else "fail_reads": [(at, size)]}, mended=True)
    first, second = front_path(
        packed, [view, view], 0.5, chunks=chunks, memory=memory, seed=seed(), limit=LIMIT, generations=[1, 1 + written],
    )
    wrong = 1 << ERRORS.index("a write failed" if written else "a read failed")
    assert (first.error & wrong, second.error) == (wrong, 0)
    image = front_memory(golden[0], chunks)
    assert np.array_equal(second.records[image.written], image.records[image.written])


def test_a_row_that_cannot_be_read() -> None:
    """The frame that would show it, and write it again with more survivors, ends with a code; the next one computes or has all that it shows."""
    packed, views = scene(), [camera(turn=turn) for turn in (0, 12, 0, 12)]
    golden, chunks, regions = golden_views(packed, views)
    found = golden[1].reused
    cluster, row = sorted({*map(tuple, found.rows_read.tolist())} & {*map(tuple, found.rows_written.tolist())})[-3]
    memory = MemoryOptions(fail_reads=[(regions.store + BEAT * (CLUSTER_BEATS * cluster + 1 + row), BEAT)], mended=True)
    frames = front_path(packed, views, 0.5, chunks=chunks, memory=memory, seed=seed(), limit=LIMIT, mended=2)
    for number, (frame, got) in enumerate(zip(golden, frames, strict=True)):
        assert got.error == (1 << ERRORS.index("a read failed") if number == 1 else 0)
        image = front_memory(frame, chunks)
        assert number == 1 or np.array_equal(got.records[image.written], image.records[image.written])


# ---- the bound ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("epsilon", [1 / 255, 4 / 255, 0.2])
def test_no_colour_differs_by_more(epsilon: float) -> None:
    """Walks and turns of all sizes: no colour of a record differs from the one that its camera shows by more than the tolerance and rounding; at 0.2 some
    differ by a good part of it."""
    packed, store = scene(), ColourStore(scene())
    rng = np.random.default_rng([seed(), 6])
    place, turn, most = np.zeros(2), 0.0, 0
    for number in range(30):
        view = camera(*place, turn)
        kept, plain = run_front(packed, view, reuse=Reuse(store, epsilon)), run_front(packed, view)
        assert np.array_equal(kept.number, plain.number) and np.array_equal(kept.key, plain.key)
        apart = np.abs(colours(kept) - colours(plain)).max()
        most = max(most, int(apart))
        assert apart <= epsilon / STEP + 2, (number, apart)
        place += rng.normal(size=2) * 10.0 ** rng.uniform(-4, -1.5)
        turn += rng.normal() * 5
    assert most * STEP > 0.1 * epsilon


def test_a_camera_that_turns_changes_no_bit() -> None:
    packed, store = scene(), ColourStore(scene())
    for turn in (0, 3, 8, -20, 90, 1):
        kept, plain = run_front(packed, camera(turn=turn), reuse=Reuse(store, 0.0)), run_front(packed, camera(turn=turn))
        assert np.array_equal(kept.records, plain.records)
    assert kept.reused.stored.mean() > 0.9


def test_slopes_hold() -> None:
    """Of random coefficients, between directions of all distances; the bound is not far from what is found."""
    rng = np.random.default_rng([seed(), 7])
    for degree in range(1, 4):
        k = (degree + 1) ** 2
        sh = rng.normal(size=(40, k, 3)) * (rng.random((40, k, 1)) < 0.5)
        bound = largest_slopes(sh, np.arange(40))
        steepest = np.zeros(40)
        for _ in range(40):
            d = rng.normal(size=(1000, 3))
            d /= np.linalg.norm(d, axis=1, keepdims=True)
            near = d + rng.normal(size=d.shape) * 1e-4
            near /= np.linalg.norm(near, axis=1, keepdims=True)
            angle = np.linalg.norm(near - d, axis=1)
            change = np.abs(_colours(sh, d) - _colours(sh, near)).max(axis=2) / angle
            steepest = np.maximum(steepest, change.max(axis=1))
        assert (steepest <= bound * 1.001).all() and (steepest[bound > 0] > 0.2 * bound[bound > 0]).all()


def _colours(sh: np.ndarray, d: np.ndarray) -> np.ndarray:
    """float64 (N, D, 3): linear in the coefficients, so that none is clipped, of directions (D, 3)."""
    basis = np.empty((len(d), sh.shape[1], 3))
    for k in range(sh.shape[1]):
        one = np.zeros((len(d), sh.shape[1], 3))
        one[:, k] = 0.4
        projection.colours(d, one, np.arange(len(d)), np.zeros(3), basis[:, k])
    return np.einsum("nkc,dkc->ndc", sh, (basis - 0.5) / 0.4)


def test_codes_of_slopes() -> None:
    """Of the table: no smaller than what the decoded coefficients have, and by a quarter of an octave larger at most."""
    packed = scene()
    found = largest_slopes(decode(packed).sh, packed.start[:-1])
    meant = slope_of(packed.slopes)
    assert (meant >= found).all() and (meant <= found * 2**0.25 * 1.02 + 0.01).all() and (packed.slopes > 0).all()
    flat = slope_of(scene(0).slopes)
    assert (flat < 0.01).all()


def test_refused() -> None:
    view = demo()
    for form in (PackedFormat.FP16, PackedFormat.FP16_LOCAL):
        with pytest.raises(FlickerError, match="format: fp16"):
            ColourStore(pack(view.scene, form).packed)
    with pytest.raises(FlickerError, match="records of 32 bytes"):
        run_front(scene(), camera(), kind=RecordKind.CONIC32, reuse=Reuse(ColourStore(scene()), 0.1))
    for epsilon in (-0.1, 1.1, float("nan")):
        with pytest.raises(FlickerError, match="colour tolerance: .*, not 0 to 1"):
            limit_of(epsilon)
