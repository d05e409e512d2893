"""Splats for a rendering stage: order and conversion on four cores at once, and whose list `finished_o` is about.

State space: lists of their own for every core, pauses on both sides, clear_i, finished_i at random. Parameter space: records of 16 bytes; the conversion
itself: tb/render/test_record_to_splat.py.
"""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_splat_input() -> None:
    build_and_test("flk_splat_input", "cocotb_splat_input", inner=False)
