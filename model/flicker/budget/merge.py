"""Merging of near-equal neighbours: two Gaussians become one with the moments of both (Runnalls 2007, "Kullback-Leibler approach to Gaussian mixture
reduction").

A Gaussian counts by opacity times the area of its broadest side, product of its two largest standard deviations. What a pair loses is Runnalls' bound, half the
difference of the logarithms of the determinants, in nats of the pair's weight, plus the square of how many `COLOUR` their colours differ by, root mean square
over all directions. Two at one place add up as they are blended, 1 - (1 - a)(1 - b); the opacity of one that is wider than its parts falls as its area grows.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation
from scipy.special import expit, log_expit

from ..fit.parameters import LOGIT, MEAN, QUAT, SCALE, SH
from ..progress import Steps
from ..scene.gaussians import logits

NEIGHBOURS = 8  # nearest by mean, of which each Gaussian's partner is one
COLOUR = 0.1  # difference of colours that is as much as a nat
_MOST_ROUNDS = 10
_FEWEST = 0.001  # of the Gaussians, merged in a round: fewer end it
_LEAST_OPACITY = 2.0**-40  # has a finite logit


def _matrices(values: np.ndarray) -> np.ndarray:
    """Covariances, float64 (N, 3, 3)."""
    axes = Rotation.from_quat(values[:, QUAT:LOGIT].astype(np.float64), scalar_first=True).as_matrix() * np.exp(values[:, None, SCALE:QUAT].astype(np.float64))
    return axes @ axes.transpose(0, 2, 1)


def _areas(log_scales: np.ndarray) -> np.ndarray:
    """Logarithms, float64 (N,): of the two largest standard deviations' product."""
    return np.sort(log_scales.astype(np.float64), axis=1)[:, 1:].sum(axis=1)


def _weights(rows: np.ndarray) -> np.ndarray:
    """Logarithms, float64 (N,): opacity times area."""
    return log_expit(rows[:, LOGIT].astype(np.float64)) + _areas(rows[:, SCALE:QUAT])


def _moments(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share of the first in the weight (M,), mean (M, 3) and covariance (M, 3, 3) of pairs of rows of parameters."""
    share = expit(_weights(a) - _weights(b))
    apart = b[:, MEAN:SCALE].astype(np.float64) - a[:, MEAN:SCALE]
    mean = a[:, MEAN:SCALE] + (1.0 - share)[:, None] * apart
    s = share[:, None, None]
    return share, mean, s * _matrices(a) + (1.0 - s) * _matrices(b) + s * (1.0 - s) * apart[:, :, None] * apart[:, None, :]


def loss(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """float64 (M,): what pairs of rows of parameters lose as one. 0: they are equal but for their opacities."""
    share, _, covariance = _moments(a, b)
    sign, wide = np.linalg.slogdet(covariance)
    wide[sign <= 0] = np.inf  # flatter than float64 can tell
    apart = 0.5 * wide - share * a[:, SCALE:QUAT].astype(np.float64).sum(axis=1) - (1.0 - share) * b[:, SCALE:QUAT].astype(np.float64).sum(axis=1)
    colour = ((a[:, SH:].astype(np.float64) - b[:, SH:]) ** 2).sum(axis=1) / (3 * 4 * np.pi)  # spherical harmonics are orthonormal
    return np.maximum(apart, 0.0) + colour / COLOUR**2


def united(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """float32 (M, P): one row for each pair of rows of parameters."""
    share, mean, covariance = _moments(a, b)
    squares, axes = np.linalg.eigh(covariance)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    out = (share[:, None] * a + (1.0 - share)[:, None] * b).astype(np.float32)  # colours
    out[:, MEAN:SCALE], out[:, SCALE:QUAT] = mean, 0.5 * np.log(np.maximum(squares, np.finfo(np.float32).tiny))
    out[:, QUAT:LOGIT] = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    area = _areas(out[:, SCALE:QUAT])
    left = [1.0 - np.exp(np.minimum(_weights(of) - area, 0.0)) for of in (a, b)]
    out[:, LOGIT] = logits(np.maximum(1.0 - left[0] * left[1], _LEAST_OPACITY))
    return out


def merge(values: np.ndarray, limit: float, steps: Steps | None = None) -> np.ndarray:
    """float32 (n, P), n <= N: parameters (N, P) in which pairs that lose at most `limit` are one, again and again until hardly any is left. A Gaussian merges
    with the one of its nearest neighbours with which it loses least, if that one's choice is the same."""
    with (steps or Steps()).bar("merging") as report:
        for turn in range(_MOST_ROUNDS):
            n = len(values)
            if n < 2:
                break
            _, near = KDTree(values[:, MEAN:SCALE]).query(values[:, MEAN:SCALE], k=min(NEIGHBOURS + 1, n))
            best, partner = np.full(n, np.inf), np.full(n, -1)
            for k, other in enumerate(near.T):
                report(turn * len(near.T) + k, _MOST_ROUNDS * len(near.T))
                lost = loss(values, values[other])
                lost[other == np.arange(n)] = np.inf
                better = lost < best
                best[better], partner[better] = lost[better], other[better]
            first = np.flatnonzero((best <= limit) & (partner > np.arange(n)))
            first = first[partner[partner[first]] == first]
            values = values.copy()
            values[first] = united(values[first], values[partner[first]])
            values = np.delete(values, partner[first], axis=0)
            if len(first) < max(1, _FEWEST * n):
                break
    return values
