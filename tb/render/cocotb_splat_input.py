"""cocotb test of flk_splat_input: every cycle against a model of elements and ends; what the stage says about a sub-tile reaches its own list alone."""

from __future__ import annotations

from collections import Counter, deque

import cocotb
import record_samples
from cocotb.triggers import FallingEdge, RisingEdge
from flicker_tb import splats
from flicker_tb.bench import Bench

from flicker.golden.front.record import RecordKind
from flicker.golden.front.to_splat import record_to_splat
from flicker.params import CORES, SUBTILE_COORD_BITS

KIND = RecordKind.FACTORED16
RECORD_BITS, PLACE_BITS = 8 * KIND.bytes, 2 * SUBTILE_COORD_BITS


def element(item: record_samples.Item) -> int:
    """splat_elem_t of a record, or the end of its list."""
    eos, record, subtile = item
    if eos:
        return splats.SPLAT_EOS | subtile
    s = record_to_splat(record, KIND, subtile & record_samples.LAST, subtile >> SUBTILE_COORD_BITS)
    return splats.splat_elem(splats.Splat((s.x.fp16, s.y.fp16, *s.shape, s.opacity, s.blue, s.green, s.red), s.spiky))


@cocotb.test()
async def every_cycle(dut):
    """Four cores with lists of their own, pauses, clear_i: elements in order, and finished_o exactly when no end lies between."""
    bench = Bench(dut)
    rng = bench.rng
    for name in ("clear", "in_valid", "in_end", "in_record", "in_subtile", "out_ready", "finished"):
        getattr(dut, f"{name}_i").value = 0
    await bench.reset()
    width = len(dut.out_elem_o) // CORES
    work = [deque(record_samples.lists(rng, KIND, 300)) for _ in range(CORES)]
    inside: list[deque[record_samples.Item]] = [deque() for _ in range(CORES)]
    offered: list[record_samples.Item | None] = [None] * CORES
    seen: Counter[str] = Counter()
    for cycle in range(2500):
        clear = rng.random() < 0.005
        for k in range(CORES):
            if offered[k] is None and work[k] and rng.random() < 0.6:
                offered[k] = work[k].popleft()
        ready, finished = [rng.random() < 0.6 for _ in range(CORES)], rng.getrandbits(CORES)
        given = [item or (0, 0, 0) for item in offered]
        dut.clear_i.value, dut.finished_i.value = int(clear), finished
        dut.in_valid_i.value = sum((item is not None) << k for k, item in enumerate(offered))
        dut.out_ready_i.value = sum(r << k for k, r in enumerate(ready))
        dut.in_end_i.value = sum(int(item[0]) << k for k, item in enumerate(given))
        dut.in_record_i.value = sum(item[1] << RECORD_BITS * k for k, item in enumerate(given))
        dut.in_subtile_i.value = sum(item[2] << PLACE_BITS * k for k, item in enumerate(given))
        await FallingEdge(dut.clk_i)
        takes, gives, elems = int(dut.in_ready_o.value), int(dut.out_valid_o.value), int(dut.out_elem_o.value) if int(dut.out_valid_o.value) else 0
        says = int(dut.finished_o.value)
        for k in range(CORES):
            between = sum(item[0] for item in inside[k])
            assert says >> k & 1 == (finished >> k & 1 and not between), f"cycle {cycle}, core {k}: {between} ends between"
            seen["held back"] += bool(finished >> k & 1 and between)
            if gives >> k & 1:
                assert elems >> width * k & (1 << width) - 1 == element(inside[k][0]), f"cycle {cycle}, core {k}"
                if ready[k] and not clear:
                    seen["end" if inside[k].popleft()[0] else "splat"] += 1
            item = offered[k]
            if item is not None and takes >> k & 1 and not clear:
                inside[k].append(item)
                offered[k] = None
        if clear:
            for k in range(CORES):
                inside[k].clear()
            seen["clear"] += 1
        await RisingEdge(dut.clk_i)
    assert min(seen[name] for name in ("held back", "end", "clear")) > 3 and seen["splat"] > 500, seen
