"""cocotb test of flk_mean_field and flk_shape_field against the golden model's fields."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import Timer
from flicker_tb.bench import config

from flicker.arithmetic.ff import ff_value
from flicker.golden.front.record import encode_mean, encode_shape
from flicker.golden.front.setup import FORMATS

TOP = config()["top"]


async def field(dut, bits: int) -> int:
    dut.x_i.value = bits
    await Timer(1, unit="ns")
    return int(dut.field_o.value)


@cocotb.test(skip=TOP != "flk_mean_field")
async def means(dut):
    """Every length of number, beside powers of two and of four, both signs."""
    width, rng = len(dut.x_i), random.Random(cocotb.RANDOM_SEED)
    top = 1 << (width - 1)
    values = [s * ((1 << k) + d) for k in range(width) for d in range(-3, 4) for s in (1, -1)]
    values += [rng.getrandbits(rng.randint(1, width - 1)) * rng.choice([1, -1]) for _ in range(2000)]
    for x in filter(lambda v: -top <= v < top, values):
        assert await field(dut, x & 2 * top - 1) == encode_mean(x), x


@cocotb.test(skip=TOP != "flk_shape_field")
async def shapes(dut):
    """Every exponent with mantissas that round up, down and to even; the sign does not matter."""
    man = FORMATS.shape
    for exponent in range(1, 255):
        for mantissa in [*range(8), *range((1 << man) - 8, 1 << man)]:
            code = exponent << man | mantissa
            due = encode_shape(ff_value(code, man))
            assert await field(dut, code) == due, hex(code)
            assert await field(dut, 1 << (8 + man) | code) == due, hex(code)
    assert await field(dut, 0) == 0
