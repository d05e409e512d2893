"""Runs the suite: every method on every case, against the float64 reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from zlib import crc32

import numba
import numpy as np

from ..methods import Method, View, get_method, methods, run
from ...scene.metrics import psnr
from ...params import Coords, Form
from ...front.reference import render_reference
from .families import FAMILIES, get_family

BROKEN_PSNR = 40.0  # dB
BROKEN_ERROR = 0.25  # of a pixel's channel, relative where the reference exceeds 1

ABSOLUTE = "@absolute"  # behind a method's name: means rounded to FP16 in screen coordinates
QUICK_METHODS = (
    "vanilla", "no_ctu", "no_ctu-conic", "gscore", "seele", "faithful", "flicker", "flicker-dense-fp16-factored",
    "exact-e4m3-factored", "exact", "exact-fp16-conic-bound", "rows", "rows-f6a6", "oracle", "no_ctu" + ABSOLUTE,
)


@dataclass(frozen=True)
class Point:
    """One method on one case.

    psnr_db: against the float64 reference, pictures clamped to [0, 1]; inf when equal, -inf when the picture holds a NaN.
    max_error: largest difference of a channel before clamping, divided by the reference where that exceeds 1.
    """

    family: str
    parameter: str
    step: int
    value: float
    method: str
    form: str
    precision: str
    psnr_db: float
    max_error: float
    has_nan: bool

    @property
    def broken(self) -> bool:
        """Whether the method has failed here."""
        return self.has_nan or not self.psnr_db >= BROKEN_PSNR or not self.max_error <= BROKEN_ERROR


@dataclass(frozen=True)
class Stability:
    """Results of a run, in the order of families, steps and methods."""

    points: tuple[Point, ...]
    seed: int

    @property
    def methods(self) -> list[str]:
        """Names in order of appearance."""
        return list(dict.fromkeys(p.method for p in self.points))

    @property
    def families(self) -> list[str]:
        """Names in order of appearance."""
        return list(dict.fromkeys(p.family for p in self.points))

    def sweep(self, family: str, method: str) -> list[Point]:
        """The points of one method in one family, by step."""
        return [p for p in self.points if p.family == family and p.method == method]

    def breaks(self, family: str, method: str) -> Point | None:
        """The first step at which the method is broken."""
        return next((p for p in self.sweep(family, method) if p.broken), None)


def suite_methods() -> list[str]:
    """All methods but those whose picture another one has by proof; then three with absolute coordinates."""
    names = [m.name for m in methods().values() if m.family != "rows" or m.accumulator or m.lists == "subtile" and m.pixels]
    return names + [name + ABSOLUTE for name in ("no_ctu-factored", "no_ctu-conic", "flicker-smooth-fixed-factored", "flicker-smooth-mixed-conic")]


def _split(name: str) -> tuple[Method, Coords]:
    base, absolute, _ = name.partition(ABSOLUTE)
    return get_method(base), Coords.ABSOLUTE if absolute else Coords.LOCAL


def _measure(image: np.ndarray, reference: np.ndarray) -> tuple[float, float, bool]:
    has_nan = bool(np.isnan(image).any())
    if has_nan:
        return -math.inf, math.inf, True
    error = np.abs(image.astype(np.float64) - reference) / np.maximum(np.abs(reference), 1.0)
    return psnr(image, reference), float(error.max()), False


def _quick(values: Sequence[float]) -> list[int]:
    return sorted({0, len(values) // 2, len(values) - 1})


def _points(steps: list, picked: list, seed: int, progress: Callable[[int, int], None]) -> list[Point]:
    points = []
    for done, (family, k) in enumerate(steps):
        progress(done, len(steps))
        value = family.values[k]
        case = family.make(value, np.random.default_rng([seed, crc32(family.name.encode())]))
        reference = render_reference(case.truth or case.projected, case.camera)
        views = {coords: View(case.projected, case.camera, coords, case.origin) for coords in Coords}
        for name, method, coords in picked:
            with np.errstate(all="ignore"):
                image = run(method, views[coords]).image
                measured = _measure(image, reference)
            points.append(Point(
                family.name, family.parameter, k, value, method.name + (ABSOLUTE if coords == Coords.ABSOLUTE else ""),
                Form(method.form).name.lower(), method.precision, *measured,
            ))
    return points


def run_stability(
    families: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    *,
    seed: int = 1,
    quick: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Stability:
    """Run families (all) with methods (all, or those of the quick choice).

    quick: first, middle and last step only. progress: called with (cases done, cases in all). Raises FlickerError, before any
    work, for an unknown family or method.
    """
    chosen = [get_family(name) for name in families or FAMILIES]
    picked = [(name, *_split(name)) for name in names or (QUICK_METHODS if quick else suite_methods())]
    steps = [(f, k) for f in chosen for k in (_quick(f.values) if quick else range(len(f.values)))]
    threads = numba.get_num_threads()
    numba.set_num_threads(1)  # the pictures are too small to share among threads
    try:
        points = _points(steps, picked, seed, progress)
    finally:
        numba.set_num_threads(threads)
    progress(len(steps), len(steps))
    return Stability(tuple(points), seed)
