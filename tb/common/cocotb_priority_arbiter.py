"""cocotb tests of flk_priority_arbiter: every cycle against a model of its counts."""

from __future__ import annotations

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb import stalls
from flicker_tb.bench import Bench, combinations

PAIRS = combinations(["never", "rare", "half", "heavy"], stalls.PATTERNS)


class PriorityModel:
    """Who goes: the lowest of those passed over `patience` times, else the lowest. passed: transfers of others since an input waits, not saturated."""

    def __init__(self, inputs: int, patience: int) -> None:
        self.inputs, self.patience = inputs, patience
        self.passed = [0] * inputs
        self.longest = 0

    def choose(self, valid: int) -> int | None:
        waiting = [k for k in range(self.inputs) if valid >> k & 1]
        return min(waiting, key=lambda k: (self.passed[k] < self.patience, k), default=None)

    def step(self, valid: int, taken: int | None) -> None:
        """A cycle ends in which `taken` (None: nobody) was served."""
        for k in range(self.inputs):
            if not valid >> k & 1 or k == taken:
                self.passed[k] = 0
            elif taken is not None:
                self.passed[k] += 1
                self.longest = max(self.longest, self.passed[k])

    def reset(self) -> None:
        self.passed = [0] * self.inputs


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PAIRS))
async def against_model(dut, idle, stall):
    """Choice, data, ready of every input, bound on waiting; an input that gives up before it is served starts anew."""
    bench = Bench(dut)
    inputs, width = len(dut.in_valid_i), len(dut.out_data_o)
    model = PriorityModel(inputs, int(dut.Patience.value))
    pauses, slow = [bench.stall(idle) for _ in range(inputs)], bench.stall(stall)
    dut.in_valid_i.value = dut.in_data_i.value = dut.out_ready_i.value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    data, valid, ready, served = [0] * inputs, 0, 0, [0] * inputs
    for _ in range(1500):
        await edge
        shown = [int(x.value) for x in (dut.out_valid_o, dut.in_ready_o)]
        choice = model.choose(valid)
        assert shown[0] == (valid != 0)
        if choice is not None:
            assert int(dut.out_index_o.value) == choice and int(dut.out_data_o.value) == data[choice]
            assert shown[1] == ready << choice
        taken = choice if ready else None
        model.step(valid, taken)
        for k in range(inputs):
            if k == taken or not valid >> k & 1:
                served[k] += k == taken
                valid = valid & ~(1 << k) | (not next(pauses[k])) << k
                data[k] = bench.rng.getrandbits(width)
            elif bench.rng.random() < 0.002:  # gives up
                valid &= ~(1 << k)
        ready = int(not next(slow))
        dut.in_valid_i.value, dut.out_ready_i.value = valid, ready
        dut.in_data_i.value = sum(x << k * width for k, x in enumerate(data))
    assert all(served) or stall in ("heavy", "bursts")
    assert model.longest <= model.patience + inputs - 1
    if idle == stall == "never":
        assert model.longest > model.patience or inputs == 2


@cocotb.test()
async def first_unless_late(dut):
    """With all inputs busy the others get one transfer after every Patience of input 0."""
    bench = Bench(dut)
    inputs, patience = len(dut.in_valid_i), int(dut.Patience.value)
    dut.in_valid_i.value = dut.in_data_i.value = 0
    dut.out_ready_i.value = 1
    await bench.reset()
    dut.in_valid_i.value = (1 << inputs) - 1
    edge, order = RisingEdge(dut.clk_i), []
    for _ in range(3 * (patience + inputs)):
        await edge
        order.append(int(dut.out_index_o.value))
    assert order[:patience] == [0] * patience
    assert order[patience : patience + inputs - 1] == list(range(1, inputs))
    assert order[patience + inputs - 1] == 0


@cocotb.test()
async def reset_forgets(dut):
    """Nobody has waited when reset ends."""
    bench = Bench(dut)
    inputs, patience = len(dut.in_valid_i), int(dut.Patience.value)
    dut.in_data_i.value = 0
    dut.in_valid_i.value = (1 << inputs) - 1
    dut.out_ready_i.value = 1
    await bench.reset()
    await bench.cycles(patience + 1)
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    for _ in range(patience):
        await edge
        assert int(dut.out_index_o.value) == 0
