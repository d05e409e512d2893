"""Mask merge unit against a plain specification.

State space: complete. Sparse: all 2^8 results of the two rectangles; dense: all 2^16 of the two batches; with the override and
without; and random sequences with bubbles between the batches, as the CTU drives it. No parameters.
"""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_mmu() -> None:
    build_and_test("flk_mmu", "cocotb_mmu")
