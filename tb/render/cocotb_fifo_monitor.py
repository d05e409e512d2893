"""cocotb test of the FIFO monitor: combinational, all inputs; setting: MaskBits."""

from __future__ import annotations

import itertools
import random

import cocotb
from cocotb.triggers import Timer
from flicker_tb.bench import config

from flicker.params import CHANNELS

ALL = range(16)
BITS = config()["MaskBits"] // CHANNELS  # of a mini-tile


def mask_bits(rng: random.Random, mask: int) -> int:
    """A generator's mask that means these mini-tiles: with 64 bits any pixels of each, one or more."""
    chosen = (rng.choice((1 << rng.randrange(BITS), rng.randrange(1, 1 << BITS), (1 << BITS) - 1)) for _ in range(CHANNELS))
    return sum(bits << BITS * m for m, bits in enumerate(chosen) if mask >> m & 1)


@cocotb.test()
async def every_input(dut):
    """Dispatch and stall rule for every combination of mask, ready, finished, token and valid."""
    seen = set()
    rng = random.Random(random.getrandbits(64))
    for valid, eos, mask, ready, finished in itertools.product((0, 1), (0, 1), range(1, 16), ALL, ALL):
        if eos and mask != 15:
            continue
        dut.in_valid_i.value = valid
        dut.in_eos_i.value = eos
        dut.in_mask_i.value = (1 << config()["MaskBits"]) - 1 if eos else mask_bits(rng, mask)
        dut.ready_i.value = ready
        dut.finished_i.value = finished
        await Timer(1, unit="ns")
        # A token goes everywhere; a splat to the unfinished channels of its mask, to all of them at once.
        target = 15 if eos else mask & ~finished
        can = target & ~ready == 0
        write = target if valid and can else 0
        splat = valid and can and not eos
        delivered = write.bit_count() if splat else 0
        filtered = (mask & finished).bit_count() if splat else 0
        got = (int(dut.in_ready_o.value), int(dut.write_o.value), int(dut.stall_o.value), int(dut.events_o.value))
        want = (int(can), write, int(ready != 15), delivered << 3 | filtered)
        assert got == want, f"valid={valid} eos={eos} mask={mask:04b} ready={ready:04b} finished={finished:04b}: {got}, wanted {want}"
        seen.add(want)
    assert len(seen) > 50
