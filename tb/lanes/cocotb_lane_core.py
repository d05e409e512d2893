"""cocotb tests of flk_lane_core; settings: Lanes, InWidth, Slots, Depth, Subtiles, passes (times that all lists are sent), aborts."""

from __future__ import annotations

from collections import Counter, deque
from itertools import pairwise

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config

from flicker import layout
from flicker.golden.lanes.lists import RecordLists
from flicker.golden.lanes.render import COUNTS, render_lanes
from flicker.params import LANE_ROW_MASK_STAGES, LANE_SETUP_STAGES, SUBTILE, SUBTILE_COORD_BITS, SUBTILE_PIXELS
from flicker.perf.lanes import lane_work, pixels_of_lanes

# Fields of lane_core_events_t, highest first.
EVENTS = {
    "busy": 1, "stalled": 1, "idle": 1, "tokens": 2, "splats": 2, "rejected": 2, "dropped": 2, "dispatched": 1, "no_slot": 1, "no_room": 1,
    "entries": 6, "visits": 6, "skipped": 6, "blended": 6, "finished": 6, "starved": 6, "waits": 6,
}
LATE = ("entries", "visits", "skipped", "blended", "finished")  # are told a cycle later, whatever clear_i does
ELEM, OUT, PIXEL = (layout.fields(name) for name in ("record_elem", "core_pixel", "pixel"))
ELEM_BITS = layout.bits("record_elem")
STAGES = LANE_SETUP_STAGES + LANE_ROW_MASK_STAGES
COLS, ROWS = 97, 61  # sub-tiles of the picture
SHARE = config().get("Subtiles", 1)  # sub-tiles of a list: one, two below each other, a tile
KINDS = {"mixed": 12, "bits": 4, "closed": 12, "wide": 4, "narrow": 5, "far": 2, "empty": 8}  # sub-tiles of each


def number(rng, exponents: tuple[int, int]) -> int:
    """Shape number with one of these exponent codes."""
    return rng.randrange(*exponents) << 9 | rng.getrandbits(9)


def record(rng, kind: str, col: int, row: int) -> int:
    """A record about this sub-tile."""
    if kind == "bits":
        return rng.getrandbits(128)
    pixel = 1 << 7
    x, y = (pixel * SUBTILE * at + rng.randrange(-3 * pixel, 11 * pixel) for at in (col, row))
    shape = [number(rng, (27, 32)) for _ in range(3)]
    opacity = rng.choice((rng.randrange(256), 20, 255, 255))
    if kind == "opaque":
        shape, opacity = [number(rng, (8, 20)) for _ in range(3)], rng.choice((255, 255, 254, 200))
    elif kind == "wide":
        shape, opacity = [number(rng, (15, 25)) for _ in range(3)], rng.randrange(1, 60)
    elif kind == "narrow":  # a pixel or a row or a column of pixels
        x, y = (pixel * (SUBTILE * at + 4) + 64 for at in (col, row))
        shape, opacity = [number(rng, e) for e in ((31, 32), (1, 3), (31, 32))], rng.randrange(1, 60)
        if rng.random() < 0.2:
            shape[rng.choice((0, 2))] = number(rng, (5, 20))
    elif kind == "far":
        x, y = x + 100 * pixel, y + 100 * pixel
    places = ((23, x & (1 << 23) - 1 if x >= 0 else x & (1 << 20) - 1), (23, y if y >= 0 else y & (1 << 20) - 1), (14, shape[0]), (14, shape[1]),
              (1, rng.getrandbits(1)), (14, shape[2]), (8, opacity), (31, rng.getrandbits(31)))
    word = at = 0
    for bits, value in places:
        assert 0 <= value < 1 << bits, places
        word |= value << at
        at += bits
    assert at == 128
    return word


class Own:
    """A sub-tile's list with what the golden model says of it.

    items: elements without its end. words: 64 output elements, by lane and in each lane's order. counts: of golden.lanes.render. done: elements up to the one
    that finishes the last pixel; beyond the list if none does. masked, needed: for each element, mask bits and lanes that have one, and lanes that have one
    of a pixel that is not finished.
    """

    def __init__(self, frame, s: int, masks: np.ndarray, finish: np.ndarray, pixels: np.ndarray) -> None:
        lists = frame.lists
        address = s // COLS << SUBTILE_COORD_BITS | s % COLS
        entries = range(lists.start[s], lists.start[s + 1])
        self.end = 1 << ELEM["eos"].at | address
        self.items = []
        for n in entries:
            low, high = (int(word) & (1 << 64) - 1 for word in lists.records[lists.entry[n]])
            self.items.append((high << 64 | low) << ELEM["record"].at | address)
        self.words = [[address << OUT["subtile"].at | int(p) << OUT["index"].at | self._pixel(frame.pixels[s, p]) for p in own] for own in pixels]
        self.counts = dict(zip(COUNTS, (int(c) for c in frame.counts[s])))
        self.done = int(finish[s].max()) + 1
        self.masked, self.lanes, self.needed = [], [], []
        for k, n in enumerate(entries):
            bits = np.array([int(masks[n]) >> p & 1 for p in range(SUBTILE_PIXELS)])
            self.masked.append(int(bits.sum()))
            self.lanes.append(int(bits[pixels].any(axis=1).sum()))
            self.needed.append(int((bits & (finish[s] >= k))[pixels].any(axis=1).sum()))

    @staticmethod
    def _pixel(values) -> int:
        return sum(int(v) << place.at for v, place in zip(values, PIXEL.values()))


class List:
    """What a core takes as one list: those of several sub-tiles, mixed at random.

    items, masked, lanes, needed: of each element, as in `Own`; member: its sub-tile. done: of each sub-tile, elements of the list up to the one that finishes
    its last pixel. counts: sums.
    """

    def __init__(self, own: list[Own], rng) -> None:
        left = [m for m, of in enumerate(own) for _ in of.items]
        rng.shuffle(left)
        at = [0] * len(own)
        self.items, self.masked, self.lanes, self.needed, self.member = [], [], [], [], left
        self.done = [1 << 30 if of.done else 0 for of in own]
        for n, m in enumerate(left):
            of, k = own[m], at[m]
            at[m] += 1
            self.items.append(of.items[k])
            self.masked.append(of.masked[k])
            self.lanes.append(of.lanes[k])
            self.needed.append(of.needed[k])
            if k + 1 == of.done:
                self.done[m] = n + 1
        self.end = rng.choice(own).end
        self.words = [[word for of in own for word in of.words[l]] for l in range(len(own[0].words))]
        self.counts = {name: sum(of.counts[name] for of in own) for name in own[0].counts}


def make(rng, pixels: np.ndarray) -> list[List]:
    """Lists of every kind, all in one picture."""
    kinds = [kind for kind, count in KINDS.items() for _ in range(count)]
    if SHARE == 1:
        groups = [[s] for s in sorted(rng.sample(range(COLS * ROWS), len(kinds)))]
        kinds = rng.sample(kinds, len(kinds))
    else:  # tiles: some of which all finish, two without an element, the rest of all kinds
        tiles = rng.sample([(y, x) for y in range(0, ROWS - 1, 2) for x in range(0, COLS - 1, 2)], 16)
        members = ((0, 0), (0, 1), (1, 0), (1, 1)) if SHARE == 4 else ((0, 0), (1, 0))
        groups = [[(y + j) * COLS + x + i for j, i in members] for y, x in tiles]
        kinds = ["closed"] * 5 * SHARE + ["empty"] * 2 * SHARE + rng.choices(kinds, k=9 * SHARE)
    chosen = dict(sorted(zip([s for group in groups for s in group], kinds)))
    records, start = [], np.zeros(COLS * ROWS + 1, np.int64)
    for s, kind in chosen.items():
        of = {"mixed": ["mixed"] * rng.randrange(1, 50), "bits": ["bits"] * rng.randrange(1, 20), "wide": ["wide"] * rng.randrange(1, 16),
              "narrow": ["narrow"] * rng.randrange(1, 60), "far": ["far"] * rng.randrange(1, 30), "empty": []}
        of["closed"] = rng.sample(of["wide"] + of["narrow"] + of["far"], rng.randrange(3)) + ["opaque"] * 5 + rng.sample(
            [*of["mixed"], *of["bits"], "wide", "wide", "wide", "far", "far"] * 50, rng.choice((0, 3, 20, 150, 250, 350)))
        made = [record(rng, k, s % COLS, s // COLS) for k in of[kind]]
        records += made
        start[s + 1] = len(made)
    start = np.cumsum(start)
    words = np.array([[r & (1 << 64) - 1, r >> 64] for r in records], np.uint64).view(np.int64)
    lists = RecordLists(COLS * SUBTILE, ROWS * SUBTILE, words, start, np.arange(len(records), dtype=np.int32), COLS, ROWS, 0)
    frame, work = render_lanes(lists), lane_work(lists)
    of = {s: Own(frame, s, work.mask, work.finish, pixels) for s in chosen}
    return [List([of[s] for s in group], rng) for group in groups]


class Core:
    """Drives and checks a core, a cycle at a time; everything is judged by what was taken."""

    def __init__(self, dut, bench: Bench) -> None:
        self.dut, self.rng, self.edge = dut, bench.rng, RisingEdge(dut.clk_i)
        self.width, self.lanes, self.depth = (config()[name] for name in ("InWidth", "Lanes", "Depth"))
        self.lane_of = {int(p): l for l, own in enumerate(pixels_of_lanes(self.lanes)) for p in own}
        self.inputs = [getattr(dut, name) for name in ("clear_i", "in_valid_i", "in_elem_i", "out_ready_i")]
        self.outputs = [getattr(dut, name) for name in ("idle_o", "in_ready_o", "finished_o", "out_valid_o", "events_o")]
        self.driven: tuple[int, ...] = ()
        self.seen: Counter[str] = Counter()
        self.most = 0  # cycles that finished_o took to rise
        self.lists: deque[List] = deque()  # to be sent
        self.after_clear = False
        self.drive(0, 0, 0, 0)
        self.forget()

    def forget(self) -> None:
        """As after reset."""
        self.beat: list[tuple[List, int | None]] = []  # offered: list and position, None: its end
        self.word = 0  # on the port
        self.at = 0  # position in the first of `lists`
        self.list: List | None = None  # the one that is open at the input
        self.taken = 0  # elements of it
        self.expected: list[deque[int]] = [deque() for _ in range(self.lanes)]
        self.left = 0  # pixels of lists whose end was taken
        self.since = STAGES + 1  # cycles since the last element was taken
        self.late, self.limit = [0] * SHARE, [0] * SHARE  # cycles in which finished_o could have come, and the most of them
        self.finished = [False] * SHARE
        self.held: int | None = None  # pixel that waits at the output
        self.total: Counter[str] = Counter()
        self.want: Counter[str] = Counter()
        self.bounds: Counter[str] = Counter()
        self.first = True

    def drive(self, *values: int) -> None:
        """Ports that change."""
        for i, port in enumerate(self.inputs):
            if self.driven[i:i + 1] != values[i:i + 1]:
                port.value = values[i]
        self.driven = values

    def form(self, both: float, leave: bool, finished: list[bool]) -> None:
        """The next beat. finished: finished_o about the next element's list."""
        lists = self.lists
        leaves = lists[0] if leave and lists and self.at > 0 else None
        for w in range(self.width):
            if not lists or (w > 0 and self.rng.random() >= both):
                break
            while lists[0] is leaves and self.at < len(leaves.items) and finished[leaves.member[self.at]]:
                self.at += 1
                self.seen["list left early"] += 1
                self.seen["list left by some"] += not all(finished)
            if self.at == len(lists[0].items):
                self.beat.append((lists.popleft(), None))
                self.at = 0
            else:
                self.beat.append((lists[0], self.at))
                self.at += 1

    async def cycle(self, *, idle: bool, ready: bool, both: float, leave: bool, clear: bool = False) -> None:
        """One cycle: drive, wait, check what it had."""
        rng, seen = self.rng, self.seen
        if not self.beat and not idle:
            self.form(both, leave, self.finished)
            elems = [own.items[k] if k is not None else own.end | rng.getrandbits(128) << ELEM["record"].at for own, k in self.beat]
            elems += [rng.getrandbits(ELEM_BITS) for _ in range(self.width - len(elems))]
            self.word = sum(e << w * ELEM_BITS for w, e in enumerate(elems))
        word = self.word if self.beat else rng.getrandbits(self.width * ELEM_BITS)
        self.drive(int(clear), (1 << len(self.beat)) - 1, word, int(ready))
        await self.edge
        idle_o, in_ready, finished, valid, events = (int(port.value) for port in self.outputs)
        count = {}
        for name, bits in reversed(EVENTS.items()):
            count[name] = events & (1 << bits) - 1
            events >>= bits
        if self.first:
            for name in LATE:
                count[name] = 0
        take = bool(self.beat) and in_ready == 1
        ends = sum(k is None for _, k in self.beat)
        # Events of the input.
        got = tuple(count[name] for name in ("busy", "stalled", "idle", "tokens", "splats"))
        want = (int(take), int(bool(self.beat) and not take), int(not self.beat), take * ends, take * (len(self.beat) - ends))
        assert got == want, f"busy, stalled, idle, tokens, splats: {got} instead of {want}"
        # idle_o
        inside = self.left > 0 or self.since <= STAGES
        assert not (idle_o and inside), f"idle_o with {self.left} pixels inside, {self.since} cycles after an element"
        assert idle_o or self.left > 0 or self.list is not None, "no list and no pixel is inside, but idle_o is low"
        seen["idle with a list open"] += idle_o and self.list is not None
        # finished_o
        told = [bool(finished >> m & 1) for m in range(SHARE)]
        for m in range(SHARE):
            over = self.list is not None and self.taken >= self.list.done[m]
            assert not told[m] or over, f"finished_o, but not all pixels of sub-tile {m} at the input are"
            assert told[m] or not self.finished[m], f"finished_o of sub-tile {m} fell before its list's end"
            if not over or told[m]:
                self.late[m], self.limit[m] = 0, 0
            else:
                self.limit[m] = self.limit[m] or self.finish_limit()
                self.late[m] += not valid or ready
                self.most = max(self.most, self.late[m])
                assert self.late[m] <= self.limit[m], f"finished_o of sub-tile {m} did not come in {self.late[m]} cycles"
        # Pixels
        assert valid or self.held is None, "out_valid_o fell"
        if valid:
            pixel = int(self.dut.out_data_o.value)
            assert self.held is None or pixel == self.held, "out_data_o changed before its transfer"
            self.held = pixel
            l = self.lane_of[pixel >> OUT["index"].at & 63]
            assert self.expected[l], f"pixel {pixel:024x} of lane {l} is not owed"
            assert pixel == self.expected[l][0], f"pixel {pixel:024x} of lane {l} instead of {self.expected[l][0]:024x}"
        self.total.update(count)
        for name in ("no_slot", "no_room", "waits", "starved", "dropped", "rejected", "stalled"):
            seen[name] += count[name] > 0
        seen["both dropped in one cycle"] += count["dropped"] == 2
        seen["finished_o"] += all(told)
        seen["finished_o of some"] += any(told) and not all(told)
        seen["pixel waits"] += valid and not ready
        if clear:
            seen["clear with pixels owed"] += self.left > 0
            seen["clear with elements inside"] += self.since <= STAGES
            seen["clear when finished"] += all(told)
            seen["clear while stalled"] += bool(self.beat) and not take
            seen["clear beside elements"] += take
            seen["clear with a pixel at the output"] += valid
            seen["clear in the middle of a beat"] += count["dispatched"] and not in_ready
            self.forget()
            self.after_clear = True
            return
        if self.after_clear:
            assert idle_o and not finished and not valid, "not as after reset behind clear_i"
            seen["element right behind clear"] += take
            self.after_clear = False
        if valid and ready:
            self.expected[l].popleft()
            self.left -= 1
            self.held = None
        self.finished = told
        self.first = False
        self.since += 1
        if take:
            self.take()

    def take(self) -> None:
        """The beat was transferred."""
        seen, want, bounds = self.seen, self.want, self.bounds
        self.since = 1
        seen[" ".join("end" if k is None else "element" for _, k in self.beat)] += 1
        for (_, end), (second, k) in pairwise(self.beat):
            if end is None and k is not None:
                # All pixels in its mask are known to be finished, but in the sub-tile before.
                seen["known finished, and an element of the next list beside its end"] += self.finished[second.member[k]] and second.masked[k] > 0
        for own, k in self.beat:
            if k is None:
                want["tokens"] += 1
                for name in ("blended", "skipped", "visited", "pixels_finished"):
                    want[name] += own.counts[name]
                for l, words in enumerate(own.words):
                    self.expected[l].extend(words)
                self.left += SHARE * SUBTILE_PIXELS
                seen["token of an empty list"] += not own.items
                self.list, self.taken, self.finished, self.late, self.limit = None, 0, [False] * SHARE, [0] * SHARE, [0] * SHARE
            else:
                want["splats"] += 1
                want["rejected"] += own.masked[k] == 0
                want["needed"] += own.needed[k] > 0
                bounds["masked"] += own.masked[k]
                bounds["lanes"] += own.lanes[k]
                want["lanes"] += own.needed[k]
                self.list, self.taken = own, k + 1
        self.beat = []

    def finish_limit(self) -> int:
        """Cycles that finished_o may take while nothing waits for the output: what may lie before it in store, queues and bank."""
        per_lane = SHARE * SUBTILE_PIXELS // self.lanes
        return 40 + self.width * STAGES * per_lane + per_lane * (self.depth + 2) + 80 * (self.left // SUBTILE_PIXELS + 1)

    def drained(self) -> None:
        """All lists are complete and have left: the sums."""
        total, want, bounds = self.total, self.want, self.bounds
        assert not any(self.expected) and self.list is None
        got = {name: total[name] for name in ("tokens", "splats", "rejected", "blended", "finished")}
        expected = {**{name: want[name] for name in ("tokens", "splats", "rejected", "blended")}, "finished": want["pixels_finished"]}
        assert got == expected, (got, expected)
        assert total["dropped"] + total["dispatched"] + total["rejected"] == total["tokens"] + total["splats"]
        assert total["dispatched"] >= total["tokens"] + want["needed"], "a splat was dropped that has pixels that are not finished"
        assert want["lanes"] <= total["entries"] <= bounds["lanes"], (want["lanes"], total["entries"], bounds["lanes"])
        assert want["visited"] <= total["visits"] <= bounds["masked"], (want["visited"], total["visits"], bounds["masked"])
        assert want["skipped"] <= total["skipped"] <= total["visits"] - total["blended"] - total["finished"]
        self.seen["visits of finished pixels"] += total["visits"] - want["visited"]

    async def run(self, lists: list[List], idle: str, stall: str, *, both: float, leave: bool, bench: Bench, abort: int = -1) -> None:
        """All lists through the core; or until clear_i comes after so many cycles."""
        self.lists.extend(lists)
        pauses, stalls = bench.stall(idle), bench.stall(stall)
        limit = 1000 + 200 * sum(len(own.items) + SHARE * SUBTILE_PIXELS for own in lists)
        for n in range(limit):
            clear = n == abort
            await self.cycle(idle=next(pauses), ready=not next(stalls), both=both, leave=leave, clear=clear)
            if clear:
                self.lists.clear()
                for _ in range(self.rng.choice((0, 0, 1, 3))):
                    self.lists.extend(self.rng.sample(lists, 2))
                    await self.cycle(idle=self.rng.random() < 0.5, ready=self.rng.random() < 0.5, both=0.5, leave=False, clear=True)
                    self.lists.clear()
                return
            if not self.lists and not self.beat and not self.left:
                for _ in range(3):
                    await self.cycle(idle=True, ready=True, both=0, leave=False)
                self.drained()
                return
        raise AssertionError(f"{self.left} pixels inside and {len(self.lists)} lists left after {limit} cycles")


@cocotb.test()
async def lists_and_pixels(dut):
    """Every pixel once and as the golden model has it, idle_o and finished_o in every cycle, events."""
    bench = Bench(dut)
    core = Core(dut, bench)
    rng, seen = core.rng, core.seen
    made = make(rng, pixels_of_lanes(core.lanes))
    assert sum(own.counts["pixels_finished"] for own in made) > 300 and sum(max(own.done) <= len(own.items) for own in made) >= (6 if SHARE == 1 else 3)
    await bench.reset()
    await core.edge
    aborts = config()["aborts"]
    for n in range(config()["passes"]):
        idle, stall = (("never", "never"), ("half", "never"), ("never", "heavy"), ("bursts", "half"), ("never", "bursts"), ("rare", "rare"))[n % 6]
        lists = rng.sample(made, len(made))
        if stall == "heavy":
            lists = lists[:12]
        await core.run(lists, idle, stall, both=rng.choice((1.0, 1.0, 0.7)), leave=n % 2 == 0, bench=bench)
        for _ in range(aborts // config()["passes"]):
            idle, stall = rng.choice(("never", "never", "rare", "half")), rng.choice(("never", "rare", "half", "heavy"))
            abort = rng.choice((9, 9, 9, 50, 400)) + rng.randrange(40)
            await core.run(rng.sample(made, 12), idle, stall, both=0.8, leave=rng.random() < 0.5, bench=bench, abort=abort)
    for own in rng.sample(made, 6):  # one after the other
        await core.run([own], "half", "half", both=0.5, leave=False, bench=bench)
    dut._log.info("%s, finished_o after %d cycles", dict(seen), core.most)
    cases = CASES + (TWO if core.width == 2 else ()) + (SOME if SHARE > 1 else ())
    never = [name for name in cases if not seen[name]]
    assert not never, (never, {name: seen[name] for name in cases})


CASES = (
    "element", "end", "no_slot", "no_room", "waits", "starved", "dropped", "rejected", "stalled", "finished_o", "list left early", "pixel waits",
    "clear with pixels owed", "clear with elements inside", "clear while stalled", "clear beside elements",
    "clear with a pixel at the output", "element right behind clear", "token of an empty list", "visits of finished pixels", "idle with a list open",
)
SOME = ("finished_o of some", "list left by some")
TWO = (
    "element element", "element end", "end element", "end end", "both dropped in one cycle", "clear in the middle of a beat",
    "known finished, and an element of the next list beside its end",
)
