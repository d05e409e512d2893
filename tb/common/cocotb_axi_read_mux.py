"""cocotb tests of flk_axi_read_mux. The memory is a list of answers for each identifier: data do not go through the design."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import FallingEdge, ReadOnly
from flicker_tb.axi import CHANNELS, pack, unpack
from flicker_tb.bench import Bench, rounds


class Ports:
    """Managers with queues of requests, and the port behind. pauses: patterns of each manager, of the port's addresses, of its beats."""

    def __init__(self, dut, idle: list[str], address: str, beats: str) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.managers = len(dut.ar_valid_i)
        self.widths = {name: place.bits for name, place in CHANNELS["ar"].items() if name != "id"}
        self.idle = [self.bench.stall(name) for name in idle]
        self.address, self.beats = self.bench.stall(address), self.bench.stall(beats)
        self.queue: list[deque[dict[str, int]]] = [deque() for _ in range(self.managers)]
        self.offered = [False] * self.managers
        self.asked: list[deque[dict[str, int]]] = [deque() for _ in range(self.managers)]  # taken from the manager, not yet at the port
        self.owed: list[deque[int]] = [deque() for _ in range(self.managers)]  # beats of each burst at the memory
        self.order: list[int] = []  # managers, as their addresses came to the port
        self.got = [0] * self.managers  # beats
        self.due = [0] * self.managers
        self.cycle = 0
        self.first = self.last = 0  # cycles with an address at the port
        self.waiting: tuple[int, ...] | None = None
        dut.ar_valid_i.value = dut.ar_ready_i.value = dut.r_valid_i.value = dut.r_id_i.value = 0
        dut.r_ready_i.value = (1 << self.managers) - 1
        dut.ar_i.value = 0
        cocotb.start_soon(self._run())

    def ask(self, manager: int, count: int) -> None:
        rng = self.bench.rng
        for _ in range(count):
            request = {name: rng.getrandbits(width) for name, width in self.widths.items()}
            self.queue[manager].append(request | {"len": rng.choice([0, 0, 7, rng.randrange(16)])})

    @property
    def busy(self) -> bool:
        return any(self.queue) or any(self.asked) or any(self.owed)

    async def _run(self) -> None:
        dut, rng = self.dut, self.bench.rng
        while True:
            # In the middle of a cycle: the pins are those of its end.
            await FallingEdge(dut.clk_i)
            if dut.rst_ni.value != 1:
                continue
            self.cycle += 1
            for k in range(self.managers):
                self.offered[k] = bool(self.queue[k]) and (self.offered[k] or not next(self.idle[k]))
            dut.ar_valid_i.value = sum(o << k for k, o in enumerate(self.offered))
            # A manager's identifier may be anything.
            own = [
                {name: rng.getrandbits(place.bits) for name, place in CHANNELS["ar"].items()} | (self.queue[k][0] if self.offered[k] else {})
                for k in range(self.managers)
            ]
            dut.ar_i.value = sum(pack("ar", fields) << len(dut.ar_o) * k for k, fields in enumerate(own))
            ready = not next(self.address)
            dut.ar_ready_i.value = int(ready)
            open_ = [k for k in range(self.managers) if self.owed[k]]
            answer = rng.choice(open_) if open_ and not next(self.beats) else None
            # What is not valid may have any identifier; a valid one nobody's high bits.
            dut.r_valid_i.value = int(answer is not None)
            dut.r_id_i.value = rng.getrandbits(len(dut.r_id_i)) if answer is None else answer
            dut.r_ready_i.value = rng.getrandbits(self.managers) | (0 if answer is None else 1 << answer)
            await ReadOnly()
            assert dut.r_ready_o.value == 1
            assert int(dut.r_valid_o.value) == (0 if answer is None else 1 << answer), "beats go to the wrong manager"
            if answer is not None:
                self.got[answer] += 1
                self.owed[answer][0] -= 1
                if not self.owed[answer][0]:
                    self.owed[answer].popleft()
            taken = int(dut.ar_ready_o.value)
            for k in range(self.managers):
                if self.offered[k] and taken >> k & 1:
                    self.asked[k].append(self.queue[k].popleft())
                    self.offered[k] = False
            valid = dut.ar_valid_o.value == 1
            fields = unpack("ar", int(dut.ar_o.value)) if valid else {}
            seen = tuple(fields[name] for name in ("id", *self.widths)) if valid else None
            assert self.waiting is None or seen == self.waiting, f"the address changed from {self.waiting} to {seen}"
            self.waiting = seen if valid and not ready else None
            if valid and ready:
                assert seen is not None
                k = seen[0]
                assert k < self.managers and self.asked[k], f"an address of {k} that nobody asked for"
                request = self.asked[k].popleft()
                assert seen[1:] == tuple(request[name] for name in self.widths), f"manager {k}: {seen[1:]}, due {request}"
                self.owed[k].append(request["len"] + 1)
                self.due[k] += request["len"] + 1
                self.order.append(k)
                self.first = self.first or self.cycle
                self.last = self.cycle


PATTERNS = [("never", "never", "never"), ("half", "half", "half"), ("bursts", "never", "heavy"), ("never", "heavy", "never")]


@cocotb.test()
@cocotb.parametrize((("idle", "address", "beats"), PATTERNS))
async def all_managers(dut, idle, address, beats):
    """Requests and beats of all managers."""
    ports = Ports(dut, [idle] * len(dut.ar_valid_i), address, beats)
    await ports.bench.reset()
    count = rounds(60, 100)
    for k in range(ports.managers):
        ports.ask(k, count)
    await ports.bench.until(lambda: not ports.busy, 60_000, "last beat")
    assert ports.got == ports.due and [ports.order.count(k) for k in range(ports.managers)] == [count] * ports.managers


@cocotb.test()
async def fair(dut):
    """While all ask an address leaves in every cycle, and each manager has its turn; one alone has all of them."""
    ports = Ports(dut, ["never"] * len(dut.ar_valid_i), "never", "never")
    await ports.bench.reset()
    for k in range(ports.managers):
        ports.ask(k, 60)
    await ports.bench.until(lambda: not any(ports.queue), 2000, "last address")
    count = len(ports.order)
    assert ports.last - ports.first == count - 1
    for at in range(count - ports.managers):
        assert len(set(ports.order[at : at + ports.managers])) == ports.managers, f"not in turn: {ports.order[at:at + 8]}"
    await ports.bench.until(lambda: not ports.busy, 60_000, "last beat")
    ports.order.clear()
    ports.first = 0
    ports.ask(ports.managers - 1, 50)
    await ports.bench.until(lambda: not ports.busy, 60_000, "last beat")
    assert ports.order == [ports.managers - 1] * 50 and ports.last - ports.first <= 51
