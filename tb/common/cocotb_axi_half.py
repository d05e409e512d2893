"""cocotb tests of flk_axi_half."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import FallingEdge, Timer
from flicker_tb.bench import Bench


@cocotb.test()
@cocotb.parametrize(fill=["empty", "few", "full"])
async def halves(dut, fill):
    """Each beat's half is that of its address, in the order of the addresses, with a memory that answers at once, soon, or as late as there is room."""
    bench = Bench(dut)
    rng = bench.rng
    width, bursts = int(dut.Width.value), int(dut.Bursts.value)
    dut.ar_move_i.value = dut.r_valid_i.value = 0
    await bench.reset()
    waiting: deque[int] = deque()
    edge = FallingEdge(dut.clk_i)
    seen, deepest = set(), 0
    for cycle in range(1200):
        await edge
        target = {"empty": 1, "few": min(4, bursts), "full": bursts}[fill]
        beat = bool(waiting) and rng.random() < (0.9 if cycle // 300 % 2 else 0.5) * (len(waiting) / target if fill == "full" else 1)
        move = len(waiting) < target and rng.random() < 0.8
        address = rng.getrandbits(len(dut.ar_addr_i))
        data = rng.getrandbits(2 * width)
        dut.ar_move_i.value, dut.ar_addr_i.value = int(move), address
        dut.r_valid_i.value, dut.r_data_i.value = int(beat), data
        await Timer(1, unit="step")
        if beat:
            lane = waiting.popleft()
            assert int(dut.r_data_o.value) == data >> lane * width & (1 << width) - 1
            seen.add(lane)
        if move:
            waiting.append(address // (width // 8) % 2)
            deepest = max(deepest, len(waiting))
    assert seen == {0, 1} and deepest == target
