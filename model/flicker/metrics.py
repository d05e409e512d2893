"""Distance between pictures."""

from __future__ import annotations

import math

import numpy as np
from skimage.metrics import structural_similarity


def _pair(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if a.shape != b.shape:
        raise ValueError(f"pictures differ in shape: {a.shape} and {b.shape}")
    return np.clip(np.asarray(a, np.float64), 0.0, 1.0), np.clip(np.asarray(b, np.float64), 0.0, 1.0)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of two unquantised pictures, clamped to [0, 1]; inf when they are equal."""
    a, b = _pair(a, b)
    error = float(np.mean((a - b) ** 2))
    return math.inf if error == 0.0 else -10.0 * math.log10(error)


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Structural similarity of two pictures (H, W, 3), clamped to [0, 1].

    Wang et al. (2004): Gaussian window of sigma 1.5, population covariance; mean over pixels and channels.
    """
    a, b = _pair(a, b)
    return float(structural_similarity(
        a, b, data_range=1.0, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    ))
