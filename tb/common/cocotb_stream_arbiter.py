"""cocotb tests of flk_stream_arbiter.

A model of each input: the elements it has offered and not yet had taken. Checked in every cycle:
the output is the head of the input it names, exactly that input is ready (and only with the
output), and no waiting input is passed over more than Inputs - 1 times.
"""

from collections import deque

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from flicker_tb import stalls
from flicker_tb.bench import Bench, combinations
from flicker_tb.streams import Monitor, Stream, StreamSink

PAIRS = combinations(stalls.PATTERNS, stalls.PATTERNS)


class ArbiterTest:
    """Drives all inputs from queues and checks every transfer."""

    def __init__(self, dut, idle, stall):
        self.dut = dut
        self.bench = Bench(dut)
        self.inputs = len(dut.in_valid_i)
        self.width = len(dut.out_data_o)
        self.queues = [deque() for _ in range(self.inputs)]
        self.idle = [self.bench.stall(idle) for _ in range(self.inputs)]
        self.offered = [False] * self.inputs
        self.passed_over = [0] * self.inputs
        self.order = []  # index of every transfer
        dut.in_valid_i.value = 0
        dut.in_data_i.value = 0
        output = Stream(dut, "out", ("data", "index"))
        self.sink = StreamSink(output, self.bench.stall(stall))
        self.monitor = Monitor(output, self.check)
        cocotb.start_soon(self.drive())

    def check(self, item):
        """One output transfer; called before the inputs move on."""
        data, index = item
        assert index < self.inputs and self.offered[index], f"input {index} offers nothing"
        expected = self.queues[index][0]
        assert data == expected, f"input {index}: got {data:#x}, expected {expected:#x}"
        for other in range(self.inputs):
            self.passed_over[other] += self.offered[other] and other != index
            assert self.passed_over[other] < self.inputs, f"input {other} starves"
        self.passed_over[index] = 0
        self.order.append(index)

    async def drive(self):
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            ready = int(dut.in_ready_o.value)
            moving = dut.out_valid_o.value == 1 and dut.out_ready_i.value == 1
            chosen = 1 << int(dut.out_index_o.value)
            taken = ready & sum(offered << i for i, offered in enumerate(self.offered))
            assert taken == (chosen if moving else 0), f"ready {ready:#b}, chosen {chosen:#b}"
            for i, queue in enumerate(self.queues):
                if taken >> i & 1:
                    queue.popleft()
                    self.offered[i] = False
                if not self.offered[i] and queue and not next(self.idle[i]):
                    self.offered[i] = True
            dut.in_valid_i.value = sum(offered << i for i, offered in enumerate(self.offered))
            dut.in_data_i.value = sum(
                (queue[0] if offered else self.bench.rng.getrandbits(self.width)) << i * self.width
                for i, (queue, offered) in enumerate(zip(self.queues, self.offered))
            )

    async def run(self, counts):
        """Send ``counts[i]`` random elements on input i and wait until all have come out."""
        for queue, count in zip(self.queues, counts):
            queue.extend(self.bench.rng.getrandbits(self.width) for _ in range(count))
        await self.bench.reset()
        total = sum(counts)
        await self.bench.until(lambda: len(self.order) == total, 1000 + 200 * total, "last element")
        await self.bench.cycles(20)
        assert self.monitor.count == total > 0 and not any(self.queues)


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PAIRS))
async def random_traffic(dut, idle, stall):
    """No loss, no duplication, order within an input, no starvation, choice holds."""
    test = ArbiterTest(dut, idle, stall)
    await test.run([test.bench.rng.randrange(20, 100) for _ in range(test.inputs)])


@cocotb.test()
async def round_robin(dut):
    """With all inputs busy every one is served in turn, one element per cycle."""
    test = ArbiterTest(dut, "never", "never")
    await test.run([50] * test.inputs)
    assert test.order == [i % test.inputs for i in range(50 * test.inputs)]
    assert test.monitor.last - test.monitor.first == 50 * test.inputs - 1


@cocotb.test()
@cocotb.parametrize(only=["first", "last"])
async def single_input(dut, only):
    """One busy input alone has the full rate."""
    test = ArbiterTest(dut, "never", "never")
    busy = 0 if only == "first" else test.inputs - 1
    await test.run([60 if i == busy else 0 for i in range(test.inputs)])
    assert test.monitor.last - test.monitor.first == 59


@cocotb.test()
async def clear_starts_over(dut):
    """After clear_i the search starts at input 0, wherever it was and whatever was waiting."""
    bench = Bench(dut)
    inputs = len(dut.in_valid_i)
    dut.in_data_i.value = 0
    await bench.reset()
    for first in range(inputs):
        dut.in_valid_i.value = 1 << first
        dut.out_ready_i.value = int(first % 2 == 0)  # served, or still waiting
        await bench.clear()
        dut.in_valid_i.value = (1 << inputs) - 1
        await FallingEdge(dut.clk_i)
        assert int(dut.out_index_o.value) == 0, f"after input {first}"


@cocotb.test()
async def combinational_paths(dut):
    """Latency 0: valid and data reach the output, ready the chosen input, in the same cycle."""
    test = ArbiterTest(dut, "never", "never")
    await test.bench.reset()
    await FallingEdge(dut.clk_i)
    for index in range(test.inputs):
        dut.in_valid_i.value = 1 << index
        dut.in_data_i.value = 1 << index * test.width
        for ready in (0, 1):
            dut.out_ready_i.value = ready
            await Timer(1, unit="step")
            assert dut.out_valid_o.value == 1
            assert int(dut.out_index_o.value) == index
            assert int(dut.out_data_o.value) == 1
            assert int(dut.in_ready_o.value) == ready << index
    dut.in_valid_i.value = 0
    await Timer(1, unit="step")
    assert dut.out_valid_o.value == 0
