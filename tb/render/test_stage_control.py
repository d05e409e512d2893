"""Frame control of a rendering stage against a model of a few lines, in every cycle.

State space: random input streams, random ready and idle of the cores, random changes of mode, aborts of one and more cycles, reset at the start;
counters of every core through the port. No parameters. Not covered: cores that are idle without having been given anything back
(tb/render/test_render_stage.py, tb/frames).
"""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_stage_control() -> None:
    build_and_test("flk_stage_control", "cocotb_stage_control")
