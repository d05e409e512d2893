"""cocotb tests of a rendering core; settings: Form, MaskBits, VrusPerChannel, lengths of the lists, idle and stall patterns."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge
from flicker_tb import splats
from flicker_tb.bench import Bench, config
from flicker_tb.streams import Monitor, Stream, StreamSink, StreamSource
from minitile_model import CHANNEL_EVENTS, DISPATCH_EVENTS, EventCounter, SubtileModel, lists, pixel_of

from flicker import layout
from flicker.params import CHANNELS, SUBTILE_PIXELS, VRUS_PER_CHANNEL, Form

FORM = Form(config()["Form"])
MASK_BITS = config().get("MaskBits", CHANNELS)
CHANNEL_BITS = MASK_BITS // CHANNELS  # mask bits of a channel
PIXELS = SUBTILE_PIXELS // CHANNELS // config().get("VrusPerChannel", VRUS_PER_CHANNEL)  # of a VRU
ELEM_BITS = layout.bits("feature_elem")  # the mask lies above
SUBTILE = (1 << layout.bits("subtile")) - 1
OUT = layout.fields("core_pixel")


class CoreTest:
    """Drives a core; checks pixels and counts against the golden model, idle_o and finished_o in every cycle."""

    def __init__(self, dut) -> None:
        self.dut, self.bench = dut, Bench(dut)
        upstream, downstream = Stream(dut, "in"), Stream(dut, "out")
        self.source = StreamSource(upstream, self.bench.stall(config()["idle"]))
        self.sink = StreamSink(downstream, self.bench.stall(config()["stall"]))
        self.dispatch = EventCounter(dut, dut.dispatch_events_o, DISPATCH_EVENTS)
        bits = layout.bits("channel_events")
        self.channels = [EventCounter(dut, dut.channel_events_o, CHANNEL_EVENTS, c * bits) for c in range(CHANNELS)]
        self.model = SubtileModel(FORM)
        self.forget()
        Monitor(downstream, self._given)
        Monitor(upstream, self._taken)
        cocotb.start_soon(self._every_cycle())

    def forget(self) -> None:
        """Start: nothing was sent."""
        self.model.clear()
        self.aborted = False  # what was expected is known to be wrong
        self.finished_seen = 0
        self.expected: dict[tuple, tuple] = {}
        self.got: dict[tuple, tuple] = {}
        self.want = {"bits": 0, "sent": [0] * CHANNELS, "finished": [0] * CHANNELS}
        for counter in (self.dispatch, *self.channels):
            counter.total.clear()

    def _taken(self, item: int) -> None:
        word, bits = item & (1 << ELEM_BITS) - 1, item >> ELEM_BITS
        if word & splats.FEATURE_EOS:
            for m in range(CHANNELS):
                self.expected.update({(word & SUBTILE, m, i): p for i, p in enumerate(self.model.pixels(m))})
            self.model.clear()
            return
        for m in range(CHANNELS):
            if bits >> CHANNEL_BITS * m & (1 << CHANNEL_BITS) - 1:
                self.want["bits"] += 1
                self.want["sent"][m] += not self.model.finished(m)
                self.want["finished"][m] += self.model.take(m, splats.unpack(word))

    def _given(self, word: int) -> None:
        key = (word >> OUT["subtile"].at, word >> OUT["minitile"].at & 3, word >> OUT["index"].at & 15)
        assert key not in self.got, f"pixel {key} came twice"
        self.got[key] = pixel_of(word)

    async def _every_cycle(self) -> None:
        while True:
            await FallingEdge(self.dut.clk_i)
            if self.dut.rst_ni.value == 1 and self.dut.clear_i.value == 0 and int(self.dut.idle_o.value) and not self.aborted:
                assert len(self.got) == len(self.expected), "idle_o is high, but pixels are inside"
            if self.dut.rst_ni.value == 1 and int(self.dut.finished_o.value) and not self.aborted:
                assert all(self.model.finished(m) for m in range(CHANNELS)), "finished_o is high, but not for the sub-tile at the input"
                self.finished_seen += 1

    def items(self, made: list[list[splats.Splat]]) -> list[int]:
        """Elements of lists with random masks, each list with its token."""
        rng, found = self.bench.rng, []
        for n, entries in enumerate(made):
            for splat in entries:
                mask = 0
                while mask == 0:
                    chosen = rng.getrandbits(MASK_BITS)
                    if CHANNEL_BITS > 1:  # few pixels, of a part of the mini-tiles
                        for m in range(CHANNELS):
                            if rng.random() < 0.4:
                                chosen &= ~(((1 << CHANNEL_BITS) - 1) << CHANNEL_BITS * m)
                        if rng.random() < 0.5:
                            chosen &= 1 << rng.randrange(MASK_BITS)
                    mask = chosen
                found.append(mask << ELEM_BITS | splats.pack(splat.features))
            found.append((1 << MASK_BITS) - 1 << ELEM_BITS | splats.FEATURE_EOS | splats.subtile(3 * n, n))
        return found


async def compare(test: CoreTest) -> None:
    """The settings' lists through a core that is empty."""
    made = lists(test.bench.rng, FORM, config()["lengths"])
    items = test.items(made)
    test.source.send(items)
    await test.bench.until(lambda: len(test.got) == SUBTILE_PIXELS * len(made), 10000 + 300 * len(items), "last pixel")
    await test.bench.cycles(50)
    expected, got, want = test.expected, test.got, test.want
    wrong = [k for k in expected if got.get(k) != expected[k]]
    assert not wrong, f"{len(wrong)} pixels differ, first {wrong[0]}: got {got.get(wrong[0])}, model {expected[wrong[0]]}"
    assert len(got) == len(expected) and test.source.pending == 0 and test.dut.idle_o.value == 1
    count = test.dispatch.total
    assert count["delivered"] + count["filtered"] == want["bits"] > 0
    for m, channel in enumerate(test.channels):
        assert channel.total["sent"] == want["sent"][m], f"channel {m}: splats sent in program order"
        assert channel.total["finished"] == want["finished"][m] > 0, f"channel {m}: pixels finished"
    handled = sum(c.total["vru_busy"] for c in test.channels) / PIXELS + sum(c.total["discarded"] for c in test.channels)
    assert handled >= count["delivered"], "splats lost between FIFO and VRUs"
    assert count["filtered"] > 0, "no splat was left out for a finished mini-tile"
    assert test.finished_seen > 0, "no sub-tile was ever told to be finished"
    assert sum(c.total["fifo_full"] for c in test.channels) > 0, "no FIFO was ever full"


@cocotb.test()
async def pixels_and_counts(dut):
    """Pixels of every sub-tile equal the model's, each once; every mask bit is delivered or filtered, and accounted for."""
    test = CoreTest(dut)
    await test.bench.reset()
    await compare(test)


@cocotb.test()
async def clear_forgets(dut):
    """Clear at any time, also when a sub-tile is finished: in the next cycle the core is idle, and what follows is as from a fresh one."""
    test = CoreTest(dut)
    rng = test.bench.rng
    await test.bench.reset()
    for turn in range(6):
        test.source.send(test.items(lists(rng, FORM, [0, 0, 400] if turn % 2 else [3, 0, rng.randrange(20), 8, 0, 5])))
        if turn % 2:
            await test.bench.until(lambda: int(dut.finished_o.value) == 1, 50_000, "a finished sub-tile")
        else:
            await test.bench.cycles(rng.randrange(1, 500))
        test.aborted = True
        await test.bench.clear(rng.choice((1, 1, 3)))
        await FallingEdge(dut.clk_i)
        test.model.clear()
        test.got.clear()
        assert dut.idle_o.value == 1 and dut.finished_o.value == 0 and dut.out_valid_o.value == 0 and dut.stall_o.value == 0, "something is left after clear_i"
        await test.bench.until(lambda: test.source.pending == 0, 50_000, "rest of the lists")
        await test.bench.clear()
        await FallingEdge(dut.clk_i)
        test.forget()
    await compare(test)
