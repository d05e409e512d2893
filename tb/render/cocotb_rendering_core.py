"""cocotb test of a rendering core; settings: Form, lengths of the lists, idle and stall patterns."""

from __future__ import annotations

import cocotb
from flicker_tb import splats
from flicker_tb.bench import Bench, config
from flicker_tb.streams import Monitor, Stream, StreamSink, StreamSource
from minitile_model import CHANNEL_EVENTS, DISPATCH_EVENTS, EventCounter, SubtileModel, lists, pixel_of

from flicker.params import CHANNELS, Form


@cocotb.test()
async def pixels_and_counts(dut):
    """Pixels of every sub-tile equal the model's, each once; every mask bit is delivered or filtered, and accounted for."""
    settings = config()
    form = Form(settings["Form"])
    bench = Bench(dut)
    upstream, downstream = Stream(dut, "in", ("elem", "mask")), Stream(dut, "out")
    source = StreamSource(upstream, bench.stall(settings["idle"]))
    StreamSink(downstream, bench.stall(settings["stall"]))
    dispatch = EventCounter(dut, dut.dispatch_events_o, DISPATCH_EVENTS)
    bits = sum(b for _, b in CHANNEL_EVENTS)
    channels = [EventCounter(dut, dut.channel_events_o, CHANNEL_EVENTS, c * bits) for c in range(CHANNELS)]
    model = SubtileModel(form)
    expected: dict[tuple, tuple] = {}
    got: dict[tuple, tuple] = {}
    want = {"bits": 0, "sent": [0] * CHANNELS, "finished": [0] * CHANNELS}

    def taken(item) -> None:
        word, mask = item
        if word & splats.FEATURE_EOS:
            for m in range(CHANNELS):
                expected.update({(word & 0xFFFFFF, m, i): p for i, p in enumerate(model.pixels(m))})
            model.clear()
            return
        want["bits"] += mask.bit_count()
        for m in range(CHANNELS):
            if mask >> m & 1:
                want["sent"][m] += not model.finished(m)
                want["finished"][m] += model.take(m, splats.unpack(word))

    def given(word: int) -> None:
        key = (word >> 70, word >> 68 & 3, word >> 64 & 15)
        assert key not in got, f"pixel {key} came twice"
        got[key] = pixel_of(word)

    Monitor(downstream, given)
    Monitor(upstream, taken)
    await bench.reset()
    items = []
    made = lists(bench.rng, form, settings["lengths"])
    for n, entries in enumerate(made):
        items += [(splats.pack(s.features), bench.rng.randrange(1, 16)) for s in entries]
        items.append((splats.FEATURE_EOS | splats.subtile(3 * n, n), 15))
    source.send(items)
    await bench.until(lambda: len(got) == 64 * len(made), 10000 + 300 * len(items), "last pixel")
    await bench.cycles(50)
    wrong = [k for k in expected if got.get(k) != expected[k]]
    assert not wrong, f"{len(wrong)} pixels differ, first {wrong[0]}: got {got.get(wrong[0])}, model {expected[wrong[0]]}"
    assert len(got) == len(expected) and source.pending == 0
    assert dispatch.total["delivered"] + dispatch.total["filtered"] == want["bits"] > 0
    for m, channel in enumerate(channels):
        assert channel.total["sent"] == want["sent"][m], f"channel {m}: splats sent in program order"
        assert channel.total["finished"] == want["finished"][m] > 0, f"channel {m}: pixels finished"
    handled = sum(c.total["vru_busy"] for c in channels) / 8 + sum(c.total["discarded"] for c in channels)
    assert handled >= dispatch.total["delivered"], "splats lost between FIFO and VRUs"
    if settings["stall"] != "never" or len(made) > 20:
        assert sum(c.total["fifo_full"] for c in channels) > 0, "no FIFO was ever full"
