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
from .setup import FORMATS, FrontFormats, rounded

# Bits of the default formats; functions take those of others as their last arguments.
DIRECTION_FRACTION = FORMATS.direction  # of a component, saturated below 1: 4095/4096
BASIS_FRACTION = FORMATS.harmonics  # all functions lie between -1 and 1
COEFFICIENT_FRACTION = FORMATS.coefficient  # of a coefficient that was FP16
COEFFICIENT_INTEGER = 3  # of one, with its sign, saturated: 4
COEFFICIENT_BITS = COEFFICIENT_INTEGER + COEFFICIENT_FRACTION
SUM_FRACTION = FORMATS.sums  # of the sum of a degree, in units of its coefficients
PRODUCT_DROP = BASIS_FRACTION - SUM_FRACTION  # fraction bits that are rounded off a product
TERM_FRACTION = FORMATS.term  # of what is added to a colour
TERM_INTEGER = 7  # of one term, with its sign, saturated: 64
TERM_BITS = TERM_INTEGER + TERM_FRACTION
COLOUR_FRACTION = 9  # of a record's colour
COLOUR_LIMIT = 1023


_FACTOR_FRACTION = 12  # of the factors of the spherical harmonics


def _constant(value: float) -> int:
    """A factor of the spherical harmonics."""
    return round(value * (1 << _FACTOR_FRACTION))


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
def basis_functions(d0, d1, d2, degree, out, M, direction=DIRECTION_FRACTION, harmonics=BASIS_FRACTION):
    """Spherical harmonics 1 to (degree + 1)^2 - 1 in the direction d, ff (M bits), into out (16,): whole numbers, `harmonics` (11) fraction bits.

    Where the square of d is 0 or saturated they are wrong, but within their bits.
    """
    one, bits, drop = 1 << direction, harmonics + 1, direction + _FACTOR_FRACTION - harmonics
    rn = ff_rsqrt(_dot(d0, d1, d2, M), M)
    x = ff_to_fixed_round(ff_mul(d0, rn, M), direction, direction + 1)
    y = ff_to_fixed_round(ff_mul(d1, rn, M), direction, direction + 1)
    z = ff_to_fixed_round(ff_mul(d2, rn, M), direction, direction + 1)
    out[1] = fixed_wrap(fixed_mix(y, -_DEGREE_1, 0, 0, 0, drop), bits)
    out[2] = fixed_wrap(fixed_mix(z, _DEGREE_1, 0, 0, 0, drop), bits)
    out[3] = fixed_wrap(fixed_mix(x, -_DEGREE_1, 0, 0, 0, drop), bits)
    if degree < 2:
        return
    xx, yy, zz = fixed_mul(x, x, direction), fixed_mul(y, y, direction), fixed_mul(z, z, direction)
    xy, yz, xz = fixed_mul(x, y, direction), fixed_mul(y, z, direction), fixed_mul(x, z, direction)
    less = fixed_mix(xx, 1, yy, -1, 0, 0)
    out[4] = fixed_wrap(fixed_mix(xy, _XY, 0, 0, 0, drop), bits)
    out[5] = fixed_wrap(fixed_mix(yz, -_XY, 0, 0, 0, drop), bits)
    out[7] = fixed_wrap(fixed_mix(xz, -_XY, 0, 0, 0, drop), bits)
    out[6] = fixed_wrap(fixed_mix(zz, 3 * _ZZ, 0, 0, -one * _ZZ, drop), bits)  # 2 zz - xx - yy, the direction having length 1
    out[8] = fixed_wrap(fixed_mix(less, _DIFFERENCE, 0, 0, 0, drop), bits)
    if degree < 3:
        return
    # Halves of what x, y and z are multiplied by: below 1.
    ends = fixed_mix(zz, 5, 0, 0, -one, 0)  # 4 zz - xx - yy
    five = fixed_mix(ends, _FIVE, 0, 0, 0, drop)
    out[9] = fixed_wrap(fixed_mul(y, fixed_mix(fixed_mix(xx, 3, yy, -1, 0, 0), _CUBE, 0, 0, 0, drop), direction), bits)
    out[10] = fixed_wrap(fixed_mul(z, fixed_mix(xy, _XYZ, 0, 0, 0, drop), direction), bits)
    out[11] = fixed_wrap(fixed_mul(y, five, direction), bits)
    out[12] = fixed_wrap(fixed_mul(z, fixed_mix(zz, 5 * _Z_FIVE, 0, 0, -3 * one * _Z_FIVE, drop), direction), bits)  # 2 zz - 3 xx - 3 yy
    out[13] = fixed_wrap(fixed_mul(x, five, direction), bits)
    out[14] = fixed_wrap(fixed_mul(z, fixed_mix(less, _Z_DIFFERENCE, 0, 0, 0, drop), direction), bits)
    out[15] = fixed_wrap(fixed_mul(x, fixed_mix(fixed_mix(xx, 1, yy, -3, 0, 0), _CUBE, 0, 0, 0, drop), direction), bits)


@numba.njit
def half_coefficient(value, fraction=COEFFICIENT_FRACTION):
    """A coefficient that was FP16: to the nearest, ties away from 0, saturated."""
    top = (1 << (COEFFICIENT_INTEGER + fraction - 1)) - 1
    magnitude = min(np.int64(np.floor(abs(value) * (1 << fraction) + 0.5)), top)
    return -magnitude if value < 0.0 else magnitude


@numba.njit
def product(basis, coefficient, drop=PRODUCT_DROP):
    """Basis times coefficient, both whole numbers."""
    return fixed_mul(basis, coefficient, drop)


@numba.njit
def group_sums(basis, coefficient, drop=PRODUCT_DROP):
    """Of four products the sum of the first three, and the fourth, which may be of another degree."""
    return (
        fixed_sum(product(basis[0], coefficient[0], drop), product(basis[1], coefficient[1], drop), product(basis[2], coefficient[2], drop)),
        product(basis[3], coefficient[3], drop),
    )


@numba.njit
def term(sum_, step, M, sums=SUM_FRACTION, fraction=TERM_FRACTION):
    """What a degree adds to a channel: step times the sum of the degree. step: ff (M bits), 2^-11 where coefficients were FP16."""
    return ff_to_fixed_round(ff_mul(step, ff_from_fixed(sum_, sums, M), M), fraction, fraction + TERM_INTEGER)


@numba.njit
def constant_part(low, step, code, M, fraction=TERM_FRACTION):
    """low + step code; low: whole number, `fraction` (13) fraction bits; step, code: ff (M bits)."""
    return low + ff_to_fixed_round(ff_mul(step, code, M), fraction, fraction + TERM_INTEGER)


@numba.njit
def colour_code(total, fraction=TERM_FRACTION):
    """Colour as a record has it, not limited, from the sum of all terms: not negative, to the nearest, ties upwards."""
    return max((total + (1 << (fraction - COLOUR_FRACTION - 1))) >> (fraction - COLOUR_FRACTION), 0)
