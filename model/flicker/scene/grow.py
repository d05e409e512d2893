"""Scenes made larger without changing much how they look: to measure how time and memory grow with the number of Gaussians.

`grown` splits Gaussians along their longest axis. The halves of one lie `SHIFT` standard deviations to both sides and are narrower by sqrt(1 - SHIFT^2):
mean and covariance of both together are those of the whole. An opacity a of each half makes what a beam through the middle sees, 1 - (1 - a g)^2 with
g = exp(-SHIFT^2 / (2 (1 - SHIFT^2))), as opaque as `_MIDDLE` times the whole: with `_MIDDLE` the halves of a faint Gaussian hold together as much as it did.
`joined` puts scenes side by side, `with_degree` gives a scene harmonics up to a degree. What they return is of no file (`Scene.path`), so that nobody takes a
file's own chunks for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import FlickerError
from .clusters import reorder
from .gaussians import Scene

MOST = 1 << 24  # Gaussians: records of a frame have numbers of 24 bits
SHIFT = 0.5
_NARROW = math.sqrt(1.0 - SHIFT**2)
_EDGE = math.exp(-(SHIFT**2) / (2.0 * (1.0 - SHIFT**2)))
_MIDDLE = _EDGE / _NARROW
_HARMONIC = 1.0 / 16  # of a coefficient that is added: two of the steps of 8 bits
_SHARE = 1.0 / 32  # of the Gaussians that have one: nearly every cluster of 256 has such a Gaussian, so its colours take the bytes of the degree
_OUTER = 0.05  # share of the Gaussians at each end of an axis that do not count for a scene's width


def _axis(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """int64 (N,) longest axis of each Gaussian, and float64 (N, 3) its direction in the world."""
    longest = scene.scales.argmax(axis=1)
    q = scene.quats.astype(np.float64)
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    columns = np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1),
        np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1),
        np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1),
    ], axis=1)
    return longest, columns[np.arange(len(q)), longest]


def _split(scene: Scene, chosen: np.ndarray) -> Scene:
    """Each of the Gaussians `chosen`, int64 (n,), as two: one in its place, the other behind all."""
    part = reorder(scene, chosen)
    longest, direction = _axis(part)
    size = part.scales[np.arange(len(part)), longest].astype(np.float64)
    step = (SHIFT * size)[:, None] * direction
    scales, opacities, means = scene.scales.copy(), scene.opacities.copy(), scene.means.copy()
    scales[chosen, longest] = _NARROW * size
    seen = 1.0 - np.sqrt(1.0 - np.minimum(_MIDDLE * part.opacities.astype(np.float64), 1.0))
    opacities[chosen] = np.minimum(seen / _EDGE, part.opacities)
    means[chosen] = part.means - step
    both = lambda values, more: np.concatenate([values, more])  # noqa: E731
    return replace(
        scene, path=None, means=both(means, part.means + step), scales=both(scales, scales[chosen]), quats=both(scene.quats, part.quats),
        opacities=both(opacities, opacities[chosen]), sh=both(scene.sh, part.sh),
    )


def grown(scene: Scene, times: float, seed: int = 0) -> Scene:
    """A scene of `times` as many Gaussians, rounded; all are split in turns, those of the last turn chosen at random. FlickerError for times below 1, and for
    more than `MOST` Gaussians."""
    if not 1.0 <= times < math.inf:
        raise FlickerError(f"expected 1 or more, not {times:g}")
    count = round(times * len(scene))
    if count > MOST:
        raise FlickerError(f"{times:g} makes {count:,} Gaussians, at most {MOST:,}")
    rng = np.random.default_rng(seed)
    while (more := count - len(scene)) > 0:
        n = len(scene)
        scene = _split(scene, np.arange(n) if more >= n else np.sort(rng.permutation(n)[:more]))
    return scene


def with_degree(scene: Scene, degree: int, seed: int = 0) -> Scene:
    """The scene with spherical harmonics up to a degree, 0 to 3: cut, or with small ones that a few Gaussians, chosen at random, get. An image stores as much
    of each cluster as one of its Gaussians needs, so the colours then take as many bytes as those of a scene that was trained with that degree."""
    if not 0 <= degree <= 3:
        raise FlickerError(f"expected 0 to 3, not {degree}")
    if degree == scene.sh_degree:
        return scene
    count = (degree + 1) ** 2
    sh = scene.sh[:, :count].copy()
    if (more := count - sh.shape[1]) > 0:
        rng = np.random.default_rng(seed)
        chosen, size = rng.random(len(scene)) < _SHARE, (len(scene), more, 3)
        added = np.where(chosen[:, None, None], _HARMONIC * rng.choice((-1.0, 1.0), size), 0.0)
        sh = np.concatenate([sh, added.astype(sh.dtype)], axis=1)
    return replace(scene, path=None, sh=sh)


def joined(scenes: Sequence[Scene]) -> Scene:
    """Scenes side by side along the first axis of the world, from the first one on, which stays; the others are made as wide as it is. Widths are those of nine
    tenths of the Gaussians. Harmonics that one has not are 0; antialiased is what the first one is."""
    if (count := sum(map(len, scenes))) > MOST:
        raise FlickerError(f"scenes: {count:,} Gaussians together, at most {MOST:,}")
    first = scenes[0]
    ends = [np.quantile(s.means.astype(np.float64), (_OUTER, 0.5, 1 - _OUTER), axis=0) for s in scenes]
    widths = [float((e[2] - e[0]).max()) for e in ends]
    sh = np.zeros((count, max(s.sh.shape[1] for s in scenes), 3), np.float32)
    means, scales, at = [], [], 0
    for k, (scene, end, width) in enumerate(zip(scenes, ends, widths)):
        factor = widths[0] / width if k and width > 0.0 and widths[0] > 0.0 else 1.0
        place = ends[0][1] + [k * widths[0], 0.0, 0.0]
        means.append(scene.means if not k else (scene.means.astype(np.float64) - end[1]) * factor + place)
        scales.append(scene.scales * np.float32(factor))
        sh[at : at + len(scene), : scene.sh.shape[1]] = scene.sh
        at += len(scene)
    return replace(
        first, path=None, means=np.concatenate(means), scales=np.concatenate(scales), quats=np.concatenate([s.quats for s in scenes]),
        opacities=np.concatenate([s.opacities for s in scenes]), sh=sh,
    )
