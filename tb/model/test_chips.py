"""Chips by name: the table in the root, files of one's own, what is refused.

State space: every field of the wrong kind, unknown, out of range; files that are none; sizes of memories of a chip's own. The commands that take a name.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from flicker_tb.bench import rounds
from flicker_tb.command import flicker
from flicker_tb.elaboration import instances
from scene_samples import thinned
from test_scene_cost import camera, some

from flicker.chip.dram import DramConfig
from flicker.chip.rendering import CACHE_WAYS
from flicker.chip.scene_cost import packed_for_cost
from flicker.chip.sizing import Rate, rates, smallest
from flicker.chips import STATUS, TABLE, chip_of, chips, name_of
from flicker.errors import FlickerError
from flicker.params import CHIP_MEMORIES, FAITHFUL, RECOMMENDED, ChipMemories, Form, RenderConfig
from flicker.scene.demo import generate

LINE = '[mine]\npurpose = "x"\nstatus = "untested"\nstage = "lanes"\n'


@pytest.fixture(autouse=True)
def own_sizes() -> Iterator[None]:
    """Sizes of memories that a test's chips bring are forgotten behind it: pages are made of that table."""
    before = dict(CHIP_MEMORIES)
    yield
    CHIP_MEMORIES.clear()
    CHIP_MEMORIES.update(before)


def test_table() -> None:
    """The names that pages and tools rely on; no two lines are one chip."""
    table = chips()
    assert list(table) == ["tiny", "small", "default", "wide", "max", "channels", "faithful"]
    assert table["default"].config == RECOMMENDED and table["faithful"].config == FAITHFUL and table["channels"].config == RenderConfig()
    assert all(chip.status in STATUS and chip.purpose for chip in table.values())
    assert len({tuple(chip.parameters.items()) for chip in table.values()}) == len(table)
    assert name_of(table["tiny"].config) == "tiny" and name_of(RenderConfig(fifo_depth=3)) is None
    assert table["tiny"].parameters["PortBits"] == 128 and "PortBits" not in table["default"].parameters


def test_own_file(tmp_path: Path) -> None:
    """Beside those of the table; memories by name and with sizes of its own, which are the named ones where they are the same."""
    file = tmp_path / "own.toml"
    file.write_text(LINE + "lanes = 64\nmemories = {pairs = 2, sort_ways = 4}\n" + LINE.replace("mine", "other") + 'memories = "small"\n')
    mine, other = chip_of("mine", file), chip_of("other", file)
    assert mine.config.lanes == 64 and mine.config.chip_memories == ChipMemories(pairs=2, sort_ways=4) and mine.parameters["Pairs"] == 2
    assert other.config.memories == "small" and chip_of("tiny", file) == chip_of("tiny")
    file.write_text(LINE + "memories = {sorted_entries = 2048}\n")
    assert chip_of("mine", file).config.memories == "default"
    assert set(CHIP_MEMORIES) >= {"default", "small", "own.toml: mine"}


@pytest.mark.parametrize("text, says", [
    ("", "own.toml: has no chip"),
    ("[mine", "own.toml: Expected ']'"),
    ("lanes = 32", "own.toml: lanes stands outside of a chip's table"),
    ("[mine]", "own.toml: chip mine: purpose must be a text"),
    ('[mine]\npurpose = "x"\nstatus = "good"', "own.toml: chip mine: status must be verified, built or untested, not good"),
    (LINE + "lane = 32", "own.toml: chip mine: unknown field lane, is lanes meant?"),
    (LINE + "lanes = 48", "own.toml: chip mine: lanes must be 16, 32, 64 or 128 with cores 4, not 48"),
    (LINE + 'lanes = "32"', "own.toml: chip mine: lanes must be a whole number, not '32'"),
    (LINE + "lanes = true", "own.toml: chip mine: lanes must be a whole number, not True"),
    (LINE + "port_bits = 64", "own.toml: chip mine: port_bits must be 128, 256 or 512, not 64"),
    (LINE + "port_bits = 1024", "own.toml: chip mine: port_bits must be 128, 256 or 512, not 1024"),
    (LINE + 'form = "round"', "own.toml: chip mine: form must be conic or factored, not round"),
    (LINE + 'memories = "tiny"', "own.toml: chip mine: memories must be one of"),
    (LINE + "memories = {pair = 2}", "own.toml: chip mine: unknown field memories.pair, is pairs meant?"),
    (LINE + "memories = {pairs = 3}", "own.toml: chip mine: memories: pairs must be 2, 4 or 8, not 3"),
    (LINE + "memories = {sorted_entries = 1000}", "own.toml: chip mine: memories: sorted_entries must be a power of two from 64 on, not 1000"),
    (LINE + "memories = {merge_lines = 4096}", "own.toml: chip mine: memories: merge_lines must be at most 128 with sorted_entries 2048, not 4096"),
    (LINE + "memories = {record_lines = 48}", "own.toml: chip mine: memories: record_lines must be a power of two, 32 to 65,536, not 48"),
    (LINE + "memories = {queued_records = 12}", "own.toml: chip mine: memories: queued_records must be a multiple of 8, not 12"),
    (LINE + "memories = {pairs = 0}", "own.toml: chip mine: memories.pairs must be a whole number from 1 on, not 0"),
])
def test_refused(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "own.toml"
    file.write_text(text)
    with pytest.raises(FlickerError, match="^" + re.escape(says)) as error:
        chips(file)
    assert "\n" not in str(error.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(FlickerError, match="none.toml: No such file"):
        chips(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(FlickerError, match="bytes.toml: is no text in UTF-8"):
        chips(tmp_path / "bytes.toml")
    with pytest.raises(FlickerError, match="chip: one of tiny, .*, not huge"):
        chip_of("huge")
    with pytest.raises(FlickerError, match="DRAM: port_bits must be 128, 256 or 512, not 100"):
        DramConfig(port_bits=100)


@pytest.mark.parametrize("arguments, says", [
    (["render", "demo", "--chip", "huge"], "chip: one of tiny"),
    (["render", "demo", "--chips", str(TABLE)], "--chips: with --chip NAME only"),
    (["cost", "demo", "--fps", "0"], "--fps: more than 0, not 0"),
    (["cost", "demo", "--fps", "nan"], "--fps: more than 0, not nan"),
    (["cost", "demo", "--clock", "0.2"], "--clock: with --fps only"),
    (["cost", "demo", "--fps", "90", "--clock", "-1"], "--clock: more than 0, not -1"),
    (["render", "demo", "--engine", "chip", "--chip", "tiny", "--lanes", "64", "--port-bits", "128"], "so it cannot be combined with --lanes, --port-bits"),
    (["render", "demo", "--chip", "tiny", "--engine", "reference"], "--chip: not for --engine reference"),
    (["cost", "demo", "--chip", "faithful"], "--chip faithful: has records of 32 bytes"),
    (["cost", "demo", "--chips", str(TABLE)], "--chips: with --chip NAME or --fps only"),
])
def test_commands_refuse(arguments: list[str], says: str) -> None:
    ended = flicker(*arguments)
    assert ended.returncode and says in ended.stderr and ended.stderr.count("\n") == 1


def test_commands_take_a_name(tmp_path: Path) -> None:
    """Costs follow the port, which both halves share."""
    cycles = []
    for name in ("tiny", "default"):
        assert flicker("cost", "demo", "--size", "32x32", "--view", "0", "--chip", name, "--quiet", "--json", tmp_path / "cost.json").returncode == 0
        found = json.loads((tmp_path / "cost.json").read_text())
        assert found["chip"] == name
        cycles.append(found["views"][0]["interval"])
    assert cycles[0] > 1.5 * cycles[1]


def test_rate_of_the_slowest_view() -> None:
    """Whatever the order of the cameras."""
    packing, near, far = packed_for_cost(some())[1], camera(), camera(-3.0)
    one, other, both, turned = (rates(packing, cameras, [chip_of("tiny")])[0] for cameras in ([near], [far], [near, far], [far, near]))
    assert one.cycles > 1.1 * other.cycles and both.cycles == turned.cycles == one.cycles
    assert (both.view, turned.view, both.waits) == (0, 1, one.waits) and both.per_second(2e9) == 2e9 / one.cycles


def test_smallest_chip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """flicker cost --fps names the chip of the least area that makes the rate in every view, and what it waits for; chips of a file of one's own take part,
    one of the same name without the table's area. A part of the demo scene, with SLOW=1 all of it."""
    scene = thinned(generate(), rounds(8, 1))
    monkeypatch.setattr("flicker.scene.demo.generate", lambda seed=1: scene)
    own = tmp_path / "own.toml"
    own.write_text(LINE + "lanes = 64\nport_bits = 128\n" + LINE.replace("mine", "max"))

    def cost(*options: str) -> tuple[dict, str]:
        done = flicker("cost", "demo", "--size", "64x48", "--views", "1", "--chips", own, *options, "--json", tmp_path / "cost.json")
        assert done.returncode == 0, done.stderr
        return json.loads((tmp_path / "cost.json").read_text()), done.stdout

    found, text = cost("--fps", "1")
    rows = found["chips"]
    assert found["smallest_chip"] == "tiny" and "smallest chip for 1 frames a second: tiny, which waits for: " in text
    assert {row["chip"] for row in rows} == {name for name, chip in chips().items() if chip.config.form is Form.FACTORED} | {"mine"}
    areas = [row["ge"] for row in rows]
    assert areas[:-2] == sorted(areas[:-2]) and areas[-2:] == [None, None] and [row["chip"] for row in rows[-2:]] == ["max", "mine"]
    between = (rows[0]["frames_per_second"] + rows[1]["frames_per_second"]) / 2  # of tiny and small
    table = [Rate(chip_of(row["chip"]), row["ge"], row["view"], row["interval"], row["waits"]) for row in rows[:-2]]
    assert (best := smallest(table, between)) and best.chip.name == "small"
    slow, text = cost("--fps", str(between), "--clock", "0.001")
    assert slow["smallest_chip"] is None and "no chip makes" in text
    assert slow["chips"][0]["frames_per_second"] == pytest.approx(rows[0]["frames_per_second"] / 1000)


def test_sizes_of_memories_reach_their_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the pins on; none is the default's."""
    sizes = ChipMemories(1024, 6, 128, 2, 64, 4, 96, 64, 2048, 32)
    assert all(getattr(sizes, name) != value for name, value in vars(ChipMemories()).items())
    monkeypatch.setitem(CHIP_MEMORIES, "others", sizes)
    found = instances("flk_top_axi", RenderConfig(stage="lanes", memories="others").top_parameters())

    def all_of(module: str, parameter: str) -> set[int]:
        return {parameters[parameter] for parameters in found[module]}

    assert all_of("flk_sorting_unit", "Stages") == {sizes.sort_stages} and all_of("flk_sorting_unit", "Ways") == {sizes.sort_ways}
    assert all_of("flk_list_reader", "Slots") == {sizes.list_chunks} and all_of("flk_entry_buffer", "Depth") == {sizes.sorted_ahead}
    assert all_of("flk_frame_writer", "Pairs") == {sizes.pairs} and all_of("flk_preprocessing_core", "Waiting") == {sizes.survivors}
    assert all_of("flk_line_writer", "Gather") == {sizes.gathered_lines, 64}  # the front end's, and the rendering half's
    assert all_of("flk_run_merge", "Lines") == {sizes.merge_lines} and all_of("flk_run_merge", "Runs") == {sizes.sort_runs}
    assert all_of("flk_delivery", "Queue") == {sizes.queued_records}
    (cache,) = found["flk_record_cache"]
    assert (cache["Banks"] * cache["Sets"] * cache["Ways"], cache["Ways"]) == (sizes.record_lines, CACHE_WAYS)
