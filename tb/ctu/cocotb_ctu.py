"""cocotb tests of the contribution test unit; settings: the module's parameters."""

from __future__ import annotations

from collections import Counter

import cocotb
from cocotb.triggers import ReadWrite, RisingEdge
from flicker_tb import splats
from flicker_tb.bench import StreamTest, config, netlist, rounds
from flicker_tb.models import CtuModel
from flicker_tb.streams import Stream

from flicker import layout
from flicker.params import AUTO_SENT_BITS, AUTO_TEST_BITS, PIXELS_PER_VRU, CatMode, Form, Precision, prtu_latency

FORM, PRECISION = Form(config()["Form"]), Precision(config()["Precision"])
# From acceptance to the output.
LATENCY = prtu_latency(FORM, PRECISION) + (config()["CtuFifoDepth"] > 0)
EVENTS = layout.fields("generator_events")
ELEM_BITS = layout.bits("feature_elem")  # the mask lies above
# Patterns of idle input, blocked output, blocked acceptance.
FREE = ("never", "never", "never")
PATTERNS = {
    "free": FREE,
    "mixed": ("half", "bursts", "rare"),
    "blocked": ("never", "heavy", "half"),
    "bursts": ("bursts", "alternate", "bursts"),
}


class CtuTest(StreamTest):
    """Bench with the golden model, counters, and a generator on stall_i."""

    def __init__(self, dut, mode: CatMode, patterns: tuple[str, str, str] = FREE) -> None:
        self.model = self.fresh(mode)
        source, sink = Stream(dut, "in", ("elem",)), Stream(dut, "out")
        super().__init__(dut, self._model, source=source, sink=sink, idle=patterns[0], stall=patterns[1])
        dut.mode_i.value = int(mode)
        dut.stall_i.value = 0
        self.counts: Counter[str] = Counter()
        self.closed = False  # nothing is to be taken
        cocotb.start_soon(self._block(self.bench.stall(patterns[2])))

    def _model(self, element: int):
        if not netlist():
            fallen = int(self.bench.dut.i_controller.fallen_o.value)
            assert fallen == self.model.fallen, f"sub-tile {len(self.model.decisions)}: fallen is {fallen}"
        assert not int(self.bench.dut.idle_o.value) or not self.checker.outstanding, "idle_o is high, but something is inside"
        return [mask << ELEM_BITS | word for word, mask in self.model.take(element)]

    @staticmethod
    def fresh(mode: CatMode) -> CtuModel:
        """The model at its start."""
        return CtuModel(FORM, PRECISION, mode, config().get("VruCycles", PIXELS_PER_VRU))

    async def _block(self, pattern) -> None:
        """Drive stall_i, count the events."""
        dut = self.bench.dut
        edge = RisingEdge(dut.clk_i)
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            assert not (dut.stall_i.value == 1 and dut.in_ready_o.value == 1), "element taken while stalled"
            events = int(dut.events_o.value)
            for name, place in EVENTS.items():
                self.counts[name] += events >> place.at & (1 << place.bits) - 1
            self.counts["cycles"] += 1
            dut.stall_i.value = int(next(pattern) or self.closed)

    async def check(self, items: list[int]) -> int:
        """Run and compare everything; returns the cycles."""
        taken = await self.run(items, limit=2000 + 400 * len(items))
        want, got = self.model.counts, self.counts
        for event, name in (("splat", "splats"), ("token", "tokens"), ("rejected", "rejected"), ("tested", "tested")):
            assert got[event] == want[name], f"counted {got[event]} {name}, the model {want[name]}"
        assert self.bench.dut.idle_o.value == 1, "idle_o is low after the last element"
        assert got["busy"] == want["batches"] + want["tokens"]
        assert got["busy"] + got["stalled"] + got["idle"] == got["cycles"]
        assert self.input.count == self.output.count + got["rejected"]
        return taken


def items_of(subtiles: list[list[splats.Splat]]) -> list[int]:
    """Elements of the lists of some sub-tiles, each with its token."""
    items = []
    for number, subtile in enumerate(subtiles):
        items += [splats.splat_elem(splat) for splat in subtile]
        items.append(splats.SPLAT_EOS | splats.subtile(number % 7, number // 7))
    return items


def random_lists(rng, count: int) -> list[list[splats.Splat]]:
    """Sub-tiles of 0 to 40 random splats."""
    return [
        [splats.mixed(rng, FORM) for _ in range(rng.choice((0, 0, 1, 1, 2, 5, 12, 40)))] for _ in range(count)
    ]


def distant(rng) -> splats.Splat:
    """A smooth splat that reaches no pixel."""
    return splats.gaussian(rng, FORM, (60.0, rng.uniform(-20, 20)), (1.0, 1.0), 0.0, 0.9)


def covering(rng) -> splats.Splat:
    """A smooth splat that reaches every pixel."""
    return splats.gaussian(rng, FORM, (3.0, 4.0), (20.0, 20.0), 0.0, 0.9)


@cocotb.test()
@cocotb.parametrize(mode=[mode.name for mode in CatMode], patterns=list(PATTERNS))
async def lists(dut, mode, patterns):
    """Elements and masks in order, whatever the stalls; nothing lost, nothing twice; counters add up."""
    test = CtuTest(dut, CatMode[mode], PATTERNS[patterns])
    await test.check(items_of(random_lists(test.bench.rng, rounds(5, 12))))


@cocotb.test()
@cocotb.parametrize(mode=["SPARSE", "DENSE"])
async def rate(dut, mode):
    """Unstalled: the promised latency, one splat per cycle sparse, one per two cycles dense."""
    test = CtuTest(dut, CatMode[mode])
    period = 2 if mode == "DENSE" else 1
    await test.check([splats.splat_elem(covering(test.bench.rng)) for _ in range(100)])
    assert test.output.count == 100, "a covering splat was rejected"
    # A splat is accepted with its last batch.
    assert test.output.first - test.input.first == LATENCY
    for monitor in (test.input, test.output):
        assert monitor.last - monitor.first == 99 * period, f"{monitor.stream.name}: {monitor.last - monitor.first}"


@cocotb.test()
async def rejected_drain(dut):
    """Rejected splats leave the pipeline at full rate while the output is blocked."""
    test = CtuTest(dut, CatMode.SPARSE)
    test.sink.stall = iter(lambda: True, None)
    await test.bench.reset()
    test.source.send([splats.splat_elem(distant(test.bench.rng)) for _ in range(100)])
    await test.bench.until(lambda: not test.source.pending, 200, "last splat taken")
    await test.bench.cycles(LATENCY + 3)
    assert test.input.last - test.input.first == 99
    assert test.counts["rejected"] == test.model.counts["rejected"] == 100


@cocotb.test()
@cocotb.parametrize(patterns=list(PATTERNS))
async def automatic(dut, patterns):
    """Falls while the test is the bottleneck and returns when it is not, at the same sub-tiles under every stall pattern.

    The decision is compared with the model's at every element, and shows in masks and batches.
    """
    test = CtuTest(dut, CatMode.AUTO, PATTERNS[patterns])
    rng = test.bench.rng
    subtiles = []
    slower = max(test.model.vru_cycles // PIXELS_PER_VRU, 1)  # slower VRUs take more that the test rejects to be the faster ones
    for _ in range(3):
        # Seven short lists that the test rejects, seven that it passes; a fallen sub-tile shows by its sparse masks.
        subtiles += [[distant(rng) for _ in range(slower * rng.randrange(3, 9))] + [splats.tame(rng, FORM)] for _ in range(7)]
        subtiles += [[covering(rng) for _ in range(rng.randrange(0, 6))] + [splats.tame(rng, FORM)] for _ in range(7)]
    await test.check(items_of([*subtiles, *random_lists(rng, 6)]))
    changes = [a != b for a, b in zip(test.model.decisions, test.model.decisions[1:])]
    assert sum(changes) >= 4, f"only {sum(changes)} changes of the decision"


@cocotb.test()
async def long_list(dut):
    """A sub-tile of 5,000 splats between two empty ones."""
    test = CtuTest(dut, CatMode.SMOOTH, ("rare", "rare", "rare"))
    rng = test.bench.rng
    await test.check(items_of([[], [splats.mixed(rng, FORM) for _ in range(5000)], []]))


@cocotb.test()
async def saturation(dut):
    """The counts of a sub-tile stop at their largest value; the sums take that without overflow. It sets registers."""
    test = CtuTest(dut, CatMode.AUTO)
    rng, model, controller = test.bench.rng, test.model, dut.i_controller
    for _ in range(8):  # the sums come close to their limit
        model.test_cycles, model.sent = (1 << AUTO_TEST_BITS) - 6, [(1 << AUTO_SENT_BITS) - 4] * 4
        if not test.input.count:
            await test.bench.reset()
        await ReadWrite()
        controller.test_q.value = model.test_cycles
        controller.sent_q.value = sum(sent << AUTO_SENT_BITS * m for m, sent in enumerate(model.sent))
        test.source.send(items_of([[covering(rng) for _ in range(12)]]))
        await test.bench.until(lambda: not test.source.pending and not test.checker.outstanding, 1000, "last answer")
        await test.bench.cycles(2)
        assert int(controller.test_avg_q.value) == model.test_avg
        assert int(controller.sent_avg_q.value) == model.sent_avg
    assert model.test_avg > 3 << AUTO_TEST_BITS - 1
    test.checker.finish(8)


@cocotb.test()
@cocotb.parametrize(how=["reset", "clear"])
async def forgets(dut, how):
    """Reset or clear in mid-traffic empties the unit; what follows comes out as from a fresh unit, the automatic decisions too."""
    test = CtuTest(dut, CatMode.AUTO, ("never", "half", "never"))
    items = items_of(random_lists(test.bench.rng, 12))
    await test.bench.reset()
    test.source.send(items)
    await test.bench.until(lambda: test.input.count > len(items) // 2, 40 * len(items), "traffic")
    if how == "reset":
        dut.rst_ni.value = 0
    else:
        test.closed = True  # the stage takes nothing while it is cleared
        await test.bench.cycles(2)
        dut.clear_i.value = 1
    await RisingEdge(dut.clk_i)
    rest = test.source.pending
    test.checker.drop()
    test.model = test.fresh(CatMode.AUTO)
    if how == "reset":
        await test.bench.reset()
    else:
        dut.clear_i.value = 0
        test.closed = False
        await ReadWrite()
        assert dut.idle_o.value == 1 and dut.out_valid_o.value == 0, "something is left after clear_i"
    done = lambda: not test.source.pending and not test.checker.outstanding  # noqa: E731
    await test.bench.until(done, 1000 + 40 * len(items), "last answer")
    await test.bench.cycles(50)
    assert test.model.counts["splats"] + test.model.counts["tokens"] == rest
    test.checker.finish(1)
