"""cocotb test of a volume rendering unit; settings: Form, Pixels, stall pattern of the output."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb import splats
from flicker_tb.bench import Bench, config, netlist
from flicker_tb.streams import Monitor, Stream, StreamSink
from minitile_model import lists, pixel_of

from flicker.arithmetic.formats import FP16
from flicker.golden.vru import PAIR_FIELDS, Pixels
from flicker.params import (
    ALPHA_MAX_BITS,
    ALPHA_MIN_BITS,
    EXP_STAGES,
    FP16_ADD_STAGES,
    FP16_MUL_STAGES,
    TRANSMITTANCE_MIN_BITS,
    Form,
    weight_latency,
)

# Cycles after the operation at which a stage's registers are loaded (rtl/render/flk_vru.sv).
ADD, MUL = FP16_ADD_STAGES, FP16_MUL_STAGES


def registers(form: Form) -> dict[str, tuple[str, int]]:
    """Register that holds a value of the model (PAIR_FIELDS), and the cycles after the operation at which it does."""
    diff = 1 + ADD
    product = diff + MUL
    weight = diff + weight_latency(form, wide=True)
    if form == Form.CONIC:
        scaled = product + MUL
        own = {"a0": ("sx_q", scaled), "a1": ("sy_q", scaled), "a2": ("xy_q", product), "a3": ("t_q", scaled), "a4": ("h_q", scaled + ADD)}
    else:
        u = product + ADD
        own = {"a0": ("p_q", product), "a1": ("q_q", product), "a2": ("v_q", product), "a3": ("u_q", u), "a4": ("uu_q", u + MUL)}
    own = {name: (f"i_weight.gen_{form.name.lower()}.{path}", delay) for name, (path, delay) in own.items()}
    power = weight + EXP_STAGES[form]
    alpha = power + MUL + 1
    return own | {
        "dx": ("dx_q", diff), "dy": ("dy_q", diff), "weight": ("weight_q", weight), "g": ("i_blend.g_q", power),
        "alpha": ("i_blend.alpha_q", alpha), "oma": ("i_blend.oma_q", alpha + ADD), "w": ("i_blend.w_q", alpha + ADD + MUL),
    }


COL, ROW = 1, 1  # place of the unit, in units of its own width and height


def handle(dut, path: str):
    """Handle of a signal below the top."""
    for name in path.split("."):
        dut = getattr(dut, name)
    return dut


@cocotb.test()
async def every_stage(dut):
    """Registers of every stage, state of the pixels and finished pixels equal the model's.

    Splats come with bubbles between and within them; one is broken off now and then before a token, when all its pixels are finished.
    A netlist has no registers by name: only the pixels are compared.
    """
    settings = config()
    form, size = Form(settings["Form"]), settings["Pixels"]
    bench = Bench(dut)
    rng = bench.rng
    downstream = Stream(dut, "out", ("index", "pixel"))
    StreamSink(downstream, bench.stall(settings["stall"]))
    dut.col_i.value, dut.row_i.value = COL, ROW
    dut.clear_i.value = 0
    dut.op_valid_i.value = 0
    dut.op_eos_i.value = 0
    got: list[tuple] = []
    Monitor(downstream, lambda item: got.append((item[0], pixel_of(item[1]))))
    places = {} if netlist() else registers(form)
    probes = {name: handle(dut, path) for name, (path, _) in places.items()}
    log: dict[str, list[int]] = {name: [] for name in probes}
    model = Pixels(np.array([(4 * COL + i % 4, size // 4 * ROW + i // 4) for i in range(size)]), form)
    expected: list[tuple] = []
    traces: list[tuple[int, np.ndarray, bool, bool]] = []  # cycle, values, pixel unfinished, splat not broken off

    await bench.reset()
    edge = RisingEdge(dut.clk_i)
    queue: list[tuple] = []
    for entries in lists(rng, form, settings["lengths"]):
        for s in entries:
            queue += [(s.features, p) for p in range(size)]
        queue.append(None)  # token
    cycle, finished, dead = 0, 0, False
    while queue or len(got) < len(expected):
        await edge
        for name, probe in probes.items():
            log[name].append(int(probe.value))
        finished += int(dut.finish_o.value)
        cycle += 1
        dut.op_valid_i.value = 0
        assert cycle < 200_000, "output does not come"
        if not queue or rng.random() < 0.2:
            continue
        if queue[0] is not None and queue[0][1] == 0:
            dead = model.finished.all()
        if queue[0] is not None and queue[0][1] == size // 2 and dead:
            del queue[: size // 2]  # broken off: all pixels were finished before the splat
            continue
        # What is driven now is sampled at the next edge.
        if queue[0] is None:
            if int(dut.op_valid_i.value) and int(dut.op_eos_i.value):
                continue
            await cocotb.triggers.ReadOnly()
            free = int(dut.eos_ready_o.value)
            await cocotb.triggers.NextTimeStep()
            if not free:
                continue
            queue.pop(0)
            dut.op_valid_i.value = 1
            dut.op_eos_i.value = 1
            expected += [(i, tuple(map(int, p))) for i, p in enumerate(model.bits())]
            model.reset()
            continue
        features, pixel = queue.pop(0)
        dut.op_valid_i.value = 1
        dut.op_eos_i.value = 0
        dut.op_pixel_i.value = pixel
        dut.op_feature_i.value = splats.pack(features)
        live = not model.finished[pixel]
        model.take(features, pixel)
        traces.append((cycle, model.trace[pixel].copy(), live, not dead))
    await bench.cycles(50)
    assert got == expected, next(f"pixel {n}: got {g}, model {e}" for n, (g, e) in enumerate(zip(got, expected)) if g != e)
    wrong = []
    for name, (path, delay) in places.items():
        field = PAIR_FIELDS.index(name)
        want = FP16.encode(np.array([t[1][field] for t in traces], np.float64))
        have = np.array([log[name][c + delay] for c, *_ in traces], np.uint16)
        # A splat that was broken off has had its numbers taken away; of finished pixels only the weights count; w is used where
        # the pair is blended.
        whole, live = np.array([t[3] for t in traces]), np.array([t[2] for t in traces])
        alpha = FP16.encode(np.array([t[1][PAIR_FIELDS.index("alpha")] for t in traces], np.float64))
        used = {"alpha": live, "oma": live, "w": live & (alpha >= ALPHA_MIN_BITS)}.get(name, whole)
        bad = np.flatnonzero(used & (want != have))
        wrong += [f"{path} ({name}): got {have[n]:04x}, model {want[n]:04x} in operation {n}; {len(bad)} differ" for n in bad[:1]]
    assert not wrong, "\n".join(wrong)
    assert finished > 0 and len(traces) > 1000


class Driver:
    """Drives a unit cycle by cycle and collects its pixels; ``got``: (index, (T, red, green, blue))."""

    def __init__(self, dut, rng) -> None:
        self.dut, self.rng, self.edge = dut, rng, RisingEdge(dut.clk_i)
        self.got: list[tuple] = []
        self.ready_for_token = False
        for name in ("clear_i", "op_valid_i", "op_eos_i", "out_ready_i"):
            getattr(dut, name).value = 0
        dut.col_i.value, dut.row_i.value = COL, ROW

    async def cycle(self, features=None, pixel: int = 0, eos: bool = False, clear: bool = False) -> None:
        """One cycle with an operation, a token, or nothing."""
        dut = self.dut
        dut.clear_i.value = int(clear)
        dut.op_valid_i.value = int(eos or features is not None)
        dut.op_eos_i.value = int(eos)
        dut.op_pixel_i.value = pixel
        if features is not None:
            dut.op_feature_i.value = splats.pack(features)
        dut.out_ready_i.value = int(self.rng.random() < 0.7)
        await self.edge
        if int(dut.out_valid_o.value) and int(dut.out_ready_i.value):
            self.got.append((int(dut.out_index_o.value), pixel_of(int(dut.out_pixel_o.value))))
        # Once free the buffer stays so until a token comes.
        self.ready_for_token = bool(int(dut.eos_ready_o.value)) and not eos

    async def token(self) -> None:
        """A token, as soon as it may come."""
        while not self.ready_for_token:
            await self.cycle()
        await self.cycle(eos=True)

    async def drain(self, count: int) -> None:
        """Until ``count`` pixels have come, and then long enough for more to show."""
        for _ in range(400):
            if len(self.got) >= count:
                break
            await self.cycle()
        for _ in range(60):
            await self.cycle()


def model_of(settings) -> Pixels:
    """The model's pixels of the unit under test."""
    size = settings["Pixels"]
    return Pixels(np.array([(4 * COL + i % 4, size // 4 * ROW + i // 4) for i in range(size)]), Form(settings["Form"]))


def last_opacities() -> tuple[int, int, int]:
    """Three opacities that take T from 1 exactly to TRANSMITTANCE_MIN, all weights being 0."""
    target = np.uint16(TRANSMITTANCE_MIN_BITS).view(np.float16)
    one, first = np.float16(1), np.float16(0.9)
    last = np.arange(FP16.encode(0.5), ALPHA_MAX_BITS, dtype=np.uint16).view(np.float16)
    for second in np.arange(FP16.encode(0.9), FP16.encode(0.95), dtype=np.uint16).view(np.float16):
        t = (one - first) * (one - second)
        if (hits := np.flatnonzero(t * (one - last) == target)).size:
            return tuple(int(x.view(np.uint16)) for x in (first, second, last[hits[0]]))
    raise AssertionError("no such opacities")


@cocotb.test()
async def bounds(dut):
    """A product of exactly ALPHA_MIN contributes, one just below does not; a T' of exactly TRANSMITTANCE_MIN is blended, the next splat finishes."""
    settings = config()
    bench = Bench(dut)
    driver = Driver(dut, bench.rng)
    await bench.reset()
    model = model_of(settings)
    hit_alpha = hit_t = 0
    expected: list[tuple] = []
    lists_of_opacities = [[ALPHA_MIN_BITS], [ALPHA_MIN_BITS - 1], [*last_opacities()], [*last_opacities(), ALPHA_MIN_BITS + 64]]
    for opacities in lists_of_opacities:
        for opacity in opacities:
            # Shape 0: the weight is 0 and g is 1 wherever the mean lies.
            features = (0x3C00, 0x4000, 0, 0, 0, opacity, 0x3800, 0x3A00, 0x3C00)
            for pixel in range(settings["Pixels"]):
                await driver.cycle(features, pixel)
                model.take(features, pixel)
                trace = dict(zip(PAIR_FIELDS, FP16.encode(model.trace[pixel].astype(np.float64))))
                hit_alpha += trace["alpha"] == ALPHA_MIN_BITS
                hit_t += trace["t_next"] == TRANSMITTANCE_MIN_BITS and trace["alpha"] == opacity
        await driver.token()
        expected += [(i, tuple(map(int, p))) for i, p in enumerate(model.bits())]
        model.reset()
    await driver.drain(len(expected))
    assert driver.got == expected, next(f"pixel {n}: got {g}, model {e}" for n, (g, e) in enumerate(zip(driver.got, expected)) if g != e)
    assert hit_alpha == settings["Pixels"] and hit_t == 2 * settings["Pixels"], (hit_alpha, hit_t)


@cocotb.test()
async def aborts(dut):
    """clear_i at any time: nothing of what was inside comes out, and the sub-tile that begins in the next cycle is right."""
    settings = config()
    form, size = Form(settings["Form"]), settings["Pixels"]
    bench = Bench(dut)
    rng = bench.rng
    driver = Driver(dut, rng)
    await bench.reset()
    model = model_of(settings)
    cut = {"pixels out": 0, "token inside": 0, "operations inside": 0}
    for _ in range(40):
        # Up to two sub-tiles and a part of one, then some cycles for the pipeline to empty, or not.
        tokens = rng.randrange(3)
        for _ in range(tokens):
            for s in lists(rng, form, [rng.randrange(6)])[0]:
                for pixel in range(size):
                    await driver.cycle(s.features, pixel)
            await driver.token()
        cover = splats.opaque(rng, form).features
        for pixel in range(rng.randrange(3 * size)):
            await driver.cycle(cover, pixel % size)
        for _ in range(rng.choice((0, 0, rng.randrange(40)))):
            await driver.cycle()
        if tokens and rng.random() < 0.3:  # until the pixels begin to leave
            for _ in range(60):
                if int(dut.out_valid_o.value):
                    break
                await driver.cycle()
        cut["pixels out"] += int(dut.out_valid_o.value)
        cut["token inside"] += not int(dut.eos_ready_o.value)
        cut["operations inside"] += int(dut.blend_valid_o.value)
        await driver.cycle(cover, 0, clear=True)
        driver.got.clear()
        driver.ready_for_token = True
        for s in lists(rng, form, [rng.randrange(5)])[0]:
            for pixel in range(size):
                await driver.cycle(s.features, pixel)
                model.take(s.features, pixel)
        assert driver.ready_for_token, "the output buffer is not free after clear_i"
        await driver.token()
        await driver.drain(size)
        expected = [(i, tuple(map(int, p))) for i, p in enumerate(model.bits())]
        assert driver.got == expected, f"got {driver.got}, model {expected}"
        driver.got.clear()
        model.reset()
    assert min(cut.values()) > 0, cut
