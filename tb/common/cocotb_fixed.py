"""cocotb tests of the conversions between FP16, fixed point and E4M3."""

from __future__ import annotations

import random

import cocotb
import numpy as np
from cocotb.triggers import Timer

from flicker.arithmetic.formats import E4M3
from flicker.golden.cat import FIXED_SCALE, fixed_mean
from flicker.params import FIXED_FRAC_BITS, FIXED_INT_BITS


@cocotb.test()
async def to_fixed(dut):
    """Every exponent and sign with mantissas of few bits set, ends of the range, random ones."""
    rng = random.Random(random.getrandbits(64))
    mantissas = {0, 1, 2, 3, 0x1FF, 0x200, 0x201, 0x3FE, 0x3FF} | {1 << i for i in range(10)} | {3 << i for i in range(9)}
    codes = {high << 10 | man for high in range(64) for man in mantissas} | {rng.getrandbits(16) for _ in range(5000)}
    for code in sorted(codes):
        value = np.float32(np.uint16(code).view(np.float16))
        dut.src_i.value = code
        await Timer(1, unit="ns")
        want = fixed_mean(value)
        got = int(dut.mag_o.value)
        assert got == abs(float(want)) * float(FIXED_SCALE), f"{code:04x}: {got}, model {want * FIXED_SCALE}"
        assert int(dut.sign_o.value) == code >> 15, f"{code:04x}: sign"


@cocotb.test()
async def to_e4m3(dut):
    """Every power of two with its neighbours and midpoints, all small magnitudes, random ones; both signs."""
    rng = random.Random(random.getrandbits(64))
    bits = FIXED_INT_BITS + FIXED_FRAC_BITS + 1
    magnitudes = set(range(256)) | {rng.getrandbits(bits) >> rng.randrange(bits) for _ in range(3000)}
    for top in range(bits):
        for sixteenth in range(16):
            middle = (1 << top) + ((sixteenth << top) >> 4)
            magnitudes |= {m for m in (middle - 1, middle, middle + 1) if 0 <= m < 1 << bits}
    exact = np.array(sorted(magnitudes), np.float64) / 2**FIXED_FRAC_BITS
    codes = E4M3.encode(exact).astype(int)
    saturated = 0
    for magnitude, want in zip(sorted(magnitudes), codes.tolist()):
        for sign in (0, 1):
            dut.sign_i.value, dut.mag_i.value = sign, magnitude
            await Timer(1, unit="ns")
            expected = want | (sign << 7 if magnitude else 0)
            got = int(dut.dst_o.value)
            assert got == expected, f"{'-' if sign else ''}{magnitude}: {got:02x}, model {expected:02x}"
        saturated += want == 0x7E
    assert saturated > 100
