"""cocotb tests of flk_axi_hold: random managers, port and ends of bursts; counts kept beside it."""

from __future__ import annotations

import cocotb
from cocotb.triggers import ReadOnly, RisingEdge
from flicker_tb.bench import Bench, rounds


@cocotb.test()
async def bursts_under_way(dut):
    """An address passes unless it is held or too many, or no longer few, are under way; drained when both are held and all have ended."""
    bench = Bench(dut)
    rng, edge = bench.rng, RisingEdge(dut.clk_i)
    readers, writers, most = int(dut.Readers.value), int(dut.Writers.value), (1 << int(dut.CountBits.value)) - 1
    managers = readers + writers
    fewest = int(dut.Few.value)
    for name in ("clear", "few", "hold_reads", "hold_writes", "ar_valid", "aw_valid", "ar_ready", "aw_ready", "r_last", "b_valid"):
        getattr(dut, f"{name}_i").value = 0
    await bench.reset()
    count = [0] * managers
    drained = fulls = limited = 0
    holds, few = (0, 0), 0
    ending = 0.3
    for cycle in range(rounds(4000, 20_000)):
        if rng.random() < 0.03:
            holds = rng.choice([(0, 0), (0, 0), (1, 0), (0, 1), (1, 1), (1, 1)])
            ending, few = rng.choice([0, 0.3, 0.9]), rng.getrandbits(1)
        clear = rng.random() < 0.002
        valid, ready = rng.getrandbits(managers), rng.getrandbits(managers)
        ends = [int(count[k] > 0 and rng.random() < ending) for k in range(managers)]
        low = (1 << readers) - 1
        dut.clear_i.value, dut.few_i.value, dut.hold_reads_i.value, dut.hold_writes_i.value = int(clear), few, *holds
        dut.ar_valid_i.value, dut.aw_valid_i.value = valid & low, valid >> readers
        dut.ar_ready_i.value, dut.aw_ready_i.value = ready & low, ready >> readers
        bits = sum(end << k for k, end in enumerate(ends))
        dut.r_last_i.value, dut.b_valid_i.value = bits & low, bits >> readers
        await ReadOnly()
        held = [holds[k >= readers] or count[k] == most or (few and count[k] >= fewest) for k in range(managers)]
        for out, given in ((int(dut.ar_valid_o.value) | int(dut.aw_valid_o.value) << readers, valid),
                           (int(dut.ar_ready_o.value) | int(dut.aw_ready_o.value) << readers, ready)):
            assert out == sum((given >> k & 1 and not held[k]) << k for k in range(managers)), cycle
        assert int(dut.drained_o.value) == (holds == (1, 1) and not any(count)), cycle
        drained += int(dut.drained_o.value)
        fulls += most in count
        limited += few and fewest in count
        await edge
        for k in range(managers):
            count[k] = 0 if clear else count[k] + (valid >> k & ready >> k & 1 and not held[k]) - ends[k]
    assert drained > 20 and limited > 20 and (fulls > 20 or most > 100)
