"""cocotb tests of flk_axi_arbiter: managers in Python, a memory behind the port, a model of choice, drain and watch that is compared in every cycle."""

from __future__ import annotations

import random
from collections import Counter, defaultdict, deque
from dataclasses import dataclass, field

import cocotb
from cocotb.triggers import RisingEdge
from cocotb_priority_arbiter import PriorityModel
from flicker_tb.axi import MemoryPort, ram_read, ram_write
from flicker_tb.bench import Bench, combinations

from flicker.chip.dram import DramConfig, port_config
from flicker.sim.memory import Memory, Order, PortConfig, WriteOrder

READ_BASE, WRITE_BASE, SIZE = 0x8000, 0x80000, 0x8000
PAGE = 4096
NEVER = 1 << 30
# Pauses of managers, of the memory, orders; all of them with SLOW=1.
TRAFFIC = combinations(["never", "half"], [0.0, 0.5], Order, [True, False])
DRAINS = combinations(["never", "half"], [0.0, 0.5], WriteOrder)


@dataclass
class Burst:
    """Of a manager. data: of a write, (beat, strobes); sent: of them, taken. given: beats that came, or went to the port."""

    manager: int
    id: int
    addr: int
    beats: int
    size: int
    data: list[tuple[int, int]] = field(default_factory=list)
    given: int = 0
    sent: int = 0


class Side:
    """Managers of one kind: what they ask for, in order; who is offered; who waits for answers."""

    def __init__(self, test: ArbiterTest, count: int) -> None:
        self.count = count
        self.queue = [deque[Burst]() for _ in range(count)]
        self.shown = [False] * count  # the head of a queue is on the pins
        self.idle = [test.bench.stall(test.idle) for _ in range(count)]
        self.model = PriorityModel(count, test.patience)
        self.asked = defaultdict(deque)  # (manager, id) to bursts whose address was taken
        self.port = deque[Burst]()  # taken, not seen at the port
        self.under_way = 0
        self.grants = Counter[int]()

    def valid(self) -> int:
        return sum(shown << k for k, shown in enumerate(self.shown))


class ArbiterTest:
    """Drives managers, watches both sides. golden: contents from WRITE_BASE on. `hold`, `timeout` are driven, `stuck` is what is expected."""

    def __init__(self, dut, idle="never", timeout=0):
        self.dut, self.bench, self.idle = dut, Bench(dut), idle
        self.rng = self.bench.rng
        self.width, self.bits = int(dut.Width.value) // 8, int(dut.IdBits.value)
        self.patience, self.addr_bits = int(dut.Patience.value), int(dut.AddrBits.value)
        self.readers, self.writers = Side(self, len(dut.ar_valid_i)), Side(self, len(dut.aw_valid_i))
        self.read = None  # contents: address, bytes
        self.golden = bytearray(SIZE)
        self.base = 0
        self.writing = deque[Burst]()  # addresses taken, data not complete
        self.data_queue = [deque[Burst]() for _ in range(self.writers.count)]  # bursts whose data are not all given
        self.data_shown = [False] * self.writers.count
        self.data_idle = [self.bench.stall(idle) for _ in range(self.writers.count)]
        self.hold, self.clear, self.timeout = 0, 0, timeout  # from the next edge on
        self.held, self.cleared, self.limit = 0, 0, timeout  # in the cycle that is sampled
        self.still = 0
        self.stuck = False
        self.beat = None  # that the port gave in the cycle before: (id, data, resp, last)
        self.port_w = deque[tuple[int, int, int]]()
        self.size = (self.width - 1).bit_length()
        self.write_at = 0
        self.first_read = self.first_write = 0
        dut.hold_i.value, dut.clear_i.value, dut.timeout_i.value = 0, 0, timeout
        for name in ("ar", "aw"):
            for pin in ("valid", "id", "addr", "len", "size"):
                getattr(dut, f"{name}_{pin}_i").value = 0
        dut.w_valid_i.value = dut.w_data_i.value = dut.w_strb_i.value = 0

    def start(self):
        cocotb.start_soon(self.run())

    # ---- traffic ----

    def make_reads(self, count, narrow=True, longest=16):
        for _ in range(count):
            manager = self.rng.randrange(self.readers.count)
            size = self.rng.choice([self.size, self.size, self.rng.randrange(self.size + 1)]) if narrow else self.size
            beats = self.rng.choice([1, 1, self.rng.randint(1, longest)])
            step = 1 << size
            first = self.rng.randrange(PAGE // step - beats + 1) * step
            addr = self.first_read + self.rng.randrange(SIZE // PAGE) * PAGE + first
            self.readers.queue[manager].append(Burst(manager, self.rng.getrandbits(self.bits), addr, beats, size))

    def make_writes(self, count, longest=16):
        """Apart from each other until the region's end; then from its beginning again: nothing may be under way by then."""
        for _ in range(count):
            manager = self.rng.randrange(self.writers.count)
            beats = self.rng.choice([1, 1, self.rng.randint(1, longest)])
            if self.write_at % PAGE + beats * self.width > PAGE:
                self.write_at += PAGE - self.write_at % PAGE
            assert self.write_at + beats * self.width <= SIZE, "too many writes for the region"
            full = (1 << self.width) - 1
            data = [(self.rng.getrandbits(8 * self.width), self.rng.choice([full, full, self.rng.getrandbits(self.width), 0])) for _ in range(beats)]
            burst = Burst(manager, self.rng.getrandbits(self.bits), self.base + self.write_at, beats, self.size, data)
            self.write_at += beats * self.width
            self.writers.queue[manager].append(burst)
            self.data_queue[manager].append(burst)

    @property
    def pending(self):
        return sum(map(len, self.readers.queue)) + sum(map(len, self.writers.queue)) + self.under_way

    @property
    def under_way(self):
        return self.readers.under_way + self.writers.under_way

    def reset_managers(self):
        for side in (self.readers, self.writers):
            for queue in side.queue:
                queue.clear()
            side.shown = [False] * side.count
            side.model.reset()
        for queue in self.data_queue:
            queue.clear()
        self.data_shown = [False] * self.writers.count
        self.drive()

    def forget(self):
        """What is under way."""
        for side in (self.readers, self.writers):
            side.asked.clear()
            side.port.clear()
            side.under_way = 0
        self.writing.clear()
        self.port_w.clear()
        self.beat = None
        self.stuck = False
        self.still = 0

    # ---- a cycle ----

    async def run(self):
        edge = RisingEdge(self.dut.clk_i)
        while True:
            await edge
            if self.dut.rst_ni.value == 1:
                self.sample()
                self.move()
            self.drive()

    def take(self, side: Side, name: str) -> bool:
        """Addresses at the managers and at the port; whether one moved there."""
        dut = self.dut
        valid, ready = side.valid(), int(getattr(dut, f"{name}_ready_o").value)
        chosen = side.model.choose(valid)
        taken = valid & ready
        assert taken in (0, 0 if chosen is None else 1 << chosen), f"{name}: {valid:b} valid, {ready:b} ready, {chosen} is next"
        assert not (taken and self.held), f"{name}: an address is taken in a drain"
        moved = getattr(dut, f"{name}_valid_o").value == 1 and getattr(dut, f"{name}_ready_i").value == 1
        if moved:
            assert side.port, f"{name}: nobody has asked"
            burst = side.port.popleft()
            port = {x: int(getattr(dut, f"{name}_{x}_o").value) for x in ("id", "addr", "len", "size", "burst", "qos")}
            assert port == {
                "id": burst.manager << self.bits | burst.id, "addr": burst.addr, "len": burst.beats - 1, "size": burst.size, "burst": 1,
                "qos": 15 - burst.manager,
            }, port
        assert (getattr(dut, f"{name}_valid_o").value == 1) == bool(side.port or moved)  # latency 1
        if not self.cleared:
            side.model.step(valid, chosen if taken else None)
            assert side.model.longest <= self.patience + side.count - 1
            if taken:
                burst = side.queue[chosen].popleft()
                side.shown[chosen] = False
                side.asked[chosen, burst.id].append(burst)
                side.port.append(burst)
                side.under_way += 1
                side.grants[chosen] += 1
                if side is self.writers:
                    self.writing.append(burst)
        return moved

    def sample(self):
        dut = self.dut
        busy = self.under_way > 0
        assert int(dut.stuck_o.value) == self.stuck
        assert int(dut.drained_o.value) == (not busy and self.beat is None)
        # Beats: of the cycle before.
        valid = int(dut.r_valid_o.value)
        if self.beat is None:
            assert valid == 0, "a beat that the port did not give"
        else:
            number, data, resp, last = self.beat
            manager = number >> self.bits
            assert valid == 1 << manager
            assert (int(dut.r_id_o.value), int(dut.r_data_o.value), int(dut.r_resp_o.value), int(dut.r_last_o.value)) == (
                number & (1 << self.bits) - 1, data, resp, last)
            queue = self.readers.asked[manager, number & (1 << self.bits) - 1]
            burst = queue[0]
            at = burst.addr + burst.given * (1 << burst.size)
            lane = at % self.width
            moved = data.to_bytes(self.width, "little")[lane : lane + (1 << burst.size)]
            assert resp == 0 and moved == self.read(at, 1 << burst.size), hex(at)
            burst.given += 1
            assert last == (burst.given == burst.beats)
            if last:
                queue.popleft()
        self.beat = None
        r_valid = dut.r_valid_i.value == 1
        assert dut.r_ready_o.value == 1 and dut.b_ready_o.value == 1
        ended = 0
        if r_valid and not self.cleared:
            self.beat = tuple(int(x.value) for x in (dut.r_id_i, dut.r_data_i, dut.r_resp_i, dut.r_last_i))
            ended = self.beat[3]
        # Answers: of this cycle.
        b_valid = dut.b_valid_i.value == 1
        answers = int(dut.b_valid_o.value)
        if b_valid:
            number = int(dut.b_id_i.value)
            key = (number >> self.bits, number & (1 << self.bits) - 1)
            assert answers == 1 << key[0] and int(dut.b_id_o.value) == key[1]
            if not self.cleared:
                burst = self.writers.asked[key].popleft()
                assert burst.given == burst.beats, "answered before its data"
                assert int(dut.b_resp_o.value) == int(dut.b_resp_i.value) == 0
        else:
            assert answers == 0
        # Data, before this cycle's addresses: none is taken with its address.
        w_valid = dut.w_valid_o.value == 1
        w_moved = w_valid and dut.w_ready_i.value == 1
        assert w_valid == bool(self.port_w)
        if w_moved:
            data, strobes, last = self.port_w.popleft()
            assert int(dut.w_strb_o.value) == strobes and int(dut.w_last_o.value) == last
            assert not strobes or int(dut.w_data_o.value) == data
        taken = int(dut.w_ready_o.value) & sum(x << k for k, x in enumerate(self.data_shown))
        if self.held:
            assert taken == 0, "data are taken in a drain"
            if self.writing and not self.port_w:
                burst = self.writing[0]
                burst.given += 1
                self.port_w.append((0, 0, int(burst.given == burst.beats)))
        elif taken:
            burst = self.writing[0]
            assert taken == 1 << burst.manager, "data of another burst"
            data, strobes = burst.data[burst.sent]
            for j in range(self.width):
                if strobes >> j & 1:
                    self.golden[burst.addr - self.base + burst.given * self.width + j] = data >> 8 * j & 0xFF
            burst.given += 1
            burst.sent += 1
            self.data_shown[burst.manager] = False
            if burst.given == burst.beats:
                assert self.data_queue[burst.manager].popleft() is burst
            self.port_w.append((data, strobes, int(burst.given == burst.beats)))
        else:
            assert not (self.writing and self.data_shown[self.writing[0].manager] and (w_moved or not w_valid)), "data wait without a reason"
        if self.writing and self.writing[0].given == self.writing[0].beats:
            self.writing.popleft()
        ar, aw = self.take(self.readers, "ar"), self.take(self.writers, "aw")
        # Watch.
        moves = ar or aw or r_valid or b_valid or w_moved
        self.stuck = self.stuck or (self.limit > 0 and busy and self.still >= self.limit)
        self.still = self.still + 1 if busy and not moves else 0
        self.readers.under_way -= ended
        self.writers.under_way -= b_valid and not self.cleared
        if self.cleared:
            self.forget()

    def move(self):
        """What managers offer next."""
        for side in (self.readers, self.writers):
            for k, queue in enumerate(side.queue):
                if not side.shown[k] and queue and not next(side.idle[k]):
                    side.shown[k] = True
        for k, queue in enumerate(self.data_queue):
            if not self.data_shown[k] and queue and not next(self.data_idle[k]):
                self.data_shown[k] = True

    def drive(self):
        dut, noise = self.dut, self.rng.getrandbits
        self.held, self.cleared, self.limit = self.hold, self.clear, self.timeout
        dut.hold_i.value, dut.clear_i.value, dut.timeout_i.value = self.hold, self.clear, self.timeout
        for side, name in ((self.readers, "ar"), (self.writers, "aw")):
            pins = dict.fromkeys(("id", "addr", "len", "size"), 0)
            for k in range(side.count):
                b = side.queue[k][0] if side.shown[k] else Burst(k, noise(self.bits), noise(self.addr_bits), 1 + noise(8), noise(3))
                for pin, value, bits in (("id", b.id, self.bits), ("addr", b.addr, self.addr_bits), ("len", b.beats - 1, 8), ("size", b.size, 3)):
                    pins[pin] |= value << k * bits
            getattr(dut, f"{name}_valid_i").value = side.valid()
            for pin, value in pins.items():
                getattr(dut, f"{name}_{pin}_i").value = value
        data = strobes = 0
        for k, queue in enumerate(self.data_queue):
            one = queue[0].data[queue[0].sent] if self.data_shown[k] else (noise(8 * self.width), noise(self.width))
            data |= one[0] << 8 * k * self.width
            strobes |= one[1] << k * self.width
        dut.w_valid_i.value = sum(x << k for k, x in enumerate(self.data_shown))
        dut.w_data_i.value, dut.w_strb_i.value = data, strobes


class WithMemory(ArbiterTest):
    """With the project's memory."""

    def __init__(self, dut, idle="never", timeout=0, perfect=True, **options):
        super().__init__(dut, idle, timeout)
        self.memory = Memory(DramConfig().timing, perfect)
        self.memory.allocate(READ_BASE, SIZE, noise=self.rng.getrandbits(30) | 1)
        self.memory.allocate(WRITE_BASE, SIZE, noise=self.rng.getrandbits(30) | 1)
        self.read, self.base, self.first_read = self.memory.read, WRITE_BASE, READ_BASE
        self.golden[:] = self.memory.read(WRITE_BASE, SIZE)
        self.axi = MemoryPort(dut, self.memory, self.config(**options))
        self.start()

    def config(self, **options) -> PortConfig:
        return port_config(data_bits=8 * self.width, id_bits=len(self.dut.ar_id_o), seed=self.rng.getrandbits(30), **options)

    def check_contents(self):
        assert self.memory.read(WRITE_BASE, SIZE) == self.golden


# ---- traffic -------------------------------------------------------------------------------------


@cocotb.test()
@cocotb.parametrize((("idle", "share", "order", "perfect"), TRAFFIC))
async def traffic(dut, idle, share, order, perfect):
    """Data, identifiers, order, quality of service, who is served; under pauses of every channel."""
    write_order = list(WriteOrder)[(order + (share > 0) + (idle == "half")) % 3]
    test = WithMemory(
        dut, idle, timeout=400, perfect=perfect, order=order, write_order=write_order, stall=dict.fromkeys(("AW", "W", "AR", "B", "R"), share), run={"R": 4},
        max_reads=12, max_writes=6,
    )
    test.make_reads(60 if share == 0 else 30)
    test.make_writes(24 if share == 0 else 12)
    await test.bench.reset()
    await test.bench.until(lambda: not test.pending, 20_000, "last answer")
    await test.bench.cycles(5)
    assert test.axi.port.idle and not test.stuck
    test.check_contents()


@cocotb.test()
@cocotb.parametrize(kind=["reads", "writes"])
async def rate(dut, kind):
    """A transfer a cycle, of single beats too, and the first of them after the latencies that the header states."""
    test = WithMemory(dut, latency=8, max_reads=100, max_writes=100)
    (test.make_reads if kind == "reads" else test.make_writes)(60, longest=1)
    if kind == "reads":
        test.readers.queue[1].extend(test.readers.queue[0])  # none of them waits for an identifier
        test.readers.queue[0].clear()
        for burst in test.readers.queue[1]:
            burst.manager = 1
    channel = "R" if kind == "reads" else "B"
    moved = []

    def count():
        moved.append(test.axi.port.channels()[channel][0])
        return not test.pending

    await test.bench.reset()
    taken = await test.bench.until(count, 2000, "last answer")
    assert taken <= 60 + 8 + 8, taken
    first = next(k for k, n in enumerate(moved) if n)
    last = next(k for k, n in enumerate(moved) if n == 60)
    assert last - first == 59


@cocotb.test()
async def other_memory(dut):
    """The memory of cocotbext-axi, which knows nothing of this project: one of reads, one of writes."""
    test = ArbiterTest(dut, "half")
    reads, writes = ram_read(dut, SIZE), ram_write(dut, SIZE)
    reads.write(0, random.Random(test.rng.getrandbits(30)).randbytes(SIZE))
    test.read = reads.read
    for channel in (reads.ar_channel, reads.r_channel, writes.aw_channel, writes.w_channel, writes.b_channel):
        channel.set_pause_generator(test.bench.stall("half"))
    test.start()
    test.make_reads(60)
    test.make_writes(30)
    await test.bench.reset()
    await test.bench.until(lambda: not test.pending, 20_000, "last answer")
    assert writes.read(0, SIZE) == test.golden


# ---- drain ---------------------------------------------------------------------------------------


@cocotb.test()
@cocotb.parametrize((("idle", "share", "write_order"), DRAINS))
async def drain(dut, idle, share, write_order):
    """Held at random times, again and again: all that was asked for comes, missing data leave old bytes, managers go on after their reset."""
    test = WithMemory(
        dut, idle, timeout=600, perfect=False, order=Order.INTERLEAVED, write_order=write_order, stall=dict.fromkeys(("AW", "W", "AR", "B", "R"), share),
    )
    test.data_idle[0] = test.bench.stall("heavy")
    await test.bench.reset()
    half_sent = 0
    for _ in range(3):
        test.write_at = 0
        test.make_reads(20)
        test.make_writes(8)
        await test.bench.cycles(test.rng.randrange(1, 150))
        test.hold = 1
        await test.bench.cycles(2)
        half_sent += len(test.writing)
        await test.bench.until(lambda: dut.drained_o.value == 1 and not test.under_way, 20_000, "drained")
        assert test.axi.port.idle and not any(test.readers.asked.values()) and not any(test.writers.asked.values())
        test.check_contents()
        await test.bench.cycles(test.rng.randrange(3))  # managers that still ask get nothing
        assert test.axi.port.idle
        test.reset_managers()
        await test.bench.cycles(test.rng.randrange(1, 3))
        test.hold = 0
    assert half_sent
    test.write_at = 0
    test.make_reads(20)
    test.make_writes(8)
    await test.bench.until(lambda: not test.pending, 20_000, "last answer")
    test.check_contents()


# ---- watch ---------------------------------------------------------------------------------------


@cocotb.test()
@cocotb.parametrize(channel=["AW", "W", "B", "AR", "R"], timeout=[1, 20, 0])
async def stops(dut, channel, timeout):
    """A channel that stops: stuck_o in the cycle that the model says, to stay; clear_i with the memory's reset, and all begins anew."""
    reads = channel in ("AR", "R")
    test = WithMemory(dut, "never", timeout=NEVER, latency=4, stop_after={channel: 6})
    (test.make_reads if reads else test.make_writes)(20)
    await test.bench.reset()
    await test.bench.cycles(400)  # more than the others' at most 20 x 16 beats
    assert test.still > 0 and not test.stuck
    # The same again, with the time-out set from the start.
    await restart(test, {"stop_after": {channel: 6}, "latency": 1})
    test.timeout = timeout
    test.write_at = 0
    (test.make_reads if reads else test.make_writes)(20, longest=1)
    await test.bench.cycles(100 + timeout)
    assert test.stuck == (timeout > 0)
    await restart(test, {"latency": 3})
    assert not test.stuck
    test.timeout = 50
    test.write_at = 0
    test.golden[:] = test.memory.read(WRITE_BASE, SIZE)
    test.make_reads(20)
    test.make_writes(10)
    await test.bench.until(lambda: not test.pending, 5000, "last answer")
    await test.bench.cycles(60)
    assert not test.stuck and test.axi.port.idle
    test.check_contents()


async def restart(test, options):
    """The memory is reset, then clear_i while the managers are."""
    test.hold = 1
    await test.bench.cycles(3)
    assert test.dut.drained_o.value == 0
    test.axi.off = True
    await test.bench.cycles(2)
    test.clear = 1
    await test.bench.cycles(3)
    test.reset_managers()
    await test.bench.cycles(2)
    assert test.dut.drained_o.value == 1 and test.dut.ar_valid_o.value == 0 and test.dut.aw_valid_o.value == 0 and test.dut.w_valid_o.value == 0
    test.clear = test.hold = 0
    test.axi.restart(test.config(**options))
    await test.bench.cycles(2)
