"""AXI4 subordinates for cocotb benches: the memory of `flicker.sim.memory` (docs/reference/memory_model.md), which checks the design's side, and that of
cocotbext-axi.

Ports are named as in docs/reference/memory_model.md: ``<prefix>ar_valid_o``, ``<prefix>r_data_i``, ...; or have structs of flk_axi_pkg: ``ar_o``, ``r_i``, ...
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge
from cocotbext.axi import AxiRamRead, AxiRamWrite
from cocotbext.axi.axi_channels import AxiARBus, AxiAWBus, AxiBBus, AxiRBus, AxiReadBus, AxiWBus, AxiWriteBus

from flicker import layout
from flicker.sim.memory import MAX_WORDS, Memory, Port, PortConfig, Request
from flicker_tb.pins import reader

# Fields of a channel in flk_axi_pkg.
CHANNELS = {channel: layout.fields(record) for channel, record in (("ar", "axi_ax"), ("aw", "axi_ax"), ("r", "axi_r"), ("w", "axi_w"), ("b", "axi_b"))}


def pack(channel: str, values: Mapping[str, int]) -> int:
    """A channel's struct of its fields."""
    return sum(values[name] << place.at for name, place in CHANNELS[channel].items())


def unpack(channel: str, word: int) -> dict[str, int]:
    """A channel's fields of its struct."""
    return {name: word >> place.at & (1 << place.bits) - 1 for name, place in CHANNELS[channel].items()}


class MemoryPort:
    """A port of a memory on the pins of a design, from the first edge on; fails the test when the design breaks a rule.

    reads, writes: which half there is. ``tick``: this port moves the memory's time; one port of a memory does. ``off``: the memory's side is in reset,
    and does not look at what the design drives.
    """

    def __init__(
        self, dut: Any, memory: Memory, config: PortConfig, *, prefix: str = "", reads: bool = True, writes: bool = True, tick: bool = True,
    ) -> None:
        self.dut, self.memory, self.port, self.tick = dut, memory, Port(memory, config), tick
        self.words = config.data_bits // 32
        self.off = False
        self._reads, self._writes = reads, writes
        self._pins = lambda name: getattr(dut, prefix + name)
        # Structs of flk_axi_pkg, or a pin for each field.
        self._structs = hasattr(dut, prefix + ("ar_o" if reads else "aw_o"))
        self._out_of_reset = reader(dut.rst_ni)
        self._value = {
            name: reader(self._pins(f"{name}_o"))
            for name in (*(("r_ready",) if reads else ()), *(("b_ready", "w_valid") if writes else ()))
        }
        channels = [name for name, present in (("ar", reads), ("aw", writes)) if present]
        self._address = [(channel, reader(self._pins(f"{channel}_valid_o")), self._fields(channel)) for channel in channels]
        self._data = self._fields("w") if writes else None
        inputs = (*(("ar_ready", "r_valid") if reads else ()), *(("aw_ready", "w_ready", "b_valid") if writes else ()))
        if not self._structs:
            inputs += (*(("r_id", "r_resp", "r_last") if reads else ()), *(("b_id", "b_resp") if writes else ()))
        self._inputs = [(self._pins(f"{x}_i"), x) for x in inputs]
        self._r = self._pins("r_i" if self._structs else "r_data_i") if reads else None
        self._b = self._pins("b_i") if writes and self._structs else None
        self._last: dict[str, int] = {}
        self._drive()
        cocotb.start_soon(self._run())

    def _fields(self, channel: str) -> Callable[[], dict[str, int]]:
        """A function that gives what the design drives of a channel now."""
        if self._structs:
            word = reader(self._pins(f"{channel}_o"))
            return lambda: unpack(channel, word())
        pins = [(name, reader(self._pins(f"{channel}_{name}_o"))) for name in CHANNELS[channel]]
        return lambda: {name: value() for name, value in pins}

    def restart(self, config: PortConfig) -> None:
        """Behind ``off``: the memory's side with other options."""
        self.port, self.off = Port(self.memory, config), False

    def _sample(self) -> None:
        q = self.port.request
        for channel, valid, fields in self._address:
            to = getattr(q, channel)
            to.valid = valid()
            if to.valid:
                for name, value in fields().items():
                    setattr(to, name, value)
        value = self._value
        if self._reads:
            q.r_ready = value["r_ready"]()
        if self._writes:
            q.b_ready, q.w_valid = value["b_ready"](), value["w_valid"]()
            if q.w_valid:
                w = self._data()
                data = w["data"].to_bytes(4 * MAX_WORDS, "little")
                ctypes.memmove(q.w_data, data, len(data))
                q.w_strb, q.w_last = w["strb"], w["last"]

    def _put(self, name: str, pin: Any, value: int) -> None:
        if self._last.get(name) != value:
            pin.value = self._last[name] = value

    def _drive(self) -> None:
        p = self.port.reply
        for pin, name in self._inputs:
            self._put(name, pin, getattr(p, name))
        data = int.from_bytes(bytes(p.r_data)[: 4 * self.words], "little") if self._reads else 0
        if self._structs:
            if self._reads:
                self._put("r", self._r, pack("r", {"data": data, "resp": p.r_resp, "last": p.r_last, "id": p.r_id}))
            if self._writes:
                self._put("b", self._b, pack("b", {"resp": p.b_resp, "id": p.b_id}))
        elif self._reads:
            self._put("r_data", self._r, data)

    async def _run(self) -> None:
        edge = RisingEdge(self.dut.clk_i)
        await edge  # at the start of time, where reset has not reached the registers
        while True:
            await edge
            if self.tick:
                self.memory.tick()
            self._sample()
            if self.off:
                self.port.request = Request()
                self.port.reset()
            elif not self._out_of_reset():
                self.port.reset()
            else:
                self.port.step()
            assert not self.port.errors, self.port.errors[0]
            self._drive()


def _bus(base: type, channel: str) -> type:
    """The bus class of cocotbext-axi with this project's names of pins."""
    suffix = {"aw": ("o", "i"), "ar": ("o", "i"), "w": ("o", "i"), "b": ("i", "o"), "r": ("i", "o")}[channel]
    names = [*base._signals, *(x for x in base._optional_signals if x in ("wstrb", "bresp", "rresp"))]
    pins = {name: f"{channel}_{name.removeprefix(channel)}_{suffix[name.endswith('ready')]}" for name in names}
    return type(base.__name__, (base,), {"_signals": pins, "_optional_signals": []})


def ram_read(dut: Any, size: int) -> AxiRamRead:
    """Memory of cocotbext-axi behind a design that reads, at address 0."""
    bus = AxiReadBus(*(_bus(base, name).from_entity(dut) for base, name in ((AxiARBus, "ar"), (AxiRBus, "r"))))
    return AxiRamRead(bus, dut.clk_i, dut.rst_ni, reset_active_level=False, size=size)


def ram_write(dut: Any, size: int) -> AxiRamWrite:
    """Memory of cocotbext-axi behind a design that writes, at address 0."""
    bus = AxiWriteBus(*(_bus(base, name).from_entity(dut) for base, name in ((AxiAWBus, "aw"), (AxiWBus, "w"), (AxiBBus, "b"))))
    return AxiRamWrite(bus, dut.clk_i, dut.rst_ni, reset_active_level=False, size=size)
