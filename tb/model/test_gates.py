"""Gates on figures: cycles and bytes of three frames of the models, areas of five units, against tb/figures.csv; and the file itself.

Figures of the RTL stand where it runs: tb/frames/test_chip_frames.py.
"""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from flicker_tb import figures

from flicker.chip import preprocessing, rendering
from flicker.chip.dram import DramConfig
from flicker.chip.tile_lists import TileLists
from flicker.cost.area import TABLE
from flicker.errors import FlickerError
from flicker.front.view import DEMO, load_view
from flicker.golden.front.frame import run_front
from flicker.golden.front.memory import front_memory
from flicker.params import FAITHFUL, RenderConfig
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat

FRAMES = {"channels": RenderConfig(), "faithful": FAITHFUL, "lanes": RenderConfig(stage="lanes")}
UNITS = (("prtu", "factored fixed"), ("vru", "factored"), ("sorting_unit", "default"), ("delivery", "default"), ("lane", "8 pixels"))


@cache
def front():
    view = load_view(DEMO, 0, (160, 90))
    found = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
    return found, front_memory(found)


@pytest.mark.parametrize("name", FRAMES)
def test_frames(name: str) -> None:
    """The demo scene at 160x90 with DRAM timing: cycles of the rendering half, bytes that it moves."""
    config = FRAMES[name]
    found = rendering.estimate(TileLists.of(*front(), config.chip_memories.sorted_entries, config.chip_memories.merge_lines), config, DramConfig())
    figures.hold(f"rendering, {name}, cycles", found.cycles)
    figures.hold(f"rendering, {name}, bytes", sum(found.bytes.values()))


def test_preprocessing() -> None:
    """The same frame's other half."""
    found = preprocessing.estimate(*front(), DramConfig())
    figures.hold("front end, cycles", found.cycles)
    figures.hold("front end, bytes", sum(found.bytes.values()))


@pytest.mark.parametrize(("unit", "config"), UNITS)
def test_areas(unit: str, config: str) -> None:
    """Gate equivalents of the committed synthesis, flip-flops beside them."""
    with TABLE.open(newline="") as file:
        (row,) = (row for row in csv.DictReader(line for line in file if not line.startswith("#")) if (row["unit"], row["config"]) == (unit, config))
    figures.hold(f"area, {unit} ({config}), gate equivalents", float(row["ge"]))
    figures.hold(f"area, {unit} ({config}), flip-flops", float(row["ff"]))


def test_a_figure_that_moves(tmp_path: Path) -> None:
    """One percent in either direction; what is not recorded; a line that was edited."""
    file = tmp_path / "figures.csv"
    figures.record("cycles", 1000, "first", file)
    figures.record("cycles", 1009, "too little to matter", file)
    assert figures.read(file) == {"cycles": ("1000", "first")}
    known = figures.read(file)
    assert not any(figures.moved(known, "cycles", value) for value in (990, 1000, 1010))
    for value in (989, 1011):
        assert "recorded are 1000" in figures.moved(known, "cycles", value) and "first" in figures.moved(known, "cycles", value)
    assert "not recorded" in figures.moved(known, "bytes", 1.0)
    figures.record("cycles", 800, "a shorter pipeline", file)
    assert figures.read(file) == {"cycles": ("800", "a shorter pipeline")}
    file.write_text(file.read_text().replace("800", "900"))
    with pytest.raises(FlickerError, match="digest does not fit"):
        figures.read(file)


def test_holding(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A test fails until the reason is given."""
    monkeypatch.setattr(figures, "FILE", tmp_path / "figures.csv")
    monkeypatch.setattr(figures, "read", lambda file=figures.FILE: {"cycles": ("1000", "first")})
    monkeypatch.delenv(figures.REASON, raising=False)
    figures.hold("cycles", 1005.0)
    with pytest.raises(AssertionError, match="recorded are 1000.*make record"):
        figures.hold("cycles", np.float64(1200.0))
