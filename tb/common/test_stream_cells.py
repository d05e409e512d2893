"""Stream cells: pipe register, skid buffer, FIFO, round-robin arbiter.

State space: every idle and every back-pressure pattern (flicker_tb.stalls), with SLOW=1 every pair of them, random payloads,
random initial register values, blocked output, reset in mid-traffic. Parameter space: registers
of more than a machine word; FIFO depths 1 and 3; 4 arbiter inputs; a skid buffer that loads early, a FIFO
of depth 16 with its head in a register. With SLOW=1 also registers of 1 and 8 bits, FIFOs of more than a machine word, depths 2, 5, 16, 17, 256, with their
head in a register 2 and 3, 2, 3 and 6 inputs.
Not covered: other depths and widths (the code has no case for them).
"""

from __future__ import annotations

import pytest
from flicker_tb.bench import rounds
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SLOW = pytest.mark.slow  # the same with other numbers
FIFOS = [  # width, depth, head in a register
    (8, 1, 0), (8, 3, 0), (9, 16, 1), *(pytest.param(9, depth, 1, marks=SLOW) for depth in (2, 3)),
    *(pytest.param(*size, 0, marks=SLOW) for size in ((1, 2), (1, 256), (8, 17), (146, 5), (8, 16), (70, 256))),
]


@pytest.mark.parametrize("width", [*(pytest.param(width, marks=SLOW) for width in (1, 8)), 146])
def test_pipe_reg(width: int) -> None:
    build_and_test(
        "flk_pipe_reg",
        "cocotb_stream_cells",
        parameters={"Width": width},
        config={"capacity": 1, "period": 1, "paths": ["out_ready_i>in_ready_o"]},
    )


@pytest.mark.parametrize(("width", "early"), [*(pytest.param(width, 0, marks=SLOW) for width in (1, 8)), (146, 0), (9, 1)])
def test_skid_buffer(width: int, early: int) -> None:
    build_and_test(
        "flk_skid_buffer",
        "cocotb_stream_cells",
        parameters={"Width": width, "Early": early},
        config={"capacity": 2, "period": 1, "paths": []},
    )


@pytest.mark.parametrize(("width", "depth", "head"), FIFOS)
def test_fifo(width: int, depth: int, head: int) -> None:
    build_and_test(
        "flk_fifo",
        "cocotb_stream_cells",
        parameters={"Width": width, "Depth": depth, "HeadRegister": head},
        config={"capacity": depth, "period": 2 if depth == 1 else 1, "paths": []},
    )


@pytest.mark.parametrize(("inputs", "width"), [(4, 80), *(pytest.param(*size, marks=SLOW) for size in ((2, 1), (3, 8), (6, 8)))])
def test_stream_arbiter(inputs: int, width: int) -> None:
    build_and_test(
        "flk_stream_arbiter",
        "cocotb_stream_arbiter",
        parameters={"Inputs": inputs, "Width": width},
    )


def test_random_start() -> None:
    """Further seeds of the initial register values: the only way to see a missing reset."""
    build_and_test(
        "flk_fifo",
        "cocotb_stream_cells",
        parameters={"Width": 8, "Depth": 3},
        config={"capacity": 3, "period": 1, "paths": []},
        tests=["rate", "capacity"],
        seeds=rounds(2, 5),
    )


@pytest.mark.parametrize(
    ("top", "parameters", "message"),
    [
        ("flk_pipe_reg", {"Width": 0}, "Width must be at least 1"),
        ("flk_skid_buffer", {"Width": 0}, "Width must be at least 1"),
        ("flk_fifo", {"Depth": 0}, "Depth must be 1 to 256"),
        ("flk_fifo", {"Depth": 257}, "Depth must be 1 to 256"),
        ("flk_stream_arbiter", {"Inputs": 1}, "Inputs must be at least 2"),
    ],
)
def test_illegal_parameters(top: str, parameters: dict[str, int], message: str) -> None:
    refused(top, parameters, message)
