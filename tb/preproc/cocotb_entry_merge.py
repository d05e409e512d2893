"""cocotb tests of flk_entry_merge; the scene's splats are dealt out to the lanes, and the banks' entries must be those of the scene in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb import stalls
from flicker_tb.bench import Bench

LANES, SEQ = 4, 12
LOW = (1 << SEQ) - 1
ENTRY_BITS = 12 + 8 + 8 + 24 + 24 + 4
Entry = tuple[int, int, int, int, int, int]  # seq, row, column, key, number, mask
Patterns = tuple[list[str], list[str]]


def packed(entry: Entry) -> int:
    word = 0
    for value, bits in zip(entry, (12, 8, 8, 24, 24, 4)):
        word = word << bits | value
    return word


class Lane:
    """Splats of a lane, [seq, entries that were not taken] with seq not reduced; `late` cycles until its progress is seen."""

    def __init__(self, idle: Iterator[bool], late: int) -> None:
        self.idle, self.offered = idle, False
        self.splats: deque[tuple[int, deque[Entry]]] = deque()
        self.shown: deque[int] = deque([0] * (late + 1))

    def progress(self, beyond: int) -> int:
        """Seq of its oldest splat, or `beyond`."""
        self.shown.append(self.splats[0][0] if self.splats else beyond)
        return self.shown.popleft()


class Merge:
    """The design between lanes and banks, one cycle at a time. ahead: splats assigned and not finished, at most."""

    def __init__(self, dut, ahead: int = 2000) -> None:
        self.dut, self.bench, self.ahead = dut, Bench(dut), ahead
        self.rng = self.bench.rng
        self.cycles = 0
        self.lanes, self.banks = int(dut.Lanes.value), int(dut.Writers.value)  # banks: outputs
        self.bank_bits = len(dut.out_bank_o) // self.banks
        for name in ("start", "end", "in_valid", "in_data", "progress", "out_ready"):
            getattr(dut, f"{name}_i").value = 0

    async def frame(
        self, splats: list[tuple[int, list[Entry]]], patterns: Patterns, late: int = 0, base: int = 0, stop: int = 0, least: bool = False,
    ) -> list[int]:
        """Splats as (lane, entries), seq from `base` on. patterns: of lanes and banks. stop: cycles after which to return.
        least: the progress of a lane without work is as little as it may be. Cycles of the banks' last elements."""
        dut, edge, rng = self.dut, RisingEdge(self.dut.clk_i), self.rng
        lanes = [Lane(stalls.make(p, rng), late) for p in patterns[0]]
        for lane in lanes:
            lane.shown = deque([base] * (late + 1))
        lanes, patterns = lanes[: self.lanes], (patterns[0], patterns[1][: self.banks])
        splats = [(lane % self.lanes, entries) for lane, entries in splats]
        banks = [stalls.make(p, rng) for p in patterns[1]]
        due: list[deque[Entry]] = [deque() for _ in range(self.banks)]
        for _, entries in splats:
            for entry in entries:
                due[((entry[2] & 1) + 2 * (entry[1] & 1)) % self.banks].append(entry)
        count = [len(d) for d in due]
        assigned, oldest, cycle = base, base, 0
        ended, last, held = [False] * self.banks, [0] * self.banks, [None] * self.banks
        assert int(dut.idle_o.value) == 1
        dut.start_i.value = 1
        dut.end_i.value = 0
        await edge
        dut.start_i.value = 0
        first = cycle
        while not all(ended):
            # Splats are assigned, a few a cycle, as far as the distance to the oldest allows.
            while assigned - base < len(splats) and assigned - oldest < self.ahead and rng.random() < 0.8:
                lane, entries = splats[assigned - base]
                lanes[lane].splats.append((assigned, deque(entries)))
                assigned += 1
            valid = data = progress = 0
            for lane in lanes:  # splats without further entries are finished
                while lane.splats and not lane.splats[0][1]:
                    lane.splats.popleft()
            beyond = min([lane.splats[0][0] for lane in lanes if lane.splats], default=assigned) if least else assigned
            for k, lane in enumerate(lanes):
                lane.offered = lane.offered or bool(lane.splats and not next(lane.idle))
                if lane.offered:
                    valid |= 1 << k
                word = packed(lane.splats[0][1][0]) if lane.offered else rng.getrandbits(ENTRY_BITS)
                data |= word << ENTRY_BITS * k
                progress |= (lane.progress(beyond) & LOW) << SEQ * k
            oldest = min(lane.shown[0] for lane in lanes)
            ready = sum((not next(b)) << i for i, b in enumerate(banks))
            dut.in_valid_i.value, dut.in_data_i.value, dut.progress_i.value, dut.out_ready_i.value = valid, data, progress, ready
            seen = all(p == assigned for lane in lanes for p in lane.shown)
            dut.end_i.value = int(assigned - base == len(splats) and not valid and seen and not any(lane.splats for lane in lanes))
            await edge
            cycle += 1
            taken = valid & int(dut.in_ready_o.value)
            for k, lane in enumerate(lanes):
                if taken >> k & 1:
                    lane.splats[0][1].popleft()
                    lane.offered = False
            leaves = int(dut.out_valid_o.value)
            if leaves:
                end, u, v, word, bank = (int(getattr(dut, f"out_{n}_o").value) for n in ("end", "u", "v", "entry", "bank"))
                for b in range(self.banks):
                    if not leaves >> b & 1:
                        assert held[b] is None, f"bank {b}: valid fell"
                        continue
                    got = (end >> b & 1, u >> 7 * b & 127, v >> 7 * b & 127, word >> 52 * b & (1 << 52) - 1,
                           bank >> self.bank_bits * b & (1 << self.bank_bits) - 1)
                    assert held[b] in (None, got), f"bank {b}: changed before its transfer"
                    held[b] = None if ready >> b & 1 else got
                    if ready >> b & 1:
                        self.check(b, got, due[b], count[b])
                        ended[b], last[b] = bool(got[0]), cycle - first
            assert cycle < 3000 + 60 * sum(count), f"stands still: {[len(d) for d in due]} to come"
            if stop and cycle >= stop:
                return last
        assert not any(due)
        dut.end_i.value = 0
        dut.out_ready_i.value = (1 << self.banks) - 1
        for _ in range(6):
            await edge
            assert int(dut.out_valid_o.value) == 0
        assert int(dut.idle_o.value) == 1
        return last

    def check(self, bank: int, got: tuple[int, int, int, int, int], due: deque[Entry], count: int) -> None:
        end, u, v, word, of_bank = got
        place = f"bank {bank}, element {count - len(due)}"
        if end:
            assert not due, f"{place}: end, but entries are to come"
            return
        assert due, f"{place}: an entry after the last"
        _, row, column, key, number, mask = due.popleft()
        want = (column >> 1, row >> 1, ((column & 1) + 2 * (row & 1)) // self.banks, key << 28 | number << 4 | mask)
        assert (u, v, of_bank, word) == want, f"{place}: {(u, v, of_bank, hex(word))}, due {(*want[:3], hex(want[3]))}"


def scene(rng, count: int, base: int = 0, entries: int = 6, weights: tuple[int, ...] = (1, 1, 1, 1)) -> list[tuple[int, list[Entry]]]:
    """Splats of random lanes; tiles of a rectangle, row by row; some have none."""
    splats = []
    for n in range(count):
        row, column = rng.randrange(256), rng.randrange(256)
        width, height = rng.randrange(entries), rng.choice((1, 1, 2, 3))
        key, number = rng.getrandbits(24), rng.getrandbits(24)
        tiles = [((row + j) % 256, (column + i) % 256) for j in range(height) for i in range(width)]
        splats.append((rng.choices(range(LANES), weights)[0], [((base + n) & LOW, *tile, key, number, rng.randrange(1, 16)) for tile in tiles]))
    return splats


def patterns(rng, kind: str) -> Patterns:
    if kind == "mixed":
        return [rng.choice(stalls.PATTERNS) for _ in range(LANES)], [rng.choice(stalls.PATTERNS) for _ in range(4)]
    lanes, banks = kind.split()
    return [lanes] * LANES, [banks] * 4


@cocotb.test()
@cocotb.parametrize(("kind", ["never never", "half half", "never heavy", "heavy never", "bursts bursts", "mixed"]))
async def frames(dut, kind):
    """Frames one after the other, of few and many splats, sequence numbers beginning anywhere and running around."""
    test = Merge(dut)
    await test.bench.reset()
    for count, late in ((0, 0), (1, 3), (40, 9), (150, 0), (60, 2)):
        base = test.rng.choice((0, 4000, 2040, test.rng.randrange(4096)))
        await test.frame(scene(test.rng, count, base), patterns(test.rng, kind), late, base, least=count == 40)


@cocotb.test()
async def one_lane_late(dut):
    """A lane with few entries, and one whose progress is seen late, hold the others, by as many splats as are allowed."""
    test = Merge(dut)
    await test.bench.reset()
    for test.ahead, late in ((4, 0), (2000, 60)):
        kinds = ["heavy", "never", "never", "never"], ["never", "rare", "never", "half"]
        await test.frame(scene(test.rng, 300, 3900, weights=(1, 9, 9, 9)), kinds, late, 3900)


@cocotb.test()
async def one_bank_stands(dut):
    """The queues take what they can while a bank stands; afterwards all of it comes."""
    test = Merge(dut)
    await test.bench.reset()
    await test.frame(scene(test.rng, 200, entries=9), (["never"] * 4, ["heavy", "never", "never", "never"]))


@cocotb.test()
async def overtaken_by_progress(dut):
    """A lane's entry is on its way from the queue's memory, and the lane's progress already beyond it: no other lane's entry goes before it."""
    test = Merge(dut)
    await test.bench.reset()
    edge = RisingEdge(dut.clk_i)
    entry = lambda seq: packed((seq, 2, 4, seq, seq, 1))  # noqa: E731
    got: list[int] = []

    async def cycle(ready: int, progress: tuple[int, int], offer: dict[int, int] | None = None, start: int = 0) -> None:
        offer = offer or {}
        dut.start_i.value, dut.out_ready_i.value = start, ready
        dut.progress_i.value = progress[0] | progress[1] << SEQ | 100 << 2 * SEQ | 100 << 3 * SEQ
        dut.in_valid_i.value = sum(1 << lane for lane in offer)
        dut.in_data_i.value = sum(entry(seq) << ENTRY_BITS * lane for lane, seq in offer.items())
        await edge
        assert all(int(dut.in_ready_o.value) >> lane & 1 for lane in offer)
        if ready and int(dut.out_valid_o.value) & 1:
            got.append(int(dut.out_entry_o.value) >> 4 & 0xFFFFFF)

    await cycle(0, (0, 0), start=1)
    await cycle(0, (0, 3), {0: 0, 1: 3})
    for _ in range(4):  # 0 stands at the output, 3 waits
        await cycle(0, (1, 50))
    await cycle(0, (1, 50), {0: 1})
    for _ in range(4):  # 1 waits in its lane's register
        await cycle(0, (2, 50))
    await cycle(0, (2, 50), {0: 2})  # into the memory
    for _ in range(8):  # and the output moves
        await cycle(1, (10, 50))
    assert got == [0, 1, 2, 3], got


@cocotb.test()
async def half_the_range(dut):
    """An entry 2,047 before others that wait."""
    test = Merge(dut, 2047)
    await test.bench.reset()
    tile = (6, 5)
    splats = [(0, [(0, *tile, 1, 2, 3)])] + [(1 + n % 3, [(n & LOW, *tile, n, n, 1)] if n > 2040 else []) for n in range(1, 2300)]
    await test.frame(splats, (["heavy", "never", "never", "never"], ["never"] * 4), 3)


@cocotb.test()
async def rate(dut):
    """Splats of four neighbouring tiles in turn to the lanes: an entry a cycle and bank. One lane alone: an entry a cycle."""
    test = Merge(dut)
    await test.bench.reset()
    n = 200

    def block(seq: int) -> list[Entry]:
        return [(seq & LOW, 2 + j, 4 + i, seq, seq, 15) for j in range(2) for i in range(2)]

    last = await test.frame([(s % LANES, block(s)) for s in range(n)], (["never"] * 4, ["never"] * 4))
    assert max(last) <= n + 16, last
    last = await test.frame([(2, block(s)) for s in range(n)], (["never"] * 4, ["never"] * 4))
    assert max(last) <= 4 * n + 16, last


@cocotb.test()
async def reset_in_a_frame(dut):
    """What a frame that reset ended has left is gone."""
    test = Merge(dut)
    await test.bench.reset()
    for _ in range(3):
        await test.frame(scene(test.rng, 200), (["never"] * 4, ["heavy"] * 4), stop=test.rng.randrange(30, 90))
        dut.in_valid_i.value = dut.end_i.value = 0
        await test.bench.reset()
        await test.frame(scene(test.rng, 30), (["rare"] * 4, ["half"] * 4))
