"""Splat records: random generators, and packing as in ``flk_pkg``.

Features are a tuple of nine FP16 bit patterns in the order of ``flk_pkg::feature_t`` from the least significant end:
mean_x, mean_y, shape0, shape1, shape2, opacity, blue, green, red.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flicker.params import SUBTILE_COORD_BITS, Form

Features = tuple[int, ...]

FIELDS = ("mean_x", "mean_y", "shape0", "shape1", "shape2", "opacity", "blue", "green", "red")
FEATURE_BITS = 16 * len(FIELDS)
SPIKY = 1 << FEATURE_BITS  # in splat_elem_t
SPLAT_EOS = 1 << (FEATURE_BITS + 1)  # in splat_elem_t
FEATURE_EOS = 1 << FEATURE_BITS  # in feature_elem_t

# Zeros, smallest and largest subnormal, smallest normal, one and its neighbours, largest, infinity, NaN; both signs.
SPECIAL = [
    sign | magnitude
    for magnitude in (0, 1, 0x3FF, 0x400, 0x3BFF, 0x3C00, 0x3C01, 0x4900, 0x7BFF, 0x7C00, 0x7C01, 0x7E00, 0x7FFF)
    for sign in (0, 0x8000)
]
# Zero, subnormal, smallest normal, 1/255 and its neighbours, 0.99 and its neighbours, one.
OPACITIES = (0, 1, 0x3FF, 0x400, 0x1C04, 0x1C05, 0x1C06, 0x3BEB, 0x3BEC, 0x3BED, 0x3C00)


@dataclass(frozen=True)
class Splat:
    """One entry of a sub-tile's list."""

    features: Features
    spiky: bool = False


def fp16(values: Sequence[float]) -> list[int]:
    """FP16 bit patterns of numbers, infinity beyond the range."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float64).astype(np.float16).view(np.uint16).tolist()


def pack(features: Features) -> int:
    """``feature_t`` as an integer."""
    return sum(value << 16 * place for place, value in enumerate(features))


def unpack(word: int) -> Features:
    """Features in the low bits of an integer."""
    return tuple(word >> 16 * place & 0xFFFF for place in range(len(FIELDS)))


def splat_elem(splat: Splat) -> int:
    """``splat_elem_t`` of a splat."""
    return pack(splat.features) | (SPIKY if splat.spiky else 0)


def subtile(col: int, row: int) -> int:
    """``subtile_t``: the data of a token."""
    return row << SUBTILE_COORD_BITS | col


def gaussian(
    rng: random.Random, form: Form, mean: tuple[float, float], sigma: tuple[float, float], angle: float, opacity: float
) -> Splat:
    """Record of a 2D Gaussian: mean in pixels of the sub-tile, sigmas of its axes in pixels, direction of the first."""
    c, s = math.cos(angle), math.sin(angle)
    i0, i1 = 1 / sigma[0] ** 2, 1 / sigma[1] ** 2
    a, b, d = c * c * i0 + s * s * i1, c * s * (i0 - i1), s * s * i0 + c * c * i1  # conic [[a, b], [b, d]]
    if form == Form.CONIC:
        shape = (a / 2, b, d / 2)
    else:
        k = 0.5 / math.log(2)
        l0 = math.sqrt(a * k)
        shape = (l0, b * k / l0, math.sqrt(k * i0 * i1 / a))
    colour = [rng.uniform(0, 1.2) for _ in range(3)]
    spiky = max(sigma) >= 3 * min(sigma)
    return Splat(tuple(fp16([*mean, *shape, opacity, *colour])), spiky)


def tame(rng: random.Random, form: Form) -> Splat:
    """A splat as in a real scene: 0.55 to 20 pixels, mostly round, near the sub-tile."""
    sigma = 0.55 * 36 ** rng.random()
    ratio = rng.choice((1.0, 1.5, 4.0)) * rng.uniform(1, 1.5)
    reach = 8 + 2 * sigma
    mean = (rng.uniform(-reach, reach) + 3.5, rng.uniform(-reach, reach) + 3.5)
    opacity = rng.choice((rng.random(), rng.random() ** 4, 1.0))
    return gaussian(rng, form, mean, (sigma * ratio, sigma), rng.uniform(0, math.pi), opacity)


def thin(rng: random.Random, form: Form) -> Splat:
    """A long slanted splat whose axis passes near the sub-tile: large terms that cancel."""
    angle = rng.choice((0.25, 0.75)) * math.pi + rng.gauss(0, 0.1)
    along, beside = rng.uniform(-100, 100), rng.gauss(0, 3)
    mean = (
        3.5 + along * math.cos(angle) - beside * math.sin(angle),
        3.5 + along * math.sin(angle) + beside * math.cos(angle),
    )
    return gaussian(rng, form, mean, (rng.uniform(20, 300), 0.55), angle, rng.uniform(0.1, 1.0))


def special(rng: random.Random, form: Form) -> Splat:
    """A splat with some numbers replaced by special values, any bit patterns or huge numbers; opacity stays in [0, 1]."""
    base = tame(rng, form)
    features = list(base.features)
    for place in range(len(FIELDS)):
        if rng.random() < 0.35:
            features[place] = rng.choice((rng.choice(SPECIAL), rng.getrandbits(16), rng.randrange(0x6000, 0x7C00)))
    features[5] = rng.choice((base.features[5], rng.choice(OPACITIES)))
    return Splat(tuple(features), rng.random() < 0.5)


def opaque(rng: random.Random, form: Form) -> Splat:
    """A splat that covers the whole sub-tile: a few of them finish every pixel."""
    mean = (rng.uniform(0, 7), rng.uniform(0, 7))
    sigma = rng.uniform(30, 90)
    return gaussian(rng, form, mean, (sigma, sigma), 0.0, rng.uniform(0.9, 1.0))


def mixed(rng: random.Random, form: Form) -> Splat:
    """One of the kinds above."""
    return rng.choices((tame, thin, special, opaque), (6, 2, 2, 1))[0](rng, form)
