"""cocotb test of the counters of a core of the lanes."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from flicker_tb.bench import Bench

from flicker.params import COUNTER_INDEX_BITS, LANE_COUNTERS

# Fields of lane_core_events_t, highest first, and the counter that each adds to.
EVENTS = {
    "busy": 1, "stalled": 1, "idle": 1, "subtiles": 2, "gaussians_in": 2, "gaussians_rejected": 2, "dropped": 2, "dispatched": 1, "no_slot": 1, "no_room": 1,
    "entries": 6, "visits": 6, "skipped": 6, "blended": 6, "pixels_finished": 6, "starved": 6, "bank_waits": 6,
}


@cocotb.test()
async def sums(dut):
    """Every counter adds its own events, none while held, and clear sets all to zero at any time; addresses beyond them read 0."""
    bench = Bench(dut)
    rng = bench.rng
    names = [name for name, _ in LANE_COUNTERS]
    assert set(names) == {"cycles", *EVENTS}
    for port in (dut.hold_i, dut.events_i, dut.addr_i):
        port.value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    await edge
    total = dict.fromkeys(names, 0)
    dut.clear_i.value = 1
    await edge
    await edge
    dut.clear_i.value = 0
    cleared = held = both = compared = 0
    for _ in range(2000):
        hold, clear = rng.random() < 0.2, rng.random() < 0.03
        held, cleared, both = held + hold, cleared + clear, both + (hold and clear)
        dut.hold_i.value = int(hold)
        dut.clear_i.value = int(clear)
        word, events = 0, {"cycles": 1}
        for name, bits in EVENTS.items():
            events[name] = rng.choice((0, (1 << bits) - 1, rng.getrandbits(bits)))
            word = word << bits | events[name]
        dut.events_i.value = word
        await edge
        # Now the counters show everything up to the cycle before the one just driven.
        await FallingEdge(dut.clk_i)
        if rng.random() < 0.1 or clear:
            got = []
            for i in range(1 << COUNTER_INDEX_BITS):
                dut.addr_i.value = i
                await Timer(10, unit="ps")
                got.append(int(dut.data_o.value))
            assert not any(got[len(names) :]), "an address without a counter"
            assert got[: len(names)] == list(total.values()), {n: (a, b) for (n, b), a in zip(total.items(), got) if a != b}
            compared += 1
        if clear:
            total = dict.fromkeys(names, 0)
        elif not hold:
            for name in names:
                total[name] += events[name]
    assert cleared > 5 and held > 100 and both > 1 and compared > 100
