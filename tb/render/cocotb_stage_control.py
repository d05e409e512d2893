"""cocotb test of the stage control: a reference model of frame, mode and counter port."""

from __future__ import annotations

from collections import Counter

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge
from flicker_tb.bench import Bench

from flicker.params import CORES, COUNTER_BITS, COUNTER_LATENCY, CatMode


@cocotb.test()
async def every_cycle(dut):
    """Outputs of every cycle, whatever the inputs: elements pass unless closed, the mode is the first element's until idle again."""
    bench = Bench(dut)
    rng = bench.rng
    ports = (dut.mode_i, dut.in_valid_i, dut.in_eos_i, dut.ready_i, dut.counter_core_i, dut.counter_i)
    for port in ports:
        port.value = 0
    dut.idle_i.value = (1 << CORES) - 1
    await bench.reset()
    lists = [False] * CORES  # a list has begun whose token has not come
    working = [0] * CORES  # cycles for which a core is not idle
    valid, eos = [False] * CORES, [False] * CORES
    mode = mode_in = 0
    seen: Counter[str] = Counter()
    counters = [0] * CORES
    wanted: list[int] = []  # counters that were addressed, oldest first
    for _ in range(5000):
        clear = rng.random() < 0.02
        if rng.random() < 0.2:
            mode_in = rng.randrange(len(CatMode))
        for k in range(CORES):
            if not valid[k]:
                valid[k], eos[k] = rng.random() < 0.3, rng.random() < 0.6
        ready = [rng.random() < 0.7 for _ in range(CORES)]
        address = rng.randrange(CORES)
        counters = [rng.getrandbits(COUNTER_BITS) for _ in range(CORES)]
        dut.clear_i.value, dut.mode_i.value = int(clear), mode_in
        dut.in_valid_i.value = sum(v << k for k, v in enumerate(valid))
        dut.in_eos_i.value = sum(v << k for k, v in enumerate(eos))
        dut.ready_i.value = sum(v << k for k, v in enumerate(ready))
        dut.idle_i.value = sum((working[k] == 0) << k for k in range(CORES))
        dut.counter_core_i.value = address
        dut.counter_i.value = sum(v << COUNTER_BITS * k for k, v in enumerate(counters))
        await FallingEdge(dut.clk_i)
        idle = not any(working) and not any(lists)
        is_open = not clear and (not idle or mode == mode_in)
        taken = [is_open and valid[k] and ready[k] for k in range(CORES)]
        got = (int(dut.idle_o.value), int(dut.valid_o.value), int(dut.in_ready_o.value))
        want = (int(idle), sum((is_open and v) << k for k, v in enumerate(valid)), sum((is_open and v) << k for k, v in enumerate(ready)))
        assert got == want, f"idle, valid, ready: {got}, wanted {want}"
        assert int(dut.mode_o.value) == mode, "mode"
        if len(wanted) == COUNTER_LATENCY:
            assert int(dut.counter_data_o.value) == wanted.pop(0), "counter"
        wanted.append(counters[address])
        seen["taken"] += sum(taken)
        seen["aborted"] += clear and not idle
        seen["changed inside"] += not idle and mode_in != mode
        seen["waited for the mode"] += idle and not clear and mode_in != mode and any(valid)
        await RisingEdge(dut.clk_i)
        if idle:
            mode = mode_in
        for k in range(CORES):
            working[k] = 0 if clear else max(working[k] - 1, 0)
            if clear:
                lists[k] = valid[k] = False
            if taken[k]:
                lists[k], valid[k] = not eos[k], False
                working[k] = rng.choice((1, 2, 5))
    assert min(seen.values()) > 20 and len(seen) == 4, seen
