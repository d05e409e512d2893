"""cocotb test of the pixel-rectangle test unit; settings: the module's parameters."""

from __future__ import annotations

import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge
from flicker_tb import splats
from flicker_tb.bench import PERIOD_NS, config

from flicker.formats import E4M3, FP16
from flicker.functions import log_opacity
from flicker.golden.cat import DENSE_RECTS, SPARSE_RECTS, trace_rect
from flicker.params import PRTU_LATENCY, Form, Precision

ITEMS = 4_000
RECT = ("x_top_i", "x_bot_i", "y_top_i", "y_bot_i")
RECORD = ("mean_x_i", "mean_y_i", "shape0_i", "shape1_i", "shape2_i")
INPUTS = (*RECT, *RECORD, "threshold_i")
SHAPES = ("shape0", "shape1", "shape2")
LEADERS = (*DENSE_RECTS.tolist(), *SPARSE_RECTS.tolist())

# Registers by stage: (cycles after the input, value of the model, register).
REGISTERS = {
    Form.CONIC: (
        (2, "xx", "gen_conic.xx_q"), (2, "yy", "gen_conic.yy_q"), (2, "xy", "gen_conic.xy_q"),
        (3, "sx", "gen_conic.sx_q"), (3, "sy", "gen_conic.sy_q"), (3, "t", "gen_conic.t_q3"),
        (4, "h", "gen_conic.h_q"),
    ),
    Form.FACTORED: (
        (2, "p", "gen_factored.p_q"), (2, "q", "gen_factored.q_q"), (2, "v", "gen_factored.v_q2"),
        (3, "u", "gen_factored.u_q"),
        (4, "uu", "gen_factored.uu_q"), (4, "vv", "gen_factored.vv_q"),
    ),
}  # fmt: skip


def registers(form: Form, precision: Precision):
    """All registers that are compared."""
    first = [(1, "dx", "dx_q"), (1, "dy", "dy_q")]
    if precision != Precision.FP16:  # else they are the inputs as they came
        first += [(1, name, f"{name}_q1") for name in SHAPES]
    last = [(5, "weight", "weight_q"), (PRTU_LATENCY, "weight", "weight_o"), (PRTU_LATENCY, "pass", "pass_o")]
    return [*first, *REGISTERS[form], *last]


def handle(dut, path: str):
    """Handle of a signal below the top."""
    for name in path.split("."):
        dut = getattr(dut, name)
    return dut


def stimulus(rng, form: Form, thresholds: list[int], width: int):
    """One operation: values of INPUTS. `thresholds` by opacity, `width` bits wide."""
    kind = rng.choices((splats.tame, splats.thin, splats.special, splats.opaque), (4, 3, 3, 1))[0]
    features = kind(rng, form).features
    rect = rng.choice((*LEADERS, [rng.randrange(8) for _ in range(4)]))
    threshold = thresholds[features[5]] if rng.random() < 0.8 else rng.getrandbits(width)
    return (*rect, *features[:5], threshold)


def expected(operations, form: Form, precision: Precision, fmt) -> dict[str, np.ndarray]:
    """Registers' contents by the model's names, uint64, for observed operations."""
    values: dict[str, list] = {}
    for operation in operations:
        features = (*operation[4:9], 0, 0, 0, 0)
        trace = trace_rect(operation[:4], features, form, precision)
        for name, value in (*trace.terms.items(), ("weight", trace.weights)):
            values.setdefault(name, []).append(value)
    arrays = {name: np.array(value) for name, value in values.items()}
    for place, name in enumerate(SHAPES):
        arrays[name] = arrays["shape"][:, place : place + 1]
    threshold = fmt.decode(np.array([operation[9] for operation in operations]))
    passes = threshold[:, None] > arrays["weight"]
    # Lane i of a register lies at bit i * width.
    packed = {name: pack(fmt.encode(array), fmt.width) for name, array in arrays.items()}
    packed["pass"] = pack(passes, 1)
    return packed


def pack(lanes: np.ndarray, width: int) -> np.ndarray:
    """Rows of lanes to one integer each, lane 0 lowest."""
    shifts = np.arange(lanes.shape[1], dtype=np.uint64) * np.uint64(width)
    return (lanes.astype(np.uint64) << shifts).sum(axis=1, dtype=np.uint64)


@cocotb.test()
async def every_stage(dut):
    """Each register holds what the model says, in the cycle in which it should; bubbles don't matter."""
    rng = random.Random(random.getrandbits(64))
    form, precision = Form(config()["Form"]), Precision(config()["Precision"])
    fmt = FP16 if precision == Precision.FP16 else E4M3
    assert len(dut.threshold_i) == fmt.width
    thresholds = log_opacity(np.arange(1 << 16), form == Form.FACTORED, fmt).tolist()
    compared = registers(form, precision)
    ports = [getattr(dut, name) for name in INPUTS]
    widths = [len(port) for port in ports]
    probes = {path: handle(dut, path) for _, _, path in compared}
    cocotb.start_soon(Clock(dut.clk_i, PERIOD_NS, unit="ns").start())

    edge = RisingEdge(dut.clk_i)
    seen: list[tuple[int, tuple[int, ...]]] = []  # (cycle, operation)
    log: dict[str, list[int]] = {path: [] for path in probes}
    cycle, left, offered = 0, ITEMS, False
    while left or cycle <= seen[-1][0] + PRTU_LATENCY:
        await edge
        for path, probe in probes.items():
            log[path].append(int(probe.value))
        if offered:
            seen.append((cycle, tuple(int(port.value) for port in ports)))
        offered = left > 0 and rng.random() < 0.8
        garbage = map(rng.getrandbits, widths)
        values = stimulus(rng, form, thresholds, fmt.width) if offered else garbage
        for port, value in zip(ports, values, strict=True):
            port.value = value
        left -= offered
        cycle += 1

    assert len(seen) == ITEMS
    want = expected([operation for _, operation in seen], form, precision, fmt)
    cycles = np.array([cycle for cycle, _ in seen])
    wrong = []
    for delay, name, path in compared:
        got = np.array(log[path], np.uint64)[cycles + delay]
        for n in np.flatnonzero(got != want[name])[:3]:
            inputs = " ".join(f"{port}={value:x}" for port, value in zip(INPUTS, seen[n][1]))
            wrong.append(f"{path}: got {got[n]:x}, model's {name} {want[name][n]:x} for {inputs}")
    assert not wrong, f"{len({w.split(':')[0] for w in wrong})} registers differ:\n" + "\n".join(wrong)
    # Both answers occur often on every leader.
    for leader in range(4):
        share = (want["pass"] >> np.uint64(leader) & np.uint64(1)).mean()
        assert 0.05 < share < 0.95, f"leader {leader} passes in {share:.0%} of the operations"
