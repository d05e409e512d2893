"""Record writer: every beat as a line, in order, with all its records and no other marked; records in any order within the ring; rates; reset inside.

State space: full and partial beats, any quarters; records before and after their beat is known; lanes that want the same quarter; ring turned round many
times; idle and back-pressure patterns of lanes, beats and lines. Parameter space: records of 16 bytes, and of 32 bytes as the front end has them; with SLOW=1
one and two lanes.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    pytest.param({}, id="16 bytes"), pytest.param({"RecordBits": 177, "Quarters": 2}, id="32 bytes", marks=pytest.mark.slow),
])
def test_record_writer(parameters: dict[str, int]) -> None:
    build_and_test("flk_record_writer", "cocotb_record_writer", parameters=parameters, inner=False)


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [1, 2])
def test_fewer_lanes(lanes: int) -> None:
    build_and_test("flk_record_writer", "cocotb_record_writer", parameters={"Lanes": lanes}, inner=False, tests=["records", "reset_inside"])
