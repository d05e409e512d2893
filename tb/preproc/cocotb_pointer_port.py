"""cocotb tests of flk_pointer_port: what is in memory, what writers get, errors, order of the channels."""

from __future__ import annotations

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench, rounds

from flicker.chip.dram import DramConfig
from flicker.sim.memory import Memory, PortConfig

LINE = 64


class Writer:
    """A list writer as the port sees it: what its place holds, and what was asked for."""

    def __init__(self, test: PortTest, number: int) -> None:
        self.test, self.number = test, number
        self.held = [test.pointer() for _ in range(16)]
        self.request: tuple[int | None, int | None] | None = None  # lines that go and come
        self.taken = self.asked = False
        self.due: list[int] | None = None  # what the place must hold in the end
        self.served = 0

    def ask(self, put: int | None, get: int | None) -> None:
        assert self.request is None and (put is not None or get is not None) and put != get
        self.request, self.taken = (put, get), False


class PortTest:
    """The design, its writers, a memory and the table in Python. errors: whether reads, writes of a line fail."""

    def __init__(self, dut, share: float = 0.0, timing: bool = False) -> None:
        self.dut, self.bench = dut, Bench(dut)
        rng = self.bench.rng
        self.bits, self.number_bits = int(dut.MoveBits.value), int(dut.NumberBits.value)
        count = int(dut.Writers.value)
        self.base = 0x3_0000_0040 - LINE * rng.randrange(2)
        self.lines = min(1 << self.number_bits, 64)
        self.memory = Memory(DramConfig().timing, not timing)
        size = LINE * count << self.number_bits
        self.memory.allocate(self.base, size, noise=rng.getrandbits(30))
        self.port = MemoryPort(dut, self.memory, PortConfig(
            max_beats=1, max_reads=1, max_writes=1, latency=10, stall=dict.fromkeys(("AR", "R", "AW", "W", "B"), share),
            seed=rng.getrandbits(30),
        ))
        self.writers = [Writer(self, k) for k in range(count)]
        self.failing: set[tuple[int, int]] = set()  # writer, line
        self.reads_only = False
        self.puts = self.gets = 0
        self.read_error = self.write_error = False
        self.table: dict[tuple[int, int], list[int]] = {}
        self.writing = 0
        self.serving: Writer | None = None
        dut.start_i.value = 0
        dut.base_i.value = self.base // LINE
        for name in ("in_valid", "in_put", "in_put_line", "in_get", "in_get_line", "in_pointer"):
            getattr(dut, f"{name}_i").value = 0
        cocotb.start_soon(self.run())

    def pointer(self) -> int:
        return self.bench.rng.getrandbits(self.bits)

    def fail(self, writer: int, line: int, reads_only: bool) -> None:
        self.failing.add((writer, line))
        self.reads_only = reads_only
        self.port.port.fail_range(self.base + LINE * (len(self.writers) * line + writer), LINE, reads=True, writes=not reads_only)

    def in_memory(self, writer: int, line: int) -> list[int]:
        data = self.memory.read(self.base + LINE * (len(self.writers) * line + writer), LINE)
        return [int.from_bytes(data[4 * i : 4 * i + 4], "little") for i in range(16)]

    def end(self, w: Writer) -> None:
        """A request is done: memory and place are as they must be."""
        assert w.request is not None
        put, get = w.request
        k = w.number
        if put is not None:
            self.puts += 1
            if (k, put) in self.failing and not self.reads_only:
                self.write_error = True
            else:
                assert self.in_memory(k, put) == w.gone, f"writer {k}: line {put} in memory"
                self.table[k, put] = w.gone
        due = [0] * 16
        if get is not None:
            self.gets += 1
            self.read_error |= (k, get) in self.failing
            if not self.read_error and not self.write_error:
                due = [x & (1 << self.bits) - 1 for x in self.in_memory(k, get)]
                assert (k, get) not in self.table or due == self.table[k, get]
        assert w.held == due, f"writer {k}: line {get} held"
        w.request = None
        w.served += 1
        w.held = [self.pointer() for _ in range(16)]

    async def run(self) -> None:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        answer = 0
        while True:
            put = sum(int(w.request is not None and w.request[0] is not None) << k for k, w in enumerate(self.writers))
            get = sum(int(w.request is not None and w.request[1] is not None) << k for k, w in enumerate(self.writers))
            lines = [sum(((w.request and w.request[i]) or 0) << self.number_bits * k for k, w in enumerate(self.writers)) for i in range(2)]
            for name, value in (
                ("valid", sum(int(w.request is not None and not w.taken) << k for k, w in enumerate(self.writers))), ("put", put), ("get", get),
                ("put_line", lines[0]), ("get_line", lines[1]), ("pointer", answer),
            ):
                getattr(dut, f"in_{name}_i").value = value
            await edge
            if not int(dut.rst_ni.value):
                for w in self.writers:
                    w.request = None
                self.serving, self.writing = None, 0
                continue
            valid, ready = int(dut.in_valid_i.value), int(dut.in_ready_o.value)
            read, write, done, index = (int(getattr(dut, f"{n}_o").value) for n in ("read", "write", "done", "index"))
            if valid & ready:
                assert self.serving is None
                self.serving = self.writers[(valid & ready).bit_length() - 1]
                self.serving.taken, self.serving.gone = True, list(self.serving.held)
            served = 1 << self.serving.number if self.serving is not None else 0
            assert not (read | write | done) & ~served
            answer = self.bench.rng.getrandbits(self.bits * len(self.writers))
            if self.serving is not None:
                w = self.serving
                if read:
                    shift = self.bits * w.number
                    answer = answer & ~((1 << self.bits) - 1 << shift) | w.held[index] << shift
                if write:
                    w.held[index] = int(dut.pointer_o.value)
                if done:
                    self.serving = None
                    self.end(w)
            # No read while a write is under way.
            self.writing += int(dut.aw_valid_o.value) & int(dut.aw_ready_i.value)
            self.writing -= int(dut.b_valid_i.value) & int(dut.b_ready_o.value)
            assert not (int(dut.ar_valid_o.value) and self.writing)

    async def start(self) -> None:
        self.dut.start_i.value = 1
        await RisingEdge(self.dut.clk_i)
        self.dut.start_i.value = 0
        await RisingEdge(self.dut.clk_i)
        self.puts = self.gets = 0
        self.read_error = self.write_error = False

    async def some(self, count: int, share: float) -> None:
        """So many requests in all."""
        rng = self.bench.rng
        left = count
        for _ in range(2000 * count):
            for w in self.writers:
                if left and w.request is None and rng.random() < share:
                    left -= 1
                    kind = rng.randrange(3)
                    put, get = rng.sample(range(self.lines), 2)
                    known = [line for k, line in self.table if k == w.number and line != put]
                    if known and rng.random() < 0.7:
                        get = rng.choice(known)
                    w.ask(None if kind == 1 else put, None if kind == 2 else get)
            await RisingEdge(self.dut.clk_i)
            if not left and all(w.request is None for w in self.writers):
                break
        else:
            raise AssertionError("requests are left")
        await RisingEdge(self.dut.clk_i)
        for name, value in (("put", self.puts), ("got", self.gets), ("read_error", self.read_error), ("write_error", self.write_error)):
            assert int(getattr(self.dut, f"{name}_o").value) == value, name


@cocotb.test()
@cocotb.parametrize((("share", "timing", "often"), [(0.0, False, 1.0), (0.5, False, 1.0), (0.2, False, 0.01), (0.0, True, 0.3)]))
async def lines(dut, share, timing, often):
    """Requests of all writers: memory and places are right at the end of each; nobody is passed over."""
    test = PortTest(dut, share, timing)
    await test.bench.reset()
    for _ in range(rounds(1, 2)):
        await test.start()
        await test.some(80, often)
    assert test.puts > 20 and test.gets > 20
    if often == 1.0:
        served = [w.served for w in test.writers]
        assert max(served) - min(served) <= 2


@cocotb.test()
@cocotb.parametrize(reads_only=[False, True])
async def errors(dut, reads_only):
    """After a line that fails only zeros come, until the next start."""
    test = PortTest(dut, 0.2)
    rng = test.bench.rng
    await test.bench.reset()
    failed = 0
    for turn in range(rounds(4, 6)):
        await test.start()
        if turn:
            for known in rng.sample(sorted(test.table), 4):
                test.fail(*known, reads_only)
        await test.some(60, 0.5)
        failed += test.write_error or test.read_error
    assert failed > 1


@cocotb.test()
async def alone(dut):
    """Cycles of a request, of a memory that answers after ten."""
    test = PortTest(dut)
    await test.bench.reset()
    await test.start()
    cycles = {}
    for name, put, get in (("put", 1, None), ("get", None, 1), ("both", 2, 1)):
        test.writers[-1].ask(put, get)
        n = 0
        while test.writers[-1].request is not None:
            await RisingEdge(dut.clk_i)
            n += 1
        cycles[name] = n
    assert cycles == {"put": 50, "get": 33, "both": 65}


@cocotb.test()
async def reset_in_a_request(dut):
    """The memory is reset as well; the next requests are right."""
    test = PortTest(dut, 0.3)
    rng = test.bench.rng
    for _ in range(5):
        await test.bench.reset()
        await test.start()
        await test.some(6, 1.0)
        for w in test.writers:
            w.ask(*rng.sample(range(test.lines), 2))
        await test.bench.cycles(rng.randrange(5, 90))
        test.port.off = True
        dut.rst_ni.value = 0
        await test.bench.cycles(3)
        test.table.clear()
        test.port.restart(PortConfig(max_beats=1, max_reads=1, max_writes=1, latency=10, seed=rng.getrandbits(30)))
