"""SH coefficients that say little: what the pictures would lose by fewer, Gaussian by Gaussian, and which clusters to take them from.

The chip's memory holds as many coefficients for all Gaussians of a cluster as one of them needs (docs/reference/memory_image.md), so cuts are made by
cluster. What is cut is replaced by its mean over the views, weighted by the squares of alpha T, in the constant term.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..fit.parameters import Parameters
from ..fit.render import Draw, render
from ..front.projection import colours
from ..progress import Steps
from ..scene.camera import Camera
from ..scene.clusters import morton_order
from ..scene.gaussians import SH_C0
from ..scene.packed import CLUSTER_LIMIT
from .score import COLUMNS, SQUARE, score_frame


@dataclass(eq=False)
class Changes:
    """What A other sets of SH coefficients change in pictures. square: float64 (N, A), of the pictures, squared; sum: float64 (N, A, 3), of colours, by weight;
    weight: float64 (N,), of squares of alpha T; views: int64 (N,), that show the Gaussian."""

    square: np.ndarray
    sum: np.ndarray
    weight: np.ndarray
    views: np.ndarray


def changes(
    parameters: Parameters, others: Sequence[np.ndarray], cameras: Sequence[Camera], steps: Steps | None = None, draw: Draw = render,
) -> Changes:
    """Gaussian by Gaussian, the others being as they are, in the cameras' pictures, made by `draw`. others: as `parameters.sh`."""
    n = len(parameters)
    found = Changes(np.zeros((n, len(others))), np.zeros((n, len(others), 3)), np.zeros(n), np.zeros(n, np.int64))
    with (steps or Steps()).bar("SH coefficients") as report:
        for k, camera in enumerate(cameras):
            report(k, len(cameras))
            frame = draw(parameters, camera)
            total, unused_tiles, unused_frames = np.zeros((n, COLUMNS)), np.zeros(n, np.int64), np.zeros(n, np.int64)
            score_frame(frame, total, unused_tiles, unused_frames)
            index = frame.index[total[frame.index, SQUARE] > 0]
            of = total[index, SQUARE]
            found.weight[index] += of
            found.views[index] += 1
            now, then = np.empty((2, len(index), 3))
            colours(parameters.means, parameters.sh, index, camera.position, now)
            for other, sh in enumerate(others):
                colours(parameters.means, sh, index, camera.position, then)
                change = now - then
                found.square[index, other] += of * (change**2).sum(axis=1)
                found.sum[index, other] += of[:, None] * change
    return found


@dataclass(eq=False)
class Losses:
    """Of N Gaussians and D smaller SH degrees 0 to D - 1. error: float64 (N, D), squared change of the pictures with no more than that degree; shift: float32
    (N, D, 3), what the constant coefficients then gain."""

    error: np.ndarray
    shift: np.ndarray


def losses(parameters: Parameters, cameras: Sequence[Camera], steps: Steps | None = None, draw: Draw = render) -> Losses:
    """What every Gaussian's degrees are worth in the cameras' pictures, made by `draw`, the others being as they are."""
    cut = [parameters.sh.copy() for _ in range(parameters.degree)]
    for degree, sh in enumerate(cut):
        sh[:, (degree + 1) ** 2 :] = 0.0
    found = changes(parameters, cut, cameras, steps, draw)
    mean = found.sum / np.maximum(found.weight, 1e-30)[:, None, None]
    error = np.maximum(found.square - (mean * found.sum).sum(axis=2), 0.0)
    return Losses(error, (mean / SH_C0).astype(np.float32))


@dataclass(eq=False)
class Cuts:
    """Cuts that could be made, M of them. members: Gaussians of the cluster. degree: int64 (M,), what stays. error: float64 (M,), squared change of the
    pictures beyond that of the cluster's cuts before it; bytes: float64 (M,), what it spares, likewise. Error by byte does not fall from a cluster's cut to its
    next."""

    members: list[np.ndarray]
    degree: np.ndarray
    error: np.ndarray
    bytes: np.ndarray


def cuts(parameters: Parameters, coefficients: np.ndarray, lost: Losses, seen: np.ndarray) -> Cuts:
    """By clusters of a Morton curve. coefficients: int64 (N,), of each Gaussian now. seen: float64 (N,), how often its coefficients are read."""
    order = morton_order(parameters.means)
    members, degree, error, bytes_ = [], [], [], []
    for begin in range(0, len(order), CLUSTER_LIMIT):
        here = order[begin : begin + CLUSTER_LIMIT]
        now = int(np.sqrt(coefficients[here].max())) - 1
        total = [*lost.error[here].sum(axis=0).tolist(), 0.0]
        size = [3.0 * float((seen[here] * (np.minimum(coefficients[here], (d + 1) ** 2) - 1)).sum()) for d in range(now + 1)]
        while now > 0:
            # Along the lower hull of error over bytes.
            slopes = [max(total[d] - (total[now] if now < len(total) - 1 else 0.0), 0.0) / max(size[now] - size[d], 1e-12) for d in range(now)]
            best = int(np.argmin(slopes))
            members.append(here)
            degree.append(best)
            bytes_.append(max(size[now] - size[best], 1e-12))
            error.append(slopes[best] * bytes_[-1])
            now = best
    return Cuts(members, np.array(degree, np.int64), np.array(error), np.array(bytes_))


def cut(parameters: Parameters, coefficients: np.ndarray, lost: Losses, found: Cuts, chosen: np.ndarray) -> None:
    """Make the cuts `chosen` (numbers, int64); parameters and coefficients change in place."""
    degree = np.sqrt(coefficients).astype(np.int64) - 1
    left = degree.copy()
    for k in chosen.tolist():
        left[found.members[k]] = np.minimum(left[found.members[k]], found.degree[k])
    less = np.flatnonzero(left < degree)
    parameters.sh[less, 0] += lost.shift[less, left[less]]
    coefficients[less] = (left[less] + 1) ** 2
    parameters.sh[np.arange(parameters.sh.shape[1]) >= coefficients[:, None]] = 0.0
