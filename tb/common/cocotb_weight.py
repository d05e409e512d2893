"""cocotb test of the Gaussian weight; settings: form, format (by name), Cols, Rows."""

from __future__ import annotations

import random

import cocotb
import numba
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly, RisingEdge
from flicker_tb import splats
from flicker_tb.bench import PERIOD_NS, config, netlist, rounds

from flicker.arithmetic.formats import E4M3, E5M2, FP16
from flicker.arithmetic.fp import rounding
from flicker.golden.weight import conic_axis, conic_pixel, factored_pixel, factored_row, mul
from flicker.params import Form, weight_latency, weight_shape_delay, weight_stages

ITEMS = rounds(1_200, 3_000)


@numba.njit(cache=True)
def conic_terms(dx, dy, s, r):
    """Terms of one pixel in conic form: xx, sx, yy, sy, xy, t, h, E."""
    xx, sx = conic_axis(dx, s[0], r)
    yy, sy = conic_axis(dy, s[2], r)
    xy, t, h, e = conic_pixel(dx, dy, sx, sy, s[1], r)
    return xx, sx, yy, sy, xy, t, h, e


@numba.njit(cache=True)
def factored_terms(dx, dy, s, r):
    """Terms of one pixel in factored form: p, q, v, vv, u, uu, E."""
    p = mul(s[0], dx, r)
    q, v, vv = factored_row(dy, s[1], s[2], r)
    u, uu, e = factored_pixel(p, q, vv, r)
    return p, q, v, vv, u, uu, e


# Name and place of each term: of a column, a row, or a pixel.
TERMS = {
    Form.CONIC: (conic_terms, "xx:c sx:c yy:r sy:r xy:p t:p h:p weight:p"),
    Form.FACTORED: (factored_terms, "p:c q:r v:r vv:r u:p uu:p weight:p"),
}


def delays(form: Form, wide: bool) -> dict[str, int]:
    """Cycles after the differences at which a term is in its register."""
    add, _, mul_ = weight_stages(wide)
    if form == Form.CONIC:
        first = {"xx": mul_, "yy": mul_, "xy": mul_, "sx": 2 * mul_, "sy": 2 * mul_, "t": 2 * mul_, "h": 2 * mul_ + add}
    else:
        first = {"p": mul_, "q": mul_, "v": mul_, "u": mul_ + add, "uu": 2 * mul_ + add, "vv": 2 * mul_ + add}
    return first | {"weight": weight_latency(form, wide)}


def stimulus(rng: random.Random, form: Form, fmt, cols: int, rows: int) -> list[int]:
    """Bit patterns of cols + rows differences and three shape numbers."""
    numbers = cols + rows + 3
    if rng.random() < 0.3:
        return [rng.choice((rng.getrandbits(fmt.width), rng.choice(SPECIAL[fmt.name]))) for _ in range(numbers)]
    kind = rng.choices((splats.tame, splats.thin, splats.special), (4, 4, 1))[0]
    mean_x, mean_y, *shape = np.array(kind(rng, form).features[:5], np.uint16).view(np.float16).astype(float)
    values = [rng.randrange(8) - mean_x for _ in range(cols)] + [rng.randrange(8) - mean_y for _ in range(rows)] + shape
    return fmt.encode(np.array(values)).tolist()


SPECIAL = {
    fmt.name: [sign | bits for bits in (0, 1, (1 << fmt.man_bits) - 1, 1 << fmt.man_bits, fmt.max_bits, fmt.max_bits + 1, fmt.nan_bits)
               for sign in (0, fmt.sign_bit)]
    for fmt in (FP16, E4M3, E5M2)
}


def pack(bits, width: int) -> int:
    """Lanes to one integer, lane 0 lowest."""
    return sum(int(b) << width * k for k, b in enumerate(bits))


@cocotb.test()
async def every_term(dut):
    """Each register holds what the model says, that many enabled cycles after the differences. With NETLIST set only the weights are compared."""
    rng = random.Random(random.getrandbits(64))
    settings = config()
    form, cols, rows = Form(settings["form"]), settings["Cols"], settings["Rows"]
    fmt = {f.name: f for f in (FP16, E4M3, E5M2)}[settings["format"]]
    wide = fmt.width > 8
    function, names = TERMS[form]
    places = [entry.split(":") for entry in names.split()]
    r = rounding(fmt)
    operations = [stimulus(rng, form, fmt, cols, rows) for _ in range(ITEMS)]
    want: dict[str, list[int]] = {name: [] for name, _ in places}
    seen = {"nan": 0, "negative": 0, "finite": 0}
    for bits in operations:
        values = fmt.decode(np.array(bits)).astype(np.float32)
        dx, dy, shape = values[:cols], values[cols : cols + rows], values[cols + rows :]
        table = [[np.array(function(x, y, shape, r)) for x in dx] for y in dy]
        for n, (name, place) in enumerate(places):
            lanes = {"c": [table[0][c][n] for c in range(cols)], "r": [table[k][0][n] for k in range(rows)],
                     "p": [table[k][c][n] for k in range(rows) for c in range(cols)]}[place]
            want[name].append(pack(fmt.encode(np.array(lanes, np.float64)), fmt.width))
        weight = table[0][0][-1]
        seen["nan" if np.isnan(weight) else "negative" if weight < 0 else "finite"] += 1
    paths = {name: "weight_o" if name == "weight" else f"gen_{form.name.lower()}.{name}_q" for name, _ in places}
    probes = {}
    for name, path in paths.items():
        if name == "weight" or not netlist():
            handle = dut
            for part in path.split("."):
                handle = getattr(handle, part)
            probes[name] = handle
    cocotb.start_soon(Clock(dut.clk_i, PERIOD_NS, unit="ns").start())

    shape_at, last = weight_shape_delay(form, wide), weight_latency(form, wide)
    steps: list[int | None] = []  # operation that entered with each enabled cycle
    log: dict[str, list[int]] = {name: [] for name in probes}  # after each enabled cycle
    edge = RisingEdge(dut.clk_i)
    todo = list(range(ITEMS))[::-1]
    dut.en_i.value = 0
    enabled = False
    while todo or any(step is not None for step in steps[-last - 1 :]):
        await edge
        await ReadOnly()
        if enabled:
            for name, probe in probes.items():
                log[name].append(int(probe.value))
        await FallingEdge(dut.clk_i)
        enabled = rng.random() < 0.8
        dut.en_i.value = int(enabled)
        for port in (dut.dx_i, dut.dy_i, dut.shape_i):
            port.value = rng.getrandbits(len(port))
        if not enabled:
            continue
        steps.append(todo.pop() if todo and rng.random() < 0.8 else None)
        if (n := steps[-1]) is not None:
            dut.dx_i.value = pack(operations[n][:cols], fmt.width)
            dut.dy_i.value = pack(operations[n][cols : cols + rows], fmt.width)
        if len(steps) > shape_at and (n := steps[-1 - shape_at]) is not None:
            dut.shape_i.value = pack(operations[n][cols + rows :], fmt.width)
    entered = {n: cycle for cycle, n in enumerate(steps) if n is not None}
    assert len(entered) == ITEMS
    wrong = []
    for name in probes:
        delay = delays(form, wide)[name]
        for n in range(ITEMS):
            # The step that takes an operation in loads the first register.
            got = log[name][entered[n] + delay - 1]
            if got != want[name][n]:
                wrong.append(f"{paths[name]}: got {got:x}, model {want[name][n]:x} for {[hex(b) for b in operations[n]]}")
                break
    assert not wrong, "\n".join(wrong)
    assert seen["finite"] > ITEMS // 2 and seen["nan"] > 20 and (seen["negative"] > 20 or form == Form.FACTORED), seen
