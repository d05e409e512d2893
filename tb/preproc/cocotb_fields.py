"""cocotb test of flk_mean_field, flk_shape_field, flk_ff_to_fp16 and flk_opacity_to_fp16 against the golden model's fields."""

from __future__ import annotations

import random

import cocotb
import numpy as np
from cocotb.triggers import Timer
from flicker_tb.bench import config

from flicker.arithmetic.ff import ff_value
from flicker.golden.front.record import encode_mean, encode_shape, to_fp16
from flicker.golden.front.setup import FORMATS
from flicker.golden.front.to_splat import opacity_to_fp16

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


@cocotb.test(skip=TOP != "flk_ff_to_fp16")
async def halves(dut):
    """Every exponent, with mantissas that round up, down and to even wherever a subnormal number is cut; both signs, and zero."""
    man, rng = FORMATS.shape, random.Random(cocotb.RANDOM_SEED)
    mantissas = {(1 << k) + d & (1 << man) - 1 for k in range(man + 1) for d in (-1, 0, 1)} | {3 << k & (1 << man) - 1 for k in range(man)}
    codes = [0, *(exponent << man | m for exponent in range(1, 255) for m in [*mantissas, *(rng.getrandbits(man) for _ in range(20))])]
    for sign in (0, 1 << 8 + man):
        due = to_fp16(np.array([ff_value(sign | code, man) if code else 0.0 for code in codes])).view(np.uint16).tolist()
        for code, half in zip(codes, due):
            if code == 0 and sign:
                continue  # ff has one zero
            dut.x_i.value = sign | code
            await Timer(1, unit="ns")
            assert int(dut.y_o.value) == half, hex(sign | code)


@cocotb.test(skip=TOP != "flk_opacity_to_fp16")
async def opacities(dut):
    """Every code, by the integer model and by division."""
    for code in range(256):
        dut.code_i.value = code
        await Timer(1, unit="ns")
        got = int(dut.opacity_o.value)
        assert got == opacity_to_fp16(code) == int(np.float16(code / 255).view(np.uint16)), code
