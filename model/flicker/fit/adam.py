"""Adam (Kingma and Ba 2015) on the Gaussians that a view shows."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-15


@numba.njit(error_model="numpy", cache=True)
def _row(k, values, first, second, index, gradient, rate, scale_1, scale_2, refused):
    i = index[k]
    total = np.float32(0.0)
    for j in range(values.shape[1]):
        total += abs(gradient[k, j]) + abs(values[i, j])
    refused[k] = not np.isfinite(total)
    if refused[k]:
        return
    for j in range(values.shape[1]):
        g = gradient[k, j]
        m = np.float32(BETA_1) * first[i, j] + np.float32(1.0 - BETA_1) * g
        v = np.float32(BETA_2) * second[i, j] + np.float32(1.0 - BETA_2) * g * g
        first[i, j] = m
        second[i, j] = v
        values[i, j] -= rate[j] * (m * scale_1) / (np.sqrt(v * scale_2) + np.float32(EPSILON))


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _step(values, first, second, index, gradient, rate, scale_1, scale_2, refused):
    for k in numba.prange(len(index)):
        _row(np.int64(k), values, first, second, index, gradient, rate, scale_1, scale_2, refused)


@dataclass(eq=False)
class Adam:
    """Moments of parameters, float32 (N, P) as they are, and the number of steps."""

    first: np.ndarray
    second: np.ndarray
    steps: int = 0

    @classmethod
    def of(cls, values: np.ndarray) -> Adam:
        return cls(np.zeros_like(values), np.zeros_like(values))

    def step(self, values: np.ndarray, index: np.ndarray, gradient: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Move the rows `index` (M,) of values against their gradient (M, P), at rates (P,). Rows with a number that is not finite stay: bool (M,), those."""
        self.steps += 1
        scale_1, scale_2 = (np.float32(1.0 / (1.0 - beta**self.steps)) for beta in (BETA_1, BETA_2))
        refused = np.empty(len(index), np.bool_)
        _step(values, self.first, self.second, index, gradient, rate.astype(np.float32), scale_1, scale_2, refused)
        return refused

    def select(self, keep: np.ndarray, new: int) -> None:
        """Keep the rows `keep` (indices), and add `new` fresh ones behind them."""
        fresh = np.zeros((new, self.first.shape[1]), np.float32)
        self.first, self.second = np.concatenate([self.first[keep], fresh]), np.concatenate([self.second[keep], fresh])
