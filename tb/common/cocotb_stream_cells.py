"""cocotb tests of the stream cells with one input: pipe register, skid buffer, FIFO."""

import cocotb
from flicker_tb import stalls
from flicker_tb.bench import StreamTest, config


@cocotb.test()
@cocotb.parametrize(idle=stalls.PATTERNS, stall=stalls.PATTERNS)
async def order(dut, idle, stall):
    """Every element comes out once, in order, whatever the stalls."""
    test = StreamTest(dut, lambda item: [item], idle=idle, stall=stall)
    width = len(dut.in_data_i)
    await test.run([test.bench.rng.getrandbits(width) for _ in range(300)], at_least=300)
