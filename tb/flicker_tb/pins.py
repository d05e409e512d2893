"""Values of ports in every cycle, without the objects that cocotb makes of them, which take a good part of a test's time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def reader(port: Any) -> Callable[[], int]:
    """A function that gives the value of a port of any width now, as an unsigned integer. It raises ValueError for a value with X or Z."""
    bits = port._handle.get_signal_val_binstr  # of the pinned cocotb; `port.value` makes a LogicArray of the same
    return lambda: int(bits(), 2)
