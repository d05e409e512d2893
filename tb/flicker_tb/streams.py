"""Stream source, sink and monitor for the valid/ready contract of docs/reference/streams.md.

A stream is a prefix of ports: ``Stream(dut, "in")`` finds ``in_valid_i`` and ``in_ready_o``, with
``_i`` and ``_o`` either way, and a data port per field (default ``in_data``). An item is an
unsigned integer, or a tuple of them for a stream of several fields.

All of them sample just before the rising edge and drive just after it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import cocotb
from cocotb.triggers import Event, RisingEdge

from flicker_tb import stalls
from flicker_tb.pins import reader

Item = int | tuple[int, ...]


class Stream:
    """Handles of one stream of a design. Raises AttributeError naming a missing port."""

    def __init__(self, dut: Any, name: str, fields: Sequence[str] = ("data",)) -> None:
        self.name = name
        self.clock = dut.clk_i
        self.reset_n = dut.rst_ni
        self.clear = getattr(dut, "clear_i", None)
        self.fields = tuple(fields)
        self.valid = _port(dut, f"{name}_valid")
        self.ready = _port(dut, f"{name}_ready")
        self.data = [_port(dut, f"{name}_{field}") for field in fields]
        self.is_valid, self.is_ready, self.is_out_of_reset = (reader(port) for port in (self.valid, self.ready, self.reset_n))
        self._data = [reader(port) for port in self.data]

    def read(self) -> Item:
        """Item on the data ports now."""
        if len(self._data) == 1:
            return self._data[0]()
        return tuple([read() for read in self._data])

    def write(self, item: Item) -> None:
        """Put an item on the data ports."""
        if len(self.data) == 1:
            self.data[0].value = item
        else:
            assert isinstance(item, tuple) and len(item) == len(self.data), item
            for port, value in zip(self.data, item):
                port.value = value

    def show(self, item: Item) -> str:
        """Item in hex, with field names if there are several."""
        if isinstance(item, tuple):
            return " ".join(f"{field}={value:#x}" for field, value in zip(self.fields, item))
        return f"{item:#x}"


def _port(dut: Any, name: str) -> Any:
    for suffix in ("_i", "_o"):
        if (handle := getattr(dut, name + suffix, None)) is not None:
            return handle
    raise AttributeError(f"{dut._name} has no port {name}_i or {name}_o")


class StreamSource:
    """Drives valid and data from a queue; ``idle`` says in which free cycles to pause.

    While nothing is offered the data ports hold the complement of the last item (X in a
    real design), so that a design that looks at data without valid is caught.
    """

    def __init__(self, stream: Stream, idle: Iterator[bool] | None = None) -> None:
        self.stream = stream
        self.idle = stalls.never() if idle is None else idle
        self.sent = 0
        self._queue: deque[Item] = deque()
        self._wake = Event()
        self._masks = [(1 << len(port)) - 1 for port in stream.data]
        stream.valid.value = 0
        stream.write(0 if len(stream.data) == 1 else (0,) * len(stream.data))
        self._task = cocotb.start_soon(self._run())

    def send(self, items: Iterable[Item]) -> None:
        """Queue items."""
        self._queue.extend(items)
        self._wake.set()

    def drop(self) -> None:
        """Forget what is queued; only in reset, where nothing is offered."""
        self._queue.clear()

    @property
    def pending(self) -> int:
        """Items not yet transferred."""
        return len(self._queue)

    def _garbage(self, item: Item) -> Item:
        if isinstance(item, tuple):
            return tuple(value ^ mask for value, mask in zip(item, self._masks))
        return item ^ self._masks[0]

    async def _run(self) -> None:
        stream, queue, idle = self.stream, self._queue, self.idle
        valid, ready, out_of_reset = stream.valid, stream.is_ready, stream.is_out_of_reset
        edge = RisingEdge(stream.clock)
        offered = False
        while True:
            await edge
            if not out_of_reset():
                if offered:
                    valid.value = 0
                    offered = False
                continue
            if offered:
                if not ready():
                    continue
                last = queue.popleft()
                self.sent += 1
                if queue and not next(idle):
                    stream.write(queue[0])
                    continue
                valid.value = 0
                stream.write(self._garbage(last))
                offered = False
            elif not queue:
                self._wake.clear()
                await self._wake.wait()
            elif not next(idle):
                stream.write(queue[0])
                valid.value = 1
                offered = True


class StreamSink:
    """Drives ready; ``stall`` says in which cycles to hold it low."""

    def __init__(self, stream: Stream, stall: Iterator[bool] | None = None) -> None:
        self.stream = stream
        self.stall = stalls.never() if stall is None else stall
        stream.ready.value = 0
        self._task = cocotb.start_soon(self._run())

    async def _run(self) -> None:
        ready, out_of_reset = self.stream.ready, self.stream.is_out_of_reset
        edge = RisingEdge(self.stream.clock)
        driven = 0
        while True:
            await edge
            wanted = 0 if not out_of_reset() or next(self.stall) else 1
            if wanted != driven:
                ready.value = driven = wanted


class Monitor:
    """Observes transfers; fails the test if valid or data change before their transfer, unless by reset or clear_i.

    Each transferred item goes to the functions in ``callbacks``. ``count`` counts transfers,
    ``cycles`` the cycles out of reset; ``first`` and ``last`` are the cycles of the first and
    the last transfer.
    """

    def __init__(self, stream: Stream, *callbacks: Callable[[Any], None]) -> None:
        self.stream = stream
        self.callbacks = list(callbacks)
        self.count = 0
        self.cycles = 0
        self.first = self.last = -1
        self._task = cocotb.start_soon(self._run())

    async def _run(self) -> None:
        stream = self.stream
        valid, ready, out_of_reset = stream.is_valid, stream.is_ready, stream.is_out_of_reset
        edge = RisingEdge(stream.clock)
        waiting: Item | None = None
        while True:
            await edge
            if not out_of_reset():
                waiting = None
                continue
            self.cycles += 1
            if not valid():
                assert waiting is None, (
                    f"{stream.name}: valid fell before the transfer of {stream.show(waiting)}"
                )
                continue
            item = stream.read()
            assert waiting is None or item == waiting, (
                f"{stream.name}: data changed from {stream.show(waiting)} "
                f"to {stream.show(item)} before the transfer"
            )
            if ready():
                self.count += 1
                self.last = self.cycles
                if self.count == 1:
                    self.first = self.cycles
                waiting = None
                for callback in self.callbacks:
                    callback(item)
            else:
                # What waits while clear_i is high may be withdrawn.
                cleared = stream.clear is not None and stream.clear.value == 1
                waiting = None if cleared else item


class Checker:
    """Compares the design's output with a model that is fed by the input monitor.

    ``model(item)`` returns the items expected for an input item, in order (none, one or more).
    Connect ``expect`` to the input monitor and ``check`` to the output monitor, and call
    ``finish`` at the end: leftovers and a run without any output are failures.
    """

    def __init__(
        self,
        model: Callable[[Any], Iterable[Any]],
        show: Callable[[Any], str] = str,
    ) -> None:
        self.model = model
        self.show = show
        self.checked = 0
        self._expected: deque[Any] = deque()

    def expect(self, item: Any) -> None:
        """Take an input item."""
        self._expected.extend(self.model(item))

    def check(self, item: Any) -> None:
        """Take an output item."""
        assert self._expected, f"output {self.checked}: {self.show(item)} was not expected"
        expected = self._expected.popleft()
        assert item == expected, (
            f"output {self.checked}: got {self.show(item)}, expected {self.show(expected)}"
        )
        self.checked += 1

    def drop(self) -> None:
        """Forget what is expected: the design was reset."""
        self._expected.clear()

    @property
    def outstanding(self) -> int:
        """Expected items that have not come yet."""
        return len(self._expected)

    def finish(self, at_least: int = 1) -> None:
        """Fail if items are missing or fewer than ``at_least`` were checked."""
        assert not self._expected, (
            f"{len(self._expected)} expected items never came, first {self.show(self._expected[0])}"
        )
        assert self.checked >= at_least, f"{self.checked} items checked, {at_least} wanted"
