"""Energy of a rendered frame: operations and accesses counted by the models, times energy per operation.

    configuration.energy(work, cycles, counters)       # microjoules by part; `stage_energy` with the stage's own counts

Logic: switched capacitance of the synthesised netlists (`flicker.cost.area`: input capacitance of all cells), scaled to 28 nm by the constants
below. Memories: published figures. Every constant has its source in SOURCES. Absolute values are estimates without layout; ratios between
configurations are what the model is for (`ratios`), since most of what is uncertain is common to both sides.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import FlickerError
from ..golden.lanes import formats as lane_formats
from ..params import CORES, PIXELS_PER_VRU, CatMode, Form, Precision, RenderConfig
from ..perf.lanes import LaneCycles
from .area import RECORD_BITS, Part, operator, part, parts, vru_part
from .operations import Operations, ctu_operations

# ---- constants ----------------------------------------------------------------------------------

VOLTAGE = 0.9
INVERTER_FF = 1.0
PARASITIC = 1.0
WIRE = 1.0
ACTIVITY = 0.1
LEAKAGE_NW_PER_GE = 2.0
CLOCK_HZ = 1_000_000_000
SRAM_PJ_PER_BIT_8K = 10 / 64
SRAM_NODE_SCALE = 28 / 45
SRAM_EXPONENT = 0.5
DRAM_PJ_PER_BIT = 8.0

_HOROWITZ = "M. Horowitz, Computing's Energy Problem, ISSCC 2014 (45 nm, 0.9 V)"
SOURCES = {
    "VOLTAGE": "assumption: V, a usual nominal supply in 28 nm",
    "INVERTER_FF": "fF of gate capacitance of the unit inverter in 28 nm: 1.7 fF of INV_X1 in the Nangate 45 nm Open Cell Library, times 28/45, rounded down",
    "PARASITIC": "drain capacitance over gate capacitance of a gate; parasitic delay of an inverter = 1 (Sutherland, Sproull, Harris: Logical Effort)",
    "WIRE": "assumption: a net's wire has the capacitance of the pins that it drives; there is no layout",
    "ACTIVITY": "transitions of a node per operation, glitches included; chosen so that the FP16 multiplier and adder, 0.55 and 0.28 pJ, lie around "
                "published ones: 1.1 and 0.4 pJ of " + _HOROWITZ + ", times 28/45, are 0.68 and 0.25 pJ",
    "LEAKAGE_NW_PER_GE": "assumption: nW a gate equivalent, typical corner, mixed thresholds",
    "CLOCK_HZ": "assumption: 1 GHz, the clock GSCore (ASPLOS 2024) states for 28 nm; turns leakage power into energy",
    "SRAM_PJ_PER_BIT_8K": "pJ a bit of an 8 KiB memory with 64-bit accesses, 10 pJ an access: " + _HOROWITZ,
    "SRAM_NODE_SCALE": "assumption: capacitance in proportion to the feature size, 45 to 28 nm, same supply",
    "SRAM_EXPONENT": "energy an access grows with this power of the capacity: 8 KiB 10 pJ, 32 KiB 20 pJ, 1 MiB 100 pJ: " + _HOROWITZ,
    "DRAM_PJ_PER_BIT": "pJ a bit of LPDDR4: value of the CACTI plug-in of Accelergy and Timeloop (type2energy), given there as public data",
}


def constant_table() -> list[tuple[str, float, str]]:
    """(name, value, source) of every constant."""
    return [(name, globals()[name], source) for name, source in SOURCES.items()]


# ---- energy per event, in pJ --------------------------------------------------------------------


def _swing(load: float) -> float:
    """pJ to charge a load (in inputs of the unit inverter) from the supply once: C V^2."""
    return load * INVERTER_FF * (1 + PARASITIC + WIRE) * VOLTAGE**2 * 1e-3


def switching_pj(load: float, activity: float = ACTIVITY) -> float:
    """pJ of an operation whose nodes make `activity` transitions each: half C V^2 a transition."""
    return 0.5 * activity * _swing(load)


def clock_pj(load: float) -> float:
    """pJ of a clock cycle: two transitions."""
    return _swing(load)


def vru_pj(form: Form | str, pixels: int = PIXELS_PER_VRU) -> float:
    """pJ of a pixel-Gaussian pair in a VRU of `pixels` pixels, without clocks that always run. One of its pixels has its state clocked, a record is
    taken once in as many pairs."""
    known, vru = vru_part(form, pixels)
    return switching_pj(vru.load) + clock_pj(vru.clock_gated) / known


def fifo_pj(depth: int, width: int = RECORD_BITS) -> float:
    """pJ to write a record into a FIFO of flip-flops and to read it. Load between synthesised depths by straight lines; one row is clocked."""
    known = sorted((int(c.split(" x ")[1]), p) for (u, c), p in parts().items() if u == "fifo" and p.load)
    depths = [d for d, _ in known]
    load = float(np.interp(depth, [0, *depths], [0.0, *(p.load for _, p in known)]))
    row = known[-1][1].clock_gated / known[-1][0]
    return (switching_pj(load) + clock_pj(row)) * width / RECORD_BITS


def ctu(form: Form | str, precision: Precision | str) -> Part:
    """The CTU."""
    return part("ctu", f"{_name(form)} {_name(precision)}")


def ctu_pj(form: Form | str, precision: Precision | str) -> float:
    """pJ of a cycle in which a CTU tests; its pipeline is clocked in these cycles only."""
    unit = ctu(form, precision)
    return switching_pj(unit.load) + clock_pj(unit.clock_gated)


def generator_pj(operations: Operations) -> float:
    """pJ of an element in a mask generator without RTL: its operators, and in the proportion of the synthesised CTU (factored, FP16) pipeline
    registers and their clocks."""
    logic = sum(o.count * operator(o).load for o in operations.per_element)
    model = part("ctu", "factored fp16")
    own = ctu_operations(RenderConfig(form=Form.FACTORED, precision=Precision.FP16, cat=CatMode.DENSE))
    scale = model.load / sum(o.count * operator(o).load for o in own.per_element)
    return switching_pj(logic * scale) + clock_pj(logic * scale * model.clock_gated / model.load)


def sram_pj(bits: int, capacity_bytes: int) -> float:
    """pJ to read or write `bits` in an SRAM of a capacity."""
    return bits * SRAM_PJ_PER_BIT_8K * SRAM_NODE_SCALE * (max(capacity_bytes, 1) / 8192) ** SRAM_EXPONENT


def dram_pj(n_bytes: int) -> float:
    """pJ to move bytes between LPDDR4 and the chip."""
    return 8 * n_bytes * DRAM_PJ_PER_BIT


def _name(value: Form | Precision | str) -> str:
    return value.name.lower() if isinstance(value, (Form, Precision)) else str(value).lower()


# ---- frames -------------------------------------------------------------------------------------


def stage_energy(
    *, cycles: int, subtiles: int, form: Form | str, vrus: int, pairs: int, pushed: int, fifos: int, fifo_depth: int, fifo_bits: int,
    masks_pj: float, masks_clock_free: float, area: float,
) -> dict[str, float]:
    """Microjoules of a frame in the rendering stage, by part.

    pairs: pixel-Gaussian pairs that the VRUs work on. pushed: records of `fifo_bits` written into the FIFOs. masks_pj: of the mask generators in
    the frame; masks_clock_free: load of clock pins that always toggle in one of them. area: of the stage, in GE.

    "ungated clock": clock pins behind no clock gate, over all cycles. Left out: wires between units, input buffers, what the sorting unit does.
    """
    form = _name(form)
    vru_pixels = 64 * CORES // vrus
    counters, arbiters = part("perf_counters", "default"), (part("stream_arbiter", "2 x 67 bit"), part("stream_arbiter", "4 x 92 bit"))
    free = part("stage_control", "default").clock_free + CORES * (counters.clock_free + masks_clock_free)
    free += vrus * vru_part(form, vru_pixels)[1].clock_free + fifos * _free_fifo(fifo_depth)
    control = CORES * cycles * (switching_pj(counters.load) + clock_pj(counters.clock_gated)) + 64 * subtiles * sum(switching_pj(a.load) for a in arbiters)
    picojoules = {
        "VRUs": pairs * vru_pj(form, vru_pixels),
        "feature FIFOs": pushed * fifo_pj(fifo_depth, fifo_bits),
        "mask generators": masks_pj,
        "counters, arbiters": control,
        "ungated clock": cycles * clock_pj(free),
        "leakage": area * LEAKAGE_NW_PER_GE * 1e-9 * cycles / CLOCK_HZ * 1e12,
    }
    return {name: value * 1e-6 for name, value in picojoules.items()}


def lane_energy(counters: LaneCycles, config: RenderConfig, build: str, subtiles: int, area: float) -> dict[str, float]:
    """Microjoules of a frame in the stage of lanes, by part: events of its counters times the loads of its units. build: its name in the table of areas.

    A visit switches a lane, clocks its pipeline and one pixel's state; the end of a list clocks the state and the bank of all pixels. A splat that is taken
    switches and clocks a setup and a mask; one that is dispatched, a slot of the store. What is in no unit (store, dispatch, delays, output) switches with
    the visits, a lane's share each: most of it is what lanes read the store with.
    """
    pixels = 64 * CORES // config.lanes
    lane, queue = part("lane", f"{pixels} pixels"), part("lane_queue", f"{pixels} pixels")
    setup, mask, count, result = part("splat_setup", "default"), part("row_mask", "default"), part("lane_counters", "default"), part("lane_result", "default")
    stage, core = part("lane_stage", build), part("lane_core", build)
    per_core = config.lanes // CORES
    own = core.load - per_core * (lane.load + queue.load) - config.in_width * (setup.load + mask.load) - result.load
    gated = core.clock_gated - per_core * (lane.clock_gated + queue.clock_gated) - config.in_width * (setup.clock_gated + mask.clock_gated)
    f = lane_formats.FORMATS
    pin = (lane.clock_free + lane.clock_gated) / lane.ff
    state, bank = pin * (f.sum + 4 + 3 * (f.accumulator + 2)), pin * (lane_formats.RESULT_FRACTION + 5 + 3 * (f.accumulator + 2))
    pipe = max(lane.clock_gated - pixels * (state + bank), 0.0)
    visits, ends = counters.total("visits"), config.lanes * counters.total("subtiles")
    row = queue.clock_gated / config.fifo_depth
    cycles = counters.cycles
    picojoules = {
        "lanes": visits * (switching_pj(lane.load) + clock_pj(pipe + state)) + ends * clock_pj(pixels * (state + bank)),
        "queues": counters.total("entries") * (switching_pj(queue.load) + clock_pj(row)) + visits * switching_pj(queue.load),
        "setup and masks": (counters.total("gaussians_in") + counters.total("subtiles")) * (
            switching_pj(setup.load + mask.load) + clock_pj(setup.clock_gated + mask.clock_gated)
        ),
        "store, dispatch, output": visits * switching_pj(own / per_core) + counters.total("dispatched") * clock_pj(gated / config.slots)
        + 64 * subtiles * switching_pj(result.load),
        "counters": CORES * cycles * (switching_pj(count.load) + clock_pj(count.clock_gated)),
        "ungated clock": cycles * clock_pj(stage.clock_free),
        "leakage": area * LEAKAGE_NW_PER_GE * 1e-9 * cycles / CLOCK_HZ * 1e12,
    }
    return {name: value * 1e-6 for name, value in picojoules.items()}


def _free_fifo(depth: int) -> float:
    """Clock pins of a FIFO that always toggle."""
    known = sorted((int(c.split(" x ")[1]), p.clock_free) for (u, c), p in parts().items() if u == "fifo" and p.load)
    return float(np.interp(depth, [d for d, _ in known], [v for _, v in known]))


def busy_energy(unit: Part, cycles: int) -> float:
    """Microjoules of a unit of which nothing is counted, at most: its logic switches and all its clocks run in each of `cycles`. With leakage."""
    leakage = unit.ge * LEAKAGE_NW_PER_GE * 1e-9 * cycles / CLOCK_HZ * 1e12
    return (cycles * (switching_pj(unit.load) + clock_pj(unit.clock_free + unit.clock_gated)) + leakage) * 1e-6


def memory_energy(dram_bytes: int, sram_bits: int = 0, capacity_bytes: int = 288 * 1024) -> dict[str, float]:
    """Microjoules of a frame in memories: bytes moved to and from LPDDR4; bits written to and read from an on-chip SRAM of a capacity
    (the paper's feature buffers have 288 KiB)."""
    return {"LPDDR4": dram_pj(dram_bytes) * 1e-6, "SRAM": sram_pj(sram_bits, capacity_bytes) * 1e-6}


def ratios(energies: dict[str, float | dict[str, float]], base: str) -> dict[str, float]:
    """Energy of each configuration over that of `base`."""
    if base not in energies:
        raise FlickerError(f"energy: no configuration '{base}' to compare with")
    total = {name: sum(e.values()) if isinstance(e, dict) else float(e) for name, e in energies.items()}
    if not total[base] > 0 or not math.isfinite(total[base]):
        raise FlickerError(f"energy: '{base}' has no energy to compare with")
    return {name: value / total[base] for name, value in total.items()}
