"""Clusters ("big Gaussians"): groups of neighbouring Gaussians, culled against the view frustum before their members are
read.

Source of the idea: paper, Sec. IV-A, after Jo et al. How clusters are made is our choice: the scene is put into
Morton order of the means and cut into runs of equal size, which PlayCanvas' writer does too; a cluster is then a
contiguous piece of memory. `flicker.chip.cull` drops those that cannot be seen.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace

import numpy as np

from ..errors import FlickerError
from .gaussians import Scene
from .memory import CHUNK

_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Clusters:
    """C clusters of a scene in Morton order.

    size: Gaussians a cluster (the last may have fewer). start: int64 (C + 1,). low, high: float32 (C, 3), box of the means.
    centre: float32 (C, 3), radius: float32 (C,): sphere around the means. sigma: float32 (C,), largest standard deviation.
    """

    size: int
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    sigma: np.ndarray

    def __len__(self) -> int:
        return len(self.sigma)

    def members(self, keep: np.ndarray) -> np.ndarray:
        """Numbers of the Gaussians in the kept clusters (bool (C,)), ascending."""
        return np.flatnonzero(np.repeat(keep, np.diff(self.start)))


def morton_order(means: np.ndarray) -> np.ndarray:
    """int64 (N,): order of the Gaussians along a Morton curve, 21 bits an axis; equal codes keep their order."""
    means = np.asarray(means, np.float64)
    low = means.min(axis=0)
    extent = np.maximum(means.max(axis=0) - low, np.finfo(np.float64).tiny)
    cell = np.minimum((means - low) / extent * 2.0**21, 2.0**21 - 1).astype(np.uint64)
    code = np.zeros(len(means), np.uint64)
    for axis in range(3):
        x = cell[:, axis]
        for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3),
                            (2, 0x1249249249249249)):
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return np.argsort(code, kind="stable")


def reorder(scene: Scene, order: np.ndarray) -> Scene:
    """The scene with its Gaussians in another order."""
    return replace(scene, means=scene.means[order], scales=scene.scales[order], quats=scene.quats[order],
                   opacities=scene.opacities[order], sh=scene.sh[order])


def build_clusters(scene: Scene, size: int = CHUNK) -> tuple[Scene, Clusters]:
    """The scene in Morton order and its clusters."""
    if size < 1:
        raise FlickerError(f"clusters: size must be at least 1, not {size}")
    scene = reorder(scene, morton_order(scene.means))
    start = np.append(np.arange(0, len(scene), size), len(scene))
    low = np.minimum.reduceat(scene.means, start[:-1])
    high = np.maximum.reduceat(scene.means, start[:-1])
    sigma = np.maximum.reduceat(scene.scales.max(axis=1), start[:-1])
    centre = ((low.astype(np.float64) + high) / 2).astype(np.float32)
    away = scene.means.astype(np.float64) - np.repeat(centre, np.diff(start), axis=0)
    reach = np.maximum.reduceat(np.sqrt((away**2).sum(axis=1)), start[:-1])
    radius = np.nextafter((reach * (1 + _ROUNDING)).astype(np.float32), np.float32(np.inf))
    return scene, Clusters(size, start, low, high, centre, radius, sigma)


def cut_clusters(means: np.ndarray, start: np.ndarray, spare: int, codes: tuple[int, ...], cluster_bytes: int, slot_bytes: int, slots: int) -> np.ndarray:
    """int64 (C',): first Gaussians of clusters cut further where that makes steps of positions finer for the fewest bytes, `spare` bytes at most.

    means: (N, 3), in order. start: int64 (C,), first Gaussians. codes: steps across a box, by axis. A cut costs cluster_bytes, and slot_bytes for each slot
    that is lost because clusters take slots by the multiple of `slots`.

    What a cluster costs the picture is taken as the sum over its Gaussians of the squared steps divided by the squared distance from the middle of the
    scene (its median, and no nearer than half of all are): a step is the smaller on the screen the farther off it lies. The cut that gains most a byte
    comes first.
    """
    means = means.astype(np.float64)
    away = np.linalg.norm(means - np.median(means, axis=0), axis=1)
    weight = 1.0 / np.maximum(away, float(np.median(away)) or float(away.max()) or 1.0) ** 2
    per_axis = 1.0 / np.array(codes, np.float64) ** 2

    def best(first: int, end: int) -> tuple[float, int, int, int, int] | None:
        """Minus the gain a byte, first and end, the cut and its bytes."""
        n = end - first
        if n < 2:
            return None
        m = means[first:end]
        total = np.cumsum(weight[first:end])
        left = np.maximum.accumulate(m) - np.minimum.accumulate(m)
        right = (np.maximum.accumulate(m[::-1]) - np.minimum.accumulate(m[::-1]))[::-1]
        kept = left[:-1] ** 2 @ per_axis * total[:-1] + right[1:] ** 2 @ per_axis * (total[-1] - total[:-1])
        k = np.arange(1, n)
        lost = (-(-k // slots) - -(n - k) // slots + -n // slots) * slots
        price = cluster_bytes + slot_bytes * lost
        gain = (left[-1] ** 2 @ per_axis * total[-1] - kept) / price
        i = int(np.argmax(gain))
        return (-float(gain[i]), first, end, first + i + 1, int(price[i])) if gain[i] > 0 else None

    found = [best(first, end) for first, end in zip(start.tolist(), [*start[1:].tolist(), len(means)])]
    heap = [entry for entry in found if entry is not None]
    heapq.heapify(heap)
    cuts = []
    while heap:
        _, first, end, at, price = heapq.heappop(heap)
        if price > spare:
            continue
        spare -= price
        cuts.append(at)
        for part in (best(first, at), best(at, end)):
            if part is not None:
                heapq.heappush(heap, part)
    return np.sort(np.concatenate([start, np.array(cuts, np.int64)]))
