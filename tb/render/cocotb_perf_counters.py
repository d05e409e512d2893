"""cocotb test of the performance counters."""

from __future__ import annotations

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench
from minitile_model import CHANNEL_EVENTS, DISPATCH_EVENTS

from flicker.params import CHANNEL_COUNTERS, CHANNELS, CORE_COUNTERS, COUNTER_BITS

CTU_EVENTS = (("busy", 1), ("stalled", 1), ("idle", 1), ("token", 1), ("splat", 1), ("rejected", 1), ("tested", 3))
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
    """Every counter adds its own events, and clear sets all to zero at any time."""
    bench = Bench(dut)
    names = ["cycles", *[n for n, _ in CORE_COUNTERS if n != "cycles"]] + [f"{c}.{n}" for c in range(CHANNELS) for n, _ in CHANNEL_COUNTERS]
    assert set(CORE) | {"cycles"} == {n for n, _ in CORE_COUNTERS} and set(CHANNEL) == {n for n, _ in CHANNEL_COUNTERS}
    dut.clear_i.value = 0
    for port in (dut.ctu_events_i, dut.dispatch_events_i, dut.channel_events_i):
        port.value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    await edge
    total = dict.fromkeys(names, 0)
    dut.clear_i.value = 1
    await edge
    await edge
    dut.clear_i.value = 0
    cleared, late = 0, dict(total)
    for _ in range(2000):
        clear = bench.rng.random() < 0.005
        cleared += clear
        dut.clear_i.value = int(clear)
        ctu, c = draw(bench.rng, CTU_EVENTS)
        dispatch, d = draw(bench.rng, DISPATCH_EVENTS)
        words = [draw(bench.rng, CHANNEL_EVENTS) for _ in range(CHANNELS)]
        dut.ctu_events_i.value = ctu
        dut.dispatch_events_i.value = dispatch
        dut.channel_events_i.value = sum(w << 7 * k for k, (w, _) in enumerate(words))
        await edge
        # Now the counters show everything up to two cycles before the one just driven.
        value = int(dut.counters_o.value)
        got = {n: value >> COUNTER_BITS * i & (2**COUNTER_BITS - 1) for i, n in enumerate(names)}
        assert got == late, {n: (got[n], late[n]) for n in names if got[n] != late[n]}
        late = dict(total)
        if clear:
            total = dict.fromkeys(names, 0)
            continue
        total["cycles"] += 1
        for name, event in CORE.items():
            total[name] += (c | d)[event]
        for k, (_, v) in enumerate(words):
            for name, event in CHANNEL.items():
                total[f"{k}.{name}"] += v[event]
    assert cleared > 2
