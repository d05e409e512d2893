"""List writer: every line of memory, in order, and the pointers against the golden model; overflow; frames one after the other; registers and memories that
begin random.

State space: entries of one tile and of tiles in turn (hits, free ways, evictions, full lines, a line closed in the cycle after its last entry), chunks begun
and full, no entries, memory that runs out at every place, idle and back-pressure patterns, reset in a frame; lines of pointers that are moved to their table
and back, by an agent of any speed; the last chunks of the largest region. Parameter space: 64 pointers for as many lists, 32 for 256; 2048 for 16,384 as in
the chip, corners of the largest picture only, with SLOW=1 whole frames, those with moves and the rate too; with 256 lists one of the patterns without SLOW=1;
with SLOW=1 two and four banks, also of the chip's sizes; the format is fixed. Not covered: counters of entries of more than 2**16.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

TESTS = ["frames", "out_of_memory", "last_chunks", "one_set", "rate", "reset_in_a_frame", "spilled"]


@pytest.mark.parametrize(("pointers", "lists", "tests"), [
    (64, 64, TESTS[:-1]), (32, 256, ["spilled"]), pytest.param(32, 256, ["frames", "out_of_memory", "one_set", "reset_in_a_frame"], marks=pytest.mark.slow),
    (2048, 16384, ["corners"]), pytest.param(2048, 16384, ["frames", "rate", "spilled"], marks=pytest.mark.slow),
])
def test_list_writer(pointers: int, lists: int, tests: list[str]) -> None:
    parameters = {"Pointers": pointers, "Lists": lists}
    build_and_test("flk_list_writer", "cocotb_list_writer", parameters=parameters, config={"pointers": pointers, "lists": lists}, tests=tests,
                   inner="last_chunks" in tests)


@pytest.mark.slow
@pytest.mark.parametrize(("banks", "pointers", "lists"), [(4, 32, 128), (2, 64, 64), (2, 32, 256), (4, 2048, 16384)])
def test_several_banks(banks: int, pointers: int, lists: int) -> None:
    parameters = {"Banks": banks, "Pointers": pointers, "Lists": lists}
    build_and_test("flk_list_writer", "cocotb_list_writer", parameters=parameters, config={"pointers": pointers, "lists": lists}, tests=["banks"])


@pytest.mark.parametrize(("parameters", "message"), [
    ({"Banks": 3}, "Banks must be 1, 2 or 4"),
    ({"Ways": 3}, "Ways must be a power of two"), ({"Pointers": 40}, "Pointers must be a multiple"), ({"Pointers": 48, "Lists": 96}, "Lists must be"),
    ({"Pointers": 64, "Lists": 32}, "Lists must be"), ({"ChunkLines": 6}, "ChunkLines must be a power of two"),
    ({"ShortEntries": 16}, "must fit a line"), ({"LineEntries": 10}, "must fill the gaps"),
])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_list_writer", parameters, message)
