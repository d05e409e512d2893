"""Tests of flk_registers; what to expect of a register follows from its description (config)."""

from __future__ import annotations

import itertools
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer
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
    for turn in range(rounds(1, 4)):
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


PIN = "s_axil_{}"


class Pins:
    """The five channels, driven pin by pin: what a manager of any make may do."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        dut.hwif_in.value = 0
        for name in ("awvalid", "wvalid", "arvalid"):
            self.pin(name).value = 0
        for name in ("bready", "rready"):
            self.pin(name).value = 1
        self.answers: list[tuple[str, int, int]] = []
        cocotb.start_soon(self._watch())

    def pin(self, name: str) -> Any:
        return getattr(self.dut, PIN.format(name))

    async def _watch(self) -> None:
        while True:
            await RisingEdge(self.dut.clk_i)
            for channel, data in (("b", None), ("r", "rdata")):
                if int(self.pin(f"{channel}valid").value) and int(self.pin(f"{channel}ready").value):
                    self.answers.append((channel, int(self.pin(f"{channel}resp").value), int(self.pin(data).value) if data else 0))

    async def send(self, channel: str, after: int, **values: int) -> None:
        """A transfer that is offered `after` cycles from now; its pins hold noise before and behind."""
        await self.bench.cycles(after)
        for name, value in values.items():
            self.pin(name).value = value
        self.pin(f"{channel}valid").value = 1
        while True:
            await RisingEdge(self.dut.clk_i)
            if int(self.pin(f"{channel}ready").value):
                break
        self.pin(f"{channel}valid").value = 0
        for name in values:
            self.pin(name).value = self.rng.getrandbits(len(self.pin(name)))

    async def write(self, address: int, data: int, strobes: int, first: str) -> None:
        """first: the channel that goes first, by up to 6 cycles; `both`: neither."""
        ahead = 0 if first == "both" else self.rng.randint(1, 6)
        address_at, data_at = (0, ahead) if first == "aw" else (ahead, 0)
        tasks = [
            cocotb.start_soon(self.send("aw", address_at, awaddr=address, awprot=self.rng.getrandbits(3))),
            cocotb.start_soon(self.send("w", data_at, wdata=data, wstrb=strobes)),
        ]
        for task in tasks:
            await task

    async def read(self, address: int) -> None:
        await self.send("ar", 0, araddr=address, arprot=self.rng.getrandbits(3))

    async def settle(self, count: int) -> None:
        await self.bench.until(lambda: len(self.answers) >= count, 50, "answers")
        await self.bench.cycles(4)
        assert len(self.answers) == count, "an answer that nobody waits for"


@cocotb.test()
async def any_order_address_and_protection(dut: Any) -> None:
    """Address before data, behind or with them; the low two bits of addresses and all of PROT are not looked at; any strobes, none too."""
    pins = Pins(dut)
    await pins.bench.reset()
    held = {word.path: word.reset & word.mask("written", "read", "!clear") for word in STORED}
    seen = set()
    for turn in range(rounds(150, 1000)):
        word, data, strobes = pins.rng.choice(STORED), pins.rng.getrandbits(32), pins.rng.getrandbits(4)
        first, low = pins.rng.choice(("aw", "w", "both")), pins.rng.randrange(4)
        await pins.write(word.address + low, data, strobes, first)
        await pins.settle(2 * turn + 1)
        mask = word.mask("written", "read", "!clear") & sum(255 << 8 * k for k in range(4) if strobes >> k & 1)
        held[word.path] = held[word.path] & ~mask | data & mask
        await pins.read(word.address + pins.rng.randrange(4))
        await pins.settle(2 * turn + 2)
        assert pins.answers[-2] == ("b", 0, 0), pins.answers[-2]
        assert pins.answers[-1] == ("r", 0, held[word.path] | word.reset & ~word.mask("written")), (word.path, first, low, strobes)
        seen.add((first, low))
    assert len(seen) == 12


@cocotb.test()
async def answers_wait_for_each_other(dut: Any) -> None:
    """Two accesses are answered later, in the order in which they were decoded: an answer that is not taken holds up those of the other kind."""
    pins = Pins(dut)
    await pins.bench.reset()
    for held, other in (("b", "r"), ("r", "b")):
        pins.answers.clear()
        pins.pin(f"{held}ready").value = 0
        accesses = {"b": lambda: pins.write(STORED[0].address, 0, 15, "both"), "r": lambda: pins.read(0)}
        await accesses[held]()
        await pins.bench.cycles(6)
        await accesses[other]()
        await pins.bench.cycles(20)
        assert int(pins.pin(f"{held}valid").value) and not int(pins.pin(f"{other}valid").value) and not pins.answers
        pins.pin(f"{held}ready").value = 1
        await pins.settle(2)
        assert [channel for channel, *_ in pins.answers] == [held, other]


@cocotb.test()
async def outputs_come_from_registers(dut: Any) -> None:
    """No input of the port reaches an output within the cycle, in any state of the five channels."""
    pins = Pins(dut)
    await pins.bench.reset()
    inputs = ("awvalid", "awaddr", "wvalid", "wdata", "wstrb", "arvalid", "araddr", "bready", "rready")
    outputs = ("awready", "wready", "arready", "bvalid", "bresp", "rvalid", "rdata", "rresp")
    states = set()
    for _ in range(400):
        await FallingEdge(dut.clk_i)
        before = [int(pins.pin(name).value) for name in outputs]
        for name in inputs:
            pins.pin(name).value = pins.rng.getrandbits(len(pins.pin(name)))
        await Timer(1, unit="ns")
        assert [int(pins.pin(name).value) for name in outputs] == before
        states.add(tuple(before[k] for k in (0, 1, 2, 3, 5)))
    assert len(states) > 10, states
