"""cocotb tests of the rendering stage; settings: FifoDepth, MaskGenerator."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge
from flicker_tb import splats
from flicker_tb.bench import Bench, config
from flicker_tb.models import CtuModel
from minitile_model import SubtileModel, lists, pixel_of

from flicker import layout
from flicker.params import (
    CHANNEL_COUNTERS,
    CHANNELS,
    CORE_COUNTERS,
    CORES,
    COUNTER_INDEX_BITS,
    COUNTER_LATENCY,
    SUBTILE_PIXELS,
    CatMode,
    RenderConfig,
)

FORM, PRECISION = RenderConfig().form, RenderConfig().precision
ELEM, PIXEL = layout.bits("splat_elem"), layout.bits("core_pixel")
OUT = layout.fields("core_pixel")
COUNTERS = [name for name, _ in CORE_COUNTERS] + [f"{c}.{name}" for c in range(CHANNELS) for name, _ in CHANNEL_COUNTERS]
MODE = CatMode.OFF if config()["MaskGenerator"] else CatMode.SMOOTH


class StageTest:
    """Drives the four input streams from queues, takes pixels, compares them with the golden models; checks idle_o and finished_o in every cycle."""

    def __init__(self, dut) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.queues: list[list[int]] = [[] for _ in range(CORES)]
        self.gap = 0  # cycles between two elements of a core
        self.expected: dict[tuple, tuple] = {}
        self.got: dict[tuple, tuple] = {}
        self.taken = [0] * CORES
        self.begun = [False] * CORES  # a list whose token has not come
        self.masked = [0] * CORES  # mini-tiles of all masks
        self.ctu = [CtuModel(FORM, PRECISION, MODE) for _ in range(CORES)]
        self.pixels = [SubtileModel(FORM) for _ in range(CORES)]
        self.output = True
        self.finished: list[set[int]] = [set() for _ in range(CORES)]  # lists that a core said to be finished
        self.lists = [0] * CORES  # whose token was taken
        dut.mode_i.value = int(MODE)
        for port in (dut.in_valid_i, dut.in_elem_i, dut.out_ready_i, dut.clear_counters_i, dut.hold_counters_i, dut.counter_addr_i):
            port.value = 0
        cocotb.start_soon(self._run())

    def _take(self, k: int, word: int) -> None:
        self.taken[k] += 1
        self.begun[k] = not word & splats.SPLAT_EOS
        self.lists[k] += not self.begun[k]
        for element, mask in self.ctu[k].take(word):
            if element & splats.FEATURE_EOS:
                place = element & (1 << layout.bits("subtile")) - 1
                for m in range(CHANNELS):
                    self.expected.update({(k, place, m, i): p for i, p in enumerate(self.pixels[k].pixels(m))})
                self.pixels[k].clear()
                continue
            self.masked[k] += mask.bit_count()
            for m in range(CHANNELS):
                if mask >> m & 1:
                    self.pixels[k].take(m, splats.unpack(element))

    async def _run(self) -> None:
        dut, rng = self.dut, self.bench.rng
        offered, wait = [False] * CORES, [0] * CORES
        while True:
            ready = self.output * rng.getrandbits(CORES)
            dut.in_valid_i.value = sum(v << k for k, v in enumerate(offered))
            dut.in_elem_i.value = sum(queue[0] << ELEM * k for k, queue in enumerate(self.queues) if offered[k])
            dut.out_ready_i.value = ready
            await FallingEdge(dut.clk_i)
            if dut.rst_ni.value == 1:
                if dut.idle_o.value == 1:
                    assert not any(self.begun), "idle_o is high, but a list has begun"
                    assert len(self.got) == len(self.expected), "idle_o is high, but pixels are inside"
                finished = int(dut.finished_o.value)
                for k in range(CORES):
                    if finished >> k & 1:
                        assert all(self.pixels[k].finished(m) for m in range(CHANNELS)), f"finished_o of core {k}, but not of the list at its input"
                        self.finished[k].add(self.lists[k])
                taken, given = int(dut.in_ready_o.value), int(dut.out_valid_o.value) & ready
                data = int(dut.out_data_o.value)
                for k in range(CORES):
                    if offered[k] and taken >> k & 1:
                        self._take(k, self.queues[k].pop(0))
                        offered[k], wait[k] = False, self.gap
                    if given >> k & 1:
                        word = data >> PIXEL * k & (1 << PIXEL) - 1
                        key = (k, word >> OUT["subtile"].at, word >> OUT["minitile"].at & 3, word >> OUT["index"].at & 15)
                        assert key not in self.got, f"pixel {key} came twice"
                        self.got[key] = pixel_of(word)
            await RisingEdge(dut.clk_i)
            if dut.rst_ni.value == 1:
                for k in range(CORES):
                    wait[k] = max(wait[k] - 1, 0)
                    offered[k] = offered[k] or (bool(self.queues[k]) and not wait[k])

    async def counters(self, core: int) -> dict[str, int]:
        """All counters of a core, through the port."""
        dut, found = self.dut, {}
        dut.hold_counters_i.value = 1
        await self.bench.cycles(2)
        for i, name in enumerate(COUNTERS):
            dut.counter_addr_i.value = core << COUNTER_INDEX_BITS | i
            await self.bench.cycles(COUNTER_LATENCY)
            await FallingEdge(dut.clk_i)
            found[name] = int(dut.counter_data_o.value)
        dut.hold_counters_i.value = 0
        return found


def token(n: int) -> int:
    """End of a sub-tile."""
    return splats.SPLAT_EOS | splats.subtile(n, 5 * n)


@cocotb.test()
async def pixels_and_counters(dut):
    """Random lists on all cores: pixels, counters of each core; clear_counters sets them to zero; idle before and after."""
    test = StageTest(dut)
    await test.bench.reset()
    assert dut.idle_o.value == 1
    subtiles = 3
    for k in range(CORES):
        for n, entries in enumerate(lists(test.bench.rng, FORM, [k, 9, 14 + k])):
            test.queues[k] += [splats.splat_elem(s) for s in entries] + [token(n + k)]
    count = [sum(not word & splats.SPLAT_EOS for word in queue) for queue in test.queues]
    total = CORES * subtiles * SUBTILE_PIXELS
    await test.bench.until(lambda: len(test.got) == total, 20_000, "last pixel")
    await test.bench.cycles(20)
    assert dut.idle_o.value == 1
    wrong = [key for key in test.expected if test.got.get(key) != test.expected[key]]
    assert not wrong and len(test.expected) == total, f"{len(wrong)} pixels differ, first {wrong[:1]}"
    for k in range(CORES):
        found = await test.counters(k)
        assert (found["subtiles"], found["gaussians_in"]) == (subtiles, count[k])
        assert found["minitiles_tested"] == test.masked[k] == found["minitiles_delivered"] + found["minitiles_filtered"] > 0
        assert found["cycles"] > found["ctu_busy"] > 0 and found["0.vru_busy"] > 0
    dut.clear_counters_i.value = 1
    await test.bench.cycles(1)
    dut.clear_counters_i.value = 0
    for k in range(CORES):
        found = await test.counters(k)
        assert found["cycles"] < 400 and sum(found.values()) == found["cycles"] + found["ctu_idle"], f"core {k} after the clear: {found}"


@cocotb.test()
async def finished(dut):
    """Lists that begin with opaque splats: each core says so before their token, also behind lists of tokens alone and at full rate."""
    test = StageTest(dut)
    test.gap = 20
    await test.bench.reset()
    kinds = [splats.opaque, splats.mixed, None, None, splats.opaque, None, splats.opaque]
    for k in range(CORES):
        for n, kind in enumerate(kinds):
            test.queues[k] += [splats.splat_elem(kind(test.bench.rng, FORM)) for _ in range(30 if kind else 0)] + [token(n)]
    total = CORES * len(kinds) * SUBTILE_PIXELS
    await test.bench.until(lambda: len(test.got) == total, 60_000, "last pixel")
    opaque = {n for n, kind in enumerate(kinds) if kind is splats.opaque}
    assert all(seen >= opaque and not seen & {2, 3, 5} for seen in test.finished), test.finished
    test.gap = 0
    for k in range(CORES):
        for n in range(6):
            test.queues[k] += [splats.splat_elem(splats.opaque(test.bench.rng, FORM)) for _ in range(60)] + [token(len(kinds) + n)]
    total += CORES * 6 * SUBTILE_PIXELS
    await test.bench.until(lambda: len(test.got) == total, 60_000, "last pixel")
    assert all(seen >= set(range(len(kinds), len(kinds) + 6)) for seen in test.finished), test.finished


@cocotb.test()
async def stalls(dut):
    """With blocked pixels and a slow stream of tokens just as many are taken as fit in VRUs and feature FIFOs: then stall_i keeps the rest out."""
    test = StageTest(dut)
    test.output, test.gap = False, 40
    await test.bench.reset()
    for queue in test.queues:
        queue += [token(n) for n in range(config()["FifoDepth"] + 8)]
    await test.bench.cycles(45 * (config()["FifoDepth"] + 8))
    assert test.taken == [config()["FifoDepth"] + 1] * CORES, test.taken
    test.output = True
    await test.bench.until(lambda: len(test.got) == CORES * SUBTILE_PIXELS * (config()["FifoDepth"] + 8), 50_000, "last pixel")
