"""Clock, reset, random numbers and bounded waiting of a cocotb test."""

from __future__ import annotations

import itertools
import json
import os
import random
from collections.abc import Callable, Iterable
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.handle import Immediate
from cocotb.triggers import ClockCycles, RisingEdge

from flicker_tb import stalls
from flicker_tb.streams import Checker, Monitor, Stream, StreamSink, StreamSource

PERIOD_NS = 10


def config() -> dict[str, Any]:
    """Settings that ``runner.build_and_test`` was given."""
    return json.loads(os.environ.get("FLICKER_TB_CONFIG", "{}"))


def four_state() -> bool:
    """Whether the design runs in Icarus Verilog, with X and Z (FOUR_STATE=1): it has the RTL's ports and parameters, but not its inner names."""
    return os.environ.get("FOUR_STATE", "") not in ("", "0")


def netlist() -> bool:
    """Whether the design is its synthesised netlist (NETLIST=1): it has the RTL's ports, but not its inner names."""
    return os.environ.get("NETLIST", "") not in ("", "0")


def rounds(few: int, many: int) -> int:
    """How often a random test repeats itself: `few`, with SLOW=1 `many`."""
    return many if os.environ.get("SLOW") == "1" else few


def combinations(*values: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Combinations of the values, of a random test's patterns: every fifth, with SLOW=1 all."""
    return list(itertools.product(*values))[:: rounds(5, 1)]


class Bench:
    """One test's view of a design with ``clk_i`` and ``rst_ni``, and perhaps ``clear_i``, which stays low until ``clear``, and ``test_en_i``, low.

    The clock runs from the constructor on. Make sources and sinks before ``reset``, so that
    no input is random when reset ends. ``rng`` is seeded by FLICKER_SEED and the test's name.
    """

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.rng = random.Random(random.getrandbits(64))
        # At once: the inputs' random start values must not make a clock edge out of reset.
        dut.rst_ni.value = Immediate(0)
        dut.clk_i.value = Immediate(0)
        for name in ("clear_i", "test_en_i"):
            if hasattr(dut, name):
                getattr(dut, name).value = 0
        cocotb.start_soon(Clock(dut.clk_i, PERIOD_NS, unit="ns").start())

    def stall(self, pattern: str) -> Any:
        """Stall generator by name (``stalls.PATTERNS``) with a random stream of its own."""
        return stalls.make(pattern, random.Random(self.rng.getrandbits(64)))

    async def reset(self, cycles: int = 3) -> None:
        """Hold reset for some cycles; returns in the first cycle out of reset."""
        self.dut.rst_ni.value = 0
        await ClockCycles(self.dut.clk_i, cycles)
        self.dut.rst_ni.value = 1

    async def clear(self, cycles: int = 1) -> None:
        """Hold clear_i for some cycles, from now on; returns after the edge that ends the last one."""
        self.dut.clear_i.value = 1
        await ClockCycles(self.dut.clk_i, cycles)
        self.dut.clear_i.value = 0

    async def cycles(self, count: int) -> None:
        """Wait for ``count`` rising edges."""
        await ClockCycles(self.dut.clk_i, count)

    async def until(self, done: Callable[[], bool], limit: int, what: str = "condition") -> int:
        """Wait until ``done()`` holds after a rising edge; returns the number of edges.

        Fails the test after ``limit`` edges: a hanging design is a failure, not a hang.
        """
        edge = RisingEdge(self.dut.clk_i)
        for cycle in range(limit):
            if done():
                return cycle
            await edge
        raise AssertionError(f"{what} not reached in {limit} cycles")


class StreamTest:
    """The usual bench of a design with one stream in and one out, in order.

    ``model(item)`` gives the output items of an input item. ``idle`` and ``stall`` are pattern
    names. Use: ``await StreamTest(...).run(items)``.
    """

    def __init__(
        self,
        dut: Any,
        model: Callable[[Any], Any],
        *,
        source: Stream | None = None,
        sink: Stream | None = None,
        idle: str = "never",
        stall: str = "never",
    ) -> None:
        self.bench = Bench(dut)
        upstream = source or Stream(dut, "in")
        downstream = sink or Stream(dut, "out")
        self.checker = Checker(model, downstream.show)
        self.source = StreamSource(upstream, self.bench.stall(idle))
        self.sink = StreamSink(downstream, self.bench.stall(stall))
        # The output is looked at first: an answer in the cycle of its input is too early
        # for any design with latency 1 or more.
        self.output = Monitor(downstream, self.checker.check)
        self.input = Monitor(upstream, self.checker.expect)

    async def run(self, items: Any, limit: int | None = None, at_least: int = 1) -> int:
        """Reset, send all items, wait for all answers, check; returns the cycles it took."""
        items = list(items)
        limit = 1000 + 200 * len(items) if limit is None else limit
        await self.bench.reset()
        self.source.send(items)
        taken = await self.bench.until(
            lambda: not self.source.pending and not self.checker.outstanding, limit, "last answer"
        )
        await self.bench.cycles(50)  # nothing may follow
        assert self.input.count == len(items), f"{self.input.count} of {len(items)} items taken"
        self.checker.finish(at_least)
        return taken
