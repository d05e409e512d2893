"""Cluster test: which clusters can hold a visible Gaussian.

With e = corner - position, the corner of the box that lies farthest along a normal: normal . e + offset + reach sigma > 0 for all five half-spaces
keeps the cluster. ff numbers of 23 mantissa bits.
"""

from __future__ import annotations

import numba
import numpy as np

from ...arithmetic.ff import ff_add, ff_mul, ff_sub, pick
from ...scene.packed import PackedScene
from .setup import CLUSTER_M, FrameSetup, image_floats


@numba.njit
def _dot(n0, n1, n2, e0, e1, e2):
    M = CLUSTER_M
    return ff_add(ff_add(ff_mul(n0, e0, M), ff_mul(n1, e1, M), M), ff_mul(n2, e2, M), M)


@numba.njit
def test_cluster(low, high, sigma, position, normal, offset, reach):
    """Whether a cluster is kept; all arguments ff numbers of 23 bits."""
    M = CLUSTER_M
    l0, l1, l2 = ff_sub(low[0], position[0], M), ff_sub(low[1], position[1], M), ff_sub(low[2], position[2], M)
    h0, h1, h2 = ff_sub(high[0], position[0], M), ff_sub(high[1], position[1], M), ff_sub(high[2], position[2], M)
    outside = 0
    for k in range(5):
        n0, n1, n2 = normal[k, 0], normal[k, 1], normal[k, 2]
        most = _dot(n0, n1, n2, pick(n0 < 0.0, l0, h0), pick(n1 < 0.0, l1, h1), pick(n2 < 0.0, l2, h2))
        sum_ = ff_add(ff_add(most, offset[k], M), ff_mul(reach[k], sigma, M), M)
        outside = outside | (sum_ <= 0.0)
    return outside < 1


@numba.njit(cache=True)
def _cull(low, high, sigma, position, normal, offset, reach, keep):
    for i in range(low.shape[0]):
        keep[i] = test_cluster(low[i], high[i], sigma[i], position, normal, offset, reach)


def cull(packed: PackedScene, setup: FrameSetup) -> np.ndarray:
    """Clusters of a scene that are kept, bool (C,)."""
    table = packed.table
    keep = np.zeros(len(table), np.bool_)
    _cull(
        image_floats(table["low"]), image_floats(table["high"]), image_floats(packed.sigma), setup.position, setup.normal, setup.offset, setup.reach, keep,
    )
    return keep
