"""cocotb tests of the generator of full masks; setting: MaskBits."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge
from flicker_tb import splats, stalls
from flicker_tb.bench import StreamTest, config
from flicker_tb.streams import Stream
from minitile_model import GENERATOR_EVENTS, EventCounter

from flicker import layout
from flicker.params import CHANNELS, CatMode

ONES = (1 << config()["MaskBits"]) - 1
ITEMS = 300


def masked(item: int) -> list[int]:
    """The element of the rendering core below a mask of ones."""
    word = item & (splats.FEATURE_EOS - 1) | (splats.FEATURE_EOS if item & splats.SPLAT_EOS else 0)
    return [ONES << layout.bits("feature_elem") | word]


class MaskTest(StreamTest):
    """Bench with events and a generator on stall_i."""

    def __init__(self, dut, idle: str = "never", stall: str = "never", block: str = "never") -> None:
        super().__init__(dut, masked, source=Stream(dut, "in", ("elem",)), sink=Stream(dut, "out"), idle=idle, stall=stall)
        self.events = EventCounter(dut, dut.events_o, GENERATOR_EVENTS)
        dut.mode_i.value = int(CatMode.OFF)
        dut.stall_i.value = 0
        cocotb.start_soon(self._block(self.bench.stall(block)))
        self.items = [self.bench.rng.getrandbits(layout.bits("splat_elem")) for _ in range(ITEMS)]

    async def _block(self, pattern) -> None:
        dut = self.bench.dut
        while True:
            await RisingEdge(dut.clk_i)
            if dut.rst_ni.value == 1:
                assert not (dut.stall_i.value == 1 and dut.in_ready_o.value == 1), "element taken while stalled"
                assert dut.idle_o.value != dut.out_valid_o.value, "idle_o"
                dut.stall_i.value = int(next(pattern))


@cocotb.test()
@cocotb.parametrize(idle=["never", "half"], stall=["never", "bursts"], block=["never", "half"])
async def order(dut, idle, stall, block):
    """All elements in order, and counted."""
    test = MaskTest(dut, idle, stall, block)
    await test.run(test.items, at_least=ITEMS)
    count, tokens = test.events.total, sum(item & splats.SPLAT_EOS != 0 for item in test.items)
    want = {"token": tokens, "splat": ITEMS - tokens, "busy": ITEMS, "rejected": 0, "tested": CHANNELS * (ITEMS - tokens)}
    assert {name: count[name] for name in want} == want
    assert count["idle"] + count["stalled"] + count["busy"] >= test.output.cycles - 1
    if (idle, stall, block) == ("never",) * 3:
        assert test.output.first - test.input.first == 1 and test.input.last - test.input.first == ITEMS - 1, "latency 1, one per cycle"


@cocotb.test()
@cocotb.parametrize(stall=stalls.PATTERNS)
async def clear_empties(dut, stall):
    """After clear_i nothing is inside, and what comes then leaves."""
    test = MaskTest(dut, stall=stall)
    await test.bench.reset()
    for part in range(0, ITEMS, 30):
        test.source.send(test.items[part : part + 30])
        await test.bench.until(lambda: test.input.count > part + 15, 3000, "traffic")
        await test.bench.clear()
        await FallingEdge(dut.clk_i)
        test.checker.drop()
        assert dut.out_valid_o.value == 0 and dut.idle_o.value == 1
        await test.bench.until(lambda: not test.source.pending and not test.checker.outstanding, 3000, "rest")
    test.checker.finish(ITEMS // 3)
