"""The threshold of a splat's opacity, and the largest weight that the VRU's alpha test lets pass."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..params import Form
from .formats import FP16
from .functions import log_opacity

EPSILON = 2.0**-11  # unit roundoff of FP16


@cache
def thresholds(form: Form) -> np.ndarray:
    """float64 (65536,): log(255 o) of every FP16 opacity, rounded up to FP16, in the base of the form; what `flk_log_opacity` gives.

    Every weight with which the VRU's alpha test passes is below it: tested for all opacities and weights (tb/model/test_configurations.py).
    """
    return FP16.decode(log_opacity(np.arange(1 << 16).astype(np.uint16), form == Form.FACTORED, FP16))


@cache
def radii(form: Form) -> np.ndarray:
    """float64 (65536,): rho(o), which bounds sqrt(u^2 + v^2) of every pair that passes the VRU's alpha test, roundings included.

    u before its rounding, v of the exact difference (docs/reference/mask_bounds.md, what the VRU passes). 0 where the threshold is negative: no pair passes.
    """
    t = thresholds(form)
    return np.where(t > 0, np.sqrt(np.maximum(t, 0)) * (1 + 3.1 * EPSILON) + 2.0**-11, 0.0)
