"""cocotb test of a channel; settings: Form, MiniTile, VrusPerChannel, lengths of the lists, idle and stall patterns."""

from __future__ import annotations

import cocotb
from flicker_tb import splats
from flicker_tb.bench import Bench, config
from flicker_tb.streams import Monitor, Stream, StreamSink, StreamSource
from minitile_model import CHANNEL_EVENTS, EventCounter, SubtileModel, lists, pixel_of

from flicker.params import Form


@cocotb.test()
async def pixels_and_counts(dut):
    """Pixels of every sub-tile equal the model's, each once; every splat is accounted for; finished_o never lies."""
    settings = config()
    form, m = Form(settings["Form"]), settings["MiniTile"]
    bench = Bench(dut)
    upstream, downstream = Stream(dut, "in", ("elem",)), Stream(dut, "out")
    source = StreamSource(upstream, bench.stall(settings["idle"]))
    StreamSink(downstream, bench.stall(settings["stall"]))
    events = EventCounter(dut, dut.events_o, CHANNEL_EVENTS)
    model = SubtileModel(form)
    expected: dict[int, list] = {}
    got: dict[int, dict] = {}
    want = {"sent": 0, "finished": 0, "splats": 0, "hinted": 0}

    def taken(word: int) -> None:
        if word & splats.FEATURE_EOS:
            expected[word & 0xFFFFFF] = model.pixels(m)
            model.clear()
            return
        want["splats"] += 1
        if int(dut.finished_o.value):
            assert model.finished(m), "finished_o is high, but pixels of this sub-tile are unfinished"
            want["hinted"] += 1
        want["sent"] += not model.finished(m)
        want["finished"] += model.take(m, splats.unpack(word))

    def given(word: int) -> None:
        subtile, index = word >> 68, word >> 64 & 15
        pixels = got.setdefault(subtile, {})
        assert index not in pixels, f"sub-tile {subtile:#x} pixel {index} came twice"
        pixels[index] = pixel_of(word)

    Monitor(downstream, given)
    Monitor(upstream, taken)
    await bench.reset()
    words = []
    made = lists(bench.rng, form, settings["lengths"])
    for n, entries in enumerate(made):
        words += [splats.pack(s.features) for s in entries] + [splats.FEATURE_EOS | splats.subtile(n, 7 * n + 1)]
    source.send(words)
    total = 16 * len(made)
    await bench.until(lambda: sum(map(len, got.values())) == total, 5000 + 100 * len(words) * (20 if "heavy" in settings.values() else 1), "last pixel")
    await bench.cycles(50)
    assert sum(map(len, got.values())) == total and source.pending == 0
    for subtile, pixels in expected.items():
        for index in range(16):
            assert got[subtile][index] == pixels[index], \
                f"sub-tile {subtile:#x} pixel {index}: got {got[subtile][index]}, model {pixels[index]}"
    count = events.total
    assert count["sent"] == want["sent"], "splats sent in program order"
    assert count["finished"] == want["finished"] > 0, "pixels finished"
    # Whole splats take a cycle for each pixel of a VRU, dropped ones fewer.
    whole, pixels = want["splats"] - count["discarded"], 16 // settings["VrusPerChannel"]
    assert pixels * whole <= count["vru_busy"] <= pixels * whole + (pixels - 1) * count["discarded"]
    assert want["sent"] <= whole + count["discarded"] and count["discarded"] > 0
    assert any(p[1:] != (0, 0, 0) for pixels in expected.values() for p in pixels), "all pictures are black"
    dut._log.info(f"{want} {dict(count)}")
