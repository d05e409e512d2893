"""Stability suite: named families of hard inputs, swept from harmless to extreme, for every configuration (docs/reference/stability.md)."""

from .families import FAMILIES, Case, Family, get_family
from .front_ends import FRONT_ENDS, FrontEnd
from .run import BROKEN_ERROR, BROKEN_PSNR, Point, Stability, run_stability
from .write import break_table, write_csv, write_pictures

__all__ = [
    "BROKEN_ERROR", "BROKEN_PSNR", "Case", "FAMILIES", "FRONT_ENDS", "Family", "FrontEnd", "Point", "Stability", "break_table", "get_family", "run_stability",
    "write_csv", "write_pictures",
]
