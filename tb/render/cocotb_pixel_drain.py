"""cocotb test of flk_pixel_drain; setting: Pixels."""

from __future__ import annotations

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config
from minitile_model import pixel_of


@cocotb.test()
async def every_pixel_once(dut):
    """In every cycle: free or not, valid or not, and the pixel that is due."""
    pixels = config()["Pixels"]
    bench = Bench(dut)
    rng = bench.rng
    inputs = ("clear_i", "token_i", "take_t_i", "t_i", "take_c_i", "c_i", "out_ready_i")
    for name in inputs:
        getattr(dut, name).value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    await edge
    busy, plan, due, t = False, [], [], []  # plan: what comes in the next cycles
    given = cleared = 0
    ready_share = 0.5
    for _ in range(4000):
        token = not busy and rng.random() < 0.2
        if token:
            plan = [None] * rng.randrange(3) + ["t"] + [None] * rng.randrange(4) + ["c"]
            ready_share = rng.choice((0.1, 0.5, 1.0))
        step = plan.pop(0) if plan and not token else None
        t_now, c_now = rng.getrandbits(15 * pixels), rng.getrandbits(45 * pixels)
        clear, ready = rng.random() < 0.01, rng.random() < ready_share
        for name, value in zip(inputs, (clear, token, step == "t", t_now, step == "c", c_now, ready)):
            getattr(dut, name).value = int(value)
        await edge
        assert int(dut.ready_o.value) == int(not busy), "ready_o"
        assert int(dut.out_valid_o.value) == int(bool(due)), "out_valid_o"
        if due:
            got = (int(dut.out_index_o.value), pixel_of(int(dut.out_pixel_o.value)))
            assert got == due[0], f"got {got}, due {due[0]}"
        busy = busy or token
        if due and ready:
            due.pop(0)
            given += 1
            busy = bool(due)
        if step == "t":
            t = [t_now >> 15 * i & 0x7FFF for i in range(pixels)]
        if step == "c":
            channels = [[c_now >> 45 * i + 15 * k & 0x7FFF for k in range(3)] for i in range(pixels)]
            due = [(i, (t[i], *channels[i])) for i in range(pixels)]
        if clear:
            cleared += busy
            busy, plan, due = False, [], []
    assert given > 200 and cleared > 5, (given, cleared)
