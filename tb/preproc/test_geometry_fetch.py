"""Geometry fetch against the image and the golden model's header values: every group, header field, word and count, under pauses on all sides.

Covered: the demo scene in chunks and in FP16, clusters of every size, headers of numbers from all over their range (subnormal ones too), none, one cluster
of one Gaussian, frames one after the other and after a reset in a frame, arrays that begin anywhere, errors of the memory in headers and geometry, headers
with numbers that are not finite, rates, the last clusters and slots that there are; with SLOW=1 small buffers.
Not covered: counts of more than 2**16 beats.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from fetch_bench import BEAT, PAUSES, FetchBench, Outcome, codes, codes_of, packed_bits
from flicker_tb.runner import seed

from flicker.front.view import DEMO, load_view
from flicker.golden.front import cull
from flicker.golden.front.colour import TERM_BITS
from flicker.golden.front.frame import SCALE_STEP_BITS, cluster_values
from flicker.golden.front.setup import CLUSTER_M, FORMATS, FrameSetup
from flicker.scene.demo import demo_cameras
from flicker.scene.packed import TABLE_ENTRY, PackedFormat, PackedScene
from flicker.scene.packing import pack

HEADERS, GEOMETRY = 0x3_0000_0FC0, 0x3_4567_8040  # beats of their own, not at a page
PORT = {"stall": {"AR": 0.3, "R": 0.3}, "run": {"R": 5}}
P, C = FORMATS.position, FORMATS.colour

# group_t, the last field lowest, the end and cluster_o with it: name, fields of it, bits of each.
LAYOUT = [
    ("word", 20, 32), ("used", 1, 4), ("group", 1, 6), ("last", 1, 1), ("first", 1, 1),
    ("sh_step", 9, 9 + C), ("dc_step", 3, 9 + C), ("dc_low", 3, TERM_BITS), ("scale_step", 3, SCALE_STEP_BITS), ("scale_low", 3, 27),
    ("step", 3, 9 + P), ("low", 3, 9 + P),
    ("sh_zero", 1, 9), ("colour", 1, 32), ("degree", 1, 2), ("count", 1, 8), ("slots", 1, 20), ("index", 1, 24), ("end", 1, 1), ("cluster", 1, 24),
]


@cache
def bench(beats: int = 96, clusters: int = 8) -> FetchBench:
    return FetchBench("geometry_fetch_bench", 45, 192, {"BufferBeats": beats, "Clusters": clusters})


@cache
def demo(form: PackedFormat) -> tuple[PackedScene, FrameSetup, np.ndarray]:
    """Scene, registers, kept clusters."""
    view = load_view(DEMO, 0, (640, 360))
    packed, setup = pack(view.scene, form).packed, FrameSetup.of(view.camera)
    return packed, setup, np.flatnonzero(cull.cull(packed, setup))


@cache
def some_setup() -> FrameSetup:
    return FrameSetup.of(demo_cameras()[0])


def wild(rng: np.random.Generator, form: PackedFormat, counts: np.ndarray) -> PackedScene:
    """Clusters of so many Gaussians, all else random: floats finite, some of them subnormal."""
    n, used = len(counts), -(-counts // 16)
    table = np.zeros(n, TABLE_ENTRY)
    table["last"], table["flags"], table["first"] = counts - 1, rng.integers(0, 4, n), np.cumsum(used) - used
    raw = rng.integers(0, 256, (n, form.header.itemsize), np.uint8)
    headers = raw.view(form.header)[:, 0]
    for name in headers.dtype.names or ():
        if headers.dtype[name].base.kind == "f":
            shape = headers[name].shape
            exponent = np.where(rng.random(shape) < 0.5, rng.integers(100, 140, shape), rng.integers(0, 255, shape))
            exponent[rng.random(shape) < 0.1] = 0
            bits = rng.integers(0, 2, shape) << 31 | exponent << 23 | rng.integers(0, 1 << 23, shape)
            headers[name] = bits.astype(np.uint32).view(np.float32)
    if form is PackedFormat.CHUNK:
        headers["sh_zero"] = rng.integers(255, 257, n)
    kind, words = form.geometry
    size = int(used.sum()) * 16 * words * kind.itemsize
    geometry = rng.integers(0, 256, size, np.uint8).view(kind).reshape(-1, words)
    return PackedScene(form, table, headers, geometry, np.zeros(BEAT, np.uint8))


def registers(packed: PackedScene, setup: FrameSetup, headers: int = HEADERS, geometry: int = GEOMETRY) -> int:
    chunked = packed.format is PackedFormat.CHUNK
    return packed_bits(*codes(setup.position, CLUSTER_M), (headers // BEAT, 34), (geometry // BEAT, 34), (chunked, 1))


def items(packed: PackedScene, kept: np.ndarray, index: int = 0, first: int = 0) -> list[int]:
    """The stream of kept clusters, with its end, whose cluster means nothing; index, first: of the scene's first cluster."""
    t = packed.table[kept]
    rows = zip(t["flags"].tolist(), t["last"].tolist(), (t["first"].astype(np.int64) + first).tolist(), (kept + index).tolist())
    return [*(packed_bits((flags & 3, 2), (last, 8), (first, 20), (index, 24)) for flags, last, first, index in rows), (1 << 55) - 1]


def contents(packed: PackedScene, headers: int = HEADERS, geometry: int = GEOMETRY) -> dict[int, bytes]:
    parts = packed.sections()
    return {headers: parts["headers"], geometry: parts["geometry"]}


def fields(outcome: Outcome) -> dict[str, np.ndarray]:
    """int64 (items, fields) by name."""
    out, at = {}, 0
    for name, count, bits in LAYOUT:
        out[name] = np.stack([outcome.field(at + bits * k, bits) for k in range(count)], axis=1)
        at += bits * count
    return out


def expected(packed: PackedScene, setup: FrameSetup, kept: np.ndarray) -> dict[str, np.ndarray]:
    chunked = packed.format is PackedFormat.CHUNK
    v, h, t = cluster_values(packed, setup), packed.headers, packed.table
    groups = -(-packed.counts[kept] // 4)
    c = np.repeat(kept, groups)  # cluster of each group
    group = np.arange(len(c)) - np.repeat(np.cumsum(groups) - groups, groups)
    left = packed.counts[c] - 4 * group
    slot = packed.first[c, None] + 4 * group[:, None] + np.arange(4)
    words = 3 if chunked else 5
    word = np.zeros((len(c), 4, 5), np.int64)
    word[:, :, :words] = np.ascontiguousarray(packed.geometry).view("<u4").reshape(-1, words)[slot]
    word[np.arange(4) >= left[:, None]] = -1  # anything
    fixed = lambda a, bits=27: a & (1 << bits) - 1  # noqa: E731
    column = lambda a: np.asarray(a, np.int64)[:, None]  # noqa: E731
    return {
        "word": word.reshape(len(c), 20), "used": column((1 << np.minimum(left, 4)) - 1), "group": column(group),
        "last": column(left <= 4), "first": column(group == 0), "end": np.zeros((len(c), 1), np.int64),
        "sh_step": codes_of(v.sh_step, C).reshape(-1, 9)[c], "dc_step": codes_of(v.dc_step, C)[c], "dc_low": fixed(v.dc_low, TERM_BITS)[c],
        "scale_step": fixed(v.scale_step, SCALE_STEP_BITS)[c], "scale_low": fixed(v.scale_low)[c],
        "step": codes_of(v.step, P)[c], "low": codes_of(v.low, P)[c],
        "sh_zero": column(h["sh_zero"][c] if chunked else np.zeros(len(c))), "colour": column(h["colour"][c]),
        "degree": column(t["flags"][c] & 3), "count": column(t["last"][c]), "slots": column(t["first"][c]), "index": column(c), "cluster": column(c),
    }


def check(outcome: Outcome, packed: PackedScene, setup: FrameSetup, kept: np.ndarray, whole: bool = True, error: int = 1) -> None:
    """whole: False for a frame in which the memory failed, or with another error (2: damaged)."""
    assert outcome.done and outcome.status[0] == (0 if whole else error)
    got, want = fields(outcome), expected(packed, setup, kept)
    assert got["end"][:, 0].tolist() == [0] * (len(outcome.when) - 1) + [1]
    assert not got["cluster"][-1]
    n = len(outcome.when) - 1
    assert n <= len(want["group"]) if not whole else n == len(want["group"])
    for name, values in want.items():
        bad = np.argwhere((got[name][:n] != values[:n]) & (values[:n] >= 0))
        assert not len(bad), f"{name}: {len(bad)} of {values.size} differ, first {bad[0]}: {got[name][tuple(bad[0])]:x} instead of {values[tuple(bad[0])]:x}"
    if whole:
        bits = 3 if packed.format is PackedFormat.CHUNK else 5
        beats = -(-packed.counts[kept] * bits // 16)
        assert outcome.status[1:3] == [len(kept) * packed.format.header.itemsize // BEAT, int(beats.sum())]


def clusters(form: PackedFormat, *places: int) -> None:
    """Clusters of every size and random headers, frames one after the other under all pauses."""
    rng = np.random.default_rng([seed(), 41])
    setup = some_setup()
    sizes = [np.arange(1, 257), np.ones(1, np.int64), np.ones(50, np.int64), rng.integers(1, 40, 100), rng.choice([1, 16, 17, 255, 256], 20)]
    unit = bench(*places)
    for turn, counts in enumerate(sizes):
        packed = wild(rng, form, counts)
        base = HEADERS + BEAT * int(rng.integers(64)), GEOMETRY + BEAT * int(rng.integers(64))
        unit.open(contents(packed, *base), latency=int(rng.choice([1, 20, 100])), **(PORT if turn % 2 else {}))
        kept = [np.arange(len(counts)), np.flatnonzero(rng.random(len(counts)) < 0.5), np.zeros(0, np.int64)]
        for idle, stall in zip(PAUSES, rng.permutation(list(PAUSES))):
            chosen = kept[int(rng.choice([0, 1, 1, 2]))]
            check(unit.frame(registers(packed, setup, *base), items(packed, chosen), idle, stall), packed, setup, chosen)
        assert unit.waits == 0


@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_clusters(form: PackedFormat) -> None:
    clusters(form)


def test_formats_in_turn() -> None:
    """A frame of each format, one after the other."""
    rng = np.random.default_rng([seed(), 42])
    setup = some_setup()
    scenes = [(wild(rng, form, rng.integers(1, 30, 20)), i << 32) for i, form in enumerate([PackedFormat.CHUNK, PackedFormat.FP16])]
    unit = bench()
    unit.open({a + base: data for packed, base in scenes for a, data in contents(packed).items()}, latency=9)
    for packed, base in scenes * 2:
        kept = np.arange(20)
        check(unit.frame(registers(packed, setup, HEADERS + base, GEOMETRY + base), items(packed, kept)), packed, setup, kept)


@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_errors(form: PackedFormat) -> None:
    """An answer with an error at any beat that is read: the frame ends, what came before it is right, and the next frame is whole."""
    rng = np.random.default_rng([seed(), 43])
    setup = some_setup()
    packed = wild(rng, form, rng.integers(1, 60, 14))
    kept = np.delete(np.arange(14), [3, 8])
    parts = contents(packed)
    other = {a + (1 << 32): data for a, data in parts.items()}
    unit = bench()
    bits = 3 if form is PackedFormat.CHUNK else 5
    per = packed.format.header.itemsize
    read = [HEADERS + per * c + BEAT * k for c in kept for k in range(per // BEAT)]
    read += [GEOMETRY + BEAT * (packed.first[c] // 16 * bits + k) for c in kept for k in range(-(-packed.counts[c] * bits // 16))]
    for turn, address in enumerate(read):
        unit.open(parts | other, latency=1 + 20 * (turn % 4), **PORT)
        unit.fail(int(address))
        idle, stall = rng.choice(list(PAUSES), 2)
        check(unit.frame(registers(packed, setup), items(packed, kept), idle, stall), packed, setup, kept, whole=False)
        check(unit.frame(registers(packed, setup, *other), items(packed, kept), idle, stall), packed, setup, kept)


@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_damaged_headers(form: PackedFormat) -> None:
    """A float that is infinite or none, in any header: the frame ends, what came before it is right, and the next frame is whole."""
    rng = np.random.default_rng([seed(), 45])
    setup = some_setup()
    packed = wild(rng, form, rng.integers(1, 60, 14))
    kept = np.arange(14)
    parts = contents(packed)
    other = {a + (1 << 32): data for a, data in parts.items()}
    size = packed.format.header.itemsize
    unit = bench()
    for name in packed.format.header.names:
        part, offset = packed.format.header.fields[name][:2]
        if part.base != np.dtype("<f4"):
            continue
        for word in range(part.itemsize // 4):
            cluster, value = int(rng.integers(14)), rng.choice([0x7F800000, 0xFF800000, 0x7FC00001, 0xFFFFFFFF])
            data = bytearray(parts[HEADERS])
            at = cluster * size + offset + 4 * word
            data[at : at + 4] = int(value).to_bytes(4, "little")
            unit.open(parts | {HEADERS: bytes(data)} | other, latency=1 + 20 * (word % 4), **PORT)
            idle, stall = rng.choice(list(PAUSES), 2)
            outcome = unit.frame(registers(packed, setup), items(packed, kept), idle, stall)
            check(outcome, packed, setup, kept, whole=False, error=2)
            groups = -(-packed.counts[:cluster] // 4)
            assert len(outcome.when) - 1 <= groups.sum(), f"a group of the damaged cluster ({name}, {word})"
            check(unit.frame(registers(packed, setup, *other), items(packed, kept), idle, stall), packed, setup, kept)


def test_reset_in_a_frame() -> None:
    rng = np.random.default_rng([seed(), 44])
    setup = some_setup()
    packed = wild(rng, PackedFormat.CHUNK, rng.integers(150, 257, 10))
    kept = np.arange(10)
    unit = bench()
    for cycle in (1, 4, 40, 45, 200, 300):
        unit.open(contents(packed), latency=30)
        assert not unit.frame(registers(packed, setup), items(packed, kept), reset_at=cycle).done
        check(unit.frame(registers(packed, setup), items(packed, kept)), packed, setup, kept)


def rate(form: PackedFormat, size: int, latency: int) -> float:
    """Cycles from group to group over clusters of a size."""
    rng = np.random.default_rng([seed(), 45])
    setup = some_setup()
    packed = wild(rng, form, np.full(max(2560 // size, 20), size))
    kept = np.arange(len(packed.table))
    unit = bench()
    unit.open(contents(packed), latency=latency)
    outcome = unit.frame(registers(packed, setup), items(packed, kept))
    check(outcome, packed, setup, kept)
    skip = len(outcome.when) // 4
    return float(outcome.when[-2] - outcome.when[skip]) / (len(outcome.when) - 2 - skip)


@pytest.mark.parametrize(("form", "latency", "limits"), [
    (PackedFormat.CHUNK, 10, (1.01, 1.1, 1.4, 5.1)), (PackedFormat.CHUNK, 100, (1.1, 1.2, 4.0, 15.0)), (PackedFormat.CHUNK, 200, (1.8, 1.8, 7.0, 28.0)),
    (PackedFormat.FP16_LOCAL, 10, (1.3, 1.4, 1.6, 5.1)), (PackedFormat.FP16_LOCAL, 100, (1.6, 1.6, 4.0, 15.0)),
    (PackedFormat.FP16_LOCAL, 200, (2.8, 2.9, 7.0, 28.0)),
])
def test_rate(form: PackedFormat, latency: int, limits: tuple[float, ...]) -> None:
    """More than a group in two cycles over whole clusters, but for FP16 from far away."""
    rates = {size: rate(form, size, latency) for size in (256, 64, 16, 1)}
    print(f"{form.value}, latency {latency}: cycles a group " + ", ".join(f"{r:.2f} (clusters of {s})" for s, r in rates.items()))
    assert all(r <= limit for r, limit in zip(rates.values(), limits))


@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_demo(form: PackedFormat) -> None:
    packed, setup, kept = demo(form)
    assert 0 < len(kept) < len(packed.table)
    unit = bench()
    for perfect in (True, False):
        unit.open(contents(packed), perfect, **PORT)
        check(unit.frame(registers(packed, setup), items(packed, kept), idle="rare", stall="half"), packed, setup, kept)
        assert unit.waits == 0


@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_the_last_places(form: PackedFormat) -> None:
    """Clusters with the highest numbers that there are, whose slots are the last ones."""
    rng, setup = np.random.default_rng([seed(), 47]), some_setup()
    packed = wild(rng, form, rng.choice([1, 16, 17, 255, 256], 12))
    words = 3 if form is PackedFormat.CHUNK else 5
    index, first = (1 << 24) - 12, (1 << 20) - len(packed.geometry) // 16
    base = 0x80_0000_0FC0, 0x90_4567_8040
    places = base[0] + index * form.header.itemsize, base[1] + first * 16 * words * 4
    unit, kept = bench(), np.arange(12)
    unit.open(contents(packed, *places), latency=20)
    outcome = unit.frame(registers(packed, setup, *base), items(packed, kept, index, first))
    got, want = fields(outcome), expected(packed, setup, kept)
    assert outcome.done and outcome.status[0] == 0 and len(got["group"]) == len(want["group"]) + 1
    for name, values in want.items():
        ahead = {"index": index, "cluster": index, "slots": first}.get(name, 0)
        assert ((got[name][:-1] == values + ahead) | (values < 0)).all(), name
    assert got["index"][-2, 0] == (1 << 24) - 1


@pytest.mark.slow
@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16_LOCAL])
def test_small_buffers(form: PackedFormat) -> None:
    clusters(form, 8, 2)
