"""The verilated front end: a packed scene in memory, a frame, and what it leaves there (docs/reference/front_end.md).

    frame = front_rtl(packed, camera)
    frame.records, frame.pointers ...      # to be compared with golden.front.memory.front_memory
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ..arithmetic.ff import ff_bits
from ..chip_counters import FRONT
from ..errors import FlickerError
from ..golden.front.frame import OUTCOMES, FrontFrame, ListKind, Outcome
from ..golden.front.memory import SLOTS_PER_STEP
from ..golden.front.record import RecordKind
from ..golden.front.reuse import CLUSTER_BEATS, limit_of
from ..golden.front.setup import CLUSTER_M, MIDDLE_INTEGER, FrameSetup
from ..golden.lists import CHUNK_LINES, LINE_BYTES, WRITERS, list_chunks, pointer_lines, read_lists, writer_columns
from ..golden.long_lists import region_bytes
from ..params import PREPROC_INTERVALS, TILE, UNIT_COUNTS, SortOrder
from ..scene.camera import Camera
from ..scene.packed import HEADER_BYTES, PackedFormat, PackedScene
from . import half
from .half import BEAT, PAGE, Fields, Half, MemoryOptions
from .memory import PortConfig, PurposeCounts

PORTS = ("table", "geometry", "colour", "pointer", "write")
PURPOSES = ("table", "headers", "geometry", "colour", "records", "lists", "pointers", "store")
ERRORS = ("a read failed", "a write failed", "a cluster's records lie beyond their region", "out of list memory",
          "the cluster table is damaged", "a cluster's header is damaged")
LIST_ERROR = 3  # bit of the last


@dataclass(frozen=True)
class Regions:
    """Where things lie: bytes. image: of the file's bytes; records, lists, pointers: and how many there are."""

    image: int
    records: int
    record_bytes: int
    lists: int
    chunks: int
    pointers: int
    pointer_bytes: int

    @property
    def store(self) -> int:
        """Of kept colours: far up, and such that clusters 7 and 8 differ in more than the lower half of a slot's number."""
        return (0x5A << 32 | 1 << 25) - 8 * CLUSTER_BEATS * BEAT

    @staticmethod
    def of(packed: PackedScene, camera: Camera, chunks: int, kind: RecordKind = RecordKind.FACTORED16) -> Regions:
        step = lambda n: -(-n // PAGE) * PAGE  # noqa: E731
        cols, rows = (-(-n // TILE) for n in (camera.width, camera.height))
        image = 1 << 28
        records = image + step(len(packed.image()))
        slots = -(-(int(packed.first[-1]) + int(packed.counts[-1])) // SLOTS_PER_STEP) * SLOTS_PER_STEP
        lists = records + step(slots * kind.bytes)
        pointers = lists + step(max(chunks, 1) * WRITERS * CHUNK_LINES * LINE_BYTES + region_bytes())
        return Regions(image, records, slots * kind.bytes, lists, chunks, pointers, pointer_lines(cols, rows) * LINE_BYTES)


def registers(
    packed: PackedScene, camera: Camera, lists: ListKind, regions: Regions, chunks: int, order: SortOrder = SortOrder.DEPTH, store: StoreSetup | None = None,
) -> Fields:
    """The fields of front_registers_t. store: None: no colours are kept."""
    setup = FrameSetup.of(camera)
    f = setup.formats
    cols, rows = (-(-n // TILE) for n in (camera.width, camera.height))
    bits: list[tuple[int, int]] = []  # value, width; the highest first

    def numbers(values: np.ndarray, M: int) -> None:
        """A packed array: its last element highest."""
        bits.extend((int(ff_bits(float(v), M)), 9 + M) for v in np.asarray(values).ravel()[::-1])

    for values in (setup.position, setup.normal, setup.offset, setup.reach):
        numbers(values, CLUSTER_M)
    bits += [
        (packed.format is PackedFormat.CHUNK, 1), (lists is ListKind.BOX, 1), (packed.antialiased, 1), (order is SortOrder.DISTANCE, 1),
        (camera.width, 13), (camera.height, 13),
    ]
    numbers(setup.view, f.position)
    numbers(setup.focal, f.position)
    for values in (setup.row_x, setup.row_x_z, setup.row_y, setup.row_y_z, setup.least, setup.limit):
        numbers(values, f.shape)
    middle_bits = MIDDLE_INTEGER + f.mean
    bits += [(int(v) & (1 << middle_bits) - 1, middle_bits) for v in setup.middle[::-1]]
    if store is None:
        bits += [(0, 1), (0, 29), (0, 32), (0, 32)]
    else:
        bits += [(1, 1), (store.address // (BEAT * CLUSTER_BEATS), 29), (store.generation, 32)]
        numbers(np.array([limit_of(store.epsilon)]), CLUSTER_M)
    offset = regions.image // BEAT + HEADER_BYTES // BEAT
    for part in packed.sections().values():
        bits.append((offset, 34))
        offset += len(part) // BEAT
    bits += [
        (len(packed.table), 24), (regions.records // BEAT, 34), (regions.record_bytes // BEAT, 23), (regions.lists // BEAT, 34), (chunks, 25),
        (regions.pointers // BEAT, 34), (pointer_lines(cols, rows) // WRITERS, 11), (writer_columns(cols), 8),
    ]
    return bits


@dataclass(frozen=True)
class StoreSetup:
    """Of a frame that keeps colours (`golden.front.reuse`). address: of the store, bytes, a multiple of 2048."""

    address: int
    epsilon: float
    generation: int = 1


@dataclass(eq=False)
class RtlFront:
    """What a frame left. records: uint8 (slots, bytes of a record). memory, pointers: as in golden.lists.ListImage. Bytes that the frame did not write hold
    noise, that of `before`: records and memory as they were.

    counters: by name; of the list writers int64 (4,), `taken` of the banks. traffic: by purpose. efficiency: share of the memory's peak rate. waits: of those
    with a stall, as the harness counts them, those that it can. store: uint8, the colour store's bytes.
    """

    records: np.ndarray
    memory: np.ndarray
    pointers: np.ndarray
    counters: dict[str, int | np.ndarray]
    errors: list[int]  # of each frame
    traffic: dict[str, PurposeCounts]
    efficiency: float
    before: tuple[np.ndarray, np.ndarray]
    waits: dict[str, int]
    store: np.ndarray | None = None

    @property
    def error(self) -> int:
        return self.errors[-1]

    @property
    def cycles(self) -> int:
        return int(self.counters["cycles"])


def build(
    kind: RecordKind = RecordKind.FACTORED16, lanes: int = UNIT_COUNTS[-1], writers: int = UNIT_COUNTS[-1], interval: int = PREPROC_INTERVALS[0],
) -> Path:
    """Shared library of the simulator, with the design's assertions; cached by content.

    Operators are inlined into their pipelines: calls of them, one for each instance, took almost half of the time.
    """
    settings = [half.HERE / f"{name}.vlt" for name in ("preprocessing", "preprocessing_watched")]
    return half.build(
        "flk_preprocessing", {"Form": int(kind.form), "PreprocLanes": lanes, "ListWriters": writers, "PreprocInterval": interval}, settings,
        ["--inline-mult", "20000"],
        define=f"-DFLK_PREPROC_LANES={lanes} -DFLK_LIST_WRITERS={writers}",
    )


PORT = PortConfig(max_reads=64, max_writes=64, latency=20, hazards=False)


def front_rtl(
    packed: PackedScene,
    camera: Camera,
    lists: ListKind = ListKind.ELLIPSE,
    *,
    kind: RecordKind = RecordKind.FACTORED16,
    chunks: int,
    memory: MemoryOptions | None = None,
    regions: Regions | None = None,
    image: bytes | None = None,
    frames: int = 1,
    seed: int = 1,
    limit: int = 20_000_000,
    order: SortOrder = SortOrder.DEPTH,
    lanes: int = UNIT_COUNTS[-1],
    writers: int = UNIT_COUNTS[-1],
    interval: int = PREPROC_INTERVALS[0],
) -> RtlFront:
    """Run frames of a packed scene through the RTL.

    kind: of the records, which the RTL is built for. chunks: that each list writer may take. image: instead of the scene's own bytes. frames: the same one so
    many times; what the last leaves counts. order: of the keys. lanes, writers, interval: of the RTL, preprocessing lanes, list
    writers, and cycles from a Gaussian of a lane to the next.
    Raises FlickerError where a frame does not end within `limit` cycles, an assertion fails, a rule of AXI is broken or the scene is no longer what it was.
    """
    run = _Run(packed, kind, lists, chunks, order, frames, limit)
    regions = regions or Regions.of(packed, camera, chunks, kind)
    with Half("front end", build(kind, lanes, writers, interval), dict.fromkeys(PORTS, PORT), memory or MemoryOptions(), seed) as sim:
        scene = _load(sim, packed, regions, image)
        return run.frame(sim, camera, regions, scene)


def front_path(
    packed: PackedScene, cameras: Sequence[Camera], epsilon: float, *, chunks: int, memory: MemoryOptions | None = None, seed: int = 1,
    limit: int = 20_000_000, lanes: int = UNIT_COUNTS[-1], writers: int = UNIT_COUNTS[-1], generations: Sequence[int] | None = None,
    store: bytes | None = None, mended: int = 1,
) -> Iterator[RtlFront]:
    """Frames of a path one after the other, with a colour store that holds `store` [zeros] at first. generations: of each frame [1]. With memory.mended
    ranges fail in frames before number `mended`. Raises as `front_rtl`."""
    run = _Run(packed, RecordKind.FACTORED16, ListKind.ELLIPSE, chunks, SortOrder.DEPTH, 1, limit)
    regions = Regions.of(packed, cameras[0], chunks)
    size = len(packed.table) * CLUSTER_BEATS * BEAT
    memory = memory or MemoryOptions()
    options = replace(memory, mended=False)
    with Half("front end", build(lanes=lanes, writers=writers), dict.fromkeys(PORTS, PORT), options, seed) as sim:
        scene = _load(sim, packed, regions, None)
        sim.load(regions.store, size, store or bytes(size), PURPOSES.index("store"))
        for number, camera in enumerate(cameras):
            if number == mended and memory.mended:
                sim.mend()
            setup = StoreSetup(regions.store, epsilon, generations[number] if generations else 1)
            found = run.frame(sim, camera, regions, scene, setup)
            found.store = sim.read(regions.store, size).copy()
            yield found


def _load(sim: Half, packed: PackedScene, regions: Regions, image: bytes | None) -> list[tuple[int, bytes]]:
    """The scene and where a frame writes; address and bytes of each part of the scene."""
    data = image or packed.image()
    at = regions.image
    sizes = [HEADER_BYTES, *map(len, packed.sections().values())]
    purposes = [len(PURPOSES), 0, 1, 2, 3]  # the image header has none
    scene = []
    for size, purpose in zip(sizes, purposes):
        offset = at - regions.image
        scene.append((at, data[offset : offset + size]))
        sim.load(at, size, scene[-1][1], purpose)
        at += size
    for base, size, purpose in (
        (regions.records, regions.record_bytes, 4), (regions.lists, max(regions.chunks, 1) * WRITERS * CHUNK_LINES * LINE_BYTES, 5),
        (regions.pointers, regions.pointer_bytes, 6),
    ):
        sim.load(base, size, b"", purpose)
    return scene


@dataclass(frozen=True)
class _Run:
    """What frames have in common."""

    packed: PackedScene
    kind: RecordKind
    lists: ListKind
    chunks: int
    order: SortOrder
    frames: int
    limit: int

    def frame(self, sim: Half, camera: Camera, regions: Regions, scene: list[tuple[int, bytes]], store: StoreSetup | None = None) -> RtlFront:
        before = _records(sim, regions, self.kind), _lines(sim, regions)
        fields = registers(self.packed, camera, self.lists, regions, self.chunks, self.order, store)
        counters, errors = sim.run(fields, FRONT, self.frames, self.limit)
        if any(sim.read(base, len(part)).tobytes() != part for base, part in scene):
            raise FlickerError(f"front end: it has written over the scene (seed {sim.seed})")
        return RtlFront(
            _records(sim, regions, self.kind), _lines(sim, regions), sim.read(regions.pointers, regions.pointer_bytes).view(np.uint32), counters, errors,
            sim.traffic(PURPOSES), sim.efficiency, before,
            sim.waits(FRONT),
        )


def front_frame(
    packed: PackedScene, camera: Camera, lists: ListKind = ListKind.ELLIPSE, kind: RecordKind = RecordKind.FACTORED16, order: SortOrder = SortOrder.DEPTH,
    *, lanes: int = UNIT_COUNTS[-1], writers: int = UNIT_COUNTS[-1], interval: int = PREPROC_INTERVALS[0],
) -> tuple[FrontFrame, RtlFront]:
    """A frame of the RTL as the rendering stage takes one, read back from memory; list memory grows until it suffices. lanes, writers, interval: as of
    `front_rtl`."""
    run = partial(front_rtl, kind=kind, order=order, lanes=lanes, writers=writers, interval=interval)
    cols, rows = (-(-n // TILE) for n in (camera.width, camera.height))
    chunks = list_chunks(camera.width, camera.height, 2 * len(packed))
    while (rtl := run(packed, camera, lists, chunks=chunks)).error >> LIST_ERROR & 1:
        chunks *= 4
    if rtl.error:
        raise FlickerError("front end: " + ", ".join(text for k, text in enumerate(ERRORS) if rtl.error >> k & 1))
    read = read_lists(rtl.memory, rtl.pointers, cols, rows)
    number, splat = np.unique(read.record, return_inverse=True)
    key = np.zeros(len(number), np.uint32)
    key[splat] = read.key
    count = rtl.counters
    outcomes = {
        Outcome.CULLED: count["culled_gaussians"], Outcome.NEAR: count["too_near"], Outcome.OUTSIDE: count["outside"], Outcome.FAINT: count["faint"],
        Outcome.MISSED: count["unlisted"] - count["faint"], Outcome.LISTED: count["survivors"] - count["unlisted"],
    }
    adjusted = {"mean beyond 2^22 pixels": count["saturated"], "colour above 2 clipped": count["clipped"]}
    frame = FrontFrame(
        camera, packed, kind, len(packed.table) - int(count["culled_clusters"]),
        np.full(len(number), -1, np.int64),  # a record does not say whose it is
        number.astype(np.int64),
        rtl.records[number], key, splat.astype(np.int32), np.repeat(np.arange(cols * rows, dtype=np.int32), np.diff(read.start)), read.mask,
        {OUTCOMES[k]: int(v) for k, v in outcomes.items()}, {k: int(v) for k, v in adjusted.items() if v},
    )
    return frame, rtl


def _records(sim: Half, regions: Regions, kind: RecordKind) -> np.ndarray:
    return sim.read(regions.records, regions.record_bytes).reshape(-1, kind.bytes)


def _lines(sim: Half, regions: Regions) -> np.ndarray:
    return sim.read(regions.lists, regions.chunks * WRITERS * CHUNK_LINES * LINE_BYTES).view(np.uint64).reshape(-1, 8)
