"""cocotb test of flk_lane_queue; settings: Pixels, Slots, Depth."""

from __future__ import annotations

from collections import Counter, deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config

STATE = 5  # cycles from a visit to the lane's state; its flags show it a cycle later
LEAVES = 9  # cycles from a token to its first pixel
INPUTS = ("clear_i", "push_i", "push_slot_i", "push_pixels_i", "finished_i", "token_i", "token_done_i", "bank_free_i")
OUTPUTS = ("ready_o", "alive_o", "empty_o", "visit_valid_o", "visit_eos_o", "visit_last_o", "starved_o", "waits_o")


class Lane:
    """The lane as the queue sees it: flags, the token on its way, the bank."""

    def __init__(self) -> None:
        self.inside: deque[tuple[bool, int] | None] = deque([None] * STATE, STATE)  # (eos, pixel), index: cycles since it came, less 1
        self.finished = 0
        self.bank = 0  # cycles until it is free

    @property
    def token(self) -> bool:
        return any(visit is not None and visit[0] for visit in self.inside)

    @property
    def token_done(self) -> bool:
        last = self.inside[-1]
        return last is not None and last[0]

    def step(self, visit: tuple[bool, int] | None, finishes: bool, pixels_leave: int) -> None:
        """A cycle ends that had this visit. finishes: whether that at the state ends its pixel. pixels_leave: cycles that a token's pixels take."""
        last = self.inside[-1]
        if last is not None:
            self.finished = 0 if last[0] else self.finished | finishes << last[1]
        self.inside.appendleft(visit)
        self.bank = LEAVES - 1 + pixels_leave if visit is not None and visit[0] else max(self.bank - 1, 0)


class Queue:
    """Entries (slot, pixels; none: an end) and what is known of them."""

    def __init__(self, depth: int) -> None:
        self.entries: deque[tuple[int, int]] = deque()
        self.depth = depth
        self.visited = 0  # pixels of the oldest entry
        self.ends = 0  # taken, not yet at the lane's state
        self.waited = False  # in the cycle before

    def expected(self, lane: Lane, every: int) -> dict[str, int]:
        """Outputs in this cycle; pixel and slot where they matter."""
        out = dict.fromkeys(OUTPUTS, 0)
        out["ready_o"] = int(len(self.entries) < self.depth)
        out["alive_o"] = every if self.ends else every & ~lane.finished
        out["empty_o"] = int(not self.entries and not self.ends)
        if not self.entries:
            out["starved_o"] = 1
            return out
        slot, pixels = self.entries[0]
        if pixels == 0:
            out["waits_o"] = int(lane.bank > 0)
            if lane.bank == 0:
                out |= {"visit_valid_o": 1, "visit_eos_o": 1, "visit_last_o": 1, "slot": slot}
            return out
        left = [p for p in range(every.bit_length()) if pixels >> p & 1 and not self.visited >> p & 1 and (lane.token or not lane.finished >> p & 1)]
        if left:
            out |= {"visit_valid_o": 1, "slot": slot, "pixel": left[0]}
        if len(left) < 2:
            out |= {"visit_last_o": 1, "slot": slot}
        return out


@cocotb.test()
async def visits(dut):
    """Every output in every cycle, beside a lane that ends pixels and keeps its bank at random."""
    setting = config()
    pixels, slots, depth = setting["Pixels"], setting["Slots"], setting["Depth"]
    every = (1 << pixels) - 1
    bench = Bench(dut)
    rng = bench.rng
    inputs, outputs = ([getattr(dut, name) for name in names] for names in (INPUTS, OUTPUTS))
    for port in inputs:
        port.value = 0
    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    await edge
    lane, queue = Lane(), Queue(depth)
    seen: Counter[str] = Counter()
    pushes = ends = finishing = slow = clears = 0.0
    for cycle in range(15_000):
        if cycle % 100 == 0:  # other conditions
            pushes, ends = rng.choice((0.05, 0.4, 1.0, 1.0)), rng.choice((0.0, 0.03, 0.03, 0.1, 0.3, 0.95))
            if rng.random() < 0.15:
                pushes, ends = 1.0, 1.0
            finishing, slow, clears = rng.choice((0.0, 0.1, 0.5, 1.0, 1.0)), rng.choice((0, 0, 10, 60)), rng.choice((0.0, 0.0, 0.05))
        clear = rng.random() < clears
        push = rng.random() < pushes
        entry = (rng.randrange(slots), 0 if rng.random() < ends else rng.choice((every, 1 << rng.randrange(pixels), rng.randrange(1, every + 1))))
        values = (int(clear), int(push), *entry, lane.finished, int(lane.token), int(lane.token_done), int(lane.bank == 0))
        for port, value in zip(inputs, values):
            port.value = value
        await edge
        # The cycle that ends here.
        want = queue.expected(lane, every)
        got = {name: int(port.value) for name, port in zip(OUTPUTS, outputs)}
        if "slot" in want:
            got["slot"] = int(dut.visit_slot_o.value)
        if "pixel" in want:
            got["pixel"] = int(dut.visit_pixel_o.value)
        assert got == want, [(name, got[name], want[name]) for name in got if got[name] != want[name]]
        visit = None
        if want["visit_valid_o"]:
            visit = (bool(want["visit_eos_o"]), want.get("pixel", 0))
        note(seen, queue, lane, want, entry, push, clear, every)
        # What the next cycle begins with.
        if clear:
            lane, queue = Lane(), Queue(depth)
            continue
        queue.ends -= lane.token_done
        lane.step(visit, rng.random() < finishing, pixels + rng.randrange(slow + 1))
        if want["visit_last_o"]:
            queue.entries.popleft()
            queue.visited = 0
        elif visit is not None:
            queue.visited |= 1 << visit[1]
        if push and want["ready_o"]:
            queue.entries.append(entry)
            queue.ends += entry[1] == 0
    dut._log.info("%s", dict(seen))
    never = [name for name in CASES if seen[name] < 3]
    assert not never, (never, dict(seen))


CASES = (
    "visit", "visit at once behind a token", "end", "end that waited", "nothing left", "nothing left of a begun entry", "finished left out",
    "finished, but of the sub-tile before", "finished between visits of an entry", "full", "push while full", "full of ends", "more ends than entries",
    "none alive", "none alive, but an end inside", "push and end done", "clear with a begun entry", "clear with ends", "push beside clear", "waits",
    "starved", "empty", "neither entry nor empty",
)


def note(seen: Counter, queue: Queue, lane: Lane, want: dict[str, int], entry: tuple[int, int], push: bool, clear: bool, every: int) -> None:
    """Count the cases of this cycle."""
    entries, full = queue.entries, not want["ready_o"]
    pixels = entries[0][1] if entries else 0
    seen["visit"] += "pixel" in want
    seen["end"] += want["visit_eos_o"]
    if "pixel" in want:
        seen["visit at once behind a token"] += lane.inside[0] is not None and lane.inside[0][0]
        seen["finished left out"] += not lane.token and pixels & lane.finished != 0
        seen["finished, but of the sub-tile before"] += lane.token and lane.finished >> want["pixel"] & 1
    seen["finished between visits of an entry"] += queue.visited != 0 and not lane.token and pixels & ~queue.visited & lane.finished != 0
    if want["visit_last_o"] and not want["visit_valid_o"]:
        seen["nothing left"] += 1
        seen["nothing left of a begun entry"] += queue.visited != 0
    seen["end that waited"] += want["visit_eos_o"] and queue.waited
    queue.waited = bool(want["waits_o"])
    seen["full"] += full
    seen["push while full"] += full and push
    seen["full of ends"] += full and all(bits == 0 for _, bits in entries)
    seen["more ends than entries"] += queue.ends > len(entries)
    seen["none alive"] += want["alive_o"] == 0
    seen["none alive, but an end inside"] += queue.ends > 0 and lane.finished == every
    seen["push and end done"] += push and not full and entry[1] == 0 and lane.token_done
    if clear:
        seen["clear with a begun entry"] += queue.visited != 0
        seen["clear with ends"] += queue.ends > 0
        seen["push beside clear"] += push and not full
    seen["waits"] += want["waits_o"]
    seen["starved"] += want["starved_o"]
    seen["empty"] += want["empty_o"]
    seen["neither entry nor empty"] += not entries and not want["empty_o"]
