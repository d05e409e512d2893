"""cocotb tests of a channel; settings: Form, FifoDepth, MiniTile, VrusPerChannel, lengths of the lists, idle and stall patterns."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge
from flicker_tb import splats
from flicker_tb.bench import Bench, config
from flicker_tb.streams import Monitor, Stream, StreamSink, StreamSource
from minitile_model import CHANNEL_EVENTS, EventCounter, SubtileModel, lists, pixel_of

from flicker import layout
from flicker.params import Form

FORM, MINITILE = Form(config()["Form"]), config()["MiniTile"]
PIXELS = 16 // config()["VrusPerChannel"]  # of a VRU
SUBTILE = (1 << layout.bits("subtile")) - 1
OUT = layout.fields("channel_pixel")


class ChannelTest:
    """Drives a channel; checks every pixel against the golden model, and finished_o and idle_o in every cycle."""

    def __init__(self, dut, idle: str, stall: str) -> None:
        self.dut, self.bench = dut, Bench(dut)
        upstream, downstream = Stream(dut, "in", ("elem",)), Stream(dut, "out")
        self.source = StreamSource(upstream, self.bench.stall(idle))
        self.sink = StreamSink(downstream, self.bench.stall(stall))
        self.events = EventCounter(dut, dut.events_o, CHANNEL_EVENTS)
        self.model = SubtileModel(FORM)
        self.forget()
        Monitor(downstream, self._given)
        Monitor(upstream, self._taken)
        cocotb.start_soon(self._every_cycle())

    def forget(self) -> None:
        """Start: nothing was sent."""
        self.model.clear()
        self.aborted = False  # what was expected is known to be wrong
        self.expected: dict[int, list] = {}
        self.got: dict[int, dict] = {}
        self.want = {"sent": 0, "finished": 0, "splats": 0, "hinted": 0}
        self.events.total.clear()

    @property
    def pixels(self) -> int:
        """Pixels that have come."""
        return sum(map(len, self.got.values()))

    def _taken(self, word: int) -> None:
        if word & splats.FEATURE_EOS:
            self.expected[word & SUBTILE] = self.model.pixels(MINITILE)
            self.model.clear()
            return
        self.want["splats"] += 1
        self.want["hinted"] += int(self.dut.finished_o.value)
        self.want["sent"] += not self.model.finished(MINITILE)
        self.want["finished"] += self.model.take(MINITILE, splats.unpack(word))

    def _given(self, word: int) -> None:
        subtile, index = word >> OUT["subtile"].at, word >> OUT["index"].at & 15
        pixels = self.got.setdefault(subtile, {})
        assert index not in pixels, f"sub-tile {subtile:#x} pixel {index} came twice"
        pixels[index] = pixel_of(word)

    async def _every_cycle(self) -> None:
        """finished_o only while what is written now would be dropped; idle_o only while all pixels are out."""
        while True:
            await FallingEdge(self.dut.clk_i)
            if self.dut.rst_ni.value != 1 or self.dut.clear_i.value == 1:
                continue
            if int(self.dut.finished_o.value):
                assert self.model.finished(MINITILE), "finished_o is high, but pixels of this sub-tile are unfinished"
            if int(self.dut.idle_o.value) and not self.aborted:
                assert self.pixels == 16 * len(self.expected), "idle_o is high, but pixels are inside"

    def words(self, made: list[list[splats.Splat]]) -> list[int]:
        """Elements of lists, each with its token."""
        found = []
        for n, entries in enumerate(made):
            found += [splats.pack(s.features) for s in entries] + [splats.FEATURE_EOS | splats.subtile(n, 7 * n + 1)]
        return found

    async def finish(self, made: list[list[splats.Splat]], words: int, slow: bool = False) -> None:
        """Wait for all pixels, compare them."""
        total = 16 * len(made)
        await self.bench.until(lambda: self.pixels == total, 5000 + 100 * words * (20 if slow else 1), "last pixel")
        await self.bench.cycles(50)
        assert self.pixels == total and self.source.pending == 0 and self.dut.idle_o.value == 1
        for subtile, pixels in self.expected.items():
            for index in range(16):
                assert self.got[subtile][index] == pixels[index], \
                    f"sub-tile {subtile:#x} pixel {index}: got {self.got[subtile][index]}, model {pixels[index]}"
        count, want = self.events.total, self.want
        assert count["sent"] == want["sent"], "splats sent in program order"
        assert count["finished"] == want["finished"], "pixels finished"
        # Whole splats take a cycle for each pixel of a VRU, dropped ones fewer.
        whole = want["splats"] - count["discarded"]
        assert PIXELS * whole <= count["vru_busy"] <= PIXELS * whole + (PIXELS - 1) * count["discarded"]
        assert want["sent"] <= want["splats"]
        self.dut._log.info(f"{want} {dict(count)}")


async def compare(test: ChannelTest) -> None:
    """The settings' lists through a channel that is empty."""
    settings = config()
    made = lists(test.bench.rng, FORM, settings["lengths"])
    words = test.words(made)
    test.source.send(words)
    await test.finish(made, len(words), "heavy" in settings.values())
    assert test.want["finished"] > 0 and test.events.total["discarded"] > 0
    assert any(p[1:] != (0, 0, 0) for pixels in test.expected.values() for p in pixels), "all pictures are black"


@cocotb.test()
async def pixels_and_counts(dut):
    """Pixels of every sub-tile equal the model's, each once; every splat is accounted for; finished_o never lies."""
    test = ChannelTest(dut, config()["idle"], config()["stall"])
    await test.bench.reset()
    await compare(test)


@cocotb.test()
async def clear_forgets(dut):
    """Clear at any time: in the next cycle the channel is idle, and what follows is as from a fresh one."""
    test = ChannelTest(dut, config()["idle"], config()["stall"])
    rng = test.bench.rng
    await test.bench.reset()
    for _ in range(12):
        made = lists(rng, FORM, [3, 0, rng.randrange(20), 8, 0, 5])
        test.source.send(test.words(made))
        await test.bench.cycles(rng.randrange(1, 400))
        test.aborted = True
        await test.bench.clear(rng.choice((1, 1, 3)))
        await FallingEdge(dut.clk_i)
        test.model.clear()
        test.got.clear()
        assert dut.idle_o.value == 1 and dut.out_valid_o.value == 0 and dut.in_ready_o.value == 1, "something is left after clear_i"
        # The rest of the lists goes through, too: it may begin with half a list.
        await test.bench.until(lambda: test.source.pending == 0, 20_000, "rest of the lists")
        await test.bench.cycles(5)
        await test.bench.clear()
        await FallingEdge(dut.clk_i)
        test.forget()
    await compare(test)


def faint(rng) -> splats.Splat:
    """A splat that leaves every pixel unfinished."""
    return splats.gaussian(rng, FORM, (rng.uniform(0, 7), rng.uniform(0, 7)), (6.0, 3.0), 0.3, 0.05)


@cocotb.test()
async def busy_exact(dut):
    """Without finished pixels every splat takes its cycles, and a token none."""
    test = ChannelTest(dut, "never", "never")
    await test.bench.reset()
    made = [[faint(test.bench.rng) for _ in range(count)] for count in (3, 0, 1, 5, 0, 0, 2)]
    words = test.words(made)
    test.source.send(words)
    await test.finish(made, len(words))
    assert test.events.total["discarded"] == 0 and test.want["finished"] == 0
    assert test.events.total["vru_busy"] == PIXELS * test.want["splats"] > 0


@cocotb.test()
async def finished_hint(dut):
    """finished_o comes soon after the last pixel, holds until the token, and stays low while as many tokens as fit are on their way."""
    test = ChannelTest(dut, "never", "never")
    rng = test.bench.rng
    await test.bench.reset()
    made = []
    for _ in range(4):
        cover = [splats.gaussian(rng, FORM, (3.0, 4.0), (60.0, 60.0), 0.0, 1.0) for _ in range(10)]
        extra = [faint(rng) for _ in range(3)]
        # A finished list, then only tokens: they fill the FIFO while the first is in the VRUs.
        made += [cover + extra, *([[]] * (config()["FifoDepth"] + 3))]
    words = test.words(made)
    start = 0
    for _ in range(4):
        test.source.send(words[start : start + 10])
        await test.bench.until(lambda: int(dut.finished_o.value) == 1, 400, "finished_o")
        await test.bench.cycles(30)
        assert dut.finished_o.value == 1
        end = start + 10 + 3 + 1 + config()["FifoDepth"] + 3
        test.source.send(words[start + 10 : end])
        await test.bench.until(lambda: test.pixels == 16 * sum(w & splats.FEATURE_EOS != 0 for w in words[:end]), 20_000, "pixels")
        start = end
    await test.finish(made, len(words))
    assert test.want["hinted"] >= 12
