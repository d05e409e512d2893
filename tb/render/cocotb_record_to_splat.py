"""cocotb tests of flk_record_to_splat against the golden model; setting: Form."""

from __future__ import annotations

import cocotb
import record_samples
from cocotb.triggers import FallingEdge
from flicker_tb import splats, stalls
from flicker_tb.bench import StreamTest, config
from flicker_tb.streams import Stream

from flicker.golden.front.record import RecordKind
from flicker.golden.front.to_splat import record_to_splat
from flicker.params import SUBTILE_COORD_BITS, Form

KIND = RecordKind.FACTORED16 if config()["Form"] == Form.FACTORED else RecordKind.CONIC32
ALL = 5500  # three shape codes each: all 2^14
SOME = 400


def element(item: record_samples.Item) -> list[int]:
    """splat_elem_t of a record, or the end of its list."""
    eos, record, subtile = item
    if eos:
        return [splats.SPLAT_EOS | subtile]
    s = record_to_splat(record, KIND, subtile & record_samples.LAST, subtile >> SUBTILE_COORD_BITS)
    features = (s.x.fp16, s.y.fp16, *s.shape, s.opacity, s.blue, s.green, s.red)
    return [splats.splat_elem(splats.Splat(features, s.spiky))]


class Test(StreamTest):
    def __init__(self, dut, idle: str = "never", stall: str = "never") -> None:
        fields = ("eos", "record", "subtile")
        super().__init__(dut, element, source=Stream(dut, "in", fields), sink=Stream(dut, "out", ("elem",)), idle=idle, stall=stall)


@cocotb.test()
async def all_codes(dut):
    """Every code of shape, opacity and colour, means of every kind; latency 3, one a cycle."""
    test = Test(dut)
    await test.run(record_samples.records(test.bench.rng, KIND, ALL), at_least=ALL)
    assert test.output.first - test.input.first == 3 and test.output.last - test.output.first == ALL - 1


@cocotb.test()
@cocotb.parametrize(idle=["never", "half"], stall=stalls.PATTERNS)
async def lists(dut, idle, stall):
    """Lists with their ends, under stalls."""
    test = Test(dut, idle, stall)
    await test.run(record_samples.lists(test.bench.rng, KIND, SOME), at_least=SOME)


@cocotb.test()
@cocotb.parametrize(stall=["never", "half", "bursts"])
async def clear_empties(dut, stall):
    """After clear_i nothing is inside, and what comes then leaves."""
    test = Test(dut, stall=stall)
    items = record_samples.lists(test.bench.rng, KIND, SOME)
    await test.bench.reset()
    for part in range(0, SOME, 40):
        test.source.send(items[part : part + 40])
        await test.bench.until(lambda: test.input.count > part + 20, 3000, "traffic")
        await test.bench.clear()
        await FallingEdge(dut.clk_i)
        test.checker.drop()
        assert dut.out_valid_o.value == 0 and dut.in_ready_o.value == 1
        await test.bench.until(lambda: not test.source.pending and not test.checker.outstanding, 3000, "rest")
    test.checker.finish(SOME // 3)
