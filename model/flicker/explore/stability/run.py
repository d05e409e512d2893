"""Runs the suite: every configuration and front end on every case, against the float64 reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from zlib import crc32

import numba
import numpy as np

from ...front.reference import render_reference
from ...front.view import View
from ...golden.front.setup import FORMATS
from ...params import Coords
from ...scene.metrics import psnr
from ..configurations import get_configuration, group
from ..machine import Configuration, run
from .families import FAMILIES, get_family
from .front_ends import FRONT_ENDS, Drawer, FrontEnd, drawable

BROKEN_PSNR = 40.0  # dB
BROKEN_ERROR = 0.25  # of a pixel's channel, relative where the reference exceeds 1

ABSOLUTE = "@absolute"  # behind a configuration's name: means rounded to FP16 in screen coordinates
_ABSOLUTE_TOO = ("no-ctu-32", "no-ctu-32-conic", "flicker", "faithful")


@dataclass(frozen=True)
class Point:
    """One configuration, or front end, on one case.

    psnr_db: against the float64 reference, pictures clamped to [0, 1]; inf when equal, -inf when the picture holds a NaN.
    max_error: largest difference of a channel before clamping, divided by the reference where that exceeds 1.
    """

    family: str
    parameter: str
    step: int
    value: float
    configuration: str
    form: str
    precision: str
    psnr_db: float
    max_error: float
    has_nan: bool

    @property
    def broken(self) -> bool:
        """Whether the configuration has failed here."""
        return self.has_nan or not self.psnr_db >= BROKEN_PSNR or not self.max_error <= BROKEN_ERROR


@dataclass(frozen=True)
class Stability:
    """Results of a run, in the order of families, steps and configurations."""

    points: tuple[Point, ...]
    seed: int

    @property
    def configurations(self) -> list[str]:
        """Names in order of appearance."""
        return list(dict.fromkeys(p.configuration for p in self.points))

    @property
    def families(self) -> list[str]:
        """Names in order of appearance."""
        return list(dict.fromkeys(p.family for p in self.points))

    def sweep(self, family: str, configuration: str) -> list[Point]:
        """The points of one configuration in one family, by step."""
        return [p for p in self.points if p.family == family and p.configuration == configuration]

    def breaks(self, family: str, configuration: str) -> Point | None:
        """The first step at which the configuration is broken."""
        return next((p for p in self.sweep(family, configuration) if p.broken), None)


def suite() -> list[str]:
    """All configurations but those whose picture another one has by proof; then some with absolute coordinates, and the front ends."""
    return group("stability") + [name + ABSOLUTE for name in _ABSOLUTE_TOO] + list(FRONT_ENDS)


def _quick_suite() -> list[str]:
    return [*group("stability, quick"), "no-ctu-32" + ABSOLUTE, *(name for name, front in FRONT_ENDS.items() if front.record and front.formats == FORMATS)]


def _split(name: str) -> tuple[Configuration | FrontEnd, Coords]:
    base, absolute, _ = name.partition(ABSOLUTE)
    if base in FRONT_ENDS and not absolute:
        return FRONT_ENDS[base], Coords.LOCAL
    return get_configuration(base), Coords.ABSOLUTE if absolute else Coords.LOCAL


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
        views = {coords: View(case.camera, projected=case.projected, coords=coords, origin=case.origin) for coords in Coords}
        by_front = Drawer(case)
        for name, chosen, coords in picked:
            if isinstance(chosen, FrontEnd):
                if not drawable(case):
                    continue
                form, precision = chosen.form, chosen.precision
                measured = _measure(*by_front(chosen))
            else:
                form, precision = chosen.form.name.lower(), chosen.generator.precision
                with np.errstate(all="ignore"):
                    measured = _measure(run(chosen, views[coords]).image, reference)
            points.append(Point(family.name, family.parameter, k, value, name, form, precision, *measured))
    return points


def run_stability(
    families: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    *,
    seed: int = 1,
    quick: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Stability:
    """Run families (all) with configurations and front ends (the suite, or those of the quick choice). A front end has no point where the screen is too
    large for it.

    quick: first, middle and last step only. progress: called with (cases done, cases in all). Raises FlickerError, before any
    work, for an unknown family or configuration.
    """
    chosen = [get_family(name) for name in families or FAMILIES]
    picked = [(name, *_split(name)) for name in names or (_quick_suite() if quick else suite())]
    steps = [(f, k) for f in chosen for k in (_quick(f.values) if quick else range(len(f.values)))]
    threads = numba.get_num_threads()
    numba.set_num_threads(1)  # the pictures are too small to share among threads
    try:
        points = _points(steps, picked, seed, progress)
    finally:
        numba.set_num_threads(threads)
    progress(len(steps), len(steps))
    return Stability(tuple(points), seed)
