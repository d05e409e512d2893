"""How fast the colours of a packed scene turn with the direction: a bound for each cluster, as the cluster table holds it (docs/reference/memory_image.md).

A channel of a Gaussian is a sum of spherical harmonics with coefficients k_lm. With k_l those of degree l, by the addition theorem its slope along the sphere
is at most

    sum over l of ||k_l|| sqrt(l (l + 1) (2 l + 1) / (8 pi))

in units of colour a radian. A cluster has the largest of its Gaussians and channels, as a code: 2^((code - 32) / 4), rounded up; code 0: not known, or beyond
the largest.
"""

from __future__ import annotations

import math

import numpy as np

CODE_BITS = 6
CODE_ONE = 32  # of a slope of 1
CODE_SHIFT = 2  # fraction bits of a slope's logarithm to base 2
CODE_STEP = 1 << CODE_SHIFT  # codes for a factor of 2
ROUNDING = 1.01  # a slope that the chip's number formats may make of 1: coefficients' steps have 11 bits there, functions 11, directions 12


def degree_factor(degree: int) -> float:
    """What the length of a degree's coefficients is multiplied by."""
    return math.sqrt(degree * (degree + 1) * (2 * degree + 1) / (8.0 * math.pi))


def largest_slopes(sh: np.ndarray, start: np.ndarray) -> np.ndarray:
    """float64 (C,): the largest slope of each cluster's Gaussians. sh: (N, K, 3), `start`: (C,) first Gaussian of each."""
    slope = np.zeros((len(sh), 3))
    for degree in range(1, math.isqrt(sh.shape[1])):
        of = sh[:, degree**2 : (degree + 1) ** 2].astype(np.float64)
        slope += degree_factor(degree) * np.sqrt((of * of).sum(axis=1))
    return np.maximum.reduceat(slope.max(axis=1), start)


def codes_of(sh: np.ndarray, start: np.ndarray) -> np.ndarray:
    """uint8 (C,): codes of clusters that begin with Gaussians `start`. sh: as of `largest_slopes`."""
    with np.errstate(divide="ignore"):
        code = np.ceil(CODE_STEP * np.log2(ROUNDING * largest_slopes(sh, start))) + CODE_ONE
    return np.where(code < 1 << CODE_BITS, np.maximum(code, 1), 0).astype(np.uint8)


def slope_of(code: np.ndarray) -> np.ndarray:
    """float64: the bound that a code means, infinite for 0."""
    code = np.asarray(code, np.int64)
    return np.where(code > 0, np.exp2((code - CODE_ONE) / CODE_STEP), np.inf)
