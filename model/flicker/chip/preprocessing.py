"""Preprocessing as the RTL does it (`flk_preprocessing`): what it moves, to the byte, and an estimate of its cycles.

Traffic follows from the golden front end alone. The units are simulated cycle by cycle from a group of Gaussians at the front to an entry at a list writer
(`unit_cycles`; a survivor's colours come an access of the memory later), the DRAM with all streams in the order in which they come (`simulate`). One waits
for the other by phases: between the points at which one more queue of survivors (`WAITING` a lane) has left the front, a frame takes the longer of both
(`phases`). docs/results/front_end.md has the estimate beside the RTL.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from ..golden.front.cull import cull
from ..golden.front.frame import FrontFrame
from ..golden.front.memory import FrontImage
from ..golden.front.reuse import CLUSTER_BEATS, ROW, Reused
from ..golden.front.setup import FrameSetup
from ..golden.lists import COMBINER_SETS, COMBINER_WAYS, ENTRY_BITS, POINTERS_PER_LINE, WRITERS, pointer_lines
from ..params import CHIP_MEMORIES, PREPROC_INTERVALS, TILE, UNIT_COUNTS, ChipMemories
from ..scene.packed import BEAT, HEADER_BYTES
from ..sim.preprocessing import Regions
from . import constants as c
from .dram import READ, WRITE, DramConfig, Stream, behind_port, simulate

# Of the RTL, times in cycles.
LANES, LIST_WRITERS = UNIT_COUNTS[-1], UNIT_COUNTS[-1]
INTERVAL = PREPROC_INTERVALS[0]  # a Gaussian of each lane enters the front
CLUSTER_CYCLES = 16  # of the cluster test
LATENCY = {2: 110, 4: 142}  # from a group to its entries, colours at hand, by that interval,
BAND_CYCLES = {2: 1, 4: 2}  # and of a band
LANE_CYCLES = (2, 2, 2, 4)  # a survivor in its lane, by SH degree, at least
SIZES = CHIP_MEMORIES["default"]
WAITING = SIZES.survivors  # of a lane between front and entries
MERGE_DEPTH = 32  # entries of a lane that wait for a list writer
GATHER = SIZES.gathered_lines  # lines that are written together
# A chip with a narrow port: lines of colours under way, which wait for survivors or survivors for them, of geometry then; lines that are read while all
# that are gathered leave, fitted to frames of the RTL behind 128 and 256 bits.
UNDER_WAY = 112
AHEAD = 32


@dataclass(frozen=True, eq=False)
class Beats:
    """What one purpose moves, in order; pointers have two, written and read. beat: int64 (B,), address / 64. due: float64 (B,), Gaussians that entered the
    front when it moves. write: else read."""

    name: str
    beat: np.ndarray
    due: np.ndarray
    write: bool

    @property
    def bytes(self) -> int:
        return len(self.beat) * BEAT


def bytes_of(beats: Sequence[Beats]) -> dict[str, int]:
    """By purpose."""
    out: dict[str, int] = {}
    for b in beats:
        out[b.name] = out.get(b.name, 0) + b.bytes
    return out


def _ranges(first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """first[0], first[0] + 1, ... `count[0]` of them, then those of first[1]."""
    return np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())


def traffic(frame: FrontFrame, image: FrontImage, lanes: int = LANES) -> list[Beats]:
    """All beats of a frame, by purpose, at the addresses of `Regions.of`. image: of `front_memory`. lanes: neighbours whose colours are asked for together."""
    packed, camera = frame.packed, frame.camera
    regions = Regions.of(packed, camera, image.lists.chunks, frame.kind)
    base, at = {}, (regions.image + HEADER_BYTES) // BEAT
    for name, part in packed.sections().items():
        base[name] = at
        at += len(part) // BEAT
    keep = np.flatnonzero(cull(packed, FrameSetup.of(camera)))
    size = packed.counts[keep]
    before = np.concatenate([[0], np.cumsum(size)])  # Gaussians of kept clusters, by cluster
    table = np.arange(-(-len(packed.table) * packed.table.itemsize // BEAT))
    entry = table * BEAT // packed.table.itemsize  # first cluster of a beat
    due_table = before[np.searchsorted(keep, np.minimum(entry, len(packed.table) - 1))]
    header = packed.headers.itemsize // BEAT
    kind, words = packed.format.geometry
    each = kind.itemsize * words
    geometry = -(-size * each // BEAT)
    first = base["geometry"] + packed.first[keep] * each // BEAT
    geometry_beats = _ranges(first, geometry)
    per_beat = BEAT / each
    inside = geometry_beats - np.repeat(first, geometry)
    out = [
        Beats("table", base["table"] + table, due_table.astype(np.float64), False),
        Beats("headers", base["headers"] + _ranges(keep * header, np.full(len(keep), header)), np.repeat(before[:-1], header).astype(np.float64), False),
        Beats("geometry", geometry_beats, np.repeat(before[:-1], geometry) + inside * per_beat, False),
    ]
    # Gaussians by their place among those of kept clusters.
    cluster = packed.cluster[frame.gaussian]
    slot = np.searchsorted(keep, cluster)
    within = frame.gaussian - packed.start[cluster]
    place = before[slot] + within
    computed = np.ones(len(place), np.bool_) if frame.reused is None else ~frame.reused.stored
    beat, due = _colour_beats(
        cluster[computed], within[computed], place[computed], packed.headers["colour"].astype(np.int64), packed.colour_strides, lanes,
    )
    out.append(Beats("colour", base["colour"] + beat, due, False))
    if frame.reused is not None:
        out += _store_beats(frame.reused, regions.store // BEAT, keep, before)
    record = np.unique(regions.records + frame.number * frame.kind.bytes) // BEAT
    last = np.concatenate([record[1:] != record[:-1], [True]]) if len(record) else np.zeros(0, np.bool_)
    out.append(Beats("records", record[last], place[last].astype(np.float64), True))
    entries = place[frame.entry_splat] if len(frame.entry_splat) else np.zeros(1)
    lists = image.lists
    lines, when = [], []
    # Of pointers: lines, when, written or not.
    moved: list[tuple[np.ndarray, np.ndarray, bool]] = []
    for b, (own, moves, closed) in enumerate(zip(lists.writes, lists.moves, lists.closed)):
        share = np.concatenate([np.arange(len(own)) + 0.5, moves[:, 0]]) / max(len(own), 1)
        due = entries[np.minimum(share * len(entries), len(entries) - 1).astype(np.int64)].astype(np.float64)
        lines.append(regions.lists // BEAT + own)
        when.append(due[: len(own)])
        for column, write in ((1, True), (2, False)):
            some = moves[:, column] >= 0
            moved.append((WRITERS * moves[some, column] + b, due[len(own) :][some], write))
        moved.append((WRITERS * closed + b, np.full(len(closed), np.inf), True))
    order = np.argsort(np.concatenate(when), kind="stable")
    out.append(Beats("lists", np.concatenate(lines)[order], np.concatenate(when)[order], True))
    for write in (True, False):
        pointers = np.concatenate([line for line, _, written in moved if written is write])
        due = np.concatenate([at for _, at, written in moved if written is write])
        order = np.lexsort((pointers, due))
        if write or len(pointers):
            out.append(Beats("pointers", regions.pointers // BEAT + pointers[order], due[order], write))
    return out


def _store_beats(reused: Reused, base: int, keep: np.ndarray, before: np.ndarray) -> list[Beats]:
    """Heads and rows of kept colours, read and written. base: beat of the store. keep: int64 (K,), clusters; before: Gaussians of those before each."""
    def moved(clusters: np.ndarray, rows: np.ndarray, last: bool) -> tuple[np.ndarray, np.ndarray]:
        """Beats and when: with the cluster's first Gaussian, with the row's, behind its last one. rows: 0 for the head."""
        slot = np.searchsorted(keep, clusters)
        due = before[slot + 1] if last else before[slot] + ROW * np.maximum(rows - 1, 0)
        return base + CLUSTER_BEATS * clusters + rows, due.astype(np.float64)

    def stream(write: bool, *parts: tuple[np.ndarray, np.ndarray]) -> Beats:
        beat, due = (np.concatenate(both) for both in zip(*parts))
        order = np.argsort(due, kind="stable")
        return Beats("store", beat[order], due[order], write)

    head = lambda clusters: np.zeros(len(clusters), np.int64)  # noqa: E731
    rows = lambda found: (found[:, 0], found[:, 1] + 1)  # noqa: E731
    return [
        stream(False, moved(reused.kept, head(reused.kept), False), moved(*rows(reused.rows_read), False)),
        stream(
            True, moved(reused.cleared, head(reused.cleared), False), moved(*rows(reused.rows_written), False),
            moved(reused.heads_written, head(reused.heads_written), True),
        ),
    ]


@numba.njit(cache=True)
def _colour_beats(cluster, within, place, colour, stride, lanes):
    """Beats with colours of survivors, each once, from the first survivor of `lanes` neighbours to the last; and when."""
    beat = np.empty(len(cluster) * 4 + 4, np.int64)
    due = np.empty(len(beat))
    n = 0
    last = np.int64(-1)
    i = 0
    while i < len(cluster):
        k = cluster[i]
        j = i
        while j + 1 < len(cluster) and cluster[j + 1] == k and within[j + 1] // lanes == within[i] // lanes:
            j += 1
        size = stride[k]
        low = colour[k] + within[i] * size // 64
        high = colour[k] + ((within[j] + 1) * size - 1) // 64
        for b in range(max(low, last + 1) if last >= colour[k] else low, high + 1):
            beat[n] = b
            due[n] = place[i]
            n += 1
        last = high
        i = j + 1
    return beat[:n], due[:n]


def _bursts(beat: np.ndarray, step: int) -> np.ndarray:
    return (beat[:, None] * step + np.arange(step)).ravel()


def in_order(beats: Sequence[Beats], config: DramConfig, gather: int = GATHER) -> Stream:
    """A frame's traffic as bursts in the order of time; writes come `gather` lines at a time."""
    reads = [b for b in beats if not b.write]
    writes = [b for b in beats if b.write]
    read, read_due = np.concatenate([b.beat for b in reads]), np.concatenate([b.due for b in reads])
    write, write_due = np.concatenate([b.beat for b in writes]), np.concatenate([b.due for b in writes])
    order = np.argsort(write_due, kind="stable")
    write, write_due = write[order], write_due[order]
    group = np.arange(len(write)) // gather
    write_due = write_due[np.minimum((group + 1) * gather, len(write)) - 1]  # with the last line of its group
    order = np.argsort(np.concatenate([read_due, write_due]), kind="stable")
    beat = np.concatenate([read, write])[order]
    kind = np.concatenate([np.full(len(read), READ, np.int8), np.full(len(write), WRITE, np.int8)])[order]
    step = BEAT // config.burst_bytes
    return Stream("front end", _bursts(beat, step), np.repeat(kind, step), len(beat) * BEAT)


@numba.njit(cache=True)
def _unit_cycles(enters, lane, busy, first, bank, bands, waiting, depth, latency, lanes, banks):
    """Cycles until the last entry is with its list writer; and when each survivor left the front.

    Survivors in the order of the scene: enters (cycle in which its group may leave the front; no two groups in one), lane, busy (cycles of the colour stage),
    first entry (S + 1,), bands. bank: list writer of each entry, one of `banks`. waiting, depth: places of a lane's queue, of a queue of the merge.
    """
    survivors = len(enters)
    went = np.zeros(survivors, np.int64)
    own = np.empty((lanes, survivors), np.int64)  # survivors of each lane
    count = np.zeros(lanes, np.int64)
    for s in range(survivors):
        own[lane[s], count[lane[s]]] = s
        count[lane[s]] += 1
    ready = np.zeros(survivors, np.int64)  # when a survivor may begin its entries
    queue = np.zeros((lanes, banks, depth), np.int64)
    head, size = np.zeros((lanes, banks), np.int64), np.zeros((lanes, banks), np.int64)
    begun, at, until, free = np.zeros(lanes, np.int64), np.zeros(lanes, np.int64), np.zeros(lanes, np.int64), np.zeros(lanes, np.int64)
    out = np.zeros(lanes, np.int64)  # survivors of each lane that left the front
    next_survivor = 0
    clock = np.int64(0)
    shift = np.int64(0)  # cycles that the front has stood
    left = np.int64(0)
    while left < len(bank) or next_survivor < survivors or begun.min() < 0:
        # Banks take the earliest entry that waits, when none before it can come.
        for b in range(banks):
            best, which = np.int64(1) << 60, -1
            for k in range(lanes):
                if size[k, b] > 0 and queue[k, b, head[k, b]] < best:
                    best, which = queue[k, b, head[k, b]], k
            if which < 0:
                continue
            for k in range(lanes):
                if size[k, b] == 0:
                    earliest = own[k, begun[k]] if begun[k] < out[k] else next_survivor
                    if earliest < best:
                        which = -1
                        break
            if which >= 0:
                head[which, b] = (head[which, b] + 1) % depth
                size[which, b] -= 1
                left += 1
        # Lanes hand over an entry a cycle; a splat takes a cycle a band at least.
        for k in range(lanes):
            if begun[k] >= out[k]:
                continue
            s = own[k, begun[k]]
            if at[k] == 0 and until[k] < ready[s]:
                until[k] = ready[s]
            if clock < ready[s]:
                continue
            e = first[s] + at[k]
            if e < first[s + 1]:
                b = bank[e]
                if size[k, b] == depth:
                    continue
                queue[k, b, (head[k, b] + size[k, b]) % depth] = s
                size[k, b] += 1
                at[k] += 1
            if first[s] + at[k] == first[s + 1] and clock >= until[k] + bands[s] - 1:
                begun[k] += 1
                at[k] = 0
                until[k] = clock + 1
        # The front: the survivors of a group leave together when all lanes have room.
        while next_survivor < survivors and enters[next_survivor] + shift <= clock:
            if (out - begun).max() >= waiting:
                shift += clock + 1 - (enters[next_survivor] + shift)
                break
            g = enters[next_survivor]
            while next_survivor < survivors and enters[next_survivor] == g:
                k = lane[next_survivor]
                free[k] = max(free[k], clock) + busy[next_survivor]
                ready[next_survivor] = free[k] + latency
                out[k] += 1
                went[next_survivor] = clock
                next_survivor += 1
        if left == len(bank) and next_survivor == survivors:
            break
        clock += 1
    return clock, went


@dataclass(frozen=True, eq=False)
class UnitCycles:
    """A frame if the memory were perfect. place: float64 (S,), Gaussians that entered the front with a survivor; went: int64 (S,), the cycle in which it left
    it. all: until the last entry."""

    place: np.ndarray
    went: np.ndarray
    all: int


def unit_cycles(
    frame: FrontFrame, waiting: int = WAITING, lanes: int = LANES, writers: int = LIST_WRITERS, interval: int = INTERVAL, access: int = 0,
) -> UnitCycles:
    """Cycles of a frame if the memory were perfect. waiting: survivors of a lane between front and entries. lanes, writers: how many there are. interval:
    cycles from a Gaussian of a lane to the next. access: of the memory, for which a survivor waits until its colours come."""
    packed = frame.packed
    keep = np.flatnonzero(cull(packed, FrameSetup.of(frame.camera)))
    groups = -(-packed.counts[keep] // lanes)  # Gaussians that enter together
    start = np.concatenate([[0], np.cumsum(groups)])
    cluster = packed.cluster[frame.gaussian]
    within = frame.gaussian - packed.start[cluster]
    slot = np.searchsorted(keep, cluster)
    # A cluster enters when it has been tested and those before it have.
    enters = interval * start[:-1] + np.maximum.accumulate(CLUSTER_CYCLES * (keep + 1) - interval * start[:-1])
    place = np.concatenate([[0], np.cumsum(packed.counts[keep])])[slot] + within
    degree = packed.degrees[cluster]
    lane = within % lanes
    cols = -(-frame.camera.width // TILE)
    first = np.concatenate([[0], np.cumsum(np.bincount(frame.entry_splat, minlength=len(frame.gaussian)))])
    x, y = frame.entry_tile % cols, frame.entry_tile // cols
    # Bands of 8 rows of pixels: the two halves of a row of tiles that some mask has.
    half = np.stack([(frame.entry_mask & 3) > 0, (frame.entry_mask & 12) > 0], axis=1)
    band = (frame.entry_splat.astype(np.int64)[:, None] << 20 | y[:, None].astype(np.int64) << 1 | np.arange(2))[half]
    bands = np.maximum(np.bincount(np.unique(band) >> 20, minlength=len(frame.gaussian)), 1)
    bank = ((x & 1 | (y & 1) << 1) % writers).astype(np.int64)
    front, went = _unit_cycles(
        enters[slot] + interval * (within // lanes), lane, np.maximum(LANE_CYCLES, interval)[degree], first, bank, BAND_CYCLES[interval] * bands, waiting,
        MERGE_DEPTH, LATENCY[interval] + access, lanes, writers,
    )
    fed = enters[-1] + interval * groups[-1] if len(keep) else 0
    # At the end a writer closes its banks one after the other; those of the first are within what the estimate leaves out.
    closed = COMBINER_SETS * COMBINER_WAYS + POINTERS_PER_LINE * pointer_lines(cols, -(-frame.camera.height // TILE)) // WRITERS
    more = (WRITERS // writers - 1) * closed
    return UnitCycles(place.astype(np.float64), went, int(max(front, fed, CLUSTER_CYCLES * len(packed.table))) + more)


def phases(units: UnitCycles, beats: Sequence[Beats], dram: int, waiting: int = WAITING, lanes: int = LANES) -> int:
    """Cycles of a frame whose traffic takes the DRAM `dram` cycles, beats at an even rate."""
    step = waiting * lanes
    bounds = np.arange(step, len(units.went), step)  # the first survivor of each phase but the first
    unit = np.diff(np.concatenate([[0], units.went[bounds], [units.all]]))
    due = np.concatenate([b.due for b in beats])
    phase = np.searchsorted(units.place[bounds], due, side="right") if len(bounds) else np.zeros(len(due), np.int64)
    each = dram / max(len(due), 1)
    return round(np.maximum(unit, each * np.bincount(phase, minlength=len(unit))).sum())


@dataclass(frozen=True, eq=False)
class Preprocessing:
    """A frame's preprocessing. beats: by purpose. used: bytes of each purpose that are needed, the rest is padding. units, dram: cycles of each
    alone, the DRAM behind its port; cycles: of both together. gather: lines that are written together."""

    beats: Sequence[Beats]
    used: dict[str, int]
    units: int
    dram: int
    cycles: int
    gather: int = GATHER

    @property
    def bytes(self) -> dict[str, int]:
        return bytes_of(self.beats)

    def streams(self, config: DramConfig) -> list[Stream]:
        """The same as bursts of the DRAM."""
        step = BEAT // config.burst_bytes
        return [
            Stream(b.name, _bursts(b.beat, step), np.full(len(b.beat) * step, WRITE if b.write else READ, np.int8), min(b.bytes, self.used[b.name]))
            for b in self.beats
        ]


def estimate(
    frame: FrontFrame, image: FrontImage, config: DramConfig | None, sizes: ChipMemories = SIZES, lanes: int = LANES, writers: int = LIST_WRITERS,
    interval: int = INTERVAL,
) -> Preprocessing:
    """Cycles and bytes of a frame. config: of the DRAM; None: a perfect memory. lanes, writers, interval: as of `unit_cycles`."""
    beats = traffic(frame, image, lanes)
    used = bytes_of(beats)
    used["records"] = len(frame.number) * frame.kind.bytes
    used["lists"] = -(-len(frame.entry_tile) * ENTRY_BITS // 8)
    units = unit_cycles(frame, sizes.survivors, lanes, writers, interval, c.DRAM_LATENCY_CYCLES if config else 0)
    order = in_order(beats, config, sizes.gathered_lines) if config else None
    if config is None or order is None:
        dram = 0
    elif config.narrow_port:
        dram = behind_port(order, config, UNDER_WAY, sizes.gathered_lines + AHEAD)
    else:
        dram = simulate(order.burst, order.kind, config).cycles
    return Preprocessing(beats, used, units.all, dram, phases(units, beats, dram, sizes.survivors, lanes), sizes.gathered_lines)
