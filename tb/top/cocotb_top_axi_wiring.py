"""cocotb tests of flk_top_axi around a chip that is a header alone: what each pin becomes on the other side."""

from __future__ import annotations

import random
from typing import Any

import cocotb
from cocotb.handle import Immediate
from cocotb.triggers import Timer
from cocotbext.axi import AxiBus, AxiLiteBus
from flicker_tb.bench import config

SETTINGS = config()
PINS = SETTINGS["pins"]
GATED = {"s_axil_awvalid", "s_axil_wvalid", "s_axil_arvalid", "s_axil_awready", "s_axil_wready", "s_axil_arready"}
IDS = 7


async def started(dut: Any) -> random.Random:
    """Out of reset, all else low."""
    rng = random.Random(random.getrandbits(64))
    for name, pin, from_outside in PINS:
        (getattr(dut, pin) if from_outside else getattr(dut.i_top, name)).value = Immediate(0)
    for pin in ("m_axi_buser", "m_axi_ruser"):
        getattr(dut, pin).value = Immediate(0)
    await Timer(1, unit="ns")
    dut.aresetn.value = 1
    for edge in range(2 * (SETTINGS["stages"] + 1)):
        await clock(dut, 1 - edge % 2)
    return rng


async def clock(dut: Any, value: int) -> None:
    dut.aclk.value = value
    await Timer(1, unit="ns")


@cocotb.test()
async def every_pin(dut: Any) -> None:
    """Random values at all inputs of the wrapper and outputs of the chip, at once and one by one."""
    rng = await started(dut)
    driven = [(getattr(dut, pin), getattr(dut.i_top, name)) if from_outside else (getattr(dut.i_top, name), getattr(dut, pin))
              for name, pin, from_outside in PINS if pin not in ("aclk", "aresetn")]
    assert len(driven) > 50
    seen = {to._name: set() for _, to in driven}
    for turn in range(300):
        for pin, _ in driven if turn % 2 else rng.sample(driven, 1):
            pin.value = rng.getrandbits(min(len(pin), IDS) if pin._name in ("m_axi_bid", "m_axi_rid") else len(pin))
        for pin in ("m_axi_buser", "m_axi_ruser"):
            getattr(dut, pin).value = rng.getrandbits(3)
        await Timer(1, unit="ns")
        for pin, to in driven:
            assert int(pin.value) == int(to.value), f"{pin._name} is {int(pin.value):x}, {to._name} {int(to.value):x}"
            seen[to._name].add(int(to.value))
        for channel in ("aw", "ar"):
            for side, value in (("lock", 0), ("cache", SETTINGS["cache"]), ("prot", SETTINGS["prot"]), ("region", 0), ("user", 0)):
                assert int(getattr(dut, f"m_axi_{channel}{side}").value) == value, f"{channel}{side}"
        assert int(dut.m_axi_wuser.value) == 0
    assert all(len(values) > 1 for values in seen.values())


@cocotb.test()
async def every_signal_is_there(dut: Any) -> None:
    """Both interfaces have all signals of AMBA, those that may be left out too, by the names by which tools look for them."""
    for bus in (AxiBus.from_prefix(dut, "m_axi"), AxiLiteBus.from_prefix(dut, "s_axil")):
        for side in (bus.write, bus.read):
            for channel in vars(side).values():
                for name in (*channel._signals, *channel._optional_signals):
                    assert hasattr(channel, name), name
    mapped = {pin for _, pin, _ in PINS}
    own = {f"m_axi_{channel}{side}" for channel in ("aw", "ar") for side in ("lock", "cache", "prot", "region", "user")}
    own |= {f"m_axi_{channel}user" for channel in "wbr"}
    assert not mapped & own and all(hasattr(dut, pin) for pin in mapped | own)


@cocotb.test()
async def reset_reaches_the_chip(dut: Any) -> None:
    """At once when it begins; when it ends, with the clock where there is a synchroniser, and no access of registers is taken before the chip is out of it."""
    rng = await started(dut)
    stages = SETTINGS["stages"]
    gated = [(name, pin, inward) for name, pin, inward in PINS if pin in GATED]
    assert len(gated) == 6
    for test in (0, 1, 0):
        dut.test_en.value = test
        for name, pin, inward in gated:
            (getattr(dut, pin) if inward else getattr(dut.i_top, name)).value = 1
        dut.aresetn.value = 0
        await Timer(1, unit="ns")
        assert int(dut.i_top.rst_ni.value) == 0
        for edge in range(rng.randrange(2, 8) & ~1):
            await clock(dut, 1 - edge % 2)
        assert int(dut.i_top.rst_ni.value) == 0
        dut.aresetn.value = 1
        await Timer(1, unit="ns")
        for edges in range(stages + 3):
            released = test or edges >= stages
            assert int(dut.i_top.rst_ni.value) == released, f"{edges} edges"
            taken = not stages or edges >= (1 if test else stages + 1)
            for name, pin, inward in gated:
                assert int((getattr(dut.i_top, name) if inward else getattr(dut, pin)).value) == taken, f"{pin} behind {edges} edges"
            await clock(dut, 1)
            await clock(dut, 0)
