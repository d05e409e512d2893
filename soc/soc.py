"""A SoC for simulation: VexRiscv, ROM, RAM, UART, timer, interrupts and the chip (docs/reference/soc.md).

    python soc/soc.py --chip tiny --out build/soc/tiny

writes the Verilog, the ROM's contents and the headers for the firmware. Two things are pins, and a harness serves both from one memory: the chip's
AXI4 port, and the CPU's port to the RAM at 0x40000000 (Wishbone, 32 bits, byte addresses 31:2).
"""

import argparse
import contextlib
import io
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from litex.build.generic_platform import Pins, Subsignal  # noqa: E402
from litex.build.sim import SimPlatform  # noqa: E402
from litex.soc.integration import export  # noqa: E402
from litex.soc.integration.soc import SoCRegion  # noqa: E402
from litex.soc.integration.soc_core import SoCCore  # noqa: E402
from litex.soc.interconnect import wishbone  # noqa: E402
from litex_flicker import CHIP, ROOT, add_flicker  # noqa: E402
from migen import ClockDomain, ClockSignal, ResetSignal  # noqa: E402

from flicker.chips import chips  # noqa: E402  (litex_flicker makes it known)

RAM_ORIGIN, RAM_BYTES = 0x4000_0000, 0x0400_0000
ROM_BYTES, SRAM_BYTES = 0x8000, 0x2000
CLOCK_HZ = 1_000_000  # of the SoC's own opinion: the timer and the table count cycles

_ADDRESS = (("id", 7), ("addr", 40), ("len", 8), ("size", 3), ("burst", 2), ("qos", 4), ("valid", 1), ("ready", 1))
_AXI = {
    "aw": _ADDRESS, "w": (("data", 512), ("strb", 64), ("last", 1), ("valid", 1), ("ready", 1)), "b": (("id", 7), ("resp", 2), ("valid", 1), ("ready", 1)),
    "ar": _ADDRESS, "r": (("id", 7), ("data", 512), ("resp", 2), ("last", 1), ("valid", 1), ("ready", 1)),
}
_RAM = (("adr", 30), ("dat_w", 32), ("dat_r", 32), ("sel", 4), ("cyc", 1), ("stb", 1), ("ack", 1), ("we", 1), ("cti", 3), ("err", 1))
IO = [
    ("sys_clk", 0, Pins(1)),
    ("sys_rst", 0, Pins(1)),
    ("serial", 0, *(Subsignal(f"{side}_{name}", Pins(width)) for side in ("source", "sink") for name, width in (("valid", 1), ("ready", 1), ("data", 8)))),
    ("mem", 0, *(Subsignal(f"{channel}_{name}", Pins(width)) for channel, fields in _AXI.items() for name, width in fields)),
    ("ram", 0, *(Subsignal(name, Pins(width)) for name, width in _RAM)),
]


class _Crg:
    """Clock and reset are pins."""

    def __new__(cls, platform):
        from litex.gen import LiteXModule

        module = LiteXModule()
        module.cd_sys = ClockDomain()
        module.comb += [module.cd_sys.clk.eq(platform.request("sys_clk")), module.cd_sys.rst.eq(platform.request("sys_rst"))]
        return module


class SimSoC(SoCCore):
    """chip: name in chips.toml. crossing: the chip has a clock domain of its own, with the same clock, behind LiteX' crossings."""

    def __init__(self, chip: str = CHIP, crossing: bool = False) -> None:
        platform = SimPlatform("SIM", list(IO), name="flk_soc")
        self.crg = _Crg(platform)
        super().__init__(
            platform, clk_freq=CLOCK_HZ, cpu_type="vexriscv", cpu_variant="imac", integrated_rom_size=ROM_BYTES, integrated_sram_size=SRAM_BYTES,
            uart_name="sim", bus_bursting=True, ident="FLICKER in simulation", ident_version=False,
        )
        if crossing:
            self.cd_chip = ClockDomain()
            self.comb += [self.cd_chip.clk.eq(ClockSignal("sys")), self.cd_chip.rst.eq(ResetSignal("sys"))]
        add_flicker(self, chip, clock_domain="chip" if crossing else "sys")
        pads = platform.request("mem")
        for channel, fields in _AXI.items():
            stream, out = getattr(self.flicker.memory, channel), channel in ("aw", "w", "ar")
            for name, _ in fields:
                pad, signal = getattr(pads, f"{channel}_{name}"), getattr(stream, name)
                self.comb += pad.eq(signal) if out != (name == "ready") else signal.eq(pad)
        bus = wishbone.Interface(data_width=32, address_width=32, addressing="word", bursting=True)
        self.bus.add_slave("main_ram", bus, SoCRegion(origin=RAM_ORIGIN, size=RAM_BYTES, mode="rwx"))
        pads = platform.request("ram")
        for name, _ in _RAM:
            pad, signal = getattr(pads, name), getattr(bus, name)
            self.comb += signal.eq(pad) if name in ("dat_r", "ack", "err") else pad.eq(signal)


def emit(soc: SoCCore, folder: Path, name: str = "flk_soc") -> Path:
    """Write Verilog, contents of memories and the firmware's headers into a folder: the Verilog."""
    folder.mkdir(parents=True, exist_ok=True)
    here = os.getcwd()
    with contextlib.redirect_stdout(io.StringIO()):
        soc.finalize()
        os.chdir(folder)
        try:
            soc.platform.get_verilog(soc, name=name).write(f"{name}.v")
        finally:
            os.chdir(here)
    write_headers(soc, folder)
    return folder / f"{name}.v"


def write_headers(soc: SoCCore, folder: Path) -> None:
    """csr.h, soc.h, mem.h: the addresses that a firmware needs."""
    for header, text in {
        "csr.h": export.get_csr_header(soc.csr.regions, soc.constants, soc.mem_regions["csr"].origin, with_access_functions=False),
        "soc.h": export.get_soc_header(soc.constants, with_access_functions=False),
        "mem.h": export.get_mem_header(soc.mem_regions),
    }.items():
        (folder / header).write_text(text)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chip", choices=chips(), default=CHIP)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "soc" / "emitted")
    options = parser.parse_args()
    print(emit(SimSoC(options.chip), options.out))


if __name__ == "__main__":
    main()
