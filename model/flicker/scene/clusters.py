"""Clusters ("big Gaussians"): groups of neighbouring Gaussians, culled against the view frustum before their members are
read.

Source of the idea: paper, Sec. IV-A, after Jo et al. How clusters are made is our choice: the scene is put into
Morton order of the means and cut into runs of equal size, which PlayCanvas' writer does too; a cluster is then a
contiguous piece of memory. `flicker.chip.cull` drops those that cannot be seen.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, replace

import numpy as np

from ..errors import FlickerError
from .gaussians import Scene
from .memory import CHUNK

FAR = 32.0  # widths of the densest quarter of a scene: a Gaussian beyond is a flyaway
OWN = 8.0  # of scenes with flyaways: Gaussians beyond have clusters of their own
_SPREAD = 0.5
_CROWD = 16  # Gaussians of one code that are not told apart further
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


def _morton_codes(values: np.ndarray, low: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """uint64 (N,): codes of places (N, 3) in boxes, 21 bits an axis. low, extent: of each box, (3,) or (N, 3)."""
    cell = np.minimum((values - low) / np.maximum(extent, np.finfo(np.float64).tiny) * 2.0**21, 2.0**21 - 1).astype(np.uint64)
    code = np.zeros(len(values), np.uint64)
    for axis in range(3):
        x = cell[:, axis]
        for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3),
                            (2, 0x1249249249249249)):
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return code


def _curve(means: np.ndarray, places: np.ndarray) -> np.ndarray:
    """int64 (N,): order along a Morton curve through places (N, 3) made of the means; equal codes keep their order.

    Where more than `_CROWD` have one code, the curve goes on within the box of their means, as often as it takes.
    """
    low = places.min(axis=0)
    code = _morton_codes(places, low, places.max(axis=0) - low)
    order = np.argsort(code, kind="stable")
    group = np.concatenate([[0], np.cumsum(np.diff(code[order]) != 0)])  # ascending along the order
    while True:
        size = np.bincount(group)
        at = np.flatnonzero((size > _CROWD)[group])
        if not len(at):
            return order
        inside, crowd = means[order[at]], group[at]
        first = np.flatnonzero(np.diff(crowd, prepend=-1))
        counts = np.diff(np.append(first, len(at)))
        low, high = (np.repeat(f.reduceat(inside, first), counts, axis=0) for f in (np.minimum, np.maximum))
        code = _morton_codes(inside, low, high - low)
        along = np.lexsort((code, crowd))
        order[at] = order[at[along]]
        new = np.zeros(len(order), bool)
        new[at[1:]] = (np.diff(code[along]) != 0) & (np.diff(crowd) == 0)
        if not new.any():  # each crowd is at one place
            return order
        group = group + np.cumsum(new)


def _middle(means: np.ndarray) -> tuple[np.ndarray, float]:
    """Where most of a scene lies: centre (3,) and width of the shortest spans, an axis each, that hold a quarter of its Gaussians, the largest width of the
    three. Wider shares where a quarter is at one place; 0: all are. From a sample."""
    ordered = np.sort(means[:: 1 + len(means) // 65536], axis=0)
    for share in (0.25, 0.5, 0.75, 1.0):
        inside = min(int(share * len(ordered)), len(ordered) - 1)
        spans = ordered[inside:] - ordered[: len(ordered) - inside]
        first = spans.argmin(axis=0)
        if (width := float(spans.min(axis=0).max())) > 0:
            break
    return np.array([(ordered[k, axis] + ordered[k + inside, axis]) / 2 for axis, k in enumerate(first)]), width


def morton_order(means: np.ndarray) -> np.ndarray:
    """int64 (N,): order of the Gaussians along a Morton curve, those far away from most (`cluster_order`) last."""
    return cluster_order(means)[0]


def cluster_order(means: np.ndarray, size: int = CHUNK, widest: float = math.inf) -> tuple[np.ndarray, np.ndarray, int]:
    """Order of the Gaussians, int64 (N,), first Gaussians of the clusters in this order, int64 (C,), and how many Gaussians are not far away.

    Far away is a Gaussian whose distance along an axis from the middle of the scene is beyond `FAR` times the width of its densest quarter (`_middle`): a
    flyaway, of any number. All others come first, along a Morton curve in their own box, in clusters of `size`, the last of them smaller.
    The far ones follow in clusters of their own, each of no greater extent than `widest` and than `_SPREAD` times the distance of its nearest from the middle:
    along a curve through the logarithms of their distances on each axis.
    """
    means = np.asarray(means, np.float64)
    centre, width = _middle(means)
    away = means - centre
    reach = np.abs(away).max(axis=1)
    far = reach > (OWN if (reach > FAR * width).any() else math.inf) * width
    near, far = np.flatnonzero(~far), np.flatnonzero(far)
    order = near[_curve(means[near], means[near])]
    start = np.arange(0, len(near), size)
    if len(far):
        away = away[far]
        along = _curve(away, np.sign(away) * np.log1p(np.abs(away) / (width or 1.0)))
        order = np.concatenate([order, far[along]])
        start = np.concatenate([start, len(near) + _spread(away[along], size, widest)])
    return order, start, len(near)


def _spread(away: np.ndarray, size: int, widest: float) -> np.ndarray:
    """int64 (C,): first Gaussians of clusters of far ones, in order; away: (N, 3), from the middle of the scene."""
    start, count = [], size
    nearest = x0 = x1 = y0 = y1 = z0 = z1 = 0.0
    for i, ((x, y, z), distance) in enumerate(zip(away.tolist(), np.linalg.norm(away, axis=1).tolist())):
        nearest = min(nearest, distance)
        x0, x1, y0, y1, z0, z1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y), min(z0, z), max(z1, z)
        if count == size or max(x1 - x0, y1 - y0, z1 - z0) > min(_SPREAD * nearest, widest):
            start.append(i)
            nearest, x0, x1, y0, y1, z0, z1, count = distance, x, x, y, y, z, z, 0
        count += 1
    return np.array(start, np.int64)


def reorder(scene: Scene, order: np.ndarray) -> Scene:
    """The scene with its Gaussians in another order."""
    return replace(scene, means=scene.means[order], scales=scene.scales[order], quats=scene.quats[order],
                   opacities=scene.opacities[order], sh=scene.sh[order])


def build_clusters(scene: Scene, size: int = CHUNK) -> tuple[Scene, Clusters]:
    """The scene in Morton order and its clusters."""
    if size < 1:
        raise FlickerError(f"clusters: size must be at least 1, not {size}")
    order, start, _ = cluster_order(scene.means, size)
    scene, start = reorder(scene, order), np.append(start, len(scene))
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
