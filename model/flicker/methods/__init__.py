"""Methods: FLICKER in all modes, its rivals, and the exploration beyond the paper (docs/methods.md)."""

from .operations import Op, Operation, Operations
from .registry import ALIASES, Masks, Method, Result, View, get_method, methods, run
from .stage import missed_pixels
from .work import Work

__all__ = [
    "ALIASES", "Masks", "Method", "Op", "Operation", "Operations", "Result", "View", "Work", "get_method", "methods", "missed_pixels", "run",
]
