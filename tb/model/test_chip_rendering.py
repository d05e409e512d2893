"""Chip model of the rendering half: what follows from the golden model holds whatever the timing. The RTL beside it: make docs PART=rendering_hardware."""

from __future__ import annotations

import inspect
import re
from functools import cache

import numpy as np
import pytest

from flicker.chip import preprocessing
from flicker.chip import rendering as model
from flicker.chip.dram import DramConfig
from flicker.chip.rendering import Rendering, estimate
from flicker.chip.run import render_on_chip
from flicker.chip.tile_lists import TileLists, tile_lists
from flicker.errors import FlickerError
from flicker.front.view import DEMO, load_view
from flicker.golden.chip import render_chip
from flicker.golden.delivery import TILES, may_be_given
from flicker.golden.front.frame import FrontFrame, run_front
from flicker.golden.front.memory import FrontImage, front_memory
from flicker.golden.long_lists import RUNS
from flicker.golden.walk import tile_walk
from flicker.params import CHIP_MEMORIES, CatMode, ChipMemories, RenderConfig
from flicker.perf.long_lists import LINES
from flicker.pipeline import Engine, packed_scene
from flicker.scene.packed import PackedFormat
from flicker.sim.chip import PORT
from flicker.toolchain import ROOT

SIZE = (112, 54)  # four pairs of tiles in a row, the last tile of which the picture lacks


@cache
def frame() -> tuple[FrontFrame, FrontImage]:
    view = load_view(DEMO, 0, SIZE)
    front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
    return front, front_memory(front)


def modelled(config: RenderConfig, dram: DramConfig | None = None, **options) -> Rendering:
    return estimate(TileLists.of(*frame(), config.chip_memories.sorted_entries, config.chip_memories.merge_lines), config, dram, **options)


@pytest.mark.parametrize("change", [
    {}, {"cat": CatMode.AUTO}, {"vrus_per_channel": 1}, {"ctu_fifo_depth": 16}, {"mask_generator": "all", "cat": CatMode.OFF},
], ids=str)
def test_records_given(change: dict) -> None:
    """Every core gets what its pixels need; in the automatic mode all."""
    config = RenderConfig().with_(**change)
    found, golden = modelled(config), render_chip(frame()[0].subtile_lists(), config)
    lengths = np.diff(golden.frame.lists.start)
    whole = config.cat == CatMode.AUTO
    assert may_be_given(found.given, lengths, golden.frame.needed, whole).all()
    assert whole or found.given.sum() < 0.9 * lengths.sum()


def test_fewer_units() -> None:
    """Of sorting units the same lists and pictures, in more cycles; of lanes and writers the same beats but for colours between the survivors of a group."""
    by_units = {n: modelled(RenderConfig(stage="lanes", sort_units=n)) for n in (1, 2, 4)}
    for found in by_units.values():  # of runs fewer lines are read where a list is left earlier
        assert all(found.bytes[name] == by_units[4].bytes[name] for name in ("pointers", "frame"))
        assert abs(found.bytes["lists"] / by_units[4].bytes["lists"] - 1) < 0.01
    assert by_units[1].cycles > 1.3 * by_units[2].cycles > 1.3 * by_units[4].cycles, by_units
    front, image = frame()
    whole, few = (preprocessing.estimate(front, image, None, lanes=n, writers=n) for n in (4, 1))
    assert {n: b for n, b in few.bytes.items() if n != "colour"} == {n: b for n, b in whole.bytes.items() if n != "colour"}
    assert 0.5 * whole.bytes["colour"] < few.bytes["colour"] <= whole.bytes["colour"] and few.cycles > 2.5 * whole.cycles
    assert RenderConfig(sort_units=1).chip_parameters()["SortUnits"] == 1 and "SortUnits" not in RenderConfig().chip_parameters()
    assert RenderConfig(list_writers=2, preproc_lanes=1).front_parameters() == {"PreprocLanes": 1, "ListWriters": 2}
    assert RenderConfig(preproc_interval=4).front_parameters() == {"PreprocInterval": 4}
    slow = preprocessing.estimate(front, image, None, lanes=1, writers=1, interval=4)
    assert slow.bytes == few.bytes and few.cycles < slow.cycles < 2.1 * few.cycles


def test_sizes() -> None:
    """What waits where in the model is what the RTL has places for."""
    def default(module: str, name: str) -> int:
        found = re.search(rf"parameter\s+int unsigned {name}\s*=\s*(\d+)", (ROOT / "rtl" / f"{module}.sv").read_text())
        assert found, f"{module}: {name}"
        return int(found[1])

    sizes = ChipMemories()
    for unit in ("sort/flk_record_cache", "sort/flk_delivery"):
        banks, sets, ways = (default(unit, name) for name in ("Banks", "Sets", "Ways"))
        assert (banks * sets * ways, ways) == (sizes.record_lines, model.CACHE_WAYS)
    until = re.search(r"UntilBits\s*= (\d+)", (ROOT / "rtl/sort/flk_record_cache.sv").read_text())
    assert until and TILES == 1 << int(until[1])
    assert RenderConfig().sort_units == default("flk_rendering", "SortUnits") == default("flk_top", "SortUnits") == default("sort/flk_delivery", "Units")
    for top in ("flk_top", "flk_top_axi", "preproc/flk_preprocessing"):
        assert RenderConfig().list_writers == default(top, "ListWriters") == preprocessing.LIST_WRITERS
        assert RenderConfig().preproc_lanes == default(top, "PreprocLanes") == preprocessing.LANES
        assert RenderConfig().preproc_interval == default(top, "PreprocInterval") == preprocessing.INTERVAL
    for top in ("flk_rendering", "flk_top"):
        assert (sizes.sort_stages, sizes.list_chunks) == (default(top, "SortStages"), default(top, "Chunks"))
        assert (sizes.sorted_ahead, sizes.pairs) == (default(top, "Entries"), default(top, "Pairs"))
        assert (sizes.sort_ways, sizes.merge_lines) == (default(top, "SortWays"), default(top, "MergeLines"))
        assert sizes.record_lines == default(top, "RecordLines")
    assert sizes.merge_lines == default("sort/flk_list_sorter", "MergeLines") == 2 * default("sort/flk_list_sorter", "Runs") == 2 * RUNS == LINES
    for top in ("flk_top", "preproc/flk_preprocessing", "preproc/flk_preprocessing_core"):
        assert sizes.survivors == default(top, "Waiting")
    for top in ("flk_top", "preproc/flk_preprocessing"):
        assert sizes.gathered_lines == default(top, "Gather") == preprocessing.GATHER
    assert sizes.sort_stages == default("sort/flk_sorting_unit", "Stages") and sizes.sorted_ahead == default("sort/flk_entry_buffer", "Depth")
    for top in ("flk_top", "flk_top_axi", "flk_rendering", "sort/flk_delivery"):
        assert sizes.queued_records == default(top, "Queue")
    queue, cull = ((ROOT / "rtl" / f"{unit}.sv").read_text() for unit in ("sort/flk_record_queue", "preproc/flk_cluster_cull"))
    assert f"Groups = Half / {model.DROP // 2};" in queue and f"Interval = {preprocessing.CLUSTER_CYCLES};" in cull
    for unit in ("sort/flk_delivery", "sort/flk_record_cache"):
        assert (model.DEPTH, model.PLACES) == (default(unit, "Depth"), default(unit, "Places"))
    given = inspect.signature(estimate).parameters
    assert (given["latency_cycles"].default, given["reads"].default) == (PORT.latency, PORT.max_reads)
    margin = re.search(r"Margin = (\d+);", (ROOT / "rtl/sort/flk_delivery.sv").read_text())
    assert margin and model.MARGIN == int(margin[1])
    beats = re.findall(r"\.BufferBeats\s*\((\d+)\)", (ROOT / "rtl/preproc/flk_preprocessing.sv").read_text())
    assert beats == [str(preprocessing.UNDER_WAY)]


def test_small_memories(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lists of more entries than the sorting unit takes are written back and read once more, whatever their length."""
    tables = TileLists.of(*frame(), 512)
    with pytest.raises(ValueError, match="sizes 512"):
        estimate(tables, RenderConfig(), None)
    lengths = np.diff(tables.start)
    assert tables.capacity == 512 and ((tables.run_lines > 0) == (lengths > 512)).all() and (tables.run_lines > 0).any()
    assert (np.add.reduceat(tables.batch_size, tables.batch_start[:-1]) == lengths).all()
    long_ones = lengths > 512
    lines, runs = tables.run_lines[long_ones], lengths[long_ones] / 512 + 1  # a run ends its line; lines hold 9 to 15 entries
    assert (lines >= lengths[long_ones] / 15).all() and (lines <= lengths[long_ones] / 9 + runs).all()
    monkeypatch.setitem(CHIP_MEMORIES, "half", ChipMemories(1024))
    half, small, default = (modelled(RenderConfig(memories=name)) for name in ("half", "small", "default"))
    assert half.bytes["lists"] > default.bytes["lists"]  # of lists of 1,025 to 2,048 entries
    assert default.bytes["lists"] < small.bytes["lists"] <= half.bytes["lists"]  # fewer lines are read ahead
    large = modelled(RenderConfig(memories="large"))
    assert large.bytes == default.bytes | {"records": large.bytes["records"]} and large.bytes["records"] < default.bytes["records"]


def test_lists_longer_than_is_sorted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The chip's golden model refuses a picture that the chip ends with an error; one entry fewer is drawn."""
    view = load_view(DEMO, 0, SIZE)
    longest = int(np.bincount(frame()[0].entry_tile).max())
    for room, drawn in ((longest, True), (longest - 1, False)):
        monkeypatch.setattr(ChipMemories, "longest_list", room)
        if drawn:
            assert render_on_chip(view, Engine.CHIP_GOLDEN).image.shape == (SIZE[1], SIZE[0], 3)
        else:
            with pytest.raises(FlickerError, match=f"a tile's list has {longest:,} entries, the chip sorts up to {room:,}"):
                render_on_chip(view, Engine.CHIP_GOLDEN)
    monkeypatch.undo()
    assert [CHIP_MEMORIES[name].longest_list for name in ("default", "small")] == [131_072, 32_768]  # docs/guide/programming.md


def test_survivors_wait_for_their_colours() -> None:
    """An access of the memory, which few of them do not cover: those of the chip `small` at an interval of 2; the default chip's do to a hundredth."""
    default, small = RenderConfig(stage="lanes"), RenderConfig(stage="lanes", memories="small", preproc_lanes=2, list_writers=2)
    for config, least, most in ((default, 1.0, 1.01), (small, 1.2, 1.6)):
        alone, behind = (
            preprocessing.estimate(*frame(), dram, config.chip_memories, config.preproc_lanes, config.list_writers).units for dram in (None, DramConfig())
        )
        assert least <= behind / alone <= most


def test_ideal_sorter() -> None:
    """Reads each list once, adds nothing to the time of its bytes, whatever the memories; records as with a sorting unit."""
    config = RenderConfig(memories="small")
    ideal = TileLists.of(*frame(), None)
    free, sorted_ = estimate(ideal, config, None), modelled(config)
    assert free.bytes["lists"] == 64 * ideal.lines.sum() < sorted_.bytes["lists"] and free.cycles < sorted_.cycles
    assert np.array_equal(ideal.record, TileLists.of(*frame(), config.chip_memories.sorted_entries).record)
    # One list of n entries: with a sorting unit at least n cycles more than without, beside its latency.
    t = int(np.diff(ideal.start).argmax())
    assert len(ideal.batch_size) == len(ideal.lines) and ideal.batch_size[t] == np.diff(ideal.start)[t] > config.chip_memories.sorted_entries


def test_cycles() -> None:
    """No frame is faster than its slowest core's blending; memory and VRUs tell."""
    perfect, slow = modelled(RenderConfig()), modelled(RenderConfig(), DramConfig())
    assert perfect.cycles < slow.cycles < modelled(RenderConfig(), DramConfig(), latency_cycles=200).cycles
    assert modelled(RenderConfig(vrus_per_channel=1)).cycles > 1.1 * perfect.cycles  # the test sets the pace of some sub-tiles
    sent = render_chip(frame()[0].subtile_lists(), RenderConfig()).frame.total("minitiles_sent")
    assert perfect.cycles > 8 * sent / 16


def test_reads_of_a_channel() -> None:
    """Lines of 32 bytes on a channel of pages of 256 bytes and two banks, by hand: open rows, another bank, another row of a bank; rows by `ask`."""
    rcd, rp, ras, rrd, burst = 10.0, 20.0, 40.0, 6.0, 4.0
    row, activated, last, bus = np.full((2, 2), -1, np.int64), np.full((2, 2), -1e9), np.full(2, -1e9), np.full(2, -1e9)

    def moves(line: int, ask: float) -> float:
        return float(model._moves(line, ask, 2, 64, 256, 2, rcd, rp, ras, rrd, burst, row, activated, last, bus))

    # Two lines of 64 bytes go to a channel, then two to the other; a page is 8 lines of a channel.
    assert moves(0, 0.0) == rcd and moves(1, 0.0) == rcd + burst and moves(4, 0.0) == rcd + 2 * burst
    assert moves(2, 0.0) == rcd and moves(3, 100.0) == 100.0  # the other channel, by itself
    assert moves(16, 0.0) == rcd + 3 * burst  # the other bank: its row is opened meanwhile, rrd after the first
    # Page 2 is row 1, whose banks are exchanged: bank 1, which was opened at rrd.
    assert moves(32, 0.0) == rrd + ras + rp + rcd
    assert moves(33, 0.0) == rrd + ras + rp + rcd + burst and moves(0, 0.0) == rrd + ras + rp + rcd + 2 * burst  # bank 0 is as it was


def test_bytes() -> None:
    """Pointers and frame buffer of whole pairs of tiles; lines of lists at least once each, of records at least those that lists name."""
    found, (front, image) = modelled(RenderConfig(cat=CatMode.AUTO)), frame()
    start, record, _ = tile_lists(front, *tile_walk(4, 4))
    assert len(start) == 8 * 4 + 1 and start[-1] == len(front.entry_tile)
    assert found.bytes["pointers"] == 32 * 8 * 4 and found.bytes["frame"] == 64 * 2 * 4 * 64
    assert found.bytes["records"] >= 32 * len(np.unique(record // 2))
    assert found.bytes["lists"] >= 64 * sum(len(w) for w in image.lists.writes)
