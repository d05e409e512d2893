"""Area of a rendering stage, put together from synthesised parts, in gate equivalents (NAND2 = 1; docs/reference/synthesis.md).

    stage_parts("factored", ctu_area("factored", "fixed"))            # the RTL: 4 CTUs, 16 FIFOs, 32 VRUs
    stage_parts("factored", vrus=64)                                  # no contribution test, 64 VRUs of 4 pixels
    stage_parts("factored", generator_area(operations), pixels=True)  # a mask generator without RTL

What is synthesised is added up as the RTL connects it, so that the RTL's own configurations come out as `make synth` has them. The rest
is an estimate by rules of this file: a mask generator without RTL (sum of its synthesised operators times OVERHEAD), FIFO depths
between synthesised ones, VRUs with other than 4, 8 or 16 pixels, pixel masks in the FIFOs.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..errors import FlickerError
from ..golden.masked import ACCUMULATOR_INT_BITS
from ..params import CHANNELS, CORES, MINITILE, PIXELS_PER_VRU, VRU_COUNTS, CatMode, Form, Precision, RenderConfig
from ..perf.lane_stage import LaneStage
from .operations import Op, Operation, Operations, ctu_operations
from .synth.units import channel_config, vru_config

TABLE = Path(__file__).with_name("areas.csv")

RECORD_BITS = 145  # flk_pkg::FEATURE_ELEM_BITS
PIXEL_MASK_BITS = MINITILE * MINITILE
# Bits of a VRU's state per pixel: transmittance 15, finished 1, colour 3 x 15, and the output buffer's transmittance and colour.
OUTPUT_STATE_BITS = 60
PIXEL_STATE_BITS = 16 + 45 + OUTPUT_STATE_BITS
MAX_VRUS = CORES * CHANNELS * PIXEL_MASK_BITS


@dataclass(frozen=True)
class Part:
    """A synthesised unit. ge: gate equivalents; sram_bits: of memories behind `flk_sram`, which are not in it. load: capacitance of its input pins without
    clock pins; clock_free, clock_gated: of the clock pins that always toggle, and of those behind clock gates; all in inputs of the unit inverter."""

    ge: float
    mem_bits: int = 0
    ff: int = 0
    load: float = 0.0
    clock_free: float = 0.0
    clock_gated: float = 0.0
    sram_bits: int = 0


def _read(path: Path) -> dict[tuple[str, str], dict[str, str]]:
    with path.open() as file:
        return {(row["unit"], row["config"]): row for row in csv.DictReader(line for line in file if not line.startswith("#"))}


@cache
def parts() -> dict[tuple[str, str], Part]:
    """Synthesised parts by (unit, configuration), of this package's table, which `make synth && make docs PART=areas` writes."""
    return {
        key: Part(
            float(row["ge"]), int(row["mem_bits"]), int(row["ff"]), sram_bits=int(row.get("sram_bits") or 0),
            **{name: float(row.get(name) or 0) for name in ("load", "clock_free", "clock_gated")},
        )
        for key, row in _read(TABLE).items()
    }


def part(unit: str, config: str) -> Part:
    """A part; FlickerError when it is not synthesised."""
    found = parts().get((unit, config))
    if found is None:
        raise FlickerError(f"area: no synthesised part '{unit} {config}' in {TABLE.name}")
    return found


def in_table(unit: tuple[str, str]) -> tuple[float, int]:
    """GE and bits of SRAM of a part; FlickerError when it is not synthesised."""
    found = part(*unit)
    return found.ge, found.sram_bits


# ---- names --------------------------------------------------------------------------------------

_FLOATS = {"fp16": (5, 10, 0, 0), "e4m3": (4, 3, 1, 1), "e5m2": (5, 2, 0, 1), "e5m6": (5, 6, 0, 1), "e4m4": (4, 4, 1, 1), "e5m3": (5, 3, 0, 1)}


def format_bits(name: str) -> tuple[int, int, int, int] | None:
    """Exponent bits, mantissa bits, no infinity, saturates of a floating-point format; `float N`: FP16's exponent and N significant bits.
    None for another name."""
    name = name.lower()
    if name.startswith("float "):
        return 5, int(name.removeprefix("float ")) - 1, 0, 0
    return _FLOATS.get(name)


def operator_name(o: Operation) -> str:
    """Name of an operation's operator in the table of parts."""
    kind = "sqr" if o.sqr else o.op.value
    return f"{kind} {o.format.lower()}"


def operator(o: Operation) -> Part:
    """The operator of an operation. Logarithms of other formats than those of the RTL count as FP16's."""
    fmt = o.format.lower()
    if o.op == Op.LOG:
        return part("log_opacity", "log2 e4m3" if fmt == "e4m3" else "log2 fp16")
    if o.op == Op.TABLE and "exp" in fmt:
        return part("exp_neg", "2^-E")
    return part("op", operator_name(o))


def _word(value: Form | Precision | str, kind: type[Form] | type[Precision]) -> str:
    """Lower-case name of a form or a precision."""
    name = value.name.lower() if isinstance(value, (Form, Precision)) else str(value).lower()
    if name not in {m.name.lower() for m in kind}:
        raise FlickerError(f"area: unknown {kind.__name__.lower()} '{name}'; known are {', '.join(m.name.lower() for m in kind)}")
    return name


# ---- parts of the stage -------------------------------------------------------------------------


def fifo_area(depth: int, width: int = RECORD_BITS) -> float:
    """A feature FIFO. Between synthesised depths by straight lines over the depth, beyond them by the last; in proportion to its width."""
    if depth < 0:
        raise FlickerError(f"area: FIFO depth must not be negative, but is {depth}")
    if depth == 0:
        return 0.0
    known = sorted((int(config.split(" x ")[1]), p.ge) for (unit, config), p in parts().items() if unit == "fifo")
    low, high = next((pair for pair in zip(known, known[1:]) if depth <= pair[1][0]), known[-2:])
    ge = low[1] + (depth - low[0]) * (high[1] - low[1]) / (high[0] - low[0])
    return max(ge, RECORD_BITS * depth * 4.0) * width / RECORD_BITS  # never below its flip-flops


def vru_area(form: Form | str, pixels: int = PIXELS_PER_VRU) -> float:
    """A VRU that holds `pixels` pixels. Other numbers than the RTL's 4, 8 and 16: estimate, from the nearest of these by PIXEL_STATE_BITS a pixel at
    a FIFO's area per bit."""
    known, vru = vru_part(form, pixels)
    fifo = part("fifo", f"{RECORD_BITS} x 8")
    return vru.ge + (pixels - known) * PIXEL_STATE_BITS * fifo.ge / (8 * RECORD_BITS)


def vru_part(form: Form | str, pixels: int = PIXELS_PER_VRU) -> tuple[int, Part]:
    """Pixels and part of the synthesised VRU whose number of pixels is nearest."""
    known = min((MINITILE * MINITILE // count for count in VRU_COUNTS), key=lambda n: abs(n - pixels))
    return known, part("vru", vru_config(_word(form, Form), known))


def ctu_area(form: Form | str, precision: Precision | str, ctu_fifo_depth: int = 0) -> float:
    """A CTU with its output FIFO."""
    return part("ctu", f"{_word(form, Form)} {_word(precision, Precision)}").ge + fifo_area(ctu_fifo_depth, RECORD_BITS + CHANNELS)


def operators_area(generator: Operations) -> float:
    """Sum of a mask generator's operators: as many of each as it needs at one element per `cycles` cycles."""
    return sum(math.ceil(o.count / generator.cycles) * operator(o).ge for o in generator.per_element)


@cache
def overhead() -> float:
    """What pipeline registers, the record's delay and control add to a generator's operators, as a factor: that of the synthesised CTU
    (factored, FP16) over its own operators."""
    config = RenderConfig(form=Form.FACTORED, precision=Precision.FP16, cat=CatMode.DENSE)
    return part("ctu", "factored fp16").ge / operators_area(ctu_operations(config))


def generator_area(generator: Operations) -> float:
    """A mask generator without RTL: estimate."""
    return operators_area(generator) * overhead()


def stage_parts(
    form: Form | str, generator: float = 0.0, *, fifo_depth: int = 16, vrus: int = 32, pixels: bool = False,
) -> dict[str, float]:
    """GE of a rendering stage by part.

    generator: GE of one core's mask generator, 0: none. vrus: over all channels, the 256 pixels of a tile divided among them. pixels: the VRUs visit
    single pixels, so that FIFOs hold pixel masks and each VRU chooses its next pixel.
    """
    channels = CORES * CHANNELS
    per_channel, rest = divmod(vrus, channels)
    if rest or per_channel not in (1, 2, 4, 8, 16):
        raise FlickerError(f"area: the number of VRUs must be {channels} times 1, 2, 4, 8 or 16, not {vrus}")
    form = _word(form, Form)
    built = min(per_channel, max(VRU_COUNTS))  # the RTL's channel; more VRUs than that have a small arbiter each
    config = channel_config(form, built)
    channel, core = part("channel", config).ge, part("rendering_core", config).ge
    control = channel - part("fifo", f"{RECORD_BITS} x 16").ge - built * vru_area(form, MINITILE * MINITILE // built)
    control += (per_channel - built) * part("stream_arbiter", "2 x 67 bit").ge
    width = RECORD_BITS + (PIXEL_MASK_BITS if pixels else 0)
    select = part("op", "select 8").ge if pixels else 0.0
    return {
        "VRUs": vrus * (vru_area(form, MINITILE * MINITILE // per_channel) + select),
        "feature FIFOs": channels * fifo_area(fifo_depth, width),
        "mask generators": CORES * generator,
        "counters": CORES * part("perf_counters", "default").ge,
        "arbiters, control": channels * control + CORES * (core - CHANNELS * channel) + part("stage_control", "default").ge,
    }


def lane_vru_area(pixels: int, window: int = 1, buffers: int = 1, accumulator: int = 0) -> float:
    """A VRU as a lane (perf.lane_stage), factored form. Estimate: the RTL's, with choice of the next pixel in each entry of the window, further output
    buffers, and fixed-point accumulators (3 integer and `accumulator` fraction bits) for FP16 adders."""
    bit = part("fifo", f"{RECORD_BITS} x 8").ge / (8 * RECORD_BITS)
    ge = vru_area(Form.FACTORED, pixels) + window * part("op", "select 8").ge + (buffers - 1) * pixels * OUTPUT_STATE_BITS * bit
    if accumulator:
        width = ACCUMULATOR_INT_BITS + accumulator
        convert, add = part("op", f"shift fp16 -> q{ACCUMULATOR_INT_BITS}.{accumulator}").ge, part("op", f"add fixed {width}").ge
        ge += 3 * (convert + add + registers(width + 1) - part("fp_add_pipe", "fp16, 3 stages").ge) + 3 * pixels * (width - 15) * bit
    return ge


def registers(bits: int) -> float:
    """A pipeline register."""
    return bits * part("pipe_reg", f"{RECORD_BITS} bit").ge / RECORD_BITS


def lane_stage_parts(lanes: LaneStage, generator: float, vrus: int, fifo_depth: int, accumulator: int = 0) -> dict[str, float]:
    """GE of a stage of independent lanes by part; arguments as of `stage_parts`. A lane has a FIFO of its own, whose oldest `window - 1` entries lie in
    registers behind it."""
    pixels = CORES * CHANNELS * MINITILE * MINITILE // vrus
    arbiter = part("stream_arbiter", "2 x 67 bit").ge
    heads = lanes.window - 1
    return {
        "VRUs": vrus * lane_vru_area(pixels, lanes.window, lanes.buffers, accumulator),
        "feature FIFOs": vrus * (fifo_area(fifo_depth - heads, RECORD_BITS + pixels) + registers(heads * (RECORD_BITS + pixels))),
        "mask generators": CORES * lanes.width * generator,
        "counters": CORES * part("perf_counters", "default").ge,
        "arbiters, control": vrus * arbiter + stage_parts(Form.FACTORED)["arbiters, control"],
    }
