"""The SoC of soc.py on Verilator, with memory and UART (docs/reference/soc.md)."""

from __future__ import annotations

import ctypes
import functools
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

try:
    import litex_flicker  # noqa: F401
except ImportError as error:  # told where a person sees it
    raise ImportError(f"{error.name} is not installed: make soc sets it up") from None

from flicker.chips import chip_of  # noqa: E402
from flicker.errors import FlickerError  # noqa: E402
from flicker.output import write_text  # noqa: E402
from flicker.sim import half  # noqa: E402
from flicker.sim.chip import PORT  # noqa: E402
from flicker.sim.chip import build as chip_simulator  # noqa: E402
from flicker.sim.memory import HEADERS, Order, PortConfig, Timing, _Config  # noqa: E402
from flicker.toolchain import BUILD, locked, sources_of, verilate  # noqa: E402

RAM = 0x4000_0000
RAM_BYTES = 64 << 20
REGISTERS = 0xA000_0000
SLICE = 10_000  # cycles between looks at the terminal
# Memory that serves the CPU: one access at a time, with the latency of the chip's port.
CPU_PORT = PortConfig(id_bits=4, max_reads=1, max_writes=1, latency=PORT.latency, hazards=False, order=Order.IN_ORDER, urgent=14)
SETTINGS = ("preprocessing", "render_stage", "lanes", "rendering")


def emitted(chip: str, crossing: bool = False) -> Path:
    """Folder with the SoC's Verilog and headers, made anew."""
    import logging

    logging.disable(logging.CRITICAL)
    from soc import SimSoC, emit

    return emit(SimSoC(chip, crossing), BUILD / "soc" / (f"{chip}-crossing" if crossing else chip)).parent


def _for_verilator(text: str) -> str:
    """LiteX' Verilog without comments, which hold the date, and with blocking assignments in its combinational blocks."""
    lines, combinational = [], False
    for line in text[text.index("`timescale") :].splitlines():
        if line.startswith("//"):
            continue
        combinational = line.startswith("always @(*)") or (combinational and line != "end")
        lines.append(re.sub(r"^(\s+[\w\[\]:{}, ]+) <= (.*;)$", r"\1 = \2", line) if combinational else line)
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Built:
    """folder: of the emitted SoC. library: of its simulator. chip: of the chip's, where that is another library; else None. data_bits: of the memory port."""

    folder: Path
    library: Path
    chip: Path | None = None
    data_bits: int = 512


def build(chip: str, shared: bool = False, crossing: bool = False) -> Built:
    """A SoC's simulator, cached by content. shared: the chip's own simulator (`flicker.sim.chip.build`), which may be built already, stands for the instance of
    flk_top_axi, and the rest of the SoC is built without it: the same cycles, in less time to build and more to run. crossing: as of SimSoC."""
    import pythondata_cpu_vexriscv

    cpu = Path(pythondata_cpu_vexriscv.data_location) / "VexRiscv_IMAC.v"
    with locked(BUILD / "soc" / f"{chip}.lock"):
        folder = emitted(chip, crossing)
        source, text = folder / "model.v", _for_verilator((folder / "flk_soc.v").read_text())
        if not source.exists() or source.read_text() != text:
            source.write_text(text)
    if shared:
        sources = [*sources_of("flk_param_pkg"), *sources_of("flk_lane_pkg"), HERE / "flk_top_axi_shim.sv"]
        other, define, settings = chip_simulator(chip_of(chip).config), "-DFLK_SHIM", []
    else:
        sources, other, define, settings = sources_of("flk_top_axi"), None, "", [half.HERE / f"{name}.vlt" for name in SETTINGS]
    library = verilate(
        "flk_soc", [*dict.fromkeys(sources), cpu, source],
        args=["--x-assign", "unique", "--x-initial", "unique", "-fno-dfg", "-fno-table", "--inline-mult", "20000",
              "-Wno-lint", "-Wno-style", "-Wno-TIMESCALEMOD", "-Wno-MULTITOP"],
        cpp=[HERE / "harness.cpp"], depends=HEADERS, settings=settings,
        cflags=f"-DVL_USER_STOP -DVL_USER_FATAL {define} -I{half.HERE}".replace("  ", " "), opt="-O1", shared=True, kind="soc", name="soc",
    )
    return Built(folder, library, other, chip_of(chip).config.port_bits)


@functools.cache
def _library(path: Path) -> ctypes.CDLL:
    lib = ctypes.CDLL(str(path))
    u64, pointer = ctypes.c_uint64, ctypes.c_void_p
    for name, result, *arguments in (
        ("failure", ctypes.c_char_p),
        ("new", pointer, ctypes.c_char_p, pointer, ctypes.c_int, pointer, u64, pointer),
        ("delete", None, pointer),
        ("allocate", ctypes.c_int, pointer, u64, u64),
        ("write", ctypes.c_int, pointer, u64, u64, ctypes.c_char_p),
        ("read", ctypes.c_int, pointer, u64, u64, pointer),
        ("run", ctypes.c_int, pointer, u64),
        ("output", ctypes.c_int, pointer, pointer, ctypes.c_int),
        ("input", None, pointer, ctypes.c_char_p, ctypes.c_int),
        ("cycles", u64, pointer),
        ("asleep", u64, pointer),
    ):
        function = getattr(lib, f"flk_soc_{name}")
        function.restype, function.argtypes = result, arguments
    return lib


class Soc:
    """A SoC out of reset. Use as a context. rom: the firmware, at most 32 KB. timing: of the DRAM; None: a perfect memory. echo: gets what the UART sends.

    FlickerError where a rule of AXI or an assertion is broken, or something does not happen in time.
    """

    def __init__(
        self, built: Built, rom: bytes, *, timing: Timing | None = None, seed: int = 1, echo: Callable[[str], None] | None = None,
    ) -> None:
        folder = built.folder
        words = np.frombuffer(rom + bytes(-len(rom) % 4), "<u4")
        write_text(folder / "flk_soc_rom.init", "".join(f"{word:08x}\n" for word in words))
        self._lib, self._echo, self.text, self._chip = _library(built.library), echo, "", None
        configs = (_Config * 2)(replace(PORT, data_bits=built.data_bits).structure(), CPU_PORT.structure())
        options = timing or Timing(*[1] * len(Timing._fields_))
        if built.chip:
            self._chips = half._library(built.chip)
            self._chip = self._chips.flk_half_new(ctypes.byref(options), True, configs, seed)
            self._lib.flk_soc_pins(self._chips.flk_chip_pins)
        self._soc = self._lib.flk_soc_new(str(folder).encode(), ctypes.byref(options), timing is None, configs, seed, self._chip)
        if not self._soc:
            raise self._failure()
        self._lib.flk_soc_allocate(self._soc, RAM, RAM_BYTES)
        self._seen = 0  # of the text, by `expect`

    def __enter__(self) -> Soc:
        return self

    def __exit__(self, *_) -> None:
        self._lib.flk_soc_delete(self._soc)
        if self._chip:
            self._chips.flk_half_delete(self._chip)

    def _failure(self, text: str = "") -> FlickerError:
        return FlickerError(f"soc: {text or self._lib.flk_soc_failure().decode()}")

    @property
    def cycles(self) -> int:
        """Since the beginning of the reset."""
        return self._lib.flk_soc_cycles(self._soc)

    @property
    def asleep(self) -> int:
        """Cycles of the CPU in wfi."""
        return self._lib.flk_soc_asleep(self._soc)

    def write(self, address: int, data: bytes) -> None:
        """Into RAM, in no time."""
        if not self._lib.flk_soc_write(self._soc, address, len(data), data):
            raise self._failure(f"{len(data)} bytes at {address:#x} are not in RAM")

    def read(self, address: int, size: int) -> np.ndarray:
        """uint8 (size,), from RAM, in no time."""
        out = np.zeros(size, np.uint8)
        if not self._lib.flk_soc_read(self._soc, address, size, out.ctypes.data):
            raise self._failure(f"{size} bytes at {address:#x} are not in RAM")
        return out

    def send(self, keys: str) -> None:
        """Bytes to the UART."""
        data = keys.encode()
        self._lib.flk_soc_input(self._soc, data, len(data))

    def run(self, cycles: int) -> None:
        """So many cycles; what the UART sends goes to `text` and to `echo`."""
        good = self._lib.flk_soc_run(self._soc, cycles)
        buffer = ctypes.create_string_buffer(4096)
        while n := self._lib.flk_soc_output(self._soc, buffer, len(buffer)):
            text = buffer.raw[:n].decode(errors="replace")
            self.text += text
            if self._echo:
                self._echo(text)
        if not good:
            raise self._failure()

    def expect(self, wanted: str, limit: int = 20_000_000) -> str:
        """Run until the UART has sent a text: what it sent up to its end, since the last call."""
        end = self.cycles + limit
        while (at := self.text.find(wanted, self._seen)) < 0:
            if self.cycles >= end:
                raise self._failure(f"no {wanted!r} within {limit} cycles; the end of the output: {self.text[-300:]!r}")
            self.run(SLICE)
        begin, self._seen = self._seen, at + len(wanted)
        return self.text[begin : self._seen]
