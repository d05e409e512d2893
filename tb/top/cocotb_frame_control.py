"""cocotb tests of flk_frame_control: host, both halves and counters as Python agents; what a frame must give follows from golden functions."""

from __future__ import annotations

from dataclasses import dataclass, field

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, four_state, netlist, rounds

from flicker.golden.frame_buffer import PixelFormat, least_stride
from flicker.golden.lists import WRITERS, pointer_lines, writer_columns
from flicker.params import CatMode

# Fields, most significant first, as in flk_top_pkg.descriptor_t, flk_preproc_pkg.front_registers_t and flk_rendering_pkg.rendering_registers_t.
CULL = 32 * (3 + 15 + 5 + 5)
LANE = (("chunked", 1), ("box", 1), ("antialiased", 1), ("by_distance", 1), ("width", 13), ("height", 13), ("view", 28 * (9 + 2) + 20 * (12 + 4) + 2 * 23))
ADDRESSES = ("scene_table", "headers", "geometry", "colours", "records", "lists", "pointers", "frame_buffer")
DESCRIPTOR = (
    ("tag", 16), ("mode", 3), ("rgba", 1), ("background", 24), ("cull", CULL), *LANE, *((name, 40) for name in ADDRESSES),
    ("store", 40), ("store_clusters", 24), ("generation", 32), ("tolerance", 32),
    ("clusters", 24), ("record_beats", 23), ("chunks", 25), ("stride", 17), ("deadline", 32),
)
FRONT = (
    ("cull", CULL), *LANE, ("store_enable", 1), ("store", 29), ("generation", 32), ("tolerance", 32),
    ("scene_table", 34), ("headers", 34), ("geometry", 34), ("colours", 34), ("clusters", 24), ("records", 34), ("record_beats", 23),
    ("lists", 34), ("chunks", 25), ("pointers", 34), ("pointer_lines", 11), ("list_columns", 8),
)
RENDERING = (
    ("mode", 3), ("rgba", 1), ("background", 24), ("pairs", 8), ("rows", 9), ("all_pairs", 16), ("lists", 34), ("chunks", 25), ("pointers", 34),
    ("records", 34), ("frame_buffer", 34), ("stride", 12),
)
# Bits of a frame's error, from bit 0: registers.md.
RENDERING_BITS, DESCRIPTOR_ERROR, ABORTED, TIMED_OUT, BAD_TABLE, LATE = 4, 1 << 7, 1 << 8, 1 << 9, 10, 1 << 12
RESET = 4  # cycles
# Mean latencies of front end, rendering half, copies, acknowledgement and host. `frames` takes every other one, `deadlines` a slow half of either kind;
# with SLOW=1 both take all.
SPEEDS = [(20, 20, 5, 10, 1), (5, 60, 5, 1, 1), (60, 5, 5, 5, 1), (8, 8, 30, 60, 1), (10, 10, 5, 5, 80)]


def pack(fields, values) -> int:
    out = 0
    for name, bits in fields:
        assert 0 <= values[name] < 1 << bits, (name, values[name])
        out = out << bits | values[name]
    return out


def unpack(fields, value) -> dict[str, int]:
    out = {}
    for name, bits in reversed(fields):
        out[name] = value & (1 << bits) - 1
        value >>= bits
    return out


def grid(d) -> tuple[int, int]:
    return -(-d["width"] // 16), -(-d["height"] // 16)


def stride_of(d) -> int:
    return least_stride(d["width"], PixelFormat.RGBA16F if d["rgba"] else PixelFormat.RGB8)


def writer_lists(d) -> int:
    cols, rows = grid(d)
    return writer_columns(cols) * -(-rows // 2)


def legal(d, lists: int) -> bool:
    """The rules of the header."""
    return (
        all(d[name] % 64 == 0 for name in ADDRESSES) and d["stride"] % 32 == 0 and 1 <= d["width"] <= 4096 and 1 <= d["height"] <= 4096
        and d["mode"] <= max(CatMode) and d["clusters"] > 0 and writer_lists(d) <= lists and d["stride"] >= stride_of(d)
        and (d["generation"] == 0 or (d["chunked"] and d["store"] % 2048 == 0 and d["store_clusters"] >= d["clusters"]))
    )


def front_registers(d) -> dict[str, int]:
    cols, rows = grid(d)
    beats = {name: d[name] // 64 for name in ADDRESSES} | {"store": d["store"] >> 11, "store_enable": int(d["generation"] > 0)}
    return {**d, **beats, "pointer_lines": pointer_lines(cols, rows) // WRITERS, "list_columns": writer_columns(cols)}


def rendering_registers(d) -> dict[str, int]:
    cols, rows = grid(d)
    beats = {name: d[name] // 64 for name in ADDRESSES}
    pairs = -(-cols // 2)
    return {**d, **beats, "pairs": pairs, "rows": rows, "all_pairs": pairs * rows, "stride": d["stride"] // 32}


@dataclass
class Frame:
    """d: descriptor. front_error, rendering_error: what the halves will say at their ends. stamps: when it was taken, left the front end, entered rendering,
    left it. begun: when the host started it. ended: the front end, by itself. late; skipped: the rendering half, for that. left: pairs of tiles that
    rendering has not written where it is stopped."""

    number: int
    d: dict[str, int]
    front_error: int
    rendering_error: int
    legal: bool
    bank: int | None = None
    stamps: list[int] = field(default_factory=lambda: [-1] * 4)
    begun: int = 0
    ended: bool = False
    late: bool = False
    skipped: bool = False
    left: int = 0
    cut: bool = False

    @property
    def error(self) -> int:
        if not self.legal:
            return DESCRIPTOR_ERROR
        front = self.ended * (self.front_error & 15 | self.front_error >> 4 << BAD_TABLE)
        return front | self.rendered * self.rendering_error << RENDERING_BITS | self.late * LATE

    @property
    def rendered(self) -> bool:
        return self.legal and not self.skipped and not (self.ended and self.front_error)

    @property
    def pairs(self) -> int:
        return self.rendered * (rendering_registers(self.d)["all_pairs"] - self.left * self.cut)

    def due(self, now: int) -> bool:
        """As the design knows it in the cycle `now`: two behind the deadline."""
        return self.d["deadline"] > 0 and (now - self.begun) % (1 << 32) - 2 >= self.d["deadline"]


class Half:
    """A half or the copy of its counters: begins on a start, is done `latency()` cycles later. idle comes `rest()` cycles after."""

    def __init__(self, latency, rest) -> None:
        self.latency, self.rest = latency, rest
        self.reset()

    def reset(self) -> None:
        self.left: int | None = None
        self.pause = 0
        self.stopping: int | None = None
        self.stopped = False  # until a reset

    @property
    def idle(self) -> bool:
        return self.left is None and self.pause == 0 and self.stopping is None and not self.stopped

    def stop(self, latency: int, goes_on: bool) -> None:
        """Has nothing under way so many cycles later, unless it ends before. goes_on: it may end by itself behind that, until it is reset."""
        self.stopping, self.goes_on = latency, goes_on

    def step(self, start: bool) -> bool:
        """A cycle; whether it is done in the next."""
        done = False
        if self.stopping is not None:
            self.stopping -= 1
            if self.stopping == 0 and self.left != 1:
                self.stopping, self.stopped = None, True
                if not self.goes_on:
                    self.left = None
        if self.left is not None:
            self.left -= 1
            if self.left == 0:
                self.left, self.pause, done = None, self.rest(), True
                self.stopping = None
        elif self.pause:
            self.pause -= 1
        if start:
            assert self.left is None
            self.left = self.latency()
        return done


class ControlTest:
    """Agents and checks, cycle by cycle. speeds: mean latencies of front end, rendering half, copies, acknowledgement and host."""

    def __init__(self, dut, speeds, share_illegal=0.3, share_error=0.3, deadline=0):
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.lists = int(dut.Lists.value)
        assert len(dut.descriptor_i) == sum(bits for _, bits in DESCRIPTOR)
        assert len(dut.front_o) == sum(bits for _, bits in FRONT) and len(dut.rendering_o) == sum(bits for _, bits in RENDERING)
        front, rendering, copy, self.acknowledge, self.host = (self.draw(mean) for mean in speeds)
        self.front, self.rendering = Half(front, self.draw(2)), Half(rendering, self.draw(2))
        self.copies = {"front": Half(copy, lambda: 0), "rendering": Half(copy, lambda: 0)}
        self.share_illegal, self.share_error, self.deadline = share_illegal, share_error, deadline
        self.stop_latency = self.draw(4)
        self.now = self.rng.getrandbits(32)
        self.wanted: list[dict[str, int]] = []  # descriptors to start, before random ones
        self.left = 0                           # frames to start
        self.posted: list[Frame] = []
        self.refused = self.both = self.stops = 0
        self.number = 0
        self.started = self.finished = 0
        self.shown = (0, 0, 0, 0)               # expected tag, error, pairs and bank
        self.late = 0                           # error that is shown when the posted frame has been acknowledged
        self.unacknowledged: Frame | None = None
        self.ack_in = 0
        self.stray = 0                          # acknowledgements that belong to no posted frame
        self.forget()
        self.command = 0                        # of the host, in the next cycle: clear, aborted, timed_out, reset as bits
        self.given = self.before = 0
        for name in ("clear", "aborted", "timed_out", "reset", "start", "acknowledged", "front_idle", "front_done", "rendering_idle", "rendering_done",
                     "copy_front_done", "copy_rendering_done", "now", "descriptor", "front_error", "rendering_error", "front_stopped", "rendering_stopped",
                     "rendering_left"):
            getattr(dut, f"{name}_i").value = 0

    def draw(self, mean):
        return lambda: 1 if mean <= 1 else 1 + int(self.rng.expovariate(1 / (mean - 1)))

    def forget(self):
        self.pending: Frame | None = None
        self.in_front: Frame | None = None
        self.in_rendering: Frame | None = None
        self.front_stage = self.rendering_stage = None  # what the half does with its frame: "run", "copy", then it is "over"
        self.pins = dict.fromkeys(("start", "acknowledged", "front_done", "rendering_done", "copy_front_done", "copy_rendering_done"), 0)
        self.resets = {"front": 0, "rendering": 0}  # cycles of a reset that have been seen
        self.wait = self.host()
        self.next = None
        for half in (self.front, self.rendering, *self.copies.values()):
            half.reset()

    # ---- descriptors ----

    def descriptor(self) -> dict[str, int]:
        """Legal."""
        rng = self.rng
        while True:
            d = {name: rng.getrandbits(bits) for name, bits in DESCRIPTOR}
            d |= {name: rng.getrandbits(34) * 64 for name in ADDRESSES}
            limit = rng.choice([40, 700, 4096])
            d |= {"width": rng.choice([rng.randint(1, limit), 16 * rng.randint(1, limit // 16)]), "height": rng.choice([rng.randint(1, limit), limit])}
            d |= {"mode": rng.randint(0, max(CatMode)), "clusters": rng.choice([1, 1 << 23, rng.randint(1, (1 << 24) - 1)])}
            room = rng.choice([d["clusters"], rng.randint(d["clusters"], (1 << 24) - 1)])
            d |= rng.choice([{"generation": 0}, {"chunked": 1, "store": d["store"] & ~2047, "store_clusters": room}])
            if self.deadline:
                d["deadline"] = rng.choice([0, rng.randint(1, self.deadline), rng.randint(1, 2 * self.deadline), (1 << 32) - 1])
            least = stride_of(d)
            d["stride"] = rng.choice([least, least + 32, rng.randint(least // 32, 4095) * 32])
            if legal(d, self.lists):
                return d

    def broken(self) -> dict[str, int]:
        """One rule broken."""
        d, rng = self.descriptor(), self.rng
        return rng.choice(self.faults(d))

    def faults(self, d) -> list[dict[str, int]]:
        """A legal descriptor, each rule of it broken alone."""
        out = [d | {name: d[name] ^ 1 << bit} for name in ADDRESSES for bit in range(6)]
        out += [d | {"stride": d["stride"] ^ 1 << bit} for bit in range(5)] + [d | {"stride": stride_of(d) - 32}]
        out += [d | {"mode": mode} for mode in range(max(CatMode) + 1, 8)] + [d | {"clusters": 0}]
        out += [d | {"width": 0}, d | {"height": 0}]
        wide = d | {"height": 1, "stride": (1 << 17) - 32}
        out += [wide | {"width": w} for w in (4097, 4112, 8191)]
        out += [d | {"width": 1, "height": h, "stride": 4096} for h in (4097, 4112, 8191)]
        kept = d | {"generation": 1 << 31, "chunked": 1, "store": d["store"] & ~2047, "store_clusters": d["clusters"]}
        out += [kept | {"chunked": 0}, kept | {"store_clusters": kept["clusters"] - 1}, *(kept | {"store": kept["store"] | 1 << bit} for bit in range(11))]
        return [x for x in out if not legal(x, self.lists)]

    def new_frame(self) -> Frame:
        rng = self.rng
        d = self.wanted.pop(0) if self.wanted else self.broken() if rng.random() < self.share_illegal else self.descriptor()
        errors = [rng.randint(1, 63) if rng.random() < self.share_error else 0, rng.randint(1, 7) if rng.random() < self.share_error else 0]
        self.number += 1
        return Frame(self.number, d, *errors, legal(d, self.lists))

    # ---- a cycle ----

    def value(self, name: str) -> int:
        return int(getattr(self.dut, name).value)

    async def run(self, frames: int, limit: int = 40_000) -> int:
        """Start so many frames and wait until all are posted, acknowledged; cycles."""
        self.left = frames
        edge = RisingEdge(self.dut.clk_i)
        for cycle in range(limit):
            self.drive()
            await edge
            self.check()
            if not self.left and not (self.pending or self.in_front or self.in_rendering or self.unacknowledged):
                return cycle
        raise AssertionError(f"{self.left} frames left, in {limit} cycles")

    def drive(self):
        dut = self.dut
        self.now = (self.now + 1) % (1 << 32)
        self.before, self.given, self.command = self.given, self.command, 0
        pins = self.pins
        if self.given:
            pins |= {"start": 0, "acknowledged": int(bool(self.unacknowledged) and self.rng.random() < 0.2)}
        elif not self.unacknowledged and self.rng.random() < 0.2:
            pins["acknowledged"] = 1
        # Data that nobody asks for are noise.
        noise = self.rng.getrandbits
        front_error = self.in_front.front_error if pins["front_done"] and self.in_front else noise(6)
        rendering_error = self.in_rendering.rendering_error if (pins["rendering_done"] or self.rendering.stopped) and self.in_rendering else noise(3)
        if self.pending:
            descriptor = pack(DESCRIPTOR, self.pending.d)
        elif self.next:
            descriptor = pack(DESCRIPTOR, self.next.d)
        else:
            descriptor = noise(len(dut.descriptor_i))
        for name, value in (
            *pins.items(), ("now", self.now), ("front_idle", int(self.front.idle)), ("rendering_idle", int(self.rendering.idle)),
            ("front_error", front_error), ("rendering_error", rendering_error), ("descriptor", descriptor),
            ("front_stopped", int(self.front.stopped)), ("rendering_stopped", int(self.rendering.stopped)),
            ("rendering_left", self.in_rendering.left if self.rendering.stopped and self.in_rendering else 0 if pins["rendering_done"] else noise(16)),
            *((name, self.given >> k & 1) for k, name in enumerate(("clear", "aborted", "timed_out", "reset"))),
        ):
            getattr(dut, f"{name}_i").value = value

    def hand_over(self, now: int) -> None:
        """The frame leaves the front end's place for the rendering half's in cycle `now`."""
        self.in_rendering, self.in_front = self.in_front, None
        self.rendering_stage = None
        r = self.in_rendering
        r.late |= r.legal and r.due(now)
        r.skipped = r.late
        r.left = self.rng.choice([0, self.rng.randint(0, rendering_registers(r.d)["all_pairs"])])

    def check(self):
        if self.given:
            self.check_cleared()
            return
        pins, rng = self.pins, self.rng
        now = self.now
        # What the control says of before.
        locked, refused = self.value("locked_o"), self.value("refused_o")
        assert locked == 1 if pins["start"] else locked == 0 or self.pending, "a frame that is started can be written"
        assert not refused or (pins["start"] and self.pending)
        assert self.value("started_o") == self.started % (1 << 16)
        acknowledged = pins["acknowledged"] and self.unacknowledged
        self.stray += pins["acknowledged"] and not self.unacknowledged
        if self.pending and not (refused if pins["start"] else locked):  # taken in the cycle before
            if self.in_front and self.front_stage == "over" and self.in_rendering is None:  # the rendering half was not idle
                self.hand_over(now - 2)
            assert self.in_front is None, "a second frame in the front end"
            self.in_front, self.pending = self.pending, None
            self.in_front.stamps[0] = (now - 1) % (1 << 32)
            self.front_stage = None
        assert refused == (pins["start"] and bool(self.pending))
        self.refused += refused
        self.check_posted()
        assert self.value("finished_o") == self.finished % (1 << 16)
        # Rendering half: the frame that has left the front end.
        start_r = self.value("rendering_start_o")
        if self.in_rendering is None and self.in_front and self.front_stage == "over" and (start_r or self.value("copy_rendering_o")):
            self.hand_over(now - 1)
            assert not start_r or not self.in_rendering.late, "a late frame is rendered"
        elif start_r or self.value("copy_rendering_o"):
            assert self.in_rendering, "the rendering half is given nothing"
        r = self.in_rendering
        if start_r:
            assert r.rendered and self.rendering_stage is None and self.rendering.idle, "started without reason"
            r.stamps[2] = now
        if r and (start_r or self.rendering_stage in ("run", "copy")) and r.rendered:
            want = rendering_registers(r.d)
            assert unpack(RENDERING, self.value("rendering_o")) == {name: want[name] for name, _ in RENDERING}
        if self.rendering_stage in ("run", "stop") and (pins["rendering_done"] or (self.rendering_stage == "stop" and self.rendering.stopped)):
            r.stamps[3] = now
            r.cut = not pins["rendering_done"]
            r.late |= r.cut and r.left > 0
            self.rendering_stage = "copy"
        elif self.rendering_stage == "run" and self.value("rendering_stop_o"):
            self.rendering_stage = "stop"
            self.stops += 1
            assert r.due(now - 1), "stopped before its deadline"
            self.rendering.stop(self.stop_latency(), rng.random() < 0.5)
        self.check_stop("rendering", r, self.rendering, self.rendering_stage)
        copying = self.value("copy_rendering_o")
        if copying:
            assert self.rendering_stage == "copy" or (self.rendering_stage is None and not r.rendered)
            self.rendering_stage = "copy"
            assert self.value("copy_rendering_bank_o") == r.bank and self.value("copy_rendering_none_o") == (not r.rendered)
            if r.rendered:
                stamps = self.value("stamps_o")
                assert [stamps >> 32 * k & 0xFFFFFFFF for k in range(4)] == r.stamps
        else:
            assert self.copies["rendering"].left is None, "the copy is withdrawn"
        # Front end.
        start_f, f = self.value("front_start_o"), self.in_front
        if start_f:
            assert f and f.legal and self.front_stage is None and self.front.idle, "started without reason"
        if f and f.legal and (start_f or self.front_stage in ("run", "copy")):
            want = front_registers(f.d)
            assert unpack(FRONT, self.value("front_o")) == {name: want[name] for name, _ in FRONT}
        if self.front_stage in ("run", "stop") and (pins["front_done"] or (self.front_stage == "stop" and self.front.stopped)):
            f.stamps[1] = now
            f.ended = bool(pins["front_done"])
            self.front_stage = "copy"
        elif self.front_stage == "run" and self.value("front_stop_o"):
            self.front_stage = "stop"
            self.stops += 1
            assert f.due(now - 1), "stopped before its deadline"
            self.front.stop(self.stop_latency(), rng.random() < 0.5)
        self.check_stop("front", f, self.front, self.front_stage)
        copying_front = self.value("copy_front_o")
        if copying_front:
            assert f and (self.front_stage == "copy" or not f.legal)
            self.front_stage = "copy"
            if f.bank is None:
                f.bank = self.value("copy_front_bank_o")
                taken = [x.bank for x in (self.in_rendering, self.unacknowledged) if x]
                assert f.bank not in taken, f"bank {f.bank} is still needed"
            assert self.value("copy_front_bank_o") == f.bank and self.value("copy_front_none_o") == (not f.legal)
        else:
            assert self.copies["front"].left is None, "the copy is withdrawn"
        assert self.value("front_done_o") == (pins["copy_front_done"] and f.legal and not f.due(now))
        assert self.value("front_busy_o") == (f is not None) or self.front_stage == "over"
        assert not (r and self.rendering_stage != "over") or self.value("rendering_busy_o")
        self.both += self.front.left is not None and self.rendering.left is not None
        # The next cycle.
        accepted = pins["start"] and not refused
        if accepted:
            self.pending, self.next = self.next, None
            self.pending.begun = now
            self.started += 1
            self.left -= 1
        if pins["copy_front_done"]:
            self.front_stage = "over"
        if pins["copy_rendering_done"]:
            self.rendering_stage = "over"
        if start_f:
            self.front_stage = "run"
        if start_r:
            self.rendering_stage = "run"
        self.show(acknowledged)
        pins["front_done"] = int(self.front.step(bool(start_f)))
        pins["rendering_done"] = int(self.rendering.step(bool(start_r)))
        for name, copy, shown in (("copy_front_done", self.copies["front"], copying_front), ("copy_rendering_done", self.copies["rendering"], copying)):
            pins[name] = int(copy.step(bool(shown and not pins[name] and copy.left is None)))
        pins["acknowledged"] = self.next_acknowledged()
        pins["start"] = 0
        if self.pending and self.left and rng.random() < 0.02:  # refused, unless the other is taken now
            self.next = self.next or self.new_frame()
            pins["start"] = 1
        if not self.pending and self.left:
            self.wait -= 1
            if self.wait <= 0:
                self.next = self.next or self.new_frame()
                pins["start"], self.wait = 1, self.host()

    def check_stop(self, name, frame, half, stage):
        """Not later than its deadline asks for; until the reset, which comes when nothing is under way and the counters are kept."""
        stop, reset = self.value(f"{name}_stop_o"), self.value(f"{name}_reset_o")
        if stage == "run" and not self.pins[f"{name}_done"]:
            assert not frame.due(self.now - 2) or (self.now - frame.stamps[2 if name == "rendering" else 0]) % (1 << 32) < 9, "not stopped at its deadline"
        if stage == "stop":
            assert stop
        if reset:
            assert stop and stage == "over" and frame is not None
            self.resets[name] += 1
            half.reset()
        else:
            assert self.resets[name] in (0, RESET)
            self.resets[name] = 0
        if stage == "copy" and half.stopped:
            assert stop

    def check_posted(self):
        """A post, and what is shown of the frame posted last."""
        if self.value("post_o"):
            frame, self.in_rendering = self.in_rendering, None
            assert frame is not None and self.rendering_stage == "over", "a post of nothing"
            assert self.unacknowledged is None, "posted before the last one was acknowledged"
            self.shown = (frame.d["tag"], frame.error, frame.pairs, frame.bank)
            self.finished += 1
            self.posted.append(frame)
            assert [f.number for f in self.posted] == sorted(f.number for f in self.posted)
            self.unacknowledged = frame
            self.ack_in = self.acknowledge()
        assert (self.value("tag_o"), self.value("error_o"), self.value("pairs_o"), self.value("bank_o")) == self.shown

    def show(self, acknowledged):
        """What is shown in the next cycle: an abort or a time-out once no posted frame waits."""
        if self.late and not self.unacknowledged:
            self.shown = (self.shown[0], self.late, 0, self.shown[3])
            self.late = 0
        if acknowledged:
            self.unacknowledged = None

    def next_acknowledged(self) -> int:
        if not self.unacknowledged:
            return 0
        self.ack_in -= 1
        return int(self.ack_in <= 0)

    def check_cleared(self):
        """A cycle with a command: what it does is there in the next one. What is posted stays, unless all begins anew."""
        clear, aborted, timed_out, reset = (self.given >> k & 1 for k in range(4))
        assert not (self.before and self.value("post_o")), "a forgotten frame is posted"
        acknowledged = self.pins["acknowledged"] and self.unacknowledged
        if reset:
            assert not self.value("post_o")
            self.unacknowledged, self.late, self.shown = None, 0, (0, 0, 0, 0)
            self.started = self.finished = 0
        else:
            self.check_posted()
            self.late = TIMED_OUT if timed_out else (self.late or aborted * ABORTED)
            if aborted and self.unacknowledged:
                self.shown = (self.shown[0], self.shown[1] | ABORTED, *self.shown[2:])
            self.show(acknowledged)
        if clear:
            self.finished = self.started
        self.forget()
        self.pins["acknowledged"] = self.next_acknowledged()


@cocotb.test()
@cocotb.parametrize(speeds=[(1, 1, 1, 1, 1), *SPEEDS][:: rounds(2, 1)])
async def frames(dut, speeds):
    """Random descriptors, legal or not; errors of either half; a host, halves and counters of every speed."""
    test = ControlTest(dut, speeds)
    await test.bench.reset()
    await test.run(60)
    assert len(test.posted) == test.started == test.finished == 60
    kinds = {(f.legal, f.front_error > 0 and f.legal, f.rendering_error > 0 and f.rendered) for f in test.posted}
    assert len(kinds) == 4
    assert {f.bank for f in test.posted} == {0, 1}
    assert test.stray > 60
    if max(speeds) > 1 and speeds[4] == 1:
        assert test.both > 0 and test.refused > 0


@cocotb.test()
@cocotb.parametrize(speeds=SPEEDS[rounds(1, 0) : rounds(3, 5)])
async def deadlines(dut, speeds):
    """Random ones, about as long as a frame takes: each half is stopped at its time and reset, the other goes on; what has not been reached is passed by."""
    test = ControlTest(dut, speeds, share_illegal=0.1, share_error=0.1, deadline=sum(speeds[:4]))
    await test.bench.reset()
    count = rounds(120, 300)
    await test.run(count)
    assert len(test.posted) == count and test.stops > 20
    kinds = {(f.late, f.ended, f.skipped, f.cut) for f in test.posted if f.legal}
    wanted = {(False, True, False, False), (True, True, True, False)}
    if speeds[0] >= 10:
        wanted.add((True, False, True, False))
    if speeds[1] >= 20:
        wanted |= {(True, True, False, True), (False, True, False, True)}  # a picture that is whole when it is stopped is not late
    assert wanted <= kinds, wanted - kinds


@cocotb.test(skip=netlist() or four_state())  # it sets registers
async def numbers_wrap(dut):
    """Numbers of frames, set to their last values in between, go on from 0; as many are started as finished at the end."""
    test = ControlTest(dut, (1, 1, 1, 1, 1))
    await test.bench.reset()
    dut.started_q.value = dut.finished_q.value = test.started = test.finished = (1 << 16) - 5
    await test.run(12)
    assert int(dut.started_o.value) == int(dut.finished_o.value) == 7


@cocotb.test()
async def illegal_alone(dut):
    """Each rule broken alone is refused, and the halves are not touched; at its limit it is not."""
    test = ControlTest(dut, (2, 2, 1, 1, 1), share_error=0)
    await test.bench.reset()
    d = test.descriptor()
    faults = test.faults(d)
    assert len(faults) >= 6 * len(ADDRESSES) + 5 + 1 + 2 + 1 + 2 + 6
    test.wanted = list(faults)
    await test.run(len(faults))
    assert all(f.error == DESCRIPTOR_ERROR for f in test.posted)
    base = d | {"stride": (1 << 17) - 32}
    side = [base | {"width": w, "height": h} for w, h in ((1, 1), (4096, 16), (16, 4096), (4096, 1), (33, 33))]
    rows = next(r for r in range(min(128, test.lists), 0, -1) if test.lists % r == 0 and test.lists // r <= 128)
    exact = base | {"width": 32 * (test.lists // rows), "height": 32 * rows}
    more = [exact | {"height": exact["height"] + 1}, exact | {"width": exact["width"] + 1}]
    assert writer_lists(exact) == test.lists
    sizes = [*side, exact, *(x for x in more if max(x["width"], x["height"]) <= 4096)]
    narrow = [x | {"rgba": rgba, "stride": stride_of(x | {"rgba": rgba}) - less} for x in (*side[:1], exact) for rgba in (0, 1) for less in (0, 32)]
    test.wanted = [*sizes, *narrow]
    before = len(test.posted)
    await test.run(len(test.wanted))
    errors = [f.error for f in test.posted[before:]]
    assert errors == [0 if legal(f.d, test.lists) else DESCRIPTOR_ERROR for f in test.posted[before:]] and {0, DESCRIPTOR_ERROR} == set(errors)
    largest = test.descriptor() | {"width": 4096, "height": 4096, "rgba": 1, "stride": 32768}
    test.wanted = [largest]
    await test.run(1)
    assert test.posted[-1].legal == (test.lists >= 16384)


@cocotb.test()
@cocotb.parametrize(command=["clear", "abort", "time-out", "reset", "reset before"])
async def forgets(dut, command):
    """At random times: nothing of before is posted or started, numbers agree, the next frames are as if nothing had been."""
    test = ControlTest(dut, (6, 6, 4, 4, 2), share_illegal=0.2, deadline=20)
    codes = {"clear": [1], "abort": [3], "time-out": [5], "reset": [9], "reset before": [8, 1]}[command]
    await test.bench.reset()
    edge = RisingEdge(dut.clk_i)
    posts = 0
    for _ in range(rounds(60, 400) if command == "reset before" else 60):  # a post that reset_i alone must hold back is rare
        test.left = 100
        test.acknowledge = test.draw(test.rng.choice([4, 60]))
        for _ in range(test.rng.randrange(60)):
            test.drive()
            await edge
            test.check()
        for code in [*codes, *([1] * test.rng.randrange(4))]:
            test.command = code
            test.drive()
            await edge
            test.check()
        posts += len(test.posted)
        test.posted.clear()
        assert not (test.pending or test.in_front or test.in_rendering)
        if test.rng.random() < 0.5:  # nothing comes by itself
            test.left = 0
            for _ in range(20):
                test.drive()
                await edge
                test.check()
    assert posts > 20
    test.posted.clear()
    await test.run(10)
    assert len(test.posted) == 10
