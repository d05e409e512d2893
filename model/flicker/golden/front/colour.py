"""Colour of a Gaussian in fixed point: spherical harmonics in a direction, coefficients, their sum.

    colour = low + step code + sum over degrees of step_d S_d,   S_d = sum of basis times coefficient of the degree

The basis has fixed factors inside and lies below 1; a chunk's coefficients are the whole numbers 2 code - zero, those of FP16 become fixed point. So
products and S_d are exact but for a rounding of each product, and only S_d, once for a degree, is made an ff number for the cluster's step.
What is added to a colour is fixed point again: its order does not matter.
"""

from __future__ import annotations

import numba
import numpy as np

from ...arithmetic.ff import ff_add, ff_from_fixed, ff_mul, ff_rsqrt, ff_to_fixed_round
from ...arithmetic.fixed import fixed_mix, fixed_mul, fixed_sum, fixed_wrap
from ...front.projection import _C0, _C1, _C2, _C3
from .setup import FrontFormats, rounded

DIRECTION_FRACTION = 12
DIRECTION_BITS = 13  # of a direction's component, saturated: 1 is 4095/4096
BASIS_FRACTION = 11
BASIS_BITS = 12  # all functions lie between -1 and 1
COEFFICIENT_FRACTION = 11  # of a coefficient that was FP16
COEFFICIENT_BITS = 14  # of one, saturated: 4
PRODUCT_DROP = 6  # fraction bits that are rounded off a product
SUM_FRACTION = BASIS_FRACTION - PRODUCT_DROP  # of the sum of a degree, in units of its coefficients
TERM_FRACTION = 13  # of what is added to a colour
TERM_BITS = 20  # of one term, saturated: 64
COLOUR_FRACTION = 9  # of a record's colour
COLOUR_LIMIT = 1023


def _constant(value: float) -> int:
    """A factor of the spherical harmonics, 12 fraction bits."""
    return round(value * 4096)


_DEGREE_1 = _constant(_C1)
_XY, _ZZ, _DIFFERENCE = _constant(_C2[0]), _constant(_C2[2]), _constant(_C2[4])
_CUBE, _XYZ, _FIVE, _Z_FIVE, _Z_DIFFERENCE = (_constant(_C3[k]) for k in (0, 1, 2, 3, 5))


def constant_factor(formats: FrontFormats) -> float:
    """Factor of the constant function, an ff number of the colour format."""
    return float(rounded(_C0, formats.colour))


@numba.njit
def _dot(a0, a1, a2, M):
    return ff_add(ff_add(ff_mul(a0, a0, M), ff_mul(a1, a1, M), M), ff_mul(a2, a2, M), M)


@numba.njit
def basis_functions(d0, d1, d2, degree, out, M):
    """Spherical harmonics 1 to (degree + 1)^2 - 1 in the direction d, ff (M bits), into out (16,): whole numbers, 11 fraction bits.

    Where the square of d is 0 or saturated they are wrong, but within their bits.
    """
    one = 1 << DIRECTION_FRACTION
    rn = ff_rsqrt(_dot(d0, d1, d2, M), M)
    x = ff_to_fixed_round(ff_mul(d0, rn, M), DIRECTION_FRACTION, DIRECTION_BITS)
    y = ff_to_fixed_round(ff_mul(d1, rn, M), DIRECTION_FRACTION, DIRECTION_BITS)
    z = ff_to_fixed_round(ff_mul(d2, rn, M), DIRECTION_FRACTION, DIRECTION_BITS)
    out[1] = fixed_wrap(fixed_mix(y, -_DEGREE_1, 0, 0, 0, 13), BASIS_BITS)
    out[2] = fixed_wrap(fixed_mix(z, _DEGREE_1, 0, 0, 0, 13), BASIS_BITS)
    out[3] = fixed_wrap(fixed_mix(x, -_DEGREE_1, 0, 0, 0, 13), BASIS_BITS)
    if degree < 2:
        return
    xx, yy, zz = fixed_mul(x, x, 12), fixed_mul(y, y, 12), fixed_mul(z, z, 12)
    xy, yz, xz = fixed_mul(x, y, 12), fixed_mul(y, z, 12), fixed_mul(x, z, 12)
    less = fixed_mix(xx, 1, yy, -1, 0, 0)
    out[4] = fixed_wrap(fixed_mix(xy, _XY, 0, 0, 0, 13), BASIS_BITS)
    out[5] = fixed_wrap(fixed_mix(yz, -_XY, 0, 0, 0, 13), BASIS_BITS)
    out[7] = fixed_wrap(fixed_mix(xz, -_XY, 0, 0, 0, 13), BASIS_BITS)
    out[6] = fixed_wrap(fixed_mix(zz, 3 * _ZZ, 0, 0, -one * _ZZ, 13), BASIS_BITS)  # 2 zz - xx - yy, the direction having length 1
    out[8] = fixed_wrap(fixed_mix(less, _DIFFERENCE, 0, 0, 0, 13), BASIS_BITS)
    if degree < 3:
        return
    # Halves of what x, y and z are multiplied by: below 1.
    ends = fixed_mix(zz, 5, 0, 0, -one, 0)  # 4 zz - xx - yy
    five = fixed_mix(ends, _FIVE, 0, 0, 0, 13)
    out[9] = fixed_wrap(fixed_mul(y, fixed_mix(fixed_mix(xx, 3, yy, -1, 0, 0), _CUBE, 0, 0, 0, 13), 12), BASIS_BITS)
    out[10] = fixed_wrap(fixed_mul(z, fixed_mix(xy, _XYZ, 0, 0, 0, 13), 12), BASIS_BITS)
    out[11] = fixed_wrap(fixed_mul(y, five, 12), BASIS_BITS)
    out[12] = fixed_wrap(fixed_mul(z, fixed_mix(zz, 5 * _Z_FIVE, 0, 0, -3 * one * _Z_FIVE, 13), 12), BASIS_BITS)  # 2 zz - 3 xx - 3 yy
    out[13] = fixed_wrap(fixed_mul(x, five, 12), BASIS_BITS)
    out[14] = fixed_wrap(fixed_mul(z, fixed_mix(less, _Z_DIFFERENCE, 0, 0, 0, 13), 12), BASIS_BITS)
    out[15] = fixed_wrap(fixed_mul(x, fixed_mix(fixed_mix(xx, 1, yy, -3, 0, 0), _CUBE, 0, 0, 0, 13), 12), BASIS_BITS)


@numba.njit
def half_coefficient(value):
    """A coefficient that was FP16: to the nearest, ties away from 0, saturated."""
    top = (1 << (COEFFICIENT_BITS - 1)) - 1
    magnitude = min(np.int64(np.floor(abs(value) * (1 << COEFFICIENT_FRACTION) + 0.5)), top)
    return -magnitude if value < 0.0 else magnitude


@numba.njit
def product(basis, coefficient):
    """Basis times coefficient, both whole numbers."""
    return fixed_mul(basis, coefficient, PRODUCT_DROP)


@numba.njit
def group_sums(basis, coefficient):
    """Of four products the sum of the first three, and the fourth, which may be of another degree."""
    return (
        fixed_sum(product(basis[0], coefficient[0]), product(basis[1], coefficient[1]), product(basis[2], coefficient[2])),
        product(basis[3], coefficient[3]),
    )


@numba.njit
def term(sum_, step, M):
    """What a degree adds to a channel: step times the sum of the degree. step: ff (M bits), 2^-11 where coefficients were FP16."""
    return ff_to_fixed_round(ff_mul(step, ff_from_fixed(sum_, SUM_FRACTION, M), M), TERM_FRACTION, TERM_BITS)


@numba.njit
def constant_part(low, step, code, M):
    """low + step code; low: whole number, 13 fraction bits; step, code: ff (M bits)."""
    return low + ff_to_fixed_round(ff_mul(step, code, M), TERM_FRACTION, TERM_BITS)


@numba.njit
def colour_code(total):
    """Colour as a record has it, not limited, from the sum of all terms: not negative, to the nearest, ties upwards."""
    return max((total + (1 << (TERM_FRACTION - COLOUR_FRACTION - 1))) >> (TERM_FRACTION - COLOUR_FRACTION), 0)
