"""cocotb test of the whole chip with the pins of AMBA, between the AXI4-Lite manager and the AXI4 memory of cocotbext-axi."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.handle import Immediate
from cocotb.triggers import ClockCycles, RisingEdge, Timer
from cocotbext.axi import AxiBus, AxiLiteBus, AxiLiteMaster, AxiRam
from flicker_tb.bench import config
from flicker_tb.pins import reader

SETTINGS = config()
AT = SETTINGS["registers"]
LIMIT = 60_000  # cycles of a frame


class Watch:
    """Every address that the chip offers and the memory takes, and how much is under way by identifier."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.seen: dict[tuple[bool, int], list[tuple[int, ...]]] = {}
        self.under_way: dict[tuple[bool, int], int] = {}
        self.most: dict[tuple[bool, int], int] = {}
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        fields = ("id", "addr", "len", "size", "burst", "qos", "cache", "lock", "prot", "region", "user")
        pin = {name: reader(getattr(self.dut, f"m_axi_{name}")) for name in (
            *(f"{channel}{x}" for channel in ("aw", "ar") for x in ("valid", "ready", *fields)),
            "rvalid", "rready", "rlast", "rid", "bvalid", "bready", "bid",
        )}
        edge = RisingEdge(self.dut.aclk)
        while True:
            await edge
            for channel, write in (("aw", True), ("ar", False)):
                if pin[f"{channel}valid"]() and pin[f"{channel}ready"]():
                    value = {x: pin[f"{channel}{x}"]() for x in fields}
                    key = write, value["id"]
                    assert (value["burst"], value["cache"], value["lock"], value["prot"], value["region"], value["user"]) == (1, 3, 0, 0, 0, 0), value
                    step = 1 << value["size"]
                    assert value["addr"] % step == 0 and value["addr"] // 4096 == (value["addr"] + step * (value["len"] + 1) - 1) // 4096, value
                    self.seen.setdefault(key, []).append((value["size"], value["len"] + 1, value["qos"]))
                    self.under_way[key] = self.under_way.get(key, 0) + 1
                    self.most[key] = max(self.most.get(key, 0), self.under_way[key])
            if pin["rvalid"]() and pin["rready"]() and pin["rlast"]():
                self.under_way[False, pin["rid"]()] -= 1
            if pin["bvalid"]() and pin["bready"]():
                self.under_way[True, pin["bid"]()] -= 1

    def check(self, table: list[dict[str, Any]]) -> None:
        """Nothing but what the table has, and all of it but pointers that a picture as small does not move."""
        rows = {(row["write"], number): row for row in table for number in row["ids"]}
        assert self.seen.keys() <= rows.keys(), self.seen.keys() - rows.keys()
        for key, accesses in self.seen.items():
            row = rows[key]
            narrow = 5 in {size for size, *_ in accesses}
            assert narrow == bool(row["note"]), f"{row['name']}: narrow {narrow}"
            for size, beats, qos in accesses:
                assert size == row["size"] or (narrow and (size, beats) == (5, 1)), f"{row['name']}: size {size}, {beats} beats"
                assert beats <= row["beats"] and qos == row["qos"], f"{row['name']}: {beats} beats, QOS {qos}"
            if row["note"].startswith("always"):
                assert {size for size, *_ in accesses} == {5}
            assert self.most[key] <= row["bursts"] // len(row["ids"]), f"{row['name']}: {self.most[key]} under way"
        assert {row["name"] for row in table} - {rows[key]["name"] for key in self.seen} == {"pointers that were written", "pointers that make room"}


@cocotb.test()
async def frame(dut: Any) -> None:
    files = Path(SETTINGS["files"])
    dut.aclk.value, dut.aresetn.value, dut.test_en.value = Immediate(0), Immediate(1), Immediate(0)
    await Timer(1, unit="ns")
    dut.aresetn.value = 0  # an edge, which flip-flops without a clock want to see in simulation
    await Timer(1, unit="ns")
    for pin in ("ruser", "buser"):
        getattr(dut, f"m_axi_{pin}").value = 0
    cocotb.start_soon(Clock(dut.aclk, 10, unit="ns").start())
    host = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axil"), dut.aclk, dut.aresetn, reset_active_level=False)
    ram = AxiRam(AxiBus.from_prefix(dut, "m_axi"), dut.aclk, dut.aresetn, reset_active_level=False, size=SETTINGS["size"])
    ram.write(SETTINGS["image"], (files / "image").read_bytes())
    watch = Watch(dut)

    async def read(name: str) -> int:
        return int.from_bytes((await host.read(AT[name], 4)).data, "little")

    async def write(offset: int, value: int) -> None:
        await host.write(offset, value.to_bytes(4, "little"))

    async def ended(limit: int) -> int:
        for _ in range(limit):
            if int(dut.irq.value):
                return await read("result")
            await RisingEdge(dut.aclk)
        raise AssertionError(f"no interrupt within {limit} cycles")

    await ClockCycles(dut.aclk, 4)
    dut.aresetn.value = 1
    assert await read("id") == 0x464C4B52  # offered before the chip is out of reset
    assert await read("capability") & SETTINGS["built"] == SETTINGS["capability"] & SETTINGS["built"]
    while not await read("status") & 1:
        pass
    await write(AT["interrupt_enable"], 2)
    # An empty descriptor: refused, and nothing asked of the memory.
    await write(AT["control"], 1)
    assert await ended(1000) == SETTINGS["descriptor_error"] << 16 and not watch.seen
    await write(AT["interrupt"], 31)
    while not await read("status") & 1:
        pass
    for offset, value in SETTINGS["written"]:
        await write(offset, value)
    assert await ended(LIMIT) == SETTINGS["tag"]
    want = (files / "want").read_bytes()
    assert ram.read(SETTINGS["frame_buffer"], len(want)) == want
    assert not any(watch.under_way.values())
    watch.check(json.loads((files / "table").read_text()))
