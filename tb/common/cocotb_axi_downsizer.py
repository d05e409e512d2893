"""cocotb tests of flk_axi_downsizer: managers in Python on its wide side, a memory that checks AXI4 on its port."""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass, field

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench, rounds

from flicker.chip.dram import DramConfig, port_config
from flicker.sim.memory import Memory, Order, PortConfig, Resp, WriteOrder

READ_BASE, WRITE_BASE, SIZE, PAGE = 0x8000, 0x80000, 0x8000, 4096


@dataclass
class Burst:
    """given: beats that came of a read. resp: the worst that is due."""

    id: int
    addr: int
    beats: int
    size: int
    qos: int
    data: list[tuple[int, int]] = field(default_factory=list)  # of a write: beat, strobes
    given: int = 0
    resp: int = 0


class Managers:
    """The wide side. read_queue, write_queue: what is asked for next; golden: contents of the region that is written."""

    def __init__(self, dut, idle: str) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.bytes = int(dut.Width.value) // 8
        self.port_bytes = int(dut.PortBits.value) // 8
        self.own, self.used = int(dut.OwnBits.value), int(dut.UsedBits.value)
        self.id_bits = int(dut.IdBits.value)
        self.idle = {name: self.bench.stall(idle) for name in ("ar", "aw", "w")}
        self.reads: deque[Burst] = deque()
        self.writes: deque[Burst] = deque()
        self.data: deque[Burst] = deque()  # whose data are not all given
        self.asked: dict[int, deque[Burst]] = defaultdict(deque)  # reads under way by identifier
        self.owed: dict[int, deque[Burst]] = defaultdict(deque)  # writes, likewise
        self.expected_ar: deque[tuple[int, ...]] = deque()  # at the port
        self.expected_aw: deque[tuple[int, ...]] = deque()
        self.shown = {"ar": False, "aw": False, "w": False}
        self.sent = 0
        self.golden = bytearray(SIZE)
        self.contents = b""
        self.beats = self.port_beats = self.cycles = 0
        for name in ("ar", "aw"):
            for pin in ("valid", "id", "addr", "len", "size", "burst", "qos"):
                getattr(dut, f"in_{name}_{pin}_i").value = 0
        dut.in_w_valid_i.value = dut.in_w_data_i.value = dut.in_w_strb_i.value = dut.in_w_last_i.value = 0
        dut.in_b_ready_i.value = 1
        dut.clear_i.value = 0

    def identifier(self) -> int:
        return self.rng.getrandbits(self.id_bits - self.own) << self.own | self.rng.getrandbits(self.used)

    def make_reads(self, count: int, longest: int | None = None) -> None:
        longest = longest or min(PAGE, 256 * self.port_bytes) // self.bytes
        full = self.bytes.bit_length() - 1
        for _ in range(count):
            size = self.rng.choice([full, full, self.rng.randint(self.port_bytes.bit_length() - 1, full)])
            beats = self.rng.choice([1, 1, longest, self.rng.randint(1, longest)]) if size == full else 1
            at = self.rng.randrange(PAGE // (1 << size) - beats + 1) << size
            addr = READ_BASE + self.rng.randrange(SIZE // PAGE) * PAGE + at
            self.reads.append(Burst(self.identifier(), addr, beats, size, self.rng.getrandbits(4)))

    def make_writes(self, count: int, longest: int = 8) -> None:
        """Apart from each other."""
        at = 0
        full = (1 << self.bytes) - 1
        for _ in range(count):
            beats = self.rng.choice([1, 1, self.rng.randint(1, longest)])
            if at % PAGE + beats * self.bytes > PAGE:
                at += PAGE - at % PAGE
            if at + beats * self.bytes > SIZE:
                break
            data = [(self.rng.getrandbits(8 * self.bytes), self.rng.choice([full, full, self.rng.getrandbits(self.bytes), 0])) for _ in range(beats)]
            burst = Burst(self.identifier(), WRITE_BASE + at, beats, self.bytes.bit_length() - 1, self.rng.getrandbits(4), data)
            self.writes.append(burst)
            self.data.append(burst)
            at += beats * self.bytes

    @property
    def busy(self) -> bool:
        return bool(self.reads or self.writes or self.data or any(self.asked.values()) or any(self.owed.values()))

    def forget(self) -> None:
        for queue in (self.reads, self.writes, self.data, self.asked, self.owed, self.expected_ar, self.expected_aw):
            queue.clear()
        self.shown = dict.fromkeys(self.shown, False)
        self.sent = 0
        self.drive()

    def start(self) -> None:
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        edge = RisingEdge(self.dut.clk_i)
        while True:
            await edge
            if self.dut.rst_ni.value == 1 and self.dut.clear_i.value == 0:
                self.sample()
            self.drive()

    def port(self, burst: Burst) -> tuple[int, ...]:
        """What the port is asked for."""
        beats = burst.beats * (1 << burst.size) // self.port_bytes
        size = self.port_bytes.bit_length() - 1
        if self.port_bytes == self.bytes:  # wires
            beats, size = burst.beats, burst.size
        return burst.id, burst.addr, beats - 1, size, 1, burst.qos

    def sample(self) -> None:
        dut = self.dut
        self.cycles += 1
        for name, queue, expected in (("ar", self.reads, self.expected_ar), ("aw", self.writes, self.expected_aw)):
            if self.shown[name] and getattr(dut, f"in_{name}_ready_o").value == 1:
                burst = queue.popleft()
                self.shown[name] = False
                (self.asked if name == "ar" else self.owed)[burst.id].append(burst)
                expected.append(self.port(burst))
            if getattr(dut, f"{name}_valid_o").value == 1 and getattr(dut, f"{name}_ready_i").value == 1:
                seen = tuple(int(getattr(dut, f"{name}_{pin}_o").value) for pin in ("id", "addr", "len", "size", "burst", "qos"))
                assert expected and seen == expected.popleft(), f"{name} {seen}"
        if self.shown["w"] and dut.in_w_ready_o.value == 1:
            self.shown["w"] = False
            burst = self.data[0]
            self.sent += 1
            if self.sent == burst.beats:
                self.data.popleft()
                self.sent = 0
                self.write(burst)
        self.port_beats += int(dut.r_valid_i.value)
        assert dut.r_ready_o.value == 1
        if dut.in_r_valid_o.value == 1:
            self.beat()
        if dut.in_b_valid_o.value == 1:
            waiting = self.owed[int(dut.in_b_id_o.value)]
            assert waiting, "a response that nobody waits for"
            assert int(dut.in_b_resp_o.value) == waiting.popleft().resp

    def write(self, burst: Burst) -> None:
        for k, (value, strobes) in enumerate(burst.data):
            at = burst.addr - WRITE_BASE + k * self.bytes
            for b in range(self.bytes):
                if strobes >> b & 1 and not burst.resp:
                    self.golden[at + b] = value >> 8 * b & 255

    def beat(self) -> None:
        dut = self.dut
        self.beats += 1
        waiting = self.asked[int(dut.in_r_id_o.value)]
        assert waiting, "a beat that nobody asked for"
        burst = waiting[0]
        step = 1 << burst.size
        at = burst.addr + burst.given * step
        burst.given += 1
        assert int(dut.in_r_last_o.value) == (burst.given == burst.beats)
        resp = int(dut.in_r_resp_o.value)
        assert resp == burst.resp, f"response {resp}, due {burst.resp}"
        if not resp:
            data = int(dut.in_r_data_o.value).to_bytes(self.bytes, "little")
            lane = at % self.bytes
            due = self.contents[at - READ_BASE : at - READ_BASE + step]
            assert data[lane : lane + step] == due, f"beat {burst.given - 1} of {burst}: {data.hex()}"
            if self.port_bytes < self.bytes:
                assert data == due * (self.bytes // step)
        if burst.given == burst.beats:
            waiting.popleft()

    def drive(self) -> None:
        dut, rng = self.dut, self.rng
        for name, queue in (("ar", self.reads), ("aw", self.writes)):
            self.shown[name] = bool(queue) and (self.shown[name] or not next(self.idle[name]))
            burst = queue[0] if self.shown[name] else None
            getattr(dut, f"in_{name}_valid_i").value = int(burst is not None)
            values = None if burst is None else (burst.id, burst.addr, burst.beats - 1, burst.size, 1, burst.qos)
            for k, pin in enumerate(("id", "addr", "len", "size", "burst", "qos")):
                signal = getattr(dut, f"in_{name}_{pin}_i")
                signal.value = rng.getrandbits(len(signal)) if values is None else values[k]
        # Data of a burst come with its address or later, as the arbiter has it.
        self.shown["w"] = bool(self.data) and (self.shown["w"] or not next(self.idle["w"]))
        value, strobes = self.data[0].data[self.sent] if self.shown["w"] else (rng.getrandbits(8 * self.bytes), rng.getrandbits(self.bytes))
        dut.in_w_valid_i.value = int(self.shown["w"])
        dut.in_w_data_i.value, dut.in_w_strb_i.value = value, strobes
        dut.in_w_last_i.value = int(self.sent + 1 == self.data[0].beats) if self.shown["w"] else rng.getrandbits(1)


def memory_of(test: Managers, dut, config: PortConfig, dram: bool) -> MemoryPort:
    memory = Memory(DramConfig().timing, perfect=not dram)
    memory.allocate(READ_BASE, SIZE, noise=7)
    memory.allocate(WRITE_BASE, SIZE)
    test.contents = memory.read(READ_BASE, SIZE)
    return MemoryPort(dut, memory, config)


STALLS = [{}, dict.fromkeys(("AW", "W", "B", "AR", "R"), 0.4), {"R": 0.8}, {"W": 0.8, "AW": 0.5}]
CASES = [
    ("never", Order.IN_ORDER, WriteOrder.ANY, 0, False), ("half", Order.INTERLEAVED, WriteOrder.ADDRESS_FIRST, 1, False),
    ("bursts", Order.BY_ID, WriteOrder.DATA_FIRST, 2, False), ("never", Order.INTERLEAVED, WriteOrder.ANY, 3, True),
    ("half", Order.WHOLE, WriteOrder.ANY, 0, True),
]


def options(test: Managers, order: Order, write_order: WriteOrder, stall: int, dram: bool) -> PortConfig:
    common = {
        "data_bits": 8 * test.port_bytes, "id_bits": test.id_bits, "order": order, "write_order": write_order, "stall": STALLS[stall], "hazards": False,
        "seed": test.rng.getrandbits(30),
    }
    return port_config(**common) if dram else PortConfig(latency=3, **common)


@cocotb.test()
@cocotb.parametrize((("idle", "order", "write_order", "stall", "dram"), CASES))
async def traffic(dut, idle, order, write_order, stall, dram):
    """Reads and writes at once."""
    test = Managers(dut, idle)
    port = memory_of(test, dut, options(test, order, write_order, stall, dram), dram)
    test.start()
    await test.bench.reset()
    test.make_reads(rounds(40, 150))
    test.make_writes(rounds(25, 100))
    await test.bench.until(lambda: not test.busy, 200_000, "last answer")
    assert port.port.idle and not test.expected_ar and not test.expected_aw
    assert port.memory.read(WRITE_BASE, SIZE) == bytes(test.golden)


@cocotb.test()
async def rate(dut):
    """A beat of the port in every cycle, of reads and of writes."""
    test = Managers(dut, "never")
    memory_of(test, dut, PortConfig(latency=1, data_bits=8 * test.port_bytes, id_bits=test.id_bits, hazards=False), False)
    test.start()
    await test.bench.reset()
    parts = test.bytes // test.port_bytes
    for k in range(16):
        test.reads.append(Burst(0, READ_BASE + 8 * k * test.bytes, 8, test.bytes.bit_length() - 1, 0))
    await test.bench.until(lambda: not test.busy, 2000, "last answer")
    assert test.beats == 128 and 128 * parts <= test.cycles <= 128 * parts + 16
    test.cycles = 0
    test.make_writes(60)
    beats = sum(burst.beats for burst in test.writes)
    await test.bench.until(lambda: not test.busy, 4000, "last answer")
    assert beats * parts <= test.cycles <= beats * parts + 16


@cocotb.test()
async def errors(dut):
    """The worst response of a burst's parts, and of no other's."""
    test = Managers(dut, "half")
    port = memory_of(test, dut, options(test, Order.INTERLEAVED, WriteOrder.ANY, 1, False), False)
    test.start()
    await test.bench.reset()
    test.make_reads(rounds(30, 60))
    test.make_writes(rounds(20, 40))
    for queue, fail in ((test.reads, port.port.fail_read), (test.writes, port.port.fail_write)):
        for k in test.rng.sample(range(len(queue)), 12):
            queue[k].resp = int(test.rng.choice([Resp.SLVERR, Resp.DECERR]))
            fail(k, Resp(queue[k].resp))
    await test.bench.until(lambda: not test.busy, 60_000, "last answer")
    assert port.memory.read(WRITE_BASE, SIZE) == bytes(test.golden)


@cocotb.test()
async def parts_that_fail(dut):
    """The worst response of the parts of one beat, whichever of them it is; the next beat of the identifier has its own."""
    test = Managers(dut, "never")
    await test.bench.reset()
    parts = test.bytes // test.port_bytes
    dut.ar_ready_i.value = dut.aw_ready_i.value = dut.w_ready_i.value = 1
    dut.b_valid_i.value = 0
    for _ in range(40):
        resp = [test.rng.choice([0, 0, 0, 2, 3]) for _ in range(parts)]
        data = [test.rng.getrandbits(8 * test.port_bytes) for _ in range(parts)]
        number = test.identifier()
        for k in range(parts):
            dut.r_valid_i.value, dut.r_id_i.value = 1, number
            dut.r_resp_i.value, dut.r_data_i.value, dut.r_last_i.value = resp[k], data[k], int(k == parts - 1)
            await RisingEdge(dut.clk_i)
            if parts > 1 or k:
                assert k == 0 or dut.in_r_valid_o.value == 0
        if parts > 1:
            dut.r_valid_i.value = 0
            await RisingEdge(dut.clk_i)
        assert dut.in_r_valid_o.value == 1 and int(dut.in_r_id_o.value) == number and int(dut.in_r_resp_o.value) == max(resp)
        assert int(dut.in_r_data_o.value) == sum(value << 8 * test.port_bytes * k for k, value in enumerate(data))


@cocotb.test()
async def clears(dut):
    """After a clear, with the memory in reset, nothing is left of what was under way."""
    test = Managers(dut, "half")
    config = options(test, Order.INTERLEAVED, WriteOrder.ANY, 1, False)
    port = memory_of(test, dut, config, False)
    test.start()
    await test.bench.reset()
    for _ in range(rounds(3, 6)):
        test.make_reads(60)
        test.make_writes(40)
        for _ in range(test.rng.randint(20, 300)):
            await RisingEdge(dut.clk_i)
        dut.clear_i.value, port.off = 1, True
        await RisingEdge(dut.clk_i)
        test.forget()
        for _ in range(4):
            await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        port.restart(config)
        test.golden[:] = port.memory.read(WRITE_BASE, SIZE)
        test.make_reads(10)
        test.make_writes(10)
        await test.bench.until(lambda: not test.busy, 30_000, "last answer")
        assert port.memory.read(WRITE_BASE, SIZE) == bytes(test.golden)
