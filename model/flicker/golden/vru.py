"""Volume rendering unit: one pixel-Gaussian pair, FP16 (docs/reference/rendering_core.md).

Rules of vanilla 3DGS: E < 0 (or NaN) is skipped, alpha is clamped to 0.99, alpha < 1/255 is skipped, and the splat that would
take the transmittance below 1e-4 is not blended but finishes the pixel. Order of operations, each rounded to FP16:

    dx = px - mean_x, dy = py - mean_y, E (weight.py)
    g = 2^-E or e^-E, alpha = min(o g, 0.99), oma = 1 - alpha
    T' = T oma;  T' < 1e-4: finished, else  w = T alpha, C += w c, T = T'
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np

from ..arithmetic.fp import FP16_R, add, mul, sub
from ..arithmetic.functions import exp_neg_f32
from ..params import ALPHA_MAX_BITS, ALPHA_MIN_BITS, TRANSMITTANCE_MIN_BITS, Form
from .weight import conic_axis, conic_pixel, factored_pixel, factored_row

CONIC = int(Form.CONIC)


def _constant(bits: int) -> np.float32:
    return np.float32(np.uint16(bits).view(np.float16))


ALPHA_MIN = _constant(ALPHA_MIN_BITS)
ALPHA_MAX = _constant(ALPHA_MAX_BITS)
TRANSMITTANCE_MIN = _constant(TRANSMITTANCE_MIN_BITS)


@numba.njit(forceinline=True)
def alpha_of(e, opacity, base2):
    """(g, alpha after the clamp) of a weight. A negative or NaN weight gives g = 0."""
    g = exp_neg_f32(e, base2)
    a = mul(opacity, g, FP16_R)
    return g, (ALPHA_MAX if a > ALPHA_MAX else a)


@numba.njit(forceinline=True)
def next_transmittance(t, alpha):
    """(1 - alpha, T (1 - alpha))."""
    oma = sub(np.float32(1.0), alpha, FP16_R)
    return oma, mul(t, oma, FP16_R)


@numba.njit(forceinline=True)
def blend(c, w, colour):
    """(w colour, C + w colour); a colour is not negative: its sign is ignored."""
    m = mul(w, abs(colour), FP16_R)
    return m, add(c, m, FP16_R)


PAIR_FIELDS = ("dx", "dy", "a0", "a1", "a2", "a3", "a4", "weight", "g", "alpha", "oma", "t_next", "w", "m_red", "m_green", "m_blue")
"""Intermediate values of a pair. a0..a4: conic (sx, sy, xy, t, h); factored (p, q, v, u, uu)."""


@numba.njit(cache=True)
def pair(px, py, f, form, state, out):
    """One pair: `f` nine FP16 values in float32, `state` float32[4] = T, red, green, blue; `out` takes PAIR_FIELDS.

    Returns 0 skipped, 1 blended (state updated), 2 the pixel is finished by this splat.
    """
    dx = sub(np.float32(px), f[0], FP16_R)
    dy = sub(np.float32(py), f[1], FP16_R)
    if form == CONIC:
        _, sx = conic_axis(dx, f[2], FP16_R)
        _, sy = conic_axis(dy, f[4], FP16_R)
        xy, t, h, e = conic_pixel(dx, dy, sx, sy, f[3], FP16_R)
        out[2], out[3], out[4], out[5], out[6] = sx, sy, xy, t, h
    else:
        p = mul(f[2], dx, FP16_R)
        q, v, vv = factored_row(dy, f[3], f[4], FP16_R)
        u, uu, e = factored_pixel(p, q, vv, FP16_R)
        out[2], out[3], out[4], out[5], out[6] = p, q, v, u, uu
    g, alpha = alpha_of(e, f[5], form != CONIC)
    oma, t_next = next_transmittance(state[0], alpha)
    w = mul(state[0], alpha, FP16_R)
    out[0], out[1], out[7], out[8], out[9], out[10], out[11], out[12] = dx, dy, e, g, alpha, oma, t_next, w
    if alpha < ALPHA_MIN:
        return 0
    if t_next < TRANSMITTANCE_MIN:
        return 2
    for k in range(3):
        # feature order: 6 = blue, 7 = green, 8 = red
        m, c = blend(state[1 + k], w, f[8 - k])
        out[13 + k] = m
        state[1 + k] = c
    state[0] = t_next
    return 1


@dataclass
class Pixels:
    """A set of pixels as a VRU or channel holds them: bit-true state, updated by `take`.

    `coords` (n, 2) are pixel columns and rows within the sub-tile.
    """

    coords: np.ndarray
    form: Form
    state: np.ndarray = field(init=False)
    finished: np.ndarray = field(init=False)
    trace: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start of a sub-tile: T = 1, black."""
        n = len(self.coords)
        self.state = np.zeros((n, 4), np.float32)
        self.state[:, 0] = 1.0
        self.finished = np.zeros(n, bool)
        self.trace = np.zeros((n, len(PAIR_FIELDS)), np.float32)

    def take(self, features: np.ndarray, pixel: int) -> int:
        """Blend one splat (nine FP16 bit patterns) into one pixel; returns what `pair` returns, 0 for finished pixels."""
        f = np.asarray(features, np.uint16).view(np.float16).astype(np.float32)
        state = self.state[pixel].copy()
        result = pair(*self.coords[pixel], f, int(self.form), state, self.trace[pixel])
        if self.finished[pixel]:
            return 0
        self.state[pixel] = state
        if result == 2:
            self.finished[pixel] = True
        return result

    def bits(self) -> np.ndarray:
        """uint16 (n, 4): transmittance, red, green, blue."""
        return self.state.astype(np.float16).view(np.uint16)
