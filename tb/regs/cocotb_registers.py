"""Tests of flk_registers; what to expect of a register follows from its description (config)."""

from __future__ import annotations

import itertools
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge
from cocotbext.axi import AxiLiteBus, AxiLiteMaster, AxiResp
from flicker_tb.bench import Bench, config, rounds

SETTINGS = config()


class Word:
    """A register, or an element of an array of them."""

    def __init__(self, register: dict[str, Any], number: int) -> None:
        self.address = register["offset"] + 4 * number
        self.path = register["name"] + (f"[{number}]" if register["count"] > 1 else "")
        self.fields = register["fields"]

    def mask(self, *kinds: str) -> int:
        """Bits of the fields that are all of these; `!kind`: not."""
        return sum(
            ((1 << f["width"]) - 1) << f["low"] for f in self.fields if all(bool(f[kind.lstrip("!")]) != kind.startswith("!") for kind in kinds)
        )

    @property
    def reset(self) -> int:
        return sum((f["reset"] or 0) << f["low"] for f in self.fields)


WORDS = [Word(register, i) for register in SETTINGS["registers"] for i in range(register["count"])]
BY_PATH = {word.path: word for word in WORDS}
STORED = [word for word in WORDS if word.mask("written", "read", "!clear")]
SIZE = 1024


class Registers:
    """The design with a manager, and what its registers hold."""

    def __init__(self, dut: Any, pauses: tuple[str, ...] = ("none",) * 5) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.inputs = 0
        dut.hwif_in.value = 0
        self.held = {word.path: word.reset & word.mask("written", "read", "!clear") for word in WORDS}
        self.master = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axil"), dut.clk_i, dut.rst_ni, reset_active_level=False)
        w, r = self.master.write_if, self.master.read_if
        for channel, pattern in zip((w.aw_channel, w.w_channel, w.b_channel, r.ar_channel, r.r_channel), pauses, strict=True):
            if pattern != "none":
                channel.set_pause_generator(self.pause(pattern))

    def pause(self, pattern: str) -> Any:
        length = 1 if pattern == "half" else 12
        while True:
            value = self.rng.random() < 0.5
            yield from itertools.repeat(value, self.rng.randint(1, length))

    def drive(self, path: str, value: int) -> None:
        at, bits = SETTINGS["in"][path]
        assert value >> bits == 0
        self.inputs = self.inputs & ~(((1 << bits) - 1) << at) | value << at
        self.dut.hwif_in.value = self.inputs

    def output(self, path: str) -> int:
        at, bits = SETTINGS["out"][path]
        return int(self.dut.hwif_out.value) >> at & ((1 << bits) - 1)

    def expected(self, word: Word) -> int:
        """What a read gives, but for interrupts."""
        value = self.held[word.path] | word.reset & ~word.mask("written")
        for f in word.fields:
            if f["from_hardware"] and not f["interrupt"]:
                at, bits = SETTINGS["in"][f"{word.path}.{f['name']}.next"]
                value |= (self.inputs >> at & ((1 << bits) - 1)) << f["low"]
        return value

    async def read(self, address: int, resp: AxiResp = AxiResp.OKAY) -> int:
        answer = await self.master.read(address, 4)
        assert answer.resp == resp, f"0x{address:03x}: {answer.resp}"
        return int.from_bytes(answer.data, "little")

    async def write(self, address: int, value: int, first: int = 0, size: int = 4, resp: AxiResp = AxiResp.OKAY) -> None:
        """`size` bytes from byte `first` of the word."""
        data = value.to_bytes(4, "little")[first : first + size]
        answer = await self.master.write(address + first, data)
        assert answer.resp == resp, f"0x{address:03x}: {answer.resp}"

    def note(self, word: Word, value: int, first: int = 0, size: int = 4, locked: bool = False) -> None:
        mask = word.mask("written", "read", "!clear") & ((1 << 8 * size) - 1) << 8 * first
        if locked:
            mask &= ~word.mask("locked")
        self.held[word.path] = self.held[word.path] & ~mask | value & mask

    async def check(self, what: str) -> None:
        for word in self.rng.sample(WORDS, len(WORDS)):
            got = await self.read(word.address)
            assert got == self.expected(word), f"{what}: {word.path} is {got:08x}, not {self.expected(word):08x}"
        await FallingEdge(self.dut.clk_i)
        for word in WORDS:
            for f in word.fields:
                if f["to_hardware"] and not f["interrupt"]:
                    value = self.held[word.path] >> f["low"] & ((1 << f["width"]) - 1)
                    assert self.output(f"{word.path}.{f['name']}.value") == value, f"{what}: hwif_out of {word.path}.{f['name']}"

    def random_inputs(self) -> None:
        for word in WORDS:
            for f in word.fields:
                if f["from_hardware"] and not f["interrupt"]:
                    self.drive(f"{word.path}.{f['name']}.next", self.rng.getrandbits(f["width"]))


@cocotb.test()
async def reset_values(dut: Any) -> None:
    """After reset, with what hardware drives, and again after all was written and reset came."""
    regs = Registers(dut)
    regs.random_inputs()
    await regs.bench.reset()
    await regs.check("after reset")
    for word in WORDS:
        await regs.write(word.address, 0xFFFFFFFF)
        regs.note(word, 0xFFFFFFFF)
    await regs.check("all ones")
    regs.random_inputs()
    await regs.bench.reset()
    regs.held = {word.path: word.reset & word.mask("written", "read", "!clear") for word in WORDS}
    await regs.check("after the second reset")


async def _traffic(dut: Any, pauses: tuple[str, ...]) -> None:
    regs = Registers(dut, pauses)
    await regs.bench.reset()
    for turn in range(rounds(2, 4)):
        regs.random_inputs()
        for word in regs.rng.sample(WORDS, len(WORDS)):
            value, first = regs.rng.getrandbits(32), regs.rng.randrange(4)
            size = regs.rng.randint(1, 4 - first)
            if regs.rng.random() < 0.5:
                first, size = 0, 4
            # A read of another register beside the write.
            other = regs.rng.choice([w for w in WORDS if w is not word])
            read = cocotb.start_soon(regs.read(other.address))
            await regs.write(word.address, value, first, size)
            regs.note(word, value, first, size)
            assert await read == regs.expected(other), other.path
        await regs.check(f"turn {turn}")


@cocotb.test()
async def write_and_read(dut: Any) -> None:
    await _traffic(dut, ("none",) * 5)


@cocotb.test()
async def write_and_read_with_pauses(dut: Any) -> None:
    for pauses in (("half",) * 5, ("bursts", "none", "half", "none", "bursts"), ("none", "bursts", "bursts", "half", "half")):
        await _traffic(dut, pauses)


@cocotb.test()
async def many_under_way(dut: Any) -> None:
    """Reads and writes queued without waiting: answers are each request's own, in order."""
    regs = Registers(dut, ("half", "none", "bursts", "half", "bursts"))
    await regs.bench.reset()
    for word in STORED:
        value = regs.rng.getrandbits(32)
        await regs.write(word.address, value)
        regs.note(word, value)
    chosen = [regs.rng.choice(WORDS) for _ in range(200)]
    expected = [regs.expected(word) for word in chosen]
    tasks = [cocotb.start_soon(regs.read(word.address)) for word in chosen]
    writes = [cocotb.start_soon(regs.write(word.address, regs.held[word.path])) for word in regs.rng.choices(STORED, k=100)]
    assert [await task for task in tasks] == expected
    for task in writes:
        await task
    await regs.check("at the end")


@cocotb.test()
async def no_register(dut: Any) -> None:
    """Words without a register answer with an error, read as 0 and change nothing."""
    regs = Registers(dut)
    await regs.bench.reset()
    for word in STORED:
        value = regs.rng.getrandbits(32)
        await regs.write(word.address, value)
        regs.note(word, value)
    empty = sorted(set(range(0, SIZE, 4)) - {word.address for word in WORDS})
    assert len(empty) + len(WORDS) == SIZE // 4
    for address in empty:
        await regs.write(address, regs.rng.getrandbits(32), resp=AxiResp.SLVERR)
        assert await regs.read(address, AxiResp.SLVERR) == 0
    await regs.check("after writes beside the registers")


@cocotb.test()
async def lock(dut: Any) -> None:
    """While descriptor_locked, writes to the descriptor answer OKAY and are ignored; all else is written."""
    regs = Registers(dut)
    await regs.bench.reset()
    assert any(word.mask("locked") for word in WORDS) and any(word.mask("written", "!locked") for word in WORDS)
    for turn in range(4):
        regs.drive("descriptor_locked", turn & 1)
        for word in regs.rng.sample(STORED, len(STORED)):
            value = regs.rng.getrandbits(32)
            await regs.write(word.address, value)
            regs.note(word, value, locked=bool(turn & 1))
        await regs.check(f"locked: {turn & 1}")


@cocotb.test()
async def commands(dut: Any) -> None:
    """Each written 1 is a pulse of one cycle; 0, and the bits of other bytes, are none."""
    regs = Registers(dut)
    await regs.bench.reset()
    pulses = [(word, f) for word in WORDS for f in word.fields if f["pulse"]]
    assert pulses
    seen = dict.fromkeys((f"{word.path}.{f['name']}.value" for word, f in pulses), 0)

    async def count() -> None:
        while True:
            await FallingEdge(dut.clk_i)
            for path in seen:
                seen[path] += regs.output(path)

    cocotb.start_soon(count())
    expected = dict(seen)
    for word in {word.path: word for word, _ in pulses}.values():
        for _ in range(40):
            value, first = regs.rng.getrandbits(32), regs.rng.randrange(2)
            await regs.write(word.address, value, first, 2)
            for f in word.fields:
                if first <= f["low"] // 8 < first + 2:
                    expected[f"{word.path}.{f['name']}.value"] += value >> f["low"] & 1
            assert await regs.read(word.address) == 0
            await regs.bench.cycles(3)
            assert seen == expected
    assert all(seen.values())


@cocotb.test()
async def interrupts(dut: Any) -> None:
    """Pulses in any cycle, also in that of a clear; the output is 1 while an enabled one waits."""
    regs = Registers(dut, ("half", "none", "none", "half", "none"))
    await regs.bench.reset()
    word, enable = BY_PATH["interrupt"], BY_PATH["interrupt_enable"]
    names = [f["name"] for f in word.fields]
    assert names == [f["name"] for f in enable.fields] and all(f["interrupt"] and f["clear"] for f in word.fields)
    # One after the other: every bit alone, cleared alone, enabled alone.
    for f in word.fields:
        bit = 1 << f["low"]
        await regs.write(enable.address, bit)
        assert regs.output("interrupt.intr") == 0
        regs.drive(f"interrupt.{f['name']}.next", 1)
        await regs.bench.cycles(1)
        regs.drive(f"interrupt.{f['name']}.next", 0)
        await regs.bench.cycles(1)
        assert await regs.read(word.address) == bit and regs.output("interrupt.intr") == 1
        for other in range(32):
            await regs.write(enable.address, 1 << other)
            await regs.bench.cycles(1)
            assert regs.output("interrupt.intr") == (1 << other == bit)
        await regs.write(word.address, 0xFFFFFFFF & ~bit)
        assert await regs.read(word.address) == bit
        regs.drive(f"interrupt.{f['name']}.next", 1)  # an event in the cycle of the clear wins
        await regs.write(word.address, bit)
        assert await regs.read(word.address) == bit
        regs.drive(f"interrupt.{f['name']}.next", 0)
        await regs.write(word.address, bit)
        await regs.bench.cycles(1)
        assert await regs.read(word.address) == 0 and regs.output("interrupt.intr") == 0
    # A pulse of one bit in every cycle around a clear of another: none is lost.
    for f, other in itertools.permutations(word.fields, 2):
        for delay in range(8):
            task = cocotb.start_soon(regs.write(word.address, 1 << other["low"]))
            await regs.bench.cycles(1 + delay)
            regs.drive(f"interrupt.{f['name']}.next", 1)
            await RisingEdge(dut.clk_i)
            regs.drive(f"interrupt.{f['name']}.next", 0)
            await task
            await regs.bench.cycles(1)
            assert await regs.read(word.address) == 1 << f["low"], f"{f['name']} while {other['name']} is cleared"
            await regs.write(word.address, 0xFFFFFFFF)
