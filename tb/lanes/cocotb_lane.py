"""cocotb test of flk_lane; settings: Lanes, Lane, Slots, Subtiles, sweep (share of all La that are visited one after the other)."""

from __future__ import annotations

import math
from collections import Counter, deque

import cocotb
import numba
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config

from flicker.golden.lanes.formats import FORMATS, OPACITIES, tables
from flicker.golden.lanes.lane import BLENDED, FINISHED, SKIPPED, blend, log_alpha, pair
from flicker.golden.lanes.mask import place_of, row_mask
from flicker.golden.lanes.setup import SplatSetup, u_of, v_of
from flicker.params import SUBTILE_COORD_BITS

T = tables(FORMATS)
# Cycles after the visit (rtl/lanes/flk_lane.sv); of several sub-tiles one more.
STATE, FETCH, COLOUR = 5, 6, 8
# lane_shape_t, highest first.
SHAPE = {"w": 17, "z": 17, "s0": 15, "s1": 16, "s2": 15, "lo": 12}
SHAPE_BITS = sum(SHAPE.values())
INPUTS = ("clear_i", "visit_valid_i", "visit_eos_i", "visit_last_i", "visit_pixel_i", "visit_slot_i", "visit_shape_i", "colour_i", "out_ready_i")
OUTPUTS = ("release_o", "token_o", "token_done_o", "bank_free_o", "finished_o", "events_o", "out_valid_o", "out_start_o", "out_last_o")
RESULT_PLACES = 3  # of S, which the result does not take
C_BITS = 16
ROW = SUBTILE_COORD_BITS  # subtile_t: row, then column
FULL_COLOUR = (1023,) * 3
POOL = 3000
HOT = 2500  # visits that a faint splat of the least alpha needs to finish a pixel, and some


def place(lanes: int, lane: int, p: int) -> tuple[int, int]:
    """(column, row) of a lane's pixel: of 8 lanes each has one in every row and column, of 16 one in each quarter, of 32 one in each half."""
    if lanes == 8:
        return (lane + 5 * p) % 8, p
    if lanes == 16:
        return lane % 4 + 4 * (p % 2), lane // 4 + 4 * (p // 2)
    return lane % 8, lane // 8 + 4 * p


@numba.njit(cache=True)
def examine(shapes, t, masks, las):
    """Mask of each splat and La of each pixel, which is column i, row j: las (n, 8, 8). shapes: int64 (n, 6) w, z, half slopes, opacity code."""
    for n in range(len(shapes)):
        w, z, s0, s1, s2, opacity = shapes[n]
        s = SplatSetup(0, 0, 0, 0, w, z, s0, s1, s2, opacity, t.lo[opacity], 0, 0, 0)
        mask = row_mask(s, t)
        for p in range(64):
            i, j = place_of(p)
            masks[n, i, j] = (mask >> p) & 1
            las[n, i, j] = log_alpha(u_of(s, i, j, t), v_of(s, j, t), s.lo, t)


@numba.njit(cache=True)
def golden(la, p, total, colour, red, green, blue, t):
    """A visit of pixel p: outcome, whether clamped, exponent; changes total (P,) and colour (P, 3)."""
    r = pair(la, total[p], t)
    if r.outcome == BLENDED:
        total[p] = r.s_next
        colour[p, 0] = blend(colour[p, 0], r.exponent, r.mantissa, red, t)[1]
        colour[p, 1] = blend(colour[p, 1], r.exponent, r.mantissa, green, t)[1]
        colour[p, 2] = blend(colour[p, 2], r.exponent, r.mantissa, blue, t)[1]
    return r.outcome, r.clamped, r.exponent


class Splat:
    """pixels: number and La of the lane's pixels in its mask."""

    def __init__(self, numbers: list[int], pixels: list[tuple[int, int]], colour: tuple[int, int, int]) -> None:
        self.shape = 0
        for value, bits in zip((*numbers[:5], int(T.lo[numbers[5]])), SHAPE.values()):
            self.shape = self.shape << bits | (value & (1 << bits) - 1)
        self.pixels, self.colour = pixels, colour


def flat(la: int, rng) -> list[int]:
    """Numbers of an opaque splat without slopes that has this La in all pixels."""
    square = la << (2 * FORMATS.uv - FORMATS.log)
    u = math.isqrt(square)
    v = math.isqrt(square - u * u)
    return [rng.choice((u, -u)) << FORMATS.guard, rng.choice((v, -v)) << FORMATS.guard, 0, 0, 0, OPACITIES - 1]


def numbers_of(kind: str, rng) -> list[int]:
    """w, z, half slopes and opacity code of a random splat about the sub-tile."""
    size = lambda high: int(2 ** rng.uniform(2, high))  # noqa: E731
    s0, s1, s2 = size(13), size(13) * rng.choice((-1, 1)), size(13)
    a, b, opacity = rng.uniform(-9, 9), rng.uniform(-9, 9), rng.randrange(1, OPACITIES)
    if kind == "opaque":
        s0, s1, s2, a, b, opacity = size(6), size(6), size(6), 0.0, 0.0, rng.choice((255, 255, 255, 254, 253, 252, 251))
    if kind == "faint":  # a pixel is its centre
        a, b, opacity = rng.randrange(-7, 8, 2), rng.randrange(-7, 8, 2), 1
    if kind == "edge":
        return flat(rng.choice((T.limit, T.limit + 1, T.limit - 1, T.clamp, T.clamp + 1, T.clamp - 1)), rng)
    if kind == "flat":
        return flat(rng.randrange(T.limit + 1), rng)
    return [int(a * s0 + b * s1), int(b * s2), s0, s1, s2, opacity]


def splats(numbers: list[list[int]], lanes: int, lane: int, subtiles: int, rng) -> list[Splat]:
    """Those that have a pixel of the lane in their mask, which is that of each sub-tile."""
    masks, las = np.zeros((len(numbers), 8, 8), np.int64), np.zeros((len(numbers), 8, 8), np.int64)
    examine(np.array(numbers, np.int64), T, masks, las)
    places = [place(lanes, lane, p) for p in range(64 // lanes)] * subtiles
    found = []
    for n, row in enumerate(numbers):
        if pixels := [(p, int(las[n, i, j])) for p, (i, j) in enumerate(places) if masks[n, i, j]]:
            colour = FULL_COLOUR if rng.random() < 0.1 else tuple(rng.randrange(1024) for _ in range(3))
            found.append(Splat(row, pixels, colour))
    return found


class Subtile:
    """What visits in program order find and leave."""

    def __init__(self, pixels: int, rng) -> None:
        self.total, self.colour = np.zeros(pixels, np.int64), np.zeros((pixels, 3), np.int64)
        self.finished = 0
        self.address = rng.getrandbits(2 * SUBTILE_COORD_BITS)


class Item:
    """What came in a cycle: a visit (splat), the end of `subtile` (eos), the release of a slot (last), or nothing."""

    def __init__(self, subtile: Subtile, splat: Splat | None = None, pixel: int = 0, la: int = 0, slot: int = 0, *, eos: bool = False) -> None:
        self.subtile, self.splat, self.pixel, self.la, self.slot, self.eos = subtile, splat, pixel, la, slot, eos
        self.last = False


class Lane:
    """Drives and checks a lane, a cycle at a time."""

    def __init__(self, dut, bench: Bench) -> None:
        self.dut, self.rng = dut, bench.rng
        setting = config()
        self.lanes, self.lane, self.slots = setting["Lanes"], setting["Lane"], setting["Slots"]
        self.subtiles = setting.get("Subtiles", 1)
        late = self.subtiles > 1
        self.state_at, self.fetch_at, self.colour_at = STATE + late, FETCH + late, COLOUR + late
        self.pixels = self.subtiles * 64 // self.lanes
        self.of = self.lanes, self.lane, self.subtiles
        self.slot_bits, self.pixel_bits = (self.slots - 1).bit_length(), (self.pixels - 1).bit_length()
        self.places = [place(self.lanes, self.lane, p) for p in range(self.pixels // self.subtiles)] * self.subtiles
        self.edge = RisingEdge(dut.clk_i)
        self.inputs, self.outputs = ([getattr(dut, name) for name in names] for names in (INPUTS, OUTPUTS))
        self.driven = (0,) * len(INPUTS)
        for port in self.inputs:
            port.value = 0
        self.seen: Counter[str] = Counter()
        self.las: set[int] = set()
        self.forget()

    def forget(self) -> None:
        """As after reset or clear_i."""
        self.state = self.subtile = Subtile(self.pixels, self.rng)  # at STATE, and of what comes now
        nothing = Item(self.subtile)
        self.inside = deque([nothing] * (self.colour_at + 1), self.colour_at + 1)  # index: cycles since it came
        self.bank = False
        self.leaves: list[int] = []  # pixels in the bank that leave, the next first
        self.free = list(range(self.slots))
        self.table = [(0, 0, 0)] * self.slots

    async def cycle(self, item: Item | None = None, *, ready: bool = True, clear: bool = False) -> bool:
        """Item in, everything else checked; whether an end of a list may come next. colour_i is noise but for a visit that fetches."""
        dut, rng, inside, seen = self.dut, self.rng, self.inside, self.seen
        before = inside[0]
        item = item or Item(self.subtile, slot=rng.getrandbits(self.slot_bits), pixel=rng.getrandbits(self.pixel_bits))
        inside.appendleft(item)
        valid = item.eos or item.splat is not None
        shape = item.splat.shape if item.splat else rng.getrandbits(SHAPE_BITS)
        if item.eos:
            shape = shape >> 2 * SUBTILE_COORD_BITS << 2 * SUBTILE_COORD_BITS | self.subtile.address
        fetching = inside[self.fetch_at]
        colour = self.table[fetching.slot] if fetching.splat else tuple(rng.getrandbits(10) for _ in range(3))
        values = (
            int(clear), int(valid), int(item.eos) if valid else rng.getrandbits(1), int(item.last), item.pixel, item.slot, shape,
            colour[0] << 20 | colour[1] << 10 | colour[2], int(ready),
        )
        for port, value, old in zip(self.inputs, values, self.driven):
            if value != old:
                port.value = value
        self.driven = values
        if item.splat and before.splat and item.pixel == before.pixel:
            seen["same pixel in successive cycles"] += 1
        if item.splat and before.eos:
            seen["visit right behind a token"] += 1
            seen["same pixel right before and behind a token"] += inside[2].splat is not None and inside[2].pixel == item.pixel
        seen["token right behind a visit"] += item.eos and before.splat is not None
        seen["release without a visit"] += item.last and not valid
        await self.edge
        # The cycle that ends here: what it had on its outputs.
        leaves = bool(self.leaves)
        expected = (
            fetching.last, any(inside[s].eos for s in range(1, self.state_at + 1)), inside[self.state_at].eos, not self.bank, self.state.finished,
            self.events, leaves, inside[self.colour_at].eos, len(self.leaves) == 1,
        )
        self.events = self.visit(inside[self.state_at])
        outputs = tuple(int(port.value) for port in self.outputs)
        assert outputs == expected, [(name, got, int(want)) for name, got, want in zip(OUTPUTS, outputs, expected) if got != want]
        if fetching.splat or fetching.last:
            assert int(dut.colour_slot_o.value) == fetching.slot, "colour_slot_o"
        if leaves:
            got, want = int(dut.out_data_o.value), self.leaves[0]
            assert got == want, f"out_data_o: {got:024x} instead of {want:024x}, {len(self.leaves)} pixels left"
        if clear:
            seen["clear with visits inside"] += any(i.splat is not None for i in inside)
            seen["clear with a token inside"] += any(i.eos for i in list(inside)[1:])
            seen["clear with pixels in the bank"] += leaves
            seen["visit beside clear"] += item.splat is not None
            seen["token beside clear"] += item.eos
            self.forget()
            return True
        if leaves and ready:
            self.leaves.pop(0)
            if not self.leaves:
                self.bank = False
        seen["pixel waits"] += leaves and not ready
        if item.eos:
            seen["token as soon as the bank is free"] += self.freed_now
            self.bank = True
            self.subtile = Subtile(self.pixels, rng)
        self.freed_now = leaves and not self.bank
        if inside[self.colour_at].eos:
            self.fill(inside[self.colour_at].subtile)
        if fetching.last:
            self.free.append(fetching.slot)
            self.table[fetching.slot] = tuple(rng.getrandbits(10) for _ in range(3))
        return not self.bank

    freed_now = False  # the bank was freed in the cycle before
    events = 0  # of the cycle before, as they are counted

    def visit(self, item: Item) -> int:
        """Events of what is at STATE; follows it in the golden model."""
        if item.eos:
            self.state = self.inside[self.inside.index(item) - 1].subtile
            return 0
        if item.splat is None:
            return 0
        state, p, seen = item.subtile, item.pixel, self.seen
        if state.finished >> p & 1:
            skipped = item.la > T.limit
            seen["visit of a finished pixel"] += 1
            return 8 | skipped << 2
        outcome, clamped, exponent = golden(item.la, p, state.total, state.colour, *item.splat.colour, T)
        seen["visits"] += 1
        if outcome == SKIPPED:
            seen["skipped"] += 1
            seen["skipped by one"] += item.la == T.limit + 1
            return 8 | 4
        if outcome == FINISHED:
            state.finished |= 1 << p
            seen["finished"] += 1
            seen["T is 1e-4 and finished"] += int(state.total[p]) == T.s_max
            return 8 | 1
        self.las.add(item.la)
        seen["clamped"] += clamped
        seen["La at the clamp"] += item.la == T.clamp
        seen["La above the clamp"] += item.la == T.clamp + 1
        seen["La at the limit"] += item.la == T.limit
        seen["T is 1e-4 and blended"] += int(state.total[p]) == T.s_max
        seen["weight without a product"] += exponent > 16
        return 8 | 2

    def fill(self, subtile: Subtile) -> None:
        """The bank: pixels as they are to leave."""
        for p, ((column, row), total, colour) in enumerate(zip(self.places, subtile.total.tolist(), subtile.colour.tolist())):
            word = self.address(subtile, p * self.subtiles // self.pixels) << 6 | column << 3 | row
            word = word << 17 | total >> RESULT_PLACES
            for c in colour:
                word = word << C_BITS | c
            self.seen["colour of 1.98 and more"] += max(colour) > 1.98 * (1 << FORMATS.accumulator)
            self.leaves.append(word)
        self.seen["sub-tiles"] += 1

    def address(self, subtile: Subtile, member: int) -> int:
        """Of one of the list's sub-tiles: two lie one below the other, four fill a tile."""
        row = 1 << ROW
        return {1: subtile.address, 2: subtile.address & ~row | member * row, 4: subtile.address & ~row & ~1 | (member >> 1) * row | member & 1}[self.subtiles]

    async def run(self, entries: list[tuple[Splat, list[tuple[int, int]]]], *, idle: float, stall, clears: float = 0.0) -> None:
        """A sub-tile: the visits of each entry in order, and its end; or until clear_i comes."""
        rng, seen = self.rng, self.seen
        waiting = deque(entries)
        splat, slot, left = None, 0, deque()  # of the entry that is visited
        token = False
        while True:
            clear = rng.random() < clears
            item = None
            if rng.random() >= idle:
                if splat is None and waiting and self.free:
                    splat, pixels = waiting.popleft()
                    left = deque(pixels)
                    slot = self.free.pop(rng.randrange(len(self.free)))
                    self.table[slot] = splat.colour
                if splat is None:
                    token = not waiting and not self.bank
                    if token:
                        clear = clear or (clears > 0 and rng.random() < 0.2)
                        item = Item(self.subtile, eos=True, slot=rng.getrandbits(self.slot_bits), pixel=rng.getrandbits(self.pixel_bits))
                    seen["no slot"] += bool(waiting)
                elif left:
                    p, la = left.popleft()
                    item = Item(self.subtile, splat, p, la, slot)
                    if not left and rng.random() < 0.9:
                        item.last, splat = True, None
                        seen["release with a visit"] += 1
                else:
                    item = Item(self.subtile, slot=slot, pixel=rng.getrandbits(self.pixel_bits))
                    item.last, splat = True, None
            await self.cycle(item, ready=not next(stall), clear=clear)
            if clear or token:
                return


@cocotb.test()
async def program_order(dut):
    """Every output in every cycle; every finished pixel as the golden model leaves it."""
    bench = Bench(dut)
    rng = bench.rng
    lane = Lane(dut, bench)
    seen = lane.seen
    assert sorted(place(lane.lanes, l, p) for l in range(lane.lanes) for p in range(64 // lane.lanes)) == [(i, j) for i in range(8) for j in range(8)]
    kinds = {"any": 0.4, "flat": 0.15, "opaque": 0.1, "faint": 0.15, "edge": 0.2}
    pool = {kind: splats([numbers_of(kind, rng) for _ in range(int(POOL * share))], *lane.of, rng) for kind, share in kinds.items()}
    assert all(len(p) > 50 for p in pool.values()), {k: len(p) for k, p in pool.items()}
    every = splats([flat(la, rng) for la in range(T.limit + 1)], *lane.of, rng)
    assert all({la for _, la in s.pixels} == {n} for n, s in enumerate(every))
    assert len(every) == T.limit + 1 and all(len(s.pixels) == lane.pixels for s in every)
    await bench.reset()
    await lane.edge

    def some() -> Splat:
        return rng.choice(pool[rng.choices(list(kinds), kinds.values())[0]])

    # Sub-tiles of all splats, pixels in any order, or one pixel only; clear_i.
    only = 0
    for _ in range(260):
        entries = []
        kind = rng.random()
        only = only if rng.random() < 0.8 else rng.randrange(lane.pixels)
        for _ in range(rng.choice((0, 1, 3, 20, 60))):
            splat = some()
            pixels = rng.sample(splat.pixels, rng.randrange(len(splat.pixels) + 1))
            if kind < 0.4:
                pixels = [(p, la) for p, la in splat.pixels if p == only]
            entries.append((splat, pixels))
        if kind < 0.1:  # three layers of 0.99
            opaque = [s for s in pool["opaque"] if any(p == only and la <= T.clamp for p, la in s.pixels)]
            entries = [(s, [(p, la) for p, la in s.pixels if p == only]) for s in rng.sample(opaque, 3)] + entries[:5]
        await lane.run(
            entries, idle=rng.choice((0.0, 0.0, 0.0, 0.3, 0.8)), stall=bench.stall(rng.choice(("never", "half", "heavy", "bursts"))),
            clears=rng.choice((0.0, 0.0, 0.05, 0.05, 0.001)),
        )
    # A pixel of thousands of layers: bright ones to its end.
    for splat in pool["faint"]:
        if any(la == T.limit for _, la in splat.pixels):
            break
    splat.colour = FULL_COLOUR
    at = next(pixel for pixel in splat.pixels if pixel[1] == T.limit)
    before = seen["La at the limit"]
    await lane.run([(splat, [at] * HOT)], idle=0.0, stall=bench.stall("half"))
    assert seen["La at the limit"] - before > 2000
    # Every La twice, on as few pixels as it can be: S with all but its lowest place leaves a trace.
    chosen = rng.sample(every, int(len(every) * config()["sweep"]))
    while chosen:
        entries = []
        for p in range(lane.pixels):
            total = 0
            while chosen and total <= T.s_max:
                splat = chosen.pop()
                la = splat.pixels[p][1]
                h = int(T.h[la]) if la > T.clamp else T.h_max
                if total + h > T.s_max and total > 0:
                    chosen.append(splat)
                    break
                times = 2 if total + 2 * h <= T.s_max else 1
                total += times * h
                entries.append((splat, [(p, la)] * times))
        await lane.run(rng.sample(entries, len(entries)), idle=0.0, stall=bench.stall("never"))
    for _ in range(100):
        await lane.cycle()
    assert not lane.bank
    assert len(lane.las) >= config()["sweep"] * T.limit, len(lane.las)
    dut._log.info("%s", dict(seen))
    never = [name for name in CASES if seen[name] < 5]
    assert not never, (never, dict(seen))
    assert seen["colour of 1.98 and more"] > 0
    assert seen["no slot"] > 5 or lane.slots > lane.fetch_at


CASES = (
    "same pixel in successive cycles", "visit right behind a token", "same pixel right before and behind a token", "token right behind a visit",
    "release without a visit", "release with a visit", "clear with visits inside", "clear with a token inside", "clear with pixels in the bank",
    "visit beside clear", "token beside clear", "pixel waits", "token as soon as the bank is free", "visit of a finished pixel", "skipped",
    "skipped by one", "finished", "T is 1e-4 and finished", "T is 1e-4 and blended", "clamped", "La at the clamp", "La above the clamp", "La at the limit",
    "weight without a product", "sub-tiles",
)
