"""cocotb test of flk_pixel_state; setting: Pixels."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config

from flicker.params import FP16_MUL_STAGES, FP16_ONE_BITS, FP16_SUM_STAGES

# Cycles after the operation (rtl/render/flk_pixel_state.sv).
BLEND = 1 + FP16_MUL_STAGES
COLOUR = BLEND + FP16_MUL_STAGES
LAST = COLOUR + FP16_SUM_STAGES
RETURN = BLEND + 1
INPUTS = ("op_pixel_i", "contributes_i", "ends_i", "t_next_i", "c_next_i")


class Subtile:
    """What the operations of one sub-tile find and leave, in program order."""

    def __init__(self, pixels: int) -> None:
        self.t = [FP16_ONE_BITS] * pixels
        self.c = [0] * pixels
        self.finished = 0


class Operation:
    """An operation or token that came a number of cycles ago."""

    def __init__(self, subtile: Subtile, pixel: int, eos: bool) -> None:
        self.subtile, self.pixel, self.eos = subtile, pixel, eos
        self.blended = False


def packed(values: list[int], bits: int) -> int:
    """List to one integer, entry 0 lowest."""
    return sum(value << bits * k for k, value in enumerate(values))


@cocotb.test()
async def program_order(dut):
    """Every output in every cycle."""
    pixels = config()["Pixels"]
    bench = Bench(dut)
    rng = bench.rng
    for name in ("clear_i", "op_valid_i", "op_eos_i", *INPUTS):
        getattr(dut, name).value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    await edge
    subtile = Subtile(pixels)
    inside: deque[Operation | None] = deque([None] * (LAST + 1), LAST + 1)  # index: cycles since it came
    seen = dict.fromkeys(("blend", "finish", "skip finished", "token", "clear with operations", "early return after a token"), 0)
    for _ in range(6000):
        new = None
        kind = rng.random()
        if kind < 0.05:
            new = Operation(subtile, rng.randrange(pixels), True)
            subtile = Subtile(pixels)
        elif kind < 0.85:
            recent = list(inside)[: RETURN - 1]
            taken = {op.pixel for op in recent if op and not op.eos and op.subtile is subtile}
            free = [p for p in range(pixels) if p not in taken]
            new = Operation(subtile, rng.choice(free), False)
            seen["early return after a token"] += any(op and not op.eos and op.subtile is not subtile and op.pixel == new.pixel for op in recent)
        inside.appendleft(new)
        clear = rng.random() < 0.01
        dut.clear_i.value = int(clear)
        dut.op_valid_i.value = int(new is not None)
        dut.op_eos_i.value = int(new.eos if new else rng.random() < 0.5)
        contributes, ends = int(rng.random() < 0.8), int(rng.random() < 0.15)
        t_next, c_next = rng.getrandbits(15), rng.getrandbits(45)
        for name, value in zip(INPUTS, (new.pixel if new else rng.randrange(pixels), contributes, ends, t_next, c_next)):
            getattr(dut, name).value = value
        await edge
        # The cycle that ends here: what it had on its outputs.
        op = inside[1]
        if op and not op.eos:
            assert int(dut.t_o.value) == op.subtile.t[op.pixel], "t_o"
        first = [inside[s - 1] for s in range(2, BLEND + 1)]
        assert int(dut.first_o.value) == packed([int(op is not None and not op.eos and op.pixel == 0) for op in first], 1), "first_o"
        op = inside[BLEND]
        assert int(dut.blend_valid_o.value) == int(op is not None and not op.eos), "blend_valid_o"
        assert int(dut.blend_eos_o.value) == int(op is not None and op.eos), "blend_eos_o"
        finish = 0
        if op and op.eos:
            assert int(dut.t_all_o.value) == packed(op.subtile.t, 15), "t_all_o"
            seen["token"] += 1
        elif op:
            state = op.subtile
            assert int(dut.blend_pixel_o.value) == op.pixel, "blend_pixel_o"
            assert int(dut.finished_o.value) == state.finished, "finished_o"
            done = state.finished >> op.pixel & 1
            finish = int(contributes and ends and not done)
            op.blended = bool(contributes and not ends and not done)
            if op.blended:
                state.t[op.pixel] = t_next
            state.finished |= finish << op.pixel
            seen["blend"] += op.blended
            seen["finish"] += finish
            seen["skip finished"] += contributes and done
        assert int(dut.finish_o.value) == finish, "finish_o"
        op = inside[COLOUR]
        if op and not op.eos:
            assert int(dut.c_o.value) == op.subtile.c[op.pixel], "c_o"
        op = inside[LAST]
        assert int(dut.last_eos_o.value) == int(op is not None and op.eos), "last_eos_o"
        if op and op.eos:
            assert int(dut.c_all_o.value) == packed(op.subtile.c, 45), "c_all_o"
        elif op and op.blended:
            op.subtile.c[op.pixel] = c_next
        if clear:
            seen["clear with operations"] += any(inside)
            inside.extend([None] * (LAST + 1))
            subtile = Subtile(pixels)
    assert min(seen.values()) > 10, seen
