"""A scheme executed step by step, with what each step moves and takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import FlickerError
from ..params import CORES
from . import constants as c
from .delivery import fetches, misses, split_by_boxes
from .dram import READ, WRITE, Stream, simulate
from .lists import Splats, build, count_entries
from .schemes import Method, Scheme
from .sorting import merge_passes, quantised_key, sort_lists


@dataclass(eq=False)
class SchemeResult:
    """What a scheme did.

    start, record: the sub-tile lists it ends with, sorted; record numbers of `Splats`. entries: entries of its own lists. longest: its longest list.
    streams: DRAM traffic, back: names of the streams of the rendering phase (the others belong to preprocessing).
    cycles: of each step. build_cycles, sort_cycles: what its steps take in the two phases. on_chip: bytes by purpose. fetched: records
    handed to the cores; missed: those read from DRAM. early_stop: entries of the sub-tile lists never asked for.
    """

    scheme: Scheme
    start: np.ndarray
    record: np.ndarray
    entries: int
    longest: int
    streams: list[Stream]
    back: tuple[str, ...]
    cycles: dict[str, int]
    build_cycles: int
    sort_cycles: int
    on_chip: dict[str, int]
    fetched: int
    missed: int
    early_stop: int

    def bytes(self) -> int:
        """Bytes moved."""
        return sum(s.moved_bytes for s in self.streams)


@dataclass(frozen=True)
class Addresses:
    """Byte addresses of the arrays in DRAM that the schemes touch."""

    records: int = 1 << 30
    boxes: int = (1 << 30) + (1 << 28)
    runs: int = (1 << 30) + (2 << 28)
    lists: int = (1 << 30) + (3 << 28)


def run_scheme(
    splats: Splats, scheme: Scheme, needed: np.ndarray | None = None, addresses: Addresses = Addresses(), ahead: int = c.QUEUE_REFERENCES
) -> SchemeResult:
    """Execute a scheme. needed: entries of each sub-tile list that rendering takes (`consumed`), None for all.

    ahead: entries fetched beyond the one that finishes a sub-tile, in the worst case a full queue.
    """
    block, cols, rows = int(scheme.grain), splats.cols, splats.rows
    total = len(splats)
    streams: list[Stream] = []
    cycles: dict[str, int] = {}
    units = c.SORTING_UNITS
    cores = c.PREPROCESSING_CORES * c.ENTRIES_PER_CYCLE
    order = np.arange(total)
    key = splats.key
    if scheme.key_bits < c.KEY_BITS:
        key = quantised_key(key.view(np.float32), scheme.key_bits, "linear")
    if scheme.method is Method.GLOBAL:
        one = sort_lists(np.array([0, total]), key, order, capacity=max(total, c.SORT_LANES))
        order = one.record[::-1].copy()
        size = scheme.key_bits + c.ID_BITS
        runs = -(-total // scheme.sort_capacity)
        passes = int(merge_passes(runs, 1, c.MERGE_WAYS))
        inner = max(int(merge_passes(min(total, scheme.sort_capacity), c.SORT_LANES, c.MERGE_WAYS)), 1)
        streams.append(Stream.span("run write", addresses.runs, total * size // 8 * (passes + 1), WRITE))
        streams.append(Stream.span("run read", addresses.runs, total * size // 8 * (passes + 1), READ))
        # Runs by all units, so the passes but the last, which one merge tree does alone.
        cycles["global sort"] = total * inner // units + total * max(passes - 1, 0) // units + (total if passes else 0)
    lists = build(splats, scheme, order, addresses.lists)
    entries = len(lists.record)
    count = np.diff(lists.start)
    cycles["emit entries"] = -(-entries // cores)
    if scheme.method is Method.COUNTING:
        cycles["count entries"] = -(-entries // cores)
        streams += [Stream.span("box write", addresses.boxes, total * c.BOX_BYTES, WRITE),
                    Stream.span("box read", addresses.boxes, total * c.BOX_BYTES, READ)]
    streams += lists.writes

    full = np.zeros(cols * rows, np.int64)
    sub_count = count_entries(np.arange(total), splats.box, 1, cols, rows)
    sub_start = np.concatenate([[0], np.cumsum(sub_count)])
    limit = sub_count if needed is None else np.minimum(sub_count, needed + ahead)
    if needed is not None and needed.shape != full.shape:
        raise FlickerError(f"lists: needed has shape {needed.shape}, not {full.shape}")

    if scheme.method is Method.GLOBAL:
        tag_record, busy, reads = lists.record, np.zeros(len(count), np.int64), (count > 0).astype(np.int64)
    else:
        done = sort_lists(lists.start, key[lists.record], lists.record, capacity=scheme.sort_capacity)
        tag_record, busy, reads = done.record, done.busy, done.reads
    sub_record = np.empty(sub_start[-1], np.int64)
    split_by_boxes(lists.start, tag_record, splats.box, block, cols, rows, sub_start, sub_record)
    out, deepest = np.empty(sub_start[-1], np.int64), np.zeros(len(count), np.int64)
    fetched = out[: fetches(lists.walk, lists.start, tag_record, splats.box, block, cols, rows, limit, out, deepest)]
    if scheme.method is not Method.GLOBAL and (count > scheme.sort_capacity).any():
        done = sort_lists(lists.start, key[lists.record], lists.record, deepest, capacity=scheme.sort_capacity)
        busy, reads = done.busy, done.reads

    # Reading the lists. Sorted chains stop where rendering stops; others are read whole, long ones once a depth chunk.
    if scheme.method is Method.COUNTING:
        lines = np.diff(lists.line_start)[lists.walk]
        first = addresses.lists + lists.line_start[:-1][lists.walk] * c.LINE_BYTES
        times = reads[lists.walk]
        read = Stream.ranges("list read", np.repeat(first, times), np.repeat(lines * c.LINE_BYTES, times), READ)
        read.used_bytes = int((count * reads).sum()) * scheme.entry_bits // 8
    else:
        chain = lists.chain[lists.walk]
        begin = np.concatenate([[0], np.cumsum(chain)])[:-1]
        if scheme.method is Method.GLOBAL:
            share = deepest / np.maximum(count, 1)  # chunks are filled unevenly; a list's are taken to be alike
            taken = np.ceil(share[lists.walk] * chain).astype(np.int64)
            times = np.ones(len(chain), np.int64)
        else:
            taken, times = chain, reads[lists.walk]
        begin, taken = np.repeat(begin, times), np.repeat(taken, times)
        place = np.repeat(begin - np.cumsum(taken) + taken, taken) + np.arange(taken.sum())
        read = Stream.items("list read", addresses.lists, c.CHUNK_BYTES, lists.chunks[place], READ)
        used = deepest if scheme.method is Method.GLOBAL else count * reads
        read.used_bytes = int(used.sum()) * scheme.entry_bits // 8
        cycles["chain latency"] = int(taken.sum()) * c.DRAM_LATENCY_CYCLES // c.LISTS_IN_FLIGHT
    streams.append(read)
    missed = fetched
    if scheme.record_cache_bytes:
        sets = scheme.record_cache_bytes // c.RECORD_BYTES // c.RECORD_CACHE_WAYS
        keep = np.empty(len(fetched), np.int64)
        missed = keep[: misses(fetched, sets, c.RECORD_CACHE_WAYS, keep)]
    burst = addresses.records // c.LINE_BYTES + missed * (c.RECORD_BYTES // c.LINE_BYTES)
    streams.append(Stream("record read", burst, np.full(len(burst), READ, np.int8), len(burst) * c.RECORD_BYTES))

    if scheme.method is not Method.GLOBAL:
        place = np.arange(len(count)) if block > 1 else (np.arange(len(count)) // cols % 2) * 2 + np.arange(len(count)) % cols % 2
        cycles["sort"] = int(np.bincount(place % units, busy, units).max())
    if block > 2:
        tiles = (block // 2) ** 2
        cycles["filter by mask"] = int((deepest * tiles).sum()) // c.FILTER_ENTRIES_PER_CYCLE
    cycles["hand out records"] = len(fetched) if block > 1 else -(-len(fetched) // 4)

    line = c.LINE_BYTES if scheme.method is Method.COUNTING else c.CHUNK_BYTES
    on_chip = {
        "list pointers": len(count) * c.POINTER_BYTES,
        "write combining": scheme.combiner_sets * scheme.combiner_ways * (line + c.POINTER_BYTES),
        "sort buffers": units * 2 * scheme.sort_capacity * max(scheme.entry_bits, scheme.key_bits + c.ID_BITS) // 8,
        "record cache": scheme.record_cache_bytes + scheme.record_cache_bytes // c.RECORD_BYTES * 3,
        "record queues": CORES * c.QUEUE_REFERENCES * c.REFERENCE_BYTES,
        "parameter buffers": c.GEOMETRY_BUFFER_BYTES,
    }
    front = cycles["emit entries"] + cycles.get("count entries", 0) + cycles.get("global sort", 0)
    back = max(cycles.get(k, 0) for k in ("sort", "chain latency", "filter by mask", "hand out records"))
    return SchemeResult(
        scheme, sub_start, sub_record, entries, int(count.max(initial=0)), streams, ("list read", "record read"), cycles, front, back,
        on_chip, len(fetched), len(missed), int((sub_count - limit).sum()),
    )


def scheme_rows(results: Sequence[SchemeResult] | None) -> list[tuple[str, ...]]:
    """Results as a table: the header (for None), else one row a scheme."""
    if results is None:
        return [("scheme", "entries", "longest", "list MB", "record MB", "other MB", "DRAM cycles", "efficiency", "first pass",
                "second pass", "sort", "chain", "filter", "hand out", "on chip KB")]
    rows = []
    for r in results:
        mb = {s.name: s.moved_bytes / 1e6 for s in r.streams}
        alone = [simulate(s.burst, s.kind) for s in r.streams]
        cycles = sum(a.cycles for a in alone)
        other = sum(v for k, v in mb.items() if k not in ("list write", "list read", "record read"))
        second = r.cycles.get("count entries", 0) + r.cycles.get("global sort", 0)
        rows.append((
            r.scheme.name, f"{r.entries:,}", f"{r.longest:,}", f"{mb['list write'] + mb['list read']:.1f}", f"{mb['record read']:.1f}",
            f"{other:.1f}", f"{cycles:,}", f"{r.bytes() / (cycles * c.DRAM_BYTES_PER_SECOND / c.CLOCK_HZ):.0%}" if cycles else "-",
            f"{r.cycles['emit entries']:,}", f"{second:,}",
            *(f"{r.cycles.get(k, 0):,}" for k in ("sort", "chain latency", "filter by mask", "hand out records")),
            f"{sum(r.on_chip.values()) / 1024:.0f}",
        ))
    return rows
