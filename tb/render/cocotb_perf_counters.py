"""cocotb test of the performance counters."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from flicker_tb.bench import Bench
from minitile_model import CHANNEL_EVENTS, DISPATCH_EVENTS, GENERATOR_EVENTS

from flicker import layout
from flicker.params import CHANNEL_COUNTERS, CHANNELS, CORE_COUNTERS, COUNTER_INDEX_BITS

# Counter -> event
CORE = {
    "subtiles": "token", "gaussians_in": "splat", "gaussians_rejected": "rejected", "ctu_busy": "busy", "ctu_stalled": "stalled",
    "ctu_idle": "idle", "minitiles_tested": "tested", "minitiles_delivered": "delivered", "minitiles_filtered": "filtered",
}
CHANNEL = {"fifo_full": "fifo_full", "vru_busy": "vru_busy", "minitiles_sent": "sent", "minitiles_discarded": "discarded", "pixels_finished": "finished"}


def draw(rng, fields) -> tuple[int, dict[str, int]]:
    """A random event word and its fields."""
    word, values = 0, {}
    for name, bits in fields:
        values[name] = rng.randrange(5 if bits == 3 else 1 << bits)
        word = word << bits | values[name]
    return word, values


@cocotb.test()
async def sums(dut):
    """Every counter adds its own events, none while held, and clear sets all to zero at any time; addresses beyond them read 0."""
    bench = Bench(dut)
    names = ["cycles", *[n for n, _ in CORE_COUNTERS if n != "cycles"]] + [f"{c}.{n}" for c in range(CHANNELS) for n, _ in CHANNEL_COUNTERS]
    assert set(CORE) | {"cycles"} == {n for n, _ in CORE_COUNTERS} and set(CHANNEL) == {n for n, _ in CHANNEL_COUNTERS}
    dut.hold_i.value = 0
    for port in (dut.generator_events_i, dut.dispatch_events_i, dut.channel_events_i):
        port.value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    await edge
    total = dict.fromkeys(names, 0)
    dut.clear_i.value = 1
    await edge
    await edge
    dut.clear_i.value = 0
    cleared = held = compared = 0
    for _ in range(2000):
        hold = bench.rng.random() < 0.2
        held += hold
        dut.hold_i.value = int(hold)
        clear = bench.rng.random() < 0.005
        cleared += clear
        dut.clear_i.value = int(clear)
        ctu, c = draw(bench.rng, GENERATOR_EVENTS)
        dispatch, d = draw(bench.rng, DISPATCH_EVENTS)
        words = [draw(bench.rng, CHANNEL_EVENTS) for _ in range(CHANNELS)]
        dut.generator_events_i.value = ctu
        dut.dispatch_events_i.value = dispatch
        dut.channel_events_i.value = sum(w << layout.bits("channel_events") * k for k, (w, _) in enumerate(words))
        await edge
        # Now the counters show everything up to the cycle before the one just driven.
        await FallingEdge(dut.clk_i)
        if bench.rng.random() < 0.1:
            got = {}
            for i in range(1 << COUNTER_INDEX_BITS):
                dut.addr_i.value = i
                await Timer(10, unit="ps")
                got[names[i] if i < len(names) else None] = int(dut.data_o.value)
            assert got.pop(None) == 0, "an address without a counter"
            assert got == total, {n: (got[n], total[n]) for n in names if got[n] != total[n]}
            compared += 1
        if clear:
            total = dict.fromkeys(names, 0)
            continue
        if hold:
            continue
        total["cycles"] += 1
        for name, event in CORE.items():
            total[name] += (c | d)[event]
        for k, (_, v) in enumerate(words):
            for name, event in CHANNEL.items():
                total[f"{k}.{name}"] += v[event]
    assert cleared > 2 and held > 100 and compared > 100
