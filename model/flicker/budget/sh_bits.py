"""Bits of SH codes by cluster for a stated loss, as `flicker pack --sh-bits auto` chooses them (docs/reference/memory_image.md).

Fewer bits spare bytes of every frame that shows a cluster and cost squared error of its pictures, which adds up over clusters, since codes are rounded
independently. Along the lower hull of error over bytes, cluster by cluster, what is cheapest by byte goes first. Pictures decide at the end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..fit.parameters import Parameters
from ..fit.render import render
from ..progress import Steps
from ..scene.camera import Camera
from ..scene.gaussians import Scene
from ..scene.packed import FULL_SH_BITS, SH_BITS, PackedFormat
from ..scene.packing import coded_sh
from .degrees import changes

WIDEST = 1280  # pixels of the pictures that decide
_TIGHTER = 0.9  # of the error that is aimed at, where the pictures lost more than is allowed
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Choice:
    """bits: int64 (C,), of each cluster. decibels: PSNR of the pictures with them to those with 8, over all views; infinite where nothing changes. views: how
    many they are."""

    bits: np.ndarray
    decibels: float
    views: int


def _narrowings(error: np.ndarray, bytes_: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cluster, column and added error of each step down the hulls, the cheapest by byte first. error, bytes_: float64 (C, bits), by `SH_BITS`."""
    cluster, column, added, slope = [], [], [], []
    for k in range(len(error)):
        now = len(SH_BITS) - 1
        while now > 0:
            slopes = [max(error[k, c] - error[k, now], 0.0) / max(bytes_[k, now] - bytes_[k, c], 1e-12) for c in range(now)]
            best = int(np.argmin(slopes))
            cluster.append(k)
            column.append(best)
            added.append(max(error[k, best] - error[k, now], 0.0))
            slope.append(slopes[best])
            now = best
    order = np.argsort(slope, kind="stable")
    return np.array(cluster, np.int64)[order], np.array(column, np.int64)[order], np.array(added)[order]


def choose(scene: Scene, start: np.ndarray, cameras: Sequence[Camera], decibels: float, steps: Steps | None = None) -> Choice:
    """Bits of clusters that begin with Gaussians `start`, such that the cameras' pictures, no wider than `WIDEST`, are at least `decibels` from those with 8
    bits; 8 everywhere, where that is not found in `_ROUNDS` steps. Clusters that no camera sees keep 8."""
    steps = steps or Steps()
    cameras = [c if c.width <= WIDEST else c.resized(WIDEST, max(1, round(c.height * WIDEST / c.width))) for c in cameras]
    full = np.full(len(start), FULL_SH_BITS)
    sh, degrees = coded_sh(scene, start, full)
    base = Parameters.of(replace(scene, sh=sh))
    others = [coded_sh(scene, start, np.full(len(start), bits))[0] for bits in SH_BITS[:-1]]
    found = changes(base, others, cameras, steps)
    error = np.column_stack([np.add.reduceat(found.square, start), np.zeros(len(start))])
    reads = np.add.reduceat(found.views, start)
    strides = np.array([[PackedFormat.CHUNK.colour_stride(d, bits) for bits in SH_BITS] for d in range(4)])[degrees]
    seen = np.flatnonzero((reads > 0) & (degrees > 0))
    cluster, column, added = _narrowings(error[seen], (strides * reads[:, None])[seen].astype(np.float64))
    allowed = sum(3 * c.width * c.height for c in cameras) * 10.0 ** (-decibels / 10)
    pictures = [np.clip(render(base, camera).image, 0, 1) for camera in cameras]
    counts, aim = np.diff(np.append(start, len(scene))), allowed
    for _ in range(_ROUNDS):
        bits = full.copy()
        steps_down = np.searchsorted(np.cumsum(added), aim, side="right")
        bits[seen[cluster[:steps_down]]] = np.array(SH_BITS)[column[:steps_down]]  # of a cluster's steps the last one counts
        wide = np.repeat(bits, counts)
        chosen = sh.copy()
        for other, own in zip(others, SH_BITS):
            chosen[wide == own] = other[wide == own]
        drawn, lost = Parameters.of(replace(scene, sh=chosen)), 0.0
        with steps.bar("pictures") as report:
            for k, (camera, picture) in enumerate(zip(cameras, pictures)):
                report(k, len(cameras))
                lost += float(((np.clip(render(drawn, camera).image, 0, 1) - picture) ** 2).sum())
        if lost <= allowed:
            break
        aim *= _TIGHTER * allowed / lost
    else:
        bits, lost = full, 0.0
    return Choice(bits, -10 * math.log10(lost / allowed) + decibels if lost else math.inf, len(cameras))
