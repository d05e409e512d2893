"""List writer: every line of memory, in order, and the pointers against the golden model; overflow; frames one after the other; registers and memories that
begin random.

State space: entries of one tile and of tiles in turn (hits, free ways, evictions, full lines, a line closed in the cycle after its last entry), chunks begun
and full, no entries, memory that runs out at every place, idle and back-pressure patterns, reset in a frame. Parameter space: 64 pointers; with SLOW=1 2048 for
whole frames and the rate only; the format is fixed. Not covered: counters of more than 2**16, chunk numbers of more than 12 bits.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test, refused


@pytest.mark.parametrize("pointers", [64, pytest.param(2048, marks=pytest.mark.slow)])
def test_list_writer(pointers: int) -> None:
    tests = ["frames", "rate"] if pointers == 2048 else []
    build_and_test("flk_list_writer", "cocotb_list_writer", parameters={"Pointers": pointers}, config={"pointers": pointers}, tests=tests)


@pytest.mark.parametrize(("parameters", "message"), [
    ({"Ways": 3}, "Ways must be a power of two"), ({"Pointers": 40}, "Pointers must be a multiple"), ({"ChunkLines": 6}, "ChunkLines must be a power of two"),
    ({"LineEntries": 10}, "must fit a line"),
])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    with refused(message):
        build_and_test("flk_list_writer", "cocotb_list_writer", parameters=parameters)
