"""cocotb tests of flk_top with stand-ins for its halves: registers, frames, interrupts, abort, time-out, reset; a memory that can fall silent."""

from __future__ import annotations

from collections import deque
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config, four_state, rounds

from flicker.chip_counters import FRONT, RENDERING, STAMPS
from flicker.chip_registers import REGISTERS, ChipCounter, ResultError

SETTINGS = config()
START, ABORT, RESET = 1, 2, 4
FRONT_DONE, FRAME_DONE, ERROR, ABORTED, REFUSED = (1 << REGISTERS["interrupt"].fields[name][0] for name in (
    "front_done", "frame_done", "error", "aborted", "refused"))
LATE = 1 << ResultError.LATE
ALL = FRONT_DONE | FRAME_DONE | ERROR | ABORTED | REFUSED
# Numbers of counters that a frame leaves.
PLACES = {*(c.number + k for c in (*FRONT, *RENDERING, *STAMPS) for k in range(c.words)), *range(ChipCounter.STAGE, ChipCounter.STAGE + 128)}


class Chip:
    """The design, a memory that answers each burst of one beat after `latency` cycles, and a host."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.silent = self.away = False  # no channel moves; the memory's side is in reset
        self.failing = False             # reads are answered with an error
        self.latency = 3
        self.now = 0                     # cycles
        self.reads: deque[tuple[int, int]] = deque()
        self.writes: deque[tuple[int, int]] = deque()
        self.places: deque[int] = deque()
        self.taken = {"ar": 0, "aw": 0, "w": 0}
        for name in ("reg_aw_valid", "reg_w_valid", "reg_ar_valid", "r_valid", "b_valid", "ar_ready", "aw_ready", "w_ready", "reg_aw_prot", "reg_ar_prot"):
            getattr(dut, f"{name}_i").value = 0
        dut.reg_b_ready_i.value = dut.reg_r_ready_i.value = 1
        dut.r_data_i.value, dut.r_last_i.value = 0, 1
        dut.reg_w_strb_i.value = 15
        dut.test_en_i.value = 0

    async def begin(self) -> None:
        await self.bench.reset()
        cocotb.start_soon(self.memory())
        if four_state():
            cocotb.start_soon(self.known())
        await self.cycles(20)

    async def cycles(self, count: int) -> None:
        await self.bench.cycles(count)

    def value(self, name: str) -> int:
        return int(getattr(self.dut, name).value)

    async def known(self) -> None:
        """From reset on no output that says something is X: none that stands alone, none beside its valid."""
        outputs = [port for port in self.dut if port._name.endswith("_o") and "." not in port._name]  # the others are of instances
        beside = [port for port in outputs if port._name[: port._name.rfind("_", 0, -2)] + "_valid_o" in {p._name for p in outputs}]
        alone = [port for port in outputs if port not in beside or port._name.endswith(("valid_o", "ready_o"))]
        assert len(alone) >= 10 and len(beside) >= 15
        while True:
            await RisingEdge(self.dut.clk_i)
            for port in alone:
                assert port.value.is_resolvable, port._name
            for port in beside:
                if getattr(self.dut, port._name[: port._name.rfind("_", 0, -2)] + "_valid_o").value == 1:
                    assert port.value.is_resolvable, port._name

    async def memory(self) -> None:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        while True:
            ready = not (self.silent or self.away)
            for name in ("ar", "aw", "w"):
                getattr(dut, f"{name}_ready_i").value = int(ready)
            answers = {}
            for channel, queue, resp in (("r", self.reads, 2 * self.failing), ("b", self.writes, 0)):
                answers[channel] = bool(ready and queue and queue[0][1] <= self.now)
                getattr(dut, f"{channel}_valid_i").value = int(answers[channel])
                if answers[channel]:
                    getattr(dut, f"{channel}_id_i").value = queue[0][0]
                    getattr(dut, f"{channel}_resp_i").value = resp
            await edge
            self.now += 1
            if self.away:
                self.reads.clear(), self.writes.clear(), self.places.clear()
                continue
            for channel, queue in (("r", self.reads), ("b", self.writes)):
                if answers[channel] and self.value(f"{channel}_ready_o"):
                    queue.popleft()
            if ready and self.value("ar_valid_o"):
                assert self.value("ar_len_o") == 0
                self.taken["ar"] += 1
                self.reads.append((self.value("ar_id_o"), self.now + self.latency))
            if ready and self.value("aw_valid_o"):
                self.taken["aw"] += 1
                self.places.append(self.value("aw_id_o"))
            if ready and self.value("w_valid_o"):
                self.taken["w"] += 1
                self.writes.append((self.places.popleft(), self.now + self.latency))

    # ---- registers ----

    async def write_all(self, *items: tuple[str, int]) -> None:
        """A write a cycle, the next one right behind."""
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        left, answers = {"aw": 0, "w": 0}, 0
        for _ in range(100):
            for channel in ("aw", "w"):
                getattr(dut, f"reg_{channel}_valid_i").value = int(left[channel] < len(items))
            if left["aw"] < len(items):
                dut.reg_aw_addr_i.value = REGISTERS[items[left["aw"]][0]].offset
            if left["w"] < len(items):
                dut.reg_w_data_i.value = items[left["w"]][1]
            await edge
            for channel in ("aw", "w"):
                left[channel] += left[channel] < len(items) and self.value(f"reg_{channel}_ready_o")
            answers += self.value("reg_b_valid_o")
            if answers == len(items):
                return
        raise AssertionError("a register does not answer")

    async def write(self, name: str, value: int) -> None:
        await self.write_all((name, value))

    async def read(self, name: str) -> int:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        dut.reg_ar_valid_i.value, dut.reg_ar_addr_i.value = 1, REGISTERS[name].offset
        for _ in range(100):
            await edge
            if self.value("reg_ar_ready_o"):
                dut.reg_ar_valid_i.value = 0
            if self.value("reg_r_valid_o"):
                dut.reg_ar_valid_i.value = 0
                return self.value("reg_r_data_o")
        raise AssertionError("a register does not answer")

    async def field(self, register: str, name: str) -> int:
        low, bits = REGISTERS[register].fields[name]
        return await self.read(register) >> low & (1 << bits) - 1

    async def counter(self, index: int) -> int:
        await self.write("counter_select", index)
        return await self.read("counter_value")

    async def result(self) -> tuple[int, int]:
        """Tag and error."""
        return await self.field("result", "tag"), await self.field("result", "error")

    async def describe(self, tag: int, front: int = 2, rendering: int = 3, deadline: int = 0) -> None:
        """A frame with so many turns in its halves."""
        await self.write("frame", tag)
        await self.write("deadline", deadline)
        for name, value in (("size", 16 << 16 | 16), ("clusters", front), ("chunks", rendering), ("stride", 96), ("table_low", 1 << 12),
                            ("lists_low", 1 << 13), ("records_low", 1 << 14), ("frame_buffer_low", 1 << 15)):
            await self.write(name, value)

    async def start(self, tag: int, front: int = 2, rendering: int = 3, deadline: int = 0) -> None:
        for _ in range(400):
            if await self.field("status", "ready"):
                break
        else:
            raise AssertionError("not ready")
        await self.describe(tag, front, rendering, deadline)
        await self.write("control", START)

    async def until(self, bits: int, limit: int = 2000) -> None:
        """Until one of these interrupts waits."""
        for _ in range(limit):
            if await self.read("interrupt") & bits:
                return
        raise AssertionError(f"no interrupt of {bits:05b}")

    async def ended(self, tag: int, error: int = 0, front: int = 2, rendering: int = 3) -> None:
        """The frame posted next, which is released."""
        await self.until(FRAME_DONE)
        assert await self.result() == (tag, error)
        if not error:
            assert await self.counter(0) == front * 0x01010101 and await self.counter(ChipCounter.RENDERING_CYCLES) == rendering * 0x01010101
        await self.write("interrupt", FRAME_DONE)

    async def die(self) -> None:
        """A time-out."""
        self.silent = True
        await self.write("timeout", 50)
        for _ in range(400):
            if await self.field("status", "dead"):
                return
        raise AssertionError("no time-out")

    async def revive(self) -> None:
        self.silent, self.away = False, True
        await self.write("control", RESET)
        for _ in range(20):
            if not await self.field("status", "aborting"):
                break
        else:
            raise AssertionError("the reset does not end")
        self.away = False


@cocotb.test()
async def before_the_first_frame(dut: Any) -> None:
    """Nothing has happened: result, frames and counters of frames are 0, and what the chip was built with can be read."""
    chip = Chip(dut)
    await chip.begin()
    assert await chip.read("result") == await chip.read("frames") == await chip.read("interrupt") == 0
    assert await chip.read("status") == 1 << REGISTERS["status"].fields["ready"][0]
    for name, value in SETTINGS["capability"].items():
        assert await chip.field("capability", name) == value, name
    assert await chip.read("capability_units") == 0x12222
    assert not any([await chip.counter(index) for index in (sorted(PLACES)[::40] if four_state() else PLACES)])  # a run there takes a minute as it is
    await chip.start(5)
    await chip.ended(5)


@cocotb.test()
async def counters(dut: Any) -> None:
    """Those of frames are there once one has ended, until a reset; a number that no counter has gives 0."""
    chip = Chip(dut)
    await chip.begin()
    live = range(ChipCounter.LIVE_CYCLES, ChipCounter.LIVE_DATA_WAITS + 1)
    for fresh in (True, False):
        if not fresh:
            await chip.revive()
        assert not any([await chip.counter(index) for index in PLACES])
        await chip.start(6)
        await chip.ended(6)
        values = {index: await chip.counter(index) for index in range(1 << 10) if index not in live}
        assert {index for index, value in values.items() if value} == PLACES
        assert await chip.counter(ChipCounter.LIVE_CYCLES) > 1000


@cocotb.test()
async def clocks(dut: Any) -> None:
    """Those of the halves stand still between frames, and in a scan test run on."""
    chip = Chip(dut)
    await chip.begin()
    edges = []
    for test in (0, 1, 0):  # what comes behind each frame
        await chip.cycles(1000)
        dut.test_en_i.value = 0
        await chip.start(7)
        await chip.until(FRAME_DONE)
        edges.append((await chip.counter(FRONT[-1].number), await chip.counter(RENDERING[-1].number)))
        await chip.write("interrupt", ALL)
        dut.test_en_i.value = test
    for half in range(2):
        assert edges[1][half] - edges[0][half] < 500 < 1000 < edges[2][half] - edges[1][half]


@cocotb.test()
async def frames(dut: Any) -> None:
    """Back to back, each with its counters; nothing is posted over a frame that was not released. What ran on is what the memory saw."""
    chip = Chip(dut)
    await chip.begin()
    rng = chip.rng
    turns = [(rng.randint(1, 5), rng.randint(1, 5)) for _ in range(8)]
    for number, (front, rendering) in enumerate(turns[:2]):
        await chip.start(number, front, rendering)
    for number in range(8):
        await chip.until(FRAME_DONE)
        await chip.cycles(rng.choice([0, 300]))
        assert await chip.field("frames", "finished") == number + 1
        await chip.ended(number, 0, *turns[number])
        if number + 2 < 8:
            await chip.start(number + 2, *turns[number + 2])
    assert await chip.field("frames", "started") == 8 and await chip.field("status", "ready")
    front, rendering = (sum(column) for column in zip(*turns))
    for counter, count in ((ChipCounter.LIVE_TABLE_BEATS, front), (ChipCounter.LIVE_LIST_BEATS, rendering), (ChipCounter.LIVE_FRONT_WRITTEN, front),
                           (ChipCounter.LIVE_FRAME_WRITTEN, rendering), (ChipCounter.LIVE_COLOUR_BEATS, 0), (ChipCounter.LIVE_RECORD_WAITS, 0)):
        assert await chip.counter(counter) == count, counter
    assert await chip.counter(ChipCounter.STAGE + 7) == 7 + turns[-1][1]
    assert chip.taken["ar"] == chip.taken["aw"] == chip.taken["w"] == front + rendering


@cocotb.test()
async def beats_that_run_on(dut: Any) -> None:
    """A beat counts when it comes, not when its address goes."""
    chip = Chip(dut)
    await chip.begin()
    chip.latency = 500
    await chip.start(0, 1, 1)
    for half, beats in enumerate((ChipCounter.LIVE_TABLE_BEATS, ChipCounter.LIVE_LIST_BEATS)):
        while chip.taken["ar"] == half:
            await chip.cycles(1)
        assert await chip.counter(beats) == 0, beats
        chip.latency = 3
        while not await chip.counter(beats):
            await chip.cycles(1)
        chip.latency = 500
    chip.latency = 3
    await chip.ended(0, 0, 1, 1)


@cocotb.test()
async def interrupts(dut: Any) -> None:
    """Each event sets its bit, and the output follows the enables."""
    chip = Chip(dut)
    await chip.begin()
    await chip.start(0)
    await chip.until(FRAME_DONE)
    for enabled in (0, FRONT_DONE, ABORTED, FRONT_DONE | ABORTED):
        await chip.write("interrupt_enable", enabled)
        await chip.cycles(2)
        assert chip.value("irq_o") == (enabled & FRONT_DONE != 0), f"{enabled:05b}"
    await chip.write("interrupt", ALL)
    await chip.write("interrupt_enable", FRAME_DONE)
    await chip.start(1)
    await chip.until(FRONT_DONE)
    await chip.until(FRAME_DONE)
    assert chip.value("irq_o") == 1 and await chip.read("interrupt") == FRONT_DONE | FRAME_DONE
    await chip.write("interrupt", FRONT_DONE)
    assert chip.value("irq_o") == 1
    await chip.write("interrupt", FRAME_DONE)
    await chip.cycles(2)
    assert chip.value("irq_o") == 0 and await chip.read("interrupt") == 0
    chip.failing = True
    await chip.start(2)
    await chip.until(FRAME_DONE)
    assert await chip.read("interrupt") == FRONT_DONE | FRAME_DONE | ERROR and await chip.result() == (2, 1 << ResultError.FRONT_READ)
    await chip.write("interrupt", ALL)
    chip.failing = False
    await chip.start(5, 2, 40)
    await chip.until(FRONT_DONE)
    chip.failing = True
    await chip.until(FRAME_DONE)
    assert await chip.read("interrupt") == FRONT_DONE | FRAME_DONE | ERROR and await chip.result() == (5, 1 << ResultError.LIST_READ)
    await chip.write("interrupt", ALL)
    chip.failing = False
    # The front end and the registers are taken: a third start is refused, and so is one while frames are forgotten.
    chip.latency = 100
    await chip.start(3)
    await chip.start(4)
    assert not await chip.field("status", "ready")
    await chip.write("control", START)
    assert await chip.read("interrupt") == REFUSED and await chip.field("frames", "started") == 6
    await chip.write("interrupt", REFUSED)
    await chip.write_all(("control", ABORT), ("control", START))
    assert await chip.read("interrupt") == REFUSED and not await chip.field("status", "ready") and await chip.field("status", "aborting")
    await chip.write("interrupt", REFUSED)
    for _ in range(400):  # no longer than the abort lasts, no shorter
        status = await chip.read("status")
        low = {name: REGISTERS["status"].fields[name][0] for name in ("aborting", "ready")}
        assert (status >> low["aborting"] & 1) != (status >> low["ready"] & 1)
        if status >> low["ready"] & 1:
            break
    await chip.until(ABORTED)
    assert await chip.read("interrupt") == ABORTED and await chip.field("frames", "started") == await chip.field("frames", "finished") == 6
    assert (await chip.result())[1] == 1 << ResultError.ABORTED


@cocotb.test()
async def deadlines(dut: Any) -> None:
    """A late frame ends at its time, in either half or before them; the frame in the other half is whole, and so are those that follow."""
    chip = Chip(dut)
    await chip.begin()
    rng, ends = chip.rng, set()
    for _ in range(rounds(24, 60)):
        chip.latency = rng.choice([3, 30])
        deadline = rng.choice([1, rng.randint(1, 40), rng.randint(40, 6000)])
        first = rng.random() < 0.7  # the late one comes before the other
        for late in (first, not first):
            await (chip.start(1, 30, 40, deadline) if late else chip.start(2, 4, 5))
            if late:
                begun = chip.now
        for late in (first, not first):
            await chip.until(FRAME_DONE)
            pairs = await chip.field("progress", "pairs")
            if not late:
                assert pairs == 1
                await chip.ended(2, 0, 4, 5)
                continue
            tag, error = await chip.result()
            assert (tag, error, pairs) in ((1, LATE, 0), (1, 0, 1))
            assert chip.now - begun < deadline + 700 or not first, "ends too late"
            assert chip.now - begun >= deadline or not error, "ends too soon"
            assert not await chip.read("interrupt") & ERROR
            ends.add((error > 0, await chip.counter(ChipCounter.RENDERING_CYCLES) > 0))
            await chip.write("interrupt", FRAME_DONE)
    assert {(True, False), (True, True), (False, True)} == ends, ends
    await chip.cycles(100)
    assert not chip.reads and not chip.writes and await chip.field("status", "ready")


@cocotb.test()
async def most_lists(dut: Any) -> None:
    """As many tile lists as the chip has, in pictures as wide and as high as there are; one row or column of pairs more is refused."""
    chip = Chip(dut)
    await chip.begin()
    longest = 2 ** SETTINGS["capability"]["log2_lists"] // 128 * 32  # pixels, beside 4096
    for width, height in ((4096, longest), (4096, longest + 1), (longest, 4096), (longest + 1, 4096)):
        error = 0 if min(width, height) == longest else 1 << ResultError.DESCRIPTOR
        await chip.describe(9)
        await chip.write("size", height << 16 | width)
        await chip.write("stride", 4096 * 3)
        await chip.write("control", START)
        await chip.ended(9, error)
        await chip.write("interrupt", ALL)


@cocotb.test()
async def writes_behind_a_start(dut: Any) -> None:
    """In the cycles right behind a start the descriptor does not change any more, however early the write is."""
    chip = Chip(dut)
    await chip.begin()
    for busy in (False, True):
        for changed, value in (("frame", 99), ("clusters", 0), ("stride", 0), ("chunks", 77), ("records_low", 4)):
            if busy:
                await chip.start(3)
            await chip.describe(7)
            await chip.write_all(("control", START), (changed, value))
            if busy:
                await chip.ended(3)
            await chip.ended(7)


@cocotb.test()
async def write_long_behind_a_start(dut: Any) -> None:
    """Once the frame is taken the descriptor is the next one's."""
    chip = Chip(dut)
    await chip.begin()
    await chip.describe(7)
    await chip.write("control", START)
    await chip.write("frame", 8)
    await chip.ended(7)
    await chip.write("control", START)
    await chip.ended(8)


@cocotb.test()
async def time_out_before_a_release(dut: Any) -> None:
    """What a frame left stays until it is released; the time-out's result and interrupt come then, and neither is lost in the release."""
    chip = Chip(dut)
    await chip.begin()
    for failing in (False, True):
        chip.failing = failing
        tag, error = 11 + failing, failing << ResultError.FRONT_READ
        await chip.start(tag)
        await chip.until(FRAME_DONE)
        read = await chip.read("interrupt") & (FRAME_DONE | ERROR)  # a handler begins
        assert read == FRAME_DONE | ERROR * failing
        await chip.start(13)
        await chip.die()
        assert await chip.read("interrupt") & ERROR and await chip.result() == (tag, error)
        assert await chip.counter(0) == 2 * 0x01010101
        await chip.write("interrupt", read)  # and releases what it has read
        await chip.cycles(4)
        assert (await chip.result())[1] == 1 << ResultError.TIMED_OUT and await chip.read("interrupt") & ERROR
        await chip.write("interrupt", ALL)
        assert await chip.read("interrupt") == 0
        await chip.revive()
        assert await chip.read("interrupt") == 0 and await chip.read("result") == 0
    chip.failing = False
    await chip.start(14)
    await chip.ended(14)


@cocotb.test()
async def dead(dut: Any) -> None:
    """A time-out is told once; an abort and starts do nothing; a reset tells nothing and all is as at the beginning."""
    chip = Chip(dut)
    await chip.begin()
    for drained in (False, True):
        await chip.start(1, front=200)
        await chip.cycles(30)
        if drained:
            chip.silent = True
            await chip.write("control", ABORT)
            assert await chip.field("status", "aborting")
        await chip.die()
        assert await chip.read("interrupt") == ERROR and (await chip.result())[1] == 1 << ResultError.TIMED_OUT
        await chip.write("interrupt", ERROR)
        assert await chip.read("interrupt") == 0
        await chip.write("control", ABORT)
        await chip.write("control", START)
        await chip.cycles(100)
        assert await chip.field("status", "dead") and await chip.read("interrupt") == REFUSED
        await chip.write("interrupt", REFUSED)
        await chip.revive()
        await chip.cycles(20)
        assert await chip.read("interrupt") == await chip.read("result") == await chip.read("frames") == 0
        assert not await chip.field("status", "dead") and await chip.field("status", "ready")
        await chip.start(2)
        await chip.ended(2)
        await chip.write("interrupt", ALL)


@cocotb.test()
async def aborts(dut: Any) -> None:
    """Frames under way are forgotten. One that was posted waits for its release, which may be late: the next ones wait for it, none is passed over."""
    chip = Chip(dut)
    await chip.begin()
    for wait in (0, 40, 400):
        await chip.start(21, 1, 1)
        await chip.until(FRAME_DONE)
        await chip.start(22, front=200)
        await chip.cycles(20)
        await chip.write("control", ABORT)
        await chip.until(ABORTED)
        kept = 21, 1 << ResultError.ABORTED  # added to what the frame left
        assert await chip.result() == kept and await chip.counter(0) == 0x01010101
        await chip.write("interrupt", ABORTED)
        finished = await chip.field("frames", "finished")
        assert finished == await chip.field("frames", "started")
        await chip.start(23)
        await chip.start(24)
        await chip.cycles(wait)
        assert await chip.result() == kept and await chip.counter(0) == 0x01010101 and await chip.field("frames", "finished") == finished
        await chip.write("interrupt", FRAME_DONE)
        await chip.until(FRAME_DONE)
        await chip.cycles(200)
        assert await chip.field("frames", "finished") == finished + 1
        await chip.ended(23)
        await chip.ended(24)
        assert await chip.read("interrupt") & (ERROR | REFUSED | ABORTED) == 0
    await chip.start(25, front=200)
    await chip.until(FRONT_DONE)
    await chip.write("control", ABORT)
    await chip.until(ABORTED)
    assert (await chip.result())[1] == 1 << ResultError.ABORTED


@cocotb.test()
async def resets(dut: Any) -> None:
    """At once, also in an abort; a frame that was posted is forgotten with its interrupt, so that no late release meets the next one."""
    chip = Chip(dut)
    await chip.begin()
    await chip.start(31)
    await chip.until(FRAME_DONE)
    await chip.start(32, front=200)
    await chip.write("interrupt", FRONT_DONE)
    await chip.revive()
    assert await chip.read("interrupt") & FRAME_DONE == 0 and await chip.read("result") == await chip.read("frames") == 0
    await chip.start(33)
    await chip.until(FRAME_DONE)
    await chip.start(34)
    await chip.cycles(200)
    assert await chip.field("frames", "finished") == 1
    await chip.ended(33)
    await chip.ended(34)
    await chip.start(35, front=200)
    chip.silent = True
    await chip.write("control", ABORT)
    await chip.write("interrupt", ALL)
    await chip.revive()
    await chip.cycles(20)
    assert await chip.read("interrupt") == 0 and await chip.field("status", "ready")


@cocotb.test()
async def abort_in_a_reset(dut: Any) -> None:
    """An abort that comes while a reset or another abort is under way is told as any other, at every distance; it does nothing else."""
    chip = Chip(dut)
    await chip.begin()
    told = 0
    for command in (RESET, ABORT):
        for distance in range(14):
            await chip.write_all(("control", command), *[("counter_select", 0)] * distance, ("control", ABORT))
            await chip.until(ABORTED)
            await chip.cycles(20)
            told += (await chip.read("interrupt")) == ABORTED
            await chip.write("interrupt", ALL)
            assert await chip.field("status", "ready")
    assert told == 28
    await chip.start(41)
    await chip.ended(41)


@cocotb.test()
async def scan_test(dut: Any) -> None:
    """In a scan test the halves' reset is the chip's alone: one that works goes on over a reset by a register, and takes no new frame."""
    chip = Chip(dut)
    await chip.begin()
    for test in (0, 1):
        await chip.start(51, front=200)
        await chip.cycles(40)
        dut.test_en_i.value = test
        await chip.revive()
        await chip.write("interrupt", ALL)
        await chip.start(52)
        await chip.cycles(300)
        assert bool(await chip.read("interrupt") & FRONT_DONE) == (not test)
        dut.test_en_i.value = 0
        await chip.revive()
        await chip.write("interrupt", ALL)
    await chip.start(53)
    await chip.ended(53)
