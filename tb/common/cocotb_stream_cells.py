"""cocotb tests of the cells with one stream in and one out: pipe register, skid buffer, FIFO.

Settings: ``capacity`` (elements held while the output is blocked), ``period`` (cycles per element
at full rate), ``paths`` (documented combinational paths, input to output).
"""


import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from flicker_tb import stalls
from flicker_tb.bench import StreamTest, combinations, config

ITEMS = 200
PAIRS = combinations(stalls.PATTERNS, stalls.PATTERNS)


def echo(item):
    """What goes in comes out."""
    return [item]


def random_items(test, count=ITEMS):
    width = len(test.bench.dut.in_data_i)
    return [test.bench.rng.getrandbits(width) for _ in range(count)]


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PAIRS))
async def order(dut, idle, stall):
    """Every element comes out once, in order, whatever the stalls; fill level is right."""
    test = StreamTest(dut, echo, idle=idle, stall=stall)
    if hasattr(dut, "usage_o"):
        cocotb.start_soon(check_usage(dut, test))
    await test.run(random_items(test), at_least=ITEMS)


async def check_usage(dut, test):
    """Fill level, full and empty agree with the transfers seen, in every cycle."""
    capacity = config()["capacity"]
    edge = RisingEdge(dut.clk_i)
    held = 0
    while True:
        await edge
        if dut.rst_ni.value != 1:
            continue
        usage = int(dut.usage_o.value)
        assert usage == held, f"usage_o is {usage}, the queue holds {held}"
        assert dut.empty_o.value == (held == 0), f"empty_o wrong with {held} elements"
        assert dut.full_o.value == (held == capacity), f"full_o wrong with {held} elements"
        held += dut.in_valid_i.value == 1 and dut.in_ready_o.value == 1
        held -= dut.out_valid_o.value == 1 and dut.out_ready_i.value == 1


@cocotb.test()
async def rate(dut):
    """Unstalled: latency 1 and the promised throughput."""
    test = StreamTest(dut, echo)
    await test.run(random_items(test), at_least=ITEMS)
    assert test.output.first - test.input.first == 1, "latency is not 1"
    for monitor in (test.input, test.output):
        taken = monitor.last - monitor.first
        assert taken == (ITEMS - 1) * config()["period"], f"{monitor.stream.name}: {taken} cycles"


@cocotb.test()
async def capacity(dut):
    """A blocked output: exactly ``capacity`` elements are taken, and all come out later."""
    gate = [True]
    test = StreamTest(dut, echo)
    test.sink.stall = iter(lambda: gate[0], None)
    await test.bench.reset()
    count = ITEMS + config()["capacity"]
    test.source.send(random_items(test, count))
    await test.bench.cycles(config()["capacity"] * 2 + 20)
    assert test.input.count == config()["capacity"], f"{test.input.count} elements taken"
    gate[0] = False
    await test.bench.until(lambda: test.checker.checked == count, 10 * count, "last element")
    test.checker.finish(count)


@cocotb.test()
async def reset_empties(dut):
    """Reset in mid-traffic forgets what was held; nothing old comes out afterwards."""
    test = StreamTest(dut, echo, stall="half")
    await test.bench.reset()
    test.source.send(random_items(test))
    await test.bench.until(lambda: test.checker.checked > 20, 1000, "traffic")
    await FallingEdge(dut.clk_i)
    dut.rst_ni.value = 0
    await Timer(100, unit="ps")
    assert dut.out_valid_o.value == 0, "out_valid_o is not cleared asynchronously"
    assert dut.in_ready_o.value == 1, "an empty cell is not ready"
    test.checker.drop()
    await test.bench.reset()
    await test.bench.until(lambda: not test.source.pending, 4 * ITEMS, "end of traffic")
    await test.bench.cycles(20 + 4 * config()["capacity"])
    test.checker.finish(ITEMS - 30)


@cocotb.test()
@cocotb.parametrize(when=["idle", "busy"])
async def clear_empties(dut, when):
    """Clear in mid-traffic forgets what is held and what is taken in that cycle; the cell is empty in the next, and works on."""
    test = StreamTest(dut, echo, stall="half" if when == "busy" else "never")
    await test.bench.reset()
    items = random_items(test)
    for part in range(0, ITEMS, 20):
        test.source.send(items[part : part + 20])
        await test.bench.until(lambda: not test.source.pending if when == "idle" else test.input.count > part + 10, 1000, "traffic")
        dut.clear_i.value = 1
        await RisingEdge(dut.clk_i)  # in this cycle an element may still enter or leave
        dut.clear_i.value = 0
        await FallingEdge(dut.clk_i)
        test.checker.drop()
        assert dut.out_valid_o.value == 0 and dut.in_ready_o.value == 1, "not empty after clear_i"
        await test.bench.until(lambda: not test.source.pending and not test.checker.outstanding, 1000, "rest")
    assert test.checker.checked > ITEMS // 4


@cocotb.test()
async def combinational_paths(dut):
    """Within a cycle, outputs react to inputs on the documented paths and on no other."""
    inputs = ("in_valid_i", "in_data_i", "out_ready_i")
    outputs = ("in_ready_o", "out_valid_o", "out_data_o", "usage_o", "full_o", "empty_o")
    outputs = [name for name in outputs if hasattr(dut, name)]
    test = StreamTest(dut, echo, idle="half", stall="half")
    await test.bench.reset()
    test.source.send(random_items(test))
    seen = set()
    for _ in range(ITEMS):
        await FallingEdge(dut.clk_i)
        before = {name: dut[name].value for name in outputs}
        for driven in inputs:
            handle = dut[driven]
            value = int(handle.value)
            handle.value = value ^ 1
            await Timer(100, unit="ps")
            seen |= {f"{driven}>{name}" for name in outputs if dut[name].value != before[name]}
            handle.value = value
            await Timer(100, unit="ps")
    assert seen == set(config()["paths"]), f"paths found: {sorted(seen)}"
    assert test.checker.checked > 20
