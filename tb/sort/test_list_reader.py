"""List reader: lines of every list in the order of the tiles against the golden model, and exactly the lines of memory that it says; faults; clear.

State space: lists of 0 to 3,000 entries, chunks begun and full, chunks across 4 KB, idle and back-pressure patterns on tiles, lines and
answers, memory with and without pauses, latency 1 to 100 and DRAM timing; faults of the memory and of each field of pointer and header; clear at any time.
Chunks all over the largest region, up to its last one, at the end of the address space. Parameter space: the default; with SLOW=1 two
and eight contexts, 4 and 11 slots, frames. Not covered: several managers at one port.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.front.view import DEMO, load_view
from flicker.golden.front.frame import run_front
from flicker.golden.front.memory import front_memory
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS, real_scenes


@pytest.mark.parametrize("parameters", [
    {}, *(pytest.param(p, marks=pytest.mark.slow) for p in (
        {"Contexts": 2, "Slots": 4, "Ahead": 1}, {"Contexts": 8, "Slots": 11, "Ahead": 3, "Bursts": 3},
    )),
])
def test_list_reader(parameters: dict[str, int]) -> None:
    tests = [] if not parameters else ["lists", "faults"]
    build_and_test("flk_list_reader", "cocotb_list_reader", parameters=parameters, tests=tests)


@pytest.mark.parametrize(("parameters", "message"), [
    ({"Contexts": 3}, "Contexts must be a power of two"), ({"Slots": 3}, "Slots must be at least 4"),
    ({"ChunkLines": 6}, "ChunkLines must be a power of two"), ({"EntryBits": 54}, "must fit a line"),
])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_list_reader", parameters, message)


@pytest.mark.slow
@pytest.mark.parametrize("slots", [9, 16, 24, 32])
@pytest.mark.parametrize("scene", ["demo", "flowers"])
def test_frame(scene: str, slots: int, tmp_path: Path) -> None:
    """Four readers at a memory with DRAM timing, latency 100: the lists of a frame of 1280x720 in at most half a million cycles; how many stands in the log."""
    folder = real_scenes()
    if scene != "demo" and folder is None:
        pytest.skip("FLICKER_SCENES is not set")
    real = {view.folder: view for view in REAL_VIEWS}
    view = load_view(DEMO if scene == "demo" else real[scene].path(folder), 0, (1280, 720))
    lists = front_memory(run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)).lists
    file = tmp_path / "lists.npz"
    np.savez(file, memory=lists.memory, pointers=lists.pointers, cols=lists.cols, rows=lists.rows, chunks=lists.chunks)
    build_and_test(
        "list_readers_bench", "cocotb_list_readers", extra=[Path(__file__).parent / "list_readers_bench.sv"],
        parameters={"Slots": slots}, config={"lists": str(file), "limit": 500_000}, opt="-O1",
    )
