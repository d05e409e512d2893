"""cocotb tests of flk_frame_counters: two banks in Python, halves that ask at any time, the stage's counters as a memory."""

from __future__ import annotations

import cocotb
from cocotb.triggers import ReadOnly, RisingEdge
from flicker_tb.bench import Bench

from flicker.chip_counters import FRONT, RENDERING
from flicker.chip_registers import ChipCounter

# Words of flk_counter_pkg.
WAITS = [counter for counter in FRONT if counter.stall]
RENDERING_AT, FRONT_WAITS_AT, STAGE_AT, STAGE_WORDS, BANK = RENDERING[0].number, WAITS[0].number, int(ChipCounter.STAGE), 128, 256
FRONT_WORDS, RENDERING_WORDS = RENDERING_AT + len(WAITS), RENDERING[-1].number + RENDERING[-1].words - RENDERING_AT
LATENCY = 1


class Side:
    """One of the two that ask. words: None for zeros."""

    def __init__(self, dut, name, count):
        self.dut, self.name, self.count = dut, name, count
        self.valid, self.bank, self.words, self.stage, self.since = 0, 0, None, None, 0

    def ask(self, rng, now):
        self.valid, self.bank, self.since = 1, rng.getrandbits(1), now
        none = rng.random() < 0.2
        self.words = None if none else [rng.getrandbits(32) for _ in range(self.count)]
        self.stage = None if none else [rng.getrandbits(32) for _ in range(STAGE_WORDS)]

    def drive(self, rng):
        """Noise where nothing is asked for, or zeros are."""
        shown = self.words if self.valid and self.words else [rng.getrandbits(32) for _ in range(self.count)]
        for name, value in (
            ("valid", self.valid), ("bank", self.bank if self.valid else rng.getrandbits(1)),
            ("none", int(self.words is None) if self.valid else rng.getrandbits(1)), ("words", sum(w << 32 * k for k, w in enumerate(shown))),
        ):
            getattr(self.dut, f"{self.name}_{name}_i").value = value

    @property
    def done(self):
        return int(getattr(self.dut, f"{self.name}_done_o").value)


class CountersTest:
    def __init__(self, dut):
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.front, self.rendering = Side(dut, "front", FRONT_WORDS), Side(dut, "rendering", RENDERING_WORDS)
        self.kept: list[int | None] = [None] * (2 * BANK)  # None: never written, or being written
        self.asked: int | None = None                      # address of the reader in the cycle before
        self.stage_at = 0
        self.now = 0
        self.copies = 0
        self.orders = []
        self.compared = 0
        self.reading = None
        self.drive()

    def drive(self):
        dut, rng = self.dut, self.rng
        self.front.drive(rng)
        self.rendering.drive(rng)
        self.asked = rng.randrange(2 * BANK) if self.reading is None else self.reading
        dut.bank_i.value, dut.addr_i.value = divmod(self.asked, BANK)
        stage = self.rendering.stage if self.rendering.valid else None
        dut.counter_data_i.value = stage[self.stage_at] if stage else rng.getrandbits(32)

    def check(self):
        """After an edge: pins of the cycle that it ends."""
        self.now += 1
        self.stage_at = int(self.dut.counter_addr_o.value)
        for side in (self.front, self.rendering):
            assert not (side.done and not side.valid), "done with nothing"
            if not (side.valid and side.done):
                continue
            at = side.bank * BANK
            if side is self.front:
                words = side.words or [0] * FRONT_WORDS
                self.kept[at : at + RENDERING_AT] = words[:RENDERING_AT]
                self.kept[at + FRONT_WAITS_AT : at + FRONT_WAITS_AT + FRONT_WORDS - RENDERING_AT] = words[RENDERING_AT:]
                least = FRONT_WORDS
            else:
                self.kept[at + RENDERING_AT : at + RENDERING_AT + RENDERING_WORDS] = side.words or [0] * RENDERING_WORDS
                self.kept[at + STAGE_AT : at + STAGE_AT + STAGE_WORDS] = side.stage or [0] * STAGE_WORDS
                least = RENDERING_WORDS + STAGE_WORDS
            assert least <= self.now - side.since <= FRONT_WORDS + RENDERING_WORDS + STAGE_WORDS + 8 + (least if side is self.front else FRONT_WORDS)
            side.valid = 0
            self.copies += 1
            self.orders.append(side.name)

    def uncertain(self):
        """Words that a copy may be writing."""
        out = set()
        waits = (FRONT_WAITS_AT, FRONT_WORDS - RENDERING_AT)
        for side, ranges in ((self.front, [(0, RENDERING_AT), waits]), (self.rendering, [(RENDERING_AT, RENDERING_WORDS), (STAGE_AT, STAGE_WORDS)])):
            if side.valid:
                out |= {side.bank * BANK + first + k for first, count in ranges for k in range(count)}
        return out

    async def cycle(self):
        asked, before = self.asked, list(self.kept) if self.asked is not None else None
        unsure = self.uncertain()
        await RisingEdge(self.dut.clk_i)
        self.check()
        self.drive()
        await ReadOnly()
        if before[asked] is not None and asked not in unsure and self.kept[asked] == before[asked]:
            assert int(self.dut.value_o.value) == before[asked], hex(asked)
            self.compared += 1

    async def read_all(self):
        for k in range(2 * BANK):
            self.reading = k
            await self.cycle()
        self.reading = None


@cocotb.test()
@cocotb.parametrize(pause=[1, 30, 400])
async def copies(dut, pause):
    """Every word where it belongs, zeros of a half that has not run, the other bank as it was; both at once, one after the other."""
    test = CountersTest(dut)
    dut.clear_i.value = 0
    await test.bench.reset()
    for _ in range(3000):
        for side in (test.front, test.rendering):
            if not side.valid and test.rng.random() < 1 / pause:
                side.ask(test.rng, test.now)
        await test.cycle()
    while test.front.valid or test.rendering.valid:
        await test.cycle()
    await test.read_all()
    assert test.copies > 8 and {"front", "rendering"} == set(test.orders) and test.compared > 512
    known = sum(x is not None for x in test.kept)
    assert known >= FRONT_WORDS + RENDERING_WORDS + STAGE_WORDS


@cocotb.test()
async def front_first(dut):
    """Asked for together, the front end's are copied first; a word a cycle."""
    test = CountersTest(dut)
    dut.clear_i.value = 0
    await test.bench.reset()
    await test.cycle()
    for side in (test.front, test.rendering):
        side.ask(test.rng, test.now)
    ends = {}
    for cycle in range(250):
        await test.cycle()
        for side in (test.front, test.rendering):
            if not side.valid:
                ends.setdefault(side.name, cycle)
    assert test.orders == ["front", "rendering"]
    assert ends["front"] <= FRONT_WORDS + 3 and ends["rendering"] - ends["front"] == RENDERING_WORDS + STAGE_WORDS + LATENCY + 1


@cocotb.test()
async def clears(dut):
    """A copy that clear_i ends writes nothing after it; the next ones are whole."""
    test = CountersTest(dut)
    dut.clear_i.value = 0
    await test.bench.reset()
    for _ in range(40):
        for side in (test.front, test.rendering):
            if test.rng.random() < 0.7:
                side.ask(test.rng, test.now)
        for _ in range(test.rng.randrange(200)):
            await test.cycle()
        for k in test.uncertain():
            test.kept[k] = None
        test.front.valid = test.rendering.valid = 0
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 1
        test.drive()
        for _ in range(2):
            await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        test.asked = None
        test.drive()
        for _ in range(3):
            await test.cycle()
        assert not (test.front.done or test.rendering.done)
    test.front.ask(test.rng, test.now)
    test.rendering.ask(test.rng, test.now)
    while test.front.valid or test.rendering.valid:
        await test.cycle()
    await test.read_all()
    assert test.copies > 20
