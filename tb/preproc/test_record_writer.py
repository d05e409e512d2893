"""Record writer: every beat as a line, in order, with all its records and no other marked; records in any order within the ring; rates; reset inside.

State space: full and partial beats, any quarters; records before and after their beat is known; lanes that want the same quarter; ring turned round many
times; idle and back-pressure patterns of lanes, beats and lines. Parameter space: the defaults (records of 16 bytes).
"""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_record_writer() -> None:
    build_and_test("flk_record_writer", "cocotb_record_writer", inner=False)
