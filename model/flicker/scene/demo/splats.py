"""Building blocks of the demo scene: exact random numbers, surface sampling, and the list of splats.

Author coordinates: x right, y away from the hero camera, z up; one unit is about a decimetre.
Random numbers and noise come from an integer hash, so that they are the same on every machine and
with every version of numpy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def hash64(x: np.ndarray) -> np.ndarray:
    """SplitMix64 finaliser of an array of uint64."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


class Rand:
    """Counter-based random numbers (SplitMix64)."""

    def __init__(self, seed: int) -> None:
        self._next = np.array([seed % 2**64], np.uint64) * np.uint64(0xD1342543DE82EF95)

    def uniform(self, *shape: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
        """Uniform float64 in [low, high)."""
        count = int(np.prod(shape, dtype=np.int64))
        x = self._next + _GOLDEN * np.arange(1, count + 1, dtype=np.uint64)
        self._next = self._next + _GOLDEN * np.array([count], np.uint64)
        bits = (hash64(x) >> np.uint64(11)).astype(np.float64)
        return (low + (high - low) * (bits * 2.0**-53)).reshape(shape)

    def normal(self, *shape: int) -> np.ndarray:
        """Bell-shaped, mean 0, variance 1, within +-3.5 (sum of four uniforms)."""
        return (self.uniform(4, *shape).sum(axis=0) - 2.0) * 3.0**0.5


def noise(x: np.ndarray, y: np.ndarray, z: np.ndarray | float = 0.0, salt: int = 0) -> np.ndarray:
    """Smooth value noise in [-1, 1] with lattice spacing 1."""
    x, y, z = np.broadcast_arrays(x, y, z)
    base = [np.floor(c) for c in (x, y, z)]
    frac = [c - b for c, b in zip((x, y, z), base, strict=True)]
    frac = [f * f * (3.0 - 2.0 * f) for f in frac]
    cell = [b.astype(np.int64).astype(np.uint64) for b in base]
    total = np.zeros(x.shape)
    for corner in range(8):
        key = np.full(x.shape, (salt * 0x632BE59BD9B4E019) % 2**64, np.uint64)
        weight = np.ones(x.shape)
        for axis in range(3):
            bit = corner >> axis & 1
            key = hash64(key + (cell[axis] + np.uint64(bit)) * _GOLDEN)
            weight = weight * (frac[axis] if bit else 1.0 - frac[axis])
        total += weight * ((key >> np.uint64(11)).astype(np.float64) * 2.0**-52 - 1.0)
    return total


def fbm(x: np.ndarray, y: np.ndarray, z: np.ndarray | float = 0.0, octaves: int = 3, salt: int = 0) -> np.ndarray:
    """Sum of `octaves` of noise, each half as strong and twice as fine as the one before."""
    return sum(0.5**k * noise(x * 2.0**k, y * 2.0**k, z * 2.0**k, salt + k) for k in range(octaves))


def step(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """Smooth step from 0 at `low` to 1 at `high` (which may be below `low`)."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def mix(a: np.ndarray | tuple, b: np.ndarray | tuple, t: np.ndarray) -> np.ndarray:
    """Colours a (t = 0) to b (t = 1); t has shape (N,)."""
    t = np.asarray(t)[..., None]
    return np.asarray(a) * (1.0 - t) + np.asarray(b) * t


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Inner products along the last axis, without a sum whose order may vary."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def unit(v: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) scaled to length 1."""
    return v / np.sqrt(np.maximum(dot(v, v), 1e-24))[..., None]


def srgb(hexadecimal: str) -> np.ndarray:
    """Linear colour (3,) of an sRGB triple written as 'rrggbb'."""
    value = np.array([int(hexadecimal[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def frame(axis: np.ndarray, hint: tuple = (0.0, 0.0, 1.0)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right-handed orthonormal (x, y, axis) around a direction (3,)."""
    axis = unit(np.asarray(axis, float))
    x = np.cross(np.asarray(hint, float), axis)
    if dot(x, x) < 1e-6:
        x = np.cross((1.0, 0.0, 0.0), axis)
    x = unit(x)
    return x, np.cross(axis, x), axis


def bezier(points: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic Bezier curve: positions and unit tangents at t, control points (3, 3)."""
    a, b, c = np.asarray(points, float)
    t = t[:, None]
    position = (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c
    return position, unit(2 * (1 - t) * (b - a) + 2 * t * (c - b))


@dataclass
class Patch:
    """Samples of a surface: parameters (N, 2), points, unit normals, partial derivatives (N, 3)."""

    uv: np.ndarray
    p: np.ndarray
    n: np.ndarray
    du: np.ndarray
    dv: np.ndarray

    def gradient(self, fun: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (N,) to the zero line of `fun(uv)` and the unit tangent (N, 3) along it."""
        eps = 1e-4
        value = fun(self.uv)
        fu = (fun(self.uv + [eps, 0.0]) - fun(self.uv - [eps, 0.0])) / (2 * eps)
        fv = (fun(self.uv + [0.0, eps]) - fun(self.uv - [0.0, eps])) / (2 * eps)
        e, f, g = dot(self.du, self.du), dot(self.du, self.dv), dot(self.dv, self.dv)
        det = np.maximum(e * g - f * f, 1e-12)
        grad = ((g * fu - f * fv) / det)[:, None] * self.du + ((e * fv - f * fu) / det)[:, None] * self.dv
        length = np.sqrt(np.maximum(dot(grad, grad), 1e-12))
        return value / length, unit(np.cross(self.n, grad))

    def take(self, keep: np.ndarray) -> Patch:
        """The chosen samples."""
        return Patch(self.uv[keep], self.p[keep], self.n[keep], self.du[keep], self.dv[keep])


def sample(
    surface: Callable[[np.ndarray], np.ndarray],
    count: int,
    rand: Rand,
    weight: Callable[[Patch], np.ndarray] | None = None,
) -> Patch:
    """About `count` even samples of a parametric surface over the unit square.

    `surface` maps parameters (N, 2) to points (N, 3). Candidates are a Kronecker sequence thinned
    by area times `weight`.
    """
    pilot = _lattice(surface, 400, rand)
    density = _density(pilot, weight)
    top = float(np.max(density)) * 1.05
    candidates = _lattice(surface, int(count * top / max(float(np.mean(density)), 1e-12)) + 1, rand)
    return candidates.take(rand.uniform(len(candidates.p)) * top < _density(candidates, weight))


def _density(patch: Patch, weight: Callable[[Patch], np.ndarray] | None) -> np.ndarray:
    area = np.cross(patch.du, patch.dv)
    area = np.sqrt(dot(area, area))
    return area if weight is None else area * weight(patch)


def _lattice(surface: Callable[[np.ndarray], np.ndarray], count: int, rand: Rand) -> Patch:
    index = np.arange(count, dtype=np.float64)[:, None]
    jitter = rand.uniform(count, 2, low=-0.35, high=0.35) / max(count, 1) ** 0.5
    uv = np.mod(rand.uniform(1, 2) + jitter + index * [0.7548776662466927, 0.5698402909980532], 1.0)
    eps = 1e-4
    du = (surface(uv + [eps, 0.0]) - surface(uv - [eps, 0.0])) / (2 * eps)
    dv = (surface(uv + [0.0, eps]) - surface(uv - [0.0, eps])) / (2 * eps)
    return Patch(uv, surface(uv), unit(np.cross(du, dv)), du, dv)


@dataclass
class Splats:
    """A growing list of splats with their materials (author coordinates, linear colours)."""

    parts: list[dict[str, np.ndarray]] = field(default_factory=list)

    def add(
        self,
        p: np.ndarray,
        n: np.ndarray,
        t: np.ndarray,
        size: tuple,
        albedo: np.ndarray,
        opacity: np.ndarray | float,
        gloss: np.ndarray | float = 0.0,
        sharp: float = 40.0,
        metal: float = 0.0,
        through: np.ndarray | float = 0.0,
        glow: np.ndarray | float = 0.0,
        casts: bool = True,
    ) -> None:
        """Append N splats.

        `p` centres (N, 3); `n` normals and `t` long axes (N, 3) or (3,); `size` sigmas along the long
        axis, across it and along the normal; `gloss` and `sharp` strength and exponent of the highlight;
        `metal` tints it; `through` is the light that comes through a thin leaf; `glow` is light of its own.
        """
        count = len(p)
        if count == 0:
            return
        n = unit(np.broadcast_to(np.asarray(n, float), (count, 3)))
        t = np.broadcast_to(np.asarray(t, float), (count, 3))
        t = unit(t - dot(t, n)[:, None] * n)

        def full(x: np.ndarray | float) -> np.ndarray:
            return np.broadcast_to(np.asarray(x, float), (count,))

        def colour(x: np.ndarray | float) -> np.ndarray:
            return np.broadcast_to(np.asarray(x, float), (count, 3))

        self.parts.append({
            "p": np.asarray(p, float), "n": n, "t": t,
            "size": np.stack([full(s) for s in size], axis=1),
            "albedo": np.clip(colour(albedo), 0.0, 1.0), "glow": colour(glow), "opacity": full(opacity),
            "gloss": full(gloss), "sharp": full(sharp), "metal": full(metal), "through": full(through),
            "casts": np.full(count, casts),
        })

    def merged(self) -> dict[str, np.ndarray]:
        """All splats as one set of arrays."""
        return {key: np.concatenate([part[key] for part in self.parts]) for key in self.parts[0]}


def spread(rand: Rand, count: int, low: np.ndarray | float = 0.06, high: float = 1.0) -> np.ndarray:
    """Opacities of detail splats: uniform with a peak at the upper end, as in trained scenes."""
    u = rand.uniform(2, count)
    return np.where(u[0] < 0.22, high - 0.12 * u[1], low + (high - low) * u[1])
