"""FLICKER for LiteX: the chip as a module, and two lines that put it into a SoC (docs/guide/soc.md).

    from litex_flicker import add_flicker
    add_flicker(self, chip="small")                      # in the SoC's __init__, behind its SDRAM

Registers are memory-mapped (1 KB, not cached), the interrupt is one of the CPU's. The chip's memory port, AXI4 of 128, 256 or 512 bits, goes to the
SoC's LiteDRAM crossbar where there is one; else it is left to the caller as `soc.flicker.memory`. Works with LiteX 2024.12.
"""

import sys
from pathlib import Path

from litex.gen import LiteXModule
from litex.soc.integration.soc import SoCRegion
from litex.soc.interconnect import axi, stream
from litex.soc.interconnect.csr import CSRStatus, CSRStorage
from migen import Cat, ClockSignal, If, Instance, Mux, ResetSignal, Signal

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT / "model") not in sys.path:
    sys.path.append(str(ROOT / "model"))

from flicker.chips import chip_of  # noqa: E402  (nothing but the standard library)

CHIP = "tiny"  # where none is named
ORIGIN = 0xA000_0000  # of the registers, where LiteX's CPUs do not cache
REGISTER_BYTES = 1024
LINE_BITS, ADDRESS_BITS, ID_BITS = 512, 40, 7  # a line is what the chip writes at once


def rtl_sources() -> list[Path]:
    """The chip's SystemVerilog, packages first."""
    listed = (ROOT / "rtl" / "flk.f").read_text().splitlines()
    return [ROOT / "rtl" / line.strip() for line in listed if line.strip() and not line.startswith("//")]


class _Level:
    """What LiteX takes an interrupt from: the chip enables and clears its interrupts itself."""

    def __init__(self) -> None:
        self.irq = Signal()


class MemoryGate(LiteXModule):
    """Between the chip's memory port and the memory: takes the memory away from the chip, so that the chip can be reset while the memory still owes answers.

    hold: the chip's addresses and data no longer reach the memory, its answers no longer the chip. What the memory was offered stays offered, data that it was
    promised come without strobes, and its answers are dropped. idle: hold, and nothing is under way. After a hold the chip must be reset before hold falls.
    Data follow their address by a cycle at least. The chip's writes are lines, of as many beats each, which this relies on.
    fail: reads whose identifier / 16 is k (docs/reference/chip_ports.md has them) are answered with SLVERR while bit k is set: to try what software does then.
    """

    def __init__(self, chip: axi.AXIInterface, memory: axi.AXIInterface) -> None:
        self.hold, self.idle, self.fail = Signal(), Signal(), Signal(8)
        reads, answers, owed = Signal(10), Signal(10), Signal(10)  # bursts without their last data, writes without an answer, without their data
        parts = LINE_BITS // memory.data_width
        part = Signal(max=max(parts, 2))  # of a line: its next beat
        waits = []
        for name in ("aw", "ar", "w"):
            source, sink, waiting, on = getattr(chip, name), getattr(memory, name), Signal(), Signal()
            self.sync += waiting.eq(sink.valid & ~sink.ready)
            self.comb += on.eq(~self.hold | waiting)
            if name == "w":
                drained = Signal()  # hold falls only when this is 0
                self.sync += drained.eq(sink.valid & ~sink.ready & (drained | ~on))
                self.comb += [
                    source.connect(sink, omit={"valid", "ready", "strb"}),
                    If(on & ~drained, sink.valid.eq(source.valid & (owed != 0)), sink.strb.eq(source.strb), source.ready.eq(sink.ready & (owed != 0)))
                    .Else(sink.valid.eq(owed != 0), sink.last.eq(part == parts - 1)),
                ]
            else:
                self.comb += [
                    source.connect(sink, omit={"valid", "ready"}),
                    sink.valid.eq(source.valid & on), source.ready.eq(sink.ready & on),
                ]
            waits.append(waiting)
        for name in ("b", "r"):
            source, sink = getattr(memory, name), getattr(chip, name)
            self.comb += [
                source.connect(sink, omit={"valid", "ready"}),
                sink.valid.eq(source.valid & ~self.hold), source.ready.eq(sink.ready | self.hold),
            ]
        self.comb += If((self.fail >> memory.r.id[4:]) & 1, chip.r.resp.eq(axi.RESP_SLVERR))
        asked, written, sent = (getattr(memory, name).valid & getattr(memory, name).ready for name in ("ar", "aw", "w"))
        given, answered = memory.r.valid & memory.r.ready & memory.r.last, memory.b.valid & memory.b.ready
        self.sync += [reads.eq(reads + asked - given), answers.eq(answers + written - answered), owed.eq(owed + Mux(written, parts, 0) - sent)]
        self.sync += If(sent, part.eq(Mux(part == parts - 1, 0, part + 1)))
        self.comb += self.idle.eq(self.hold & (reads == 0) & (answers == 0) & (owed == 0) & (Cat(*waits) == 0))


class Flicker(LiteXModule):
    """flk_top_axi. registers: AXI-Lite of the domain "sys". memory: AXI4 of the chip's width, addresses of 40 bits, 7 bits of ids, of the domain "sys".
    ev.irq: a level.

    chip: name in chips.toml, or in the file `chips` of the same kind.
    clock_domain: of the chip; another than "sys" puts LiteX's crossings of AXI-Lite and AXI4 between. platform: gets the sources; None: the caller has them.
    CSRs: `hold`, `idle`, `fail` of the MemoryGate, the first two for a reset of the chip after a time-out.
    """

    def __init__(self, platform=None, chip: str = CHIP, clock_domain: str = "sys", chips: str | Path | None = None) -> None:
        self.chip = chip
        found = chip_of(chip, chips)
        self.parameters, data_bits = found.parameters, found.config.port_bits
        self.registers = axi.AXILiteInterface(data_width=32, address_width=32)
        self.memory = axi.AXIInterface(data_width=data_bits, address_width=ADDRESS_BITS, id_width=ID_BITS)
        self.ev = _Level()
        self._hold = CSRStorage(1, name="hold", description="The memory is taken away from the chip.")
        self._idle = CSRStatus(1, name="idle", description="hold, and nothing of the chip's is under way at the memory.")
        self._fail = CSRStorage(8, name="fail", description="Reads with an identifier of 16 k to 16 k + 15 fail, by bit k.")
        gated = axi.AXIInterface(data_width=data_bits, address_width=ADDRESS_BITS, id_width=ID_BITS)
        self.gate = MemoryGate(gated, self.memory)
        self.comb += [self.gate.hold.eq(self._hold.storage), self.gate.fail.eq(self._fail.storage), self._idle.status.eq(self.gate.idle)]
        registers, memory, irq = self.registers, gated, self.ev.irq
        if clock_domain != "sys":
            from migen.genlib.cdc import MultiReg

            registers = axi.AXILiteInterface(data_width=32, address_width=32, clock_domain=clock_domain)
            memory = axi.AXIInterface(data_width=data_bits, address_width=ADDRESS_BITS, id_width=ID_BITS, clock_domain=clock_domain)
            irq = Signal()
            for name in ("aw", "w", "b", "ar", "r"):
                back = name in ("b", "r")
                self._cross(getattr(registers if back else self.registers, name), getattr(self.registers if back else registers, name), back, clock_domain)
                self._cross(getattr(gated if back else memory, name), getattr(memory if back else gated, name), not back, clock_domain)
            self.specials += MultiReg(irq, self.ev.irq)

        ports = {
            "i_aclk": ClockSignal(clock_domain), "i_aresetn": ~ResetSignal(clock_domain), "i_test_en": 0, "o_irq": irq,
            "i_m_axi_buser": 0, "i_m_axi_ruser": 0,
        }
        for channel, out, names in (
            ("aw", False, ("addr", "prot")), ("w", False, ("data", "strb")), ("b", True, ("resp",)), ("ar", False, ("addr", "prot")),
            ("r", True, ("data", "resp")),
        ):
            endpoint = getattr(registers, channel)
            for name in (*names, "valid"):
                # LiteX's AXI-Lite has no PROT.
                value = getattr(endpoint, name) if name != "prot" else 0
                ports[f"{'o' if out else 'i'}_s_axil_{channel}{name}"] = value[:10] if name == "addr" else value
            ports[f"{'i' if out else 'o'}_s_axil_{channel}ready"] = endpoint.ready
        address = ("id", "addr", "len", "size", "burst", "lock", "cache", "prot", "qos", "region", "valid")
        for channel, out, names in (
            ("aw", True, address), ("w", True, ("data", "strb", "last", "valid")), ("b", False, ("id", "resp", "valid")), ("ar", True, address),
            ("r", False, ("id", "data", "resp", "last", "valid")),
        ):
            endpoint = getattr(memory, channel)
            for name in names:
                ports[f"{'o' if out else 'i'}_m_axi_{channel}{name}"] = getattr(endpoint, name)
            ports[f"{'i' if out else 'o'}_m_axi_{channel}ready"] = endpoint.ready
        self.specials += Instance("flk_top_axi", **{f"p_{name}": value for name, value in self.parameters.items()}, **ports)
        if platform is not None:
            for path in rtl_sources():
                platform.add_source(str(path))

    def _cross(self, source, sink, to_sys: bool, clock_domain: str) -> None:
        """LiteX' crossing of a channel, between the chip's domain and "sys"."""
        crossing = stream.ClockDomainCrossing(source.description, clock_domain if to_sys else "sys", "sys" if to_sys else clock_domain, depth=8)
        self.submodules += crossing
        self.comb += [source.connect(crossing.sink), crossing.source.connect(sink)]


def add_flicker(
    soc, chip: str = CHIP, name: str = "flicker", origin: int = ORIGIN, clock_domain: str = "sys", chips: str | Path | None = None,
) -> Flicker:
    """The chip in a SoC: registers at `origin`, interrupt, memory port at the crossbar of `soc.sdram` where there is one. chip, chips: as of Flicker.

    The chip sees the memory at the CPU's addresses: what software names in a descriptor is what the CPU reads and writes.
    """
    module = Flicker(soc.platform, chip, clock_domain, chips)
    soc.add_module(name=name, module=module)
    soc.bus.add_slave(name, module.registers, SoCRegion(origin=origin, size=REGISTER_BYTES, cached=False))
    if soc.irq.enabled:
        soc.irq.add(name, use_loc_if_exists=True)
    soc.add_constant("FLICKER_CHIP", chip)
    if hasattr(soc, "sdram"):
        from litedram.frontend.axi import LiteDRAMAXI2Native

        port = soc.sdram.crossbar.get_port(data_width=module.memory.data_width)
        bridge = LiteDRAMAXI2Native(axi=module.memory, port=port, base_address=soc.bus.regions["main_ram"].origin)
        soc.add_module(name=f"{name}_bridge", module=bridge)
    return module
