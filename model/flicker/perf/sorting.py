"""Cycles of a sorting unit."""
BACK_TO_BACK = 40


def list_cycles(n: int) -> int:
    return n + 1


def unit_cycles(golden, cells: int = 16, stages: int = 7) -> int:
    return 0
