"""Cluster test: which clusters can hold a visible Gaussian, and between which depths the kept ones lie.

With e = corner - position, the corner of the box that lies farthest along a normal: normal . e + offset + reach sigma > 0 for all five half-spaces
keeps the cluster.
Depth: the third row of the view over the nearest and the farthest corner. ff numbers of 23 mantissa bits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ...arithmetic.ff import ff_add, ff_mul, ff_sub, pick
from ...front.projection import NEAR
from ...scene.packed import PackedScene
from .setup import CLUSTER_M, KEY_BITS, MAX_KEY_SHIFT, FrameSetup, image_floats, rounded


@numba.njit
def _dot(n0, n1, n2, e0, e1, e2):
    M = CLUSTER_M
    return ff_add(ff_add(ff_mul(n0, e0, M), ff_mul(n1, e1, M), M), ff_mul(n2, e2, M), M)


@numba.njit
def test_cluster(low, high, sigma, position, normal, offset, reach):
    """(keep, nearest, farthest depth) of a cluster; all ff numbers of 23 bits."""
    M = CLUSTER_M
    l0, l1, l2 = ff_sub(low[0], position[0], M), ff_sub(low[1], position[1], M), ff_sub(low[2], position[2], M)
    h0, h1, h2 = ff_sub(high[0], position[0], M), ff_sub(high[1], position[1], M), ff_sub(high[2], position[2], M)
    outside = 0
    nearest = farthest = l0
    for k in range(5):
        n0, n1, n2 = normal[k, 0], normal[k, 1], normal[k, 2]
        most = _dot(n0, n1, n2, pick(n0 < 0.0, l0, h0), pick(n1 < 0.0, l1, h1), pick(n2 < 0.0, l2, h2))
        sum_ = ff_add(ff_add(most, offset[k], M), ff_mul(reach[k], sigma, M), M)
        outside = outside | (sum_ <= 0.0)
        if k == 0:
            nearest = _dot(n0, n1, n2, pick(n0 > 0.0, l0, h0), pick(n1 > 0.0, l1, h1), pick(n2 > 0.0, l2, h2))
            farthest = most
    return outside < 1, nearest, farthest


@numba.njit(cache=True)
def _cull(low, high, sigma, position, normal, offset, reach, keep, depth):
    for i in range(low.shape[0]):
        keep[i], depth[i, 0], depth[i, 1] = test_cluster(low[i], high[i], sigma[i], position, normal, offset, reach)


@dataclass(frozen=True, eq=False)
class Culled:
    """keep: bool (C,). nearest, farthest: ff (23 bits), depths that bound the kept clusters; nearest is at least 0.2.

    key_shift: a key step is 2^-key_shift. Key 0 is the depth `nearest`.
    """

    keep: np.ndarray
    nearest: float
    farthest: float
    key_shift: int


NEAR_FF = float(rounded(NEAR, CLUSTER_M))


def key_scale(nearest: float, farthest: float, bits: int = KEY_BITS) -> int:
    """Key shift: the finest step 2^-shift with which the depths from nearest to farthest have keys of `bits` bits, at most `MAX_KEY_SHIFT`.

    It is one less than the bits, less the exponent of the distance.
    """
    span = float(ff_sub(farthest, nearest, CLUSTER_M))
    return min(bits - int(np.frexp(span)[1]), MAX_KEY_SHIFT) if span > 0.0 else MAX_KEY_SHIFT


def cull(packed: PackedScene, setup: FrameSetup) -> Culled:
    """Test the clusters of a scene."""
    table, bits = packed.table, setup.formats.key
    low, high = image_floats(table["low"]), image_floats(table["high"])
    keep, depth = np.zeros(len(table), np.bool_), np.zeros((len(table), 2))
    _cull(low, high, image_floats(packed.sigma), setup.position, setup.normal, setup.offset, setup.reach, keep, depth)
    if not keep.any():
        return Culled(keep, NEAR_FF, NEAR_FF, key_scale(NEAR_FF, NEAR_FF, bits))
    nearest = max(float(depth[keep, 0].min()), NEAR_FF)
    farthest = max(float(depth[keep, 1].max()), nearest)
    return Culled(keep, nearest, farthest, key_scale(nearest, farthest, bits))

