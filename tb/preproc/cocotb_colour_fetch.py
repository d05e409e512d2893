"""cocotb tests of flk_colour_fetch: parts against the bytes in memory, beats against those that hold survivors."""

from __future__ import annotations

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench, rounds
from flicker_tb.streams import Stream, StreamSource

from flicker.chip.dram import DramConfig
from flicker.scene.packed import FULL_SH_BITS, SH_BITS, PackedFormat
from flicker.sim.memory import Memory, PortConfig

BASE, SIZE = 0x7F_F000, 0x8_0000  # beats from below a multiple of 2^17, where the halves of an address meet
CLUSTERS = 8  # whose colours may be under way
PART = (("cluster", 4), ("stored", 1), ("first", 1), ("last", 1), ("part", 2), ("used", 4), ("opacity", 16), ("dc", 48), ("raw", 192))
USED = {0: [0], 1: [7], 2: [15, 15], 3: [15, 15, 15, 7]}


def stride_of(chunked: bool, of: Survivors) -> int:
    """Bytes of a Gaussian."""
    return (PackedFormat.CHUNK if chunked else PackedFormat.FP16).colour_stride(of.degree, of.sh_bits)


class Survivors:
    """A group of survivors as the design takes it."""

    def __init__(self, cluster: int, colour: int, degree: int, group: int, alive: int, sh_bits: int = 8, at: int = 0):
        """at: place in the group of the first of those that come together."""
        self.cluster, self.colour, self.degree, self.group, self.alive, self.sh_bits, self.at = cluster, colour, degree, group, alive, sh_bits, at

    def word(self, chunked: bool) -> int:
        """With the stride, and the half bytes of four coefficients, of chunks or of FP16."""
        stride, step = stride_of(chunked, self), 3 * self.sh_bits if chunked else 48
        return (self.cluster % 16) << 59 | self.colour << 27 | stride << 20 | step << 14 | self.degree << 12 | self.group << 6 | self.at << 4 | self.alive

    def with_(self, **fields: int) -> Survivors:
        return Survivors(**{**vars(self), **fields})


class Fetch:
    """The design with its memory."""

    def __init__(self, dut, chunked: bool, perfect: bool, idle: str = "never", stall: str = "never", latency: int = 5, first: int = 0):
        """first: beat that the colours begin with."""
        self.dut, self.bench, self.chunked, self.first = dut, Bench(dut), chunked, first
        self.memory = Memory(DramConfig().timing, perfect)
        self.memory.allocate(BASE + 64 * first, SIZE, 77)
        self.data = self.memory.read(BASE + 64 * first, SIZE)
        rng = self.bench.rng
        stalls = {k: rng.choice([0.0, 0.3]) for k in ("AR", "R")} if not perfect else {}
        self.port = MemoryPort(dut, self.memory, PortConfig(max_reads=64, latency=latency, stall=stalls), writes=False)
        self.source = StreamSource(Stream(dut, "in", ("data",)), self.bench.stall(idle))
        self.lanes = int(dut.Lanes.value)
        self.stalls = [self.bench.stall(stall) for _ in range(self.lanes)]
        self.parts: list[list[int]] = [[] for _ in range(self.lanes)]
        for name, value in (("start", 0), ("chunked", chunked), ("colours", BASE // 64), ("exit", 0), ("out_ready", 0)):
            getattr(dut, f"{name}_i").value = value
        self.under_way: list[Survivors] = []
        cocotb.start_soon(self._take())

    async def _take(self) -> None:
        dut, width = self.dut, sum(b for _, b in PART)
        while True:
            ready = sum(int(not next(stall)) << k for k, stall in enumerate(self.stalls))
            dut.out_ready_i.value = ready
            await RisingEdge(dut.clk_i)
            valid = dut.out_valid_o.value
            if not valid.is_resolvable:
                continue
            moved = int(valid) & ready
            if moved:
                word = int(dut.out_data_o.value)
                for k in range(self.lanes):
                    if moved >> k & 1:
                        self.parts[k].append(word >> (width * k) & (1 << width) - 1)

    def turns(self, g: Survivors) -> list[Survivors]:
        """A group as it comes: the survivors of as many neighbours as there are lanes, one part after the other."""
        mask = (1 << self.lanes) - 1
        return [g.with_(alive=g.alive & mask << k, at=k) for k in range(0, 4, self.lanes)]

    def due(self, groups: list[Survivors]) -> list[list[dict[str, int]]]:
        """Parts of each lane."""
        lanes: list[list[dict[str, int]]] = [[] for _ in range(self.lanes)]
        size = 1 if self.chunked else 2
        number = lambda at: int.from_bytes(self.data[at : at + size], "little")  # noqa: E731
        for g in groups:
            for k in range(4):
                if not g.alive >> k & 1:
                    continue
                at = (g.colour - self.first) * 64 + (4 * g.group + k) * stride_of(self.chunked, g)
                head = [number(at + size * i) for i in range(4)]
                opacity, dc = (head[0], head[:0:-1]) if self.chunked else (head[0], head[1:])
                for part, used in enumerate(USED[g.degree]):
                    raw = {(i, c): self.code(at, 12 * part + 3 * i + c, g.sh_bits) for i in range(4) for c in range(3) if used >> i & 1}
                    lanes[k % self.lanes].append({
                        "cluster": g.cluster % 16, "stored": 0, "first": part == 0, "last": part == len(USED[g.degree]) - 1, "part": part, "used": used,
                        "opacity": opacity, "dc": dc, "raw": raw,
                    })
        return lanes

    def code(self, at: int, number: int, bits: int) -> int:
        """Of SH: the one of that number of the Gaussian at byte `at`."""
        if not self.chunked:
            return int.from_bytes(self.data[at + 8 + 2 * number :][:2], "little")
        first = 8 * (at + 4) + bits * number
        return int.from_bytes(self.data[first // 8 :][:2], "little") >> first % 8 & (1 << bits) - 1

    def beats(self, groups: list[Survivors]) -> int:
        """Beats from the first survivor of those that come together to the last one, each once."""
        found = set()
        for g in groups:
            alive = [4 * g.group + k for k in range(4) if g.alive >> k & 1]
            if alive:
                stride = stride_of(self.chunked, g)
                first, last = alive[0] * stride // 64, (alive[-1] * stride + stride - 1) // 64
                found |= {(g.cluster, b) for b in range(first, last + 1)}
        return len(found)

    async def run(self, groups: list[Survivors]) -> int:
        """A frame. Returns its cycles."""
        dut = self.dut
        groups = [part for group in groups for part in self.turns(group)]
        await self.bench.until(lambda: int(dut.idle_o.value) == 1, 2000, "idle")
        for lane in self.parts:
            lane.clear()
        dut.exit_i.value = 0
        dut.start_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.start_i.value = 0
        due = self.due(groups)
        begin = self.memory.cycle
        for g in groups:  # a cluster enters when there is room for it, as in flk_preprocessing
            await self.bench.until(lambda g=g: (g.cluster - int(dut.oldest_o.value)) % 16 < CLUSTERS, 20_000, "room for a cluster")
            dut.exit_i.value = g.cluster % 16
            self.source.send([g.word(self.chunked)])
            await self.bench.until(lambda: not self.source.pending, 20_000, "a group")
        count = sum(map(len, due))
        await self.bench.until(lambda: sum(map(len, self.parts)) >= count, 50_000, "last part")
        cycles = self.memory.cycle - begin
        await self.bench.cycles(30)
        assert int(dut.idle_o.value) == 1
        assert int(dut.beats_o.value) == self.beats(groups)
        for k, (got, want) in enumerate(zip(self.parts, due)):
            assert len(got) == len(want)
            for i, (word, part) in enumerate(zip(got, want)):
                fields = {}
                for name, width in reversed(PART):
                    fields[name] = word & (1 << width) - 1
                    word >>= width
                for name in ("cluster", "stored", "first", "last", "part", "used") + (("opacity",) if part["first"] else ()):
                    assert fields[name] == part[name], f"lane {k}, part {i}: {name} {fields[name]}, due {part[name]}"
                if part["first"]:
                    assert [fields["dc"] >> 16 * c & 0xFFFF for c in range(3)] == part["dc"], f"lane {k}, part {i}: dc"
                for (j, c), value in part["raw"].items():
                    assert fields["raw"] >> 16 * (3 * j + c) & 0xFFFF == value, f"lane {k}, part {i}: coefficient {j}, channel {c}"
        return cycles


def frame(rng, chunked: bool, clusters: int, degree: int | None = None, full: bool = False, first: int = 0, bits: int | None = None) -> list[Survivors]:
    """Groups of clusters of any size, degree and, of chunks, bits of SH codes; some clusters and some stretches without survivors."""
    groups, colour = [], first + rng.randrange(4)
    for cluster in range(clusters):
        d = rng.randrange(4) if degree is None else degree
        b = bits or (rng.choice(SH_BITS) if chunked else FULL_SH_BITS)
        size = 256 if full else rng.choice([1, 2, 5, rng.randint(1, 64), 64])
        dead = not full and rng.random() < 0.2
        share = rng.choice([0.1, 0.5, 0.9, 1.0])
        for group in range(-(-size // 4)):
            exist = (1 << min(4, size - 4 * group)) - 1
            alive = exist if full else sum((rng.random() < share) << k for k in range(4)) & exist
            groups.append(Survivors(cluster, colour, d, group, 0 if dead else alive, b))
        colour += -(-size * stride_of(chunked, groups[-1]) // 64)
    return groups


@cocotb.test()
@cocotb.parametrize(chunked=[True, False], idle=["never", "half"], stall=["never", "heavy"])
async def parts(dut, chunked, idle, stall):
    """Parts of all lanes, of clusters of all degrees; frames one after the other."""
    fetch = Fetch(dut, chunked, stall == "never", idle, stall)
    await fetch.bench.reset()
    for _ in range(rounds(1, 2)):
        await fetch.run(frame(fetch.bench.rng, chunked, 14))


@cocotb.test()
@cocotb.parametrize(chunked=[True, False])
async def last_colours(dut, chunked):
    """The highest beats that a header can name."""
    first = (1 << 32) - 3000
    fetch = Fetch(dut, chunked, True, first=first)
    await fetch.bench.reset()
    groups = frame(fetch.bench.rng, chunked, 6, 3, full=True, first=first)
    last = max(g.colour for g in groups)
    await fetch.run([g.with_(colour=g.colour + (1 << 32) - 1 - last) for g in groups])


@cocotb.test()
async def a_lane_that_waits(dut):
    """One lane has survivors in a cluster and then in the one with the same number, sixteen later; others have some in all of them."""
    fetch = Fetch(dut, True, True, latency=3)
    await fetch.bench.reset()
    await fetch.run([Survivors(c, 2 * c, 0, 0, 15 if c % 16 == 0 else 1) for c in range(33)])


@cocotb.test()
@cocotb.parametrize(gap=[15, 16, 17, 32, 48])
async def clusters_without_survivors(dut, gap):
    """So many cluster numbers further come the next survivors, in the same beats of their cluster; all that went before is done by then, or nearly."""
    fetch = Fetch(dut, True, True, latency=3)
    await fetch.bench.reset()
    rng = fetch.bench.rng
    for _ in range(rounds(1, 2)):
        alive = [rng.randrange(1, 16) for _ in range(6)]
        groups = [Survivors(c, 20 * c, 3, rng.randrange(2), alive[c // gap] if c % gap == 0 else 0) for c in range(5 * gap + 1)]
        await fetch.run(groups)
        await fetch.run([g for group in groups for g in (group, Survivors(group.cluster, group.colour, 3, 2 + rng.randrange(3), group.alive))])


@cocotb.test()
@cocotb.parametrize(bits=SH_BITS)
async def codes_of_fewer_bits(dut, bits):
    """Every Gaussian of clusters of each degree."""
    fetch = Fetch(dut, True, True)
    await fetch.bench.reset()
    for degree in range(4):
        await fetch.run(frame(fetch.bench.rng, True, rounds(1, 2), degree, full=True, bits=bits))


@cocotb.test()
@cocotb.parametrize(degree=[0, 1, 2, 3])
async def rates(dut, degree):
    """With every Gaussian alive: as fast as groups come, beats or the lanes' parts allow, nearly."""
    fetch = Fetch(dut, True, True, latency=40)
    await fetch.bench.reset()
    groups = frame(fetch.bench.rng, True, 4, degree, full=True, bits=FULL_SH_BITS)
    cycles = await fetch.run(groups)
    dut._log.info("degree %d: %d cycles for %d Gaussians", degree, cycles, 4 * len(groups))
    limit = max(2 * len(groups), len(groups) * len(USED[degree]), fetch.beats(groups))
    assert cycles < 1.25 * limit + 150
