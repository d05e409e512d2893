"""What a scene costs on the chip, view by view, and which of its Gaussians cost more than they give (docs/reference/scene_cost.md).

    cost = scene_cost(scene, cameras)
    cost.views[0].cycles, cost.findings(), cost.dearest(10)

Cycles and bytes are those of the chip model's two halves (`chip.preprocessing`, `chip.rendering`), which are held to the RTL. What a Gaussian gives is
counted in float64 on the front end's own records and lists, by the rules of the reference renderer: its weight is the sum over pixels of alpha T.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numba
import numpy as np

from ..explore.generators.contribution import cat_masks
from ..golden.chip import chip_walk, whole_pairs
from ..golden.front.blend import alpha_at
from ..golden.front.cull import cull
from ..golden.front.frame import FrontFrame, run_front
from ..golden.front.setup import MEAN_FRACTION, FrameSetup
from ..golden.render import stream_order
from ..params import ALPHA_MIN, CORES, LINE_BITS, SUBTILE, TILE, TRANSMITTANCE_MIN, RenderConfig, SortOrder
from ..pipeline import packing_of
from ..progress import Steps
from ..scene.camera import Camera
from ..scene.gaussians import Scene
from ..scene.packed import PackedFormat, decode
from ..scene.packing import Packing
from .constants import CLOCK_HZ
from .dram import DramConfig
from .whole import halves, shared_cycles

CONFIG = RenderConfig()  # of the stage by whose visits Gaussians are judged, and of the chip unless another is asked for
ENTRY_BYTES = 64 / 14  # most lines of 64 bytes have fourteen or fifteen entries
VRUS = 32  # pixels that the stage visits in a cycle at most
ENORMOUS = 0.25  # share of a view's tiles that a Gaussian is listed in
LEAST_COLOUR = 1.0 / 255.0  # change of colour below which coefficients say nothing
# Largest absolute values of the real spherical harmonics of degree 1, 2 and 3 in the order of the coefficients, over all directions.
SH_PEAK = np.array([
    0.4886025, 0.4886025, 0.4886025, 0.5462742, 0.5462742, 0.6307831, 0.5462742, 0.5462742,
    0.5900436, 0.5562984, 0.6293804, 0.7463527, 0.6293804, 0.5562984, 0.5900436,
])


@numba.njit(parallel=True, cache=True)
def _give(mean, shape, opacity, start, entry, mask, cols, width, height, weight, peak, visits, visited, seen):
    """Of each entry: weight, largest alpha T, pixels visited in mini-tiles of its mask that are not finished. Of each pixel: how often it is visited, the entry
    with the largest alpha T."""
    for s in numba.prange(len(start) - 1):
        left, top = s % cols * SUBTILE, s // cols * SUBTILE
        transmittance = np.ones((SUBTILE, SUBTILE))
        done = np.zeros((SUBTILE, SUBTILE), np.bool_)
        live = np.full(4, 16)
        most = np.zeros((SUBTILE, SUBTILE))
        for e in range(start[s], start[s + 1]):
            i = entry[e]
            for m in range(4):
                if live[m] == 0:
                    continue
                sent = mask[e] >> m & 1
                visits[e] += 16 * sent
                for p in range(16):
                    v, u = m // 2 * 4 + p // 4, m % 2 * 4 + p % 4
                    y, x = top + v, left + u
                    if y < height and x < width:
                        visited[y, x] += sent
                    if done[v, u]:
                        continue
                    dx, dy = x - mean[i, 0], y - mean[i, 1]
                    alpha = alpha_at(shape[i], True, opacity[i], dx, dy)
                    if alpha == 0.0:
                        continue
                    before = transmittance[v, u]
                    after = before * (1.0 - alpha)
                    if after < TRANSMITTANCE_MIN:
                        done[v, u] = True
                        live[m] -= 1
                        continue
                    if y < height and x < width:
                        weight[e] += alpha * before
                        peak[e] = max(peak[e], alpha * before)
                        if alpha * before > most[v, u]:
                            most[v, u] = alpha * before
                            seen[y, x] = e
                    transmittance[v, u] = after


def stage_cycles(visits: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """Cycles of the rendering stage for so many visits and sub-tile entries: what the VRUs take, and a core takes an entry a cycle."""
    return visits / VRUS + entries / CORES


@dataclass(eq=False)
class ViewCost:
    """One view. cycles: of each half, and of a memory port narrower than a line. bytes: by purpose.

    Of each Gaussian of the scene, in its file's order: entries, tiles: int64 (N,), entries of its 8x8 sub-tiles and of 16x16 tiles; visits: int64 (N,), pixels
    visited for it; weight, peak: float64 (N,), sum over pixels and largest of alpha T; fetched, recorded: bool (N,), its geometry was read, it got a record.
    visited: int32 (H, W), visits of each pixel. seen: int64 (H, W), the Gaussian with the largest alpha T at each pixel, -1: none. cluster_fetched: bool
    (clusters,).
    """

    camera: Camera
    cycles: dict[str, int]
    bytes: dict[str, int]
    entries: np.ndarray
    tiles: np.ndarray
    visits: np.ndarray
    weight: np.ndarray
    peak: np.ndarray
    fetched: np.ndarray
    recorded: np.ndarray
    visited: np.ndarray
    seen: np.ndarray
    cluster_fetched: np.ndarray

    @property
    def interval(self) -> int:
        """Cycles between frames that follow each other: the slower half's, or those of a memory port that both wait for."""
        return max(self.cycles.values())

    @property
    def frames_per_second(self) -> float:
        """At the chip's clock, from the slower half."""
        return CLOCK_HZ / self.interval


@dataclass(frozen=True)
class Finding:
    """Gaussians with something in common. what: for people. gaussians: how many. bytes, entries, visits: a frame's mean over the views, of what could be
    spared."""

    name: str
    what: str
    gaussians: int
    bytes: float
    entries: float
    visits: float


@dataclass(eq=False)
class SceneCost:
    """A scene over views. Arrays of Gaussians are in the file's order, which is `scene`'s."""

    scene: Scene
    packing: Packing
    views: list[ViewCost]

    def _sum(self, name: str) -> np.ndarray:
        return np.sum([getattr(view, name) for view in self.views], axis=0)

    @cached_property
    def peak(self) -> np.ndarray:
        """float64 (N,): the largest alpha T of each Gaussian in any view."""
        return np.max([view.peak for view in self.views], axis=0)

    @cached_property
    def moved(self) -> np.ndarray:
        """float64 (N,): bytes that each Gaussian moves in a frame, mean over the views: geometry, colour; record and list entries, written and read once."""
        kind, words = self.packing.packed.format.geometry
        colour = self.colour_bytes
        total = np.zeros(len(colour))
        for view in self.views:
            total += view.fetched * float(kind.itemsize * words) + view.recorded * (colour + 32.0) + 2 * ENTRY_BYTES * view.tiles
        return total / len(self.views)

    def _finding(self, name: str, what: str, which: np.ndarray) -> Finding:
        """Gaussians that could go altogether."""
        entries, visits = (float(self._sum(of)[which].sum() / len(self.views)) for of in ("entries", "visits"))
        return Finding(name, what, int(which.sum()), float(self.moved[which].sum()), entries, visits)

    @cached_property
    def degree(self) -> np.ndarray:
        """int64 (N,): SH degree of each Gaussian in memory, its cluster's; 0 for what is not packed."""
        degree = np.zeros(len(self.scene.opacities), np.int64)
        degree[self.packing.order] = (self.packing.packed.table["flags"] & 3)[self.packing.packed.cluster]
        return degree

    @cached_property
    def colour_bytes(self) -> np.ndarray:
        """int64 (N,): of each Gaussian's opacity and colour in memory; for what is not packed those without SH."""
        packed = self.packing.packed
        found = np.full(len(self.scene.opacities), packed.format.colour_stride(0))
        found[self.packing.order] = packed.colour_strides[packed.cluster]
        return found

    def sh_change(self) -> np.ndarray:
        """float64 (N,): the most that coefficients beyond degree 0 can add to a colour channel, over all directions."""
        rest = np.abs(self.scene.sh[:, 1:, :]).astype(np.float64)
        return (rest * SH_PEAK[: rest.shape[1], None]).sum(axis=1).max(axis=1) if rest.shape[1] else np.zeros(len(self.scene.opacities))

    def findings(self) -> list[Finding]:
        """What a linter would say: Gaussians that no view needs, that cost much, whose colours say nothing; clusters that are read for little."""
        form = self.packing.packed.format
        packed_ = np.zeros(len(self.scene.opacities), np.bool_)
        packed_[self.packing.order] = True
        tiles = [-(-v.camera.width // TILE) * -(-v.camera.height // TILE) for v in self.views]
        enormous = np.max([view.tiles / n for view, n in zip(self.views, tiles)], axis=0) > ENORMOUS
        found = [
            self._finding("left out", "opacity below 1/255: never packed", ~packed_),
            self._finding("never seen", "blended in no pixel of any view", packed_ & (self.peak == 0)),
            self._finding("hardly seen", "never more than 1/255 of a pixel", packed_ & (self.peak > 0) & (self.peak < ALPHA_MIN)),
            self._finding("enormous", f"in more than {ENORMOUS:.0%} of a view's tiles", enormous),
        ]
        mute = packed_ & (self.degree > 0) & (self.sh_change() < LEAST_COLOUR)
        saved = self.colour_bytes - form.colour_stride(0)
        colour = float(np.mean([saved[mute & view.recorded].sum() for view in self.views]))
        found.append(Finding("SH says nothing", "coefficients change no channel by 1/255", int(mute.sum()), colour, 0.0, 0.0))
        cluster = np.zeros(len(packed_), np.int64)
        cluster[self.packing.order] = self.packing.packed.cluster
        count = np.bincount(cluster[packed_], minlength=len(self.packing.packed.table))
        wide = np.zeros(len(count), np.bool_)
        bytes_ = 0.0
        kind, words = form.geometry
        for view in self.views:
            used = np.bincount(cluster[view.recorded], minlength=len(count))
            idle = view.cluster_fetched & (used < 0.1 * count)
            wide |= idle
            bytes_ += float(((count - used) * kind.itemsize * words)[idle].sum())
        what = "in clusters of which a view reads all and records less than a tenth"
        found.append(Finding("wide clusters", what, int((packed_ & wide[cluster]).sum()), bytes_ / len(self.views), 0.0, 0.0))
        return [finding for finding in found if finding.gaussians]

    @cached_property
    def cycles(self) -> np.ndarray:
        """float64 (N,): cycles of the rendering stage that each Gaussian takes in a frame, mean over the views."""
        return stage_cycles(self._sum("visits"), self._sum("entries")) / len(self.views)

    def of(self, i: int) -> dict[str, Any]:
        """What Gaussian i costs and gives in a frame, mean over the views, as plain numbers."""
        entries, visits, weight = (float(np.mean([getattr(view, name)[i] for view in self.views])) for name in ("entries", "visits", "weight"))
        return {
            "gaussian": int(i), "cycles": float(self.cycles[i]), "entries": entries, "visits": visits, "weight": weight, "peak": float(self.peak[i]),
            "opacity": float(self.scene.opacities[i]), "scale": float(np.max(self.scene.scales[i])),
        }

    def dearest(self, count: int = 10) -> list[dict[str, Any]]:
        """Gaussians that cost most for what they give: visits and entries, in cycles of a frame, over blended weight in pixels; mean over the views."""
        order = np.argsort(-self.cycles / (self._sum("weight") / len(self.views) + 1.0), kind="stable")[:count]
        return [self.of(i) for i in order if self.cycles[i] > 0]

    def summary(self) -> dict[str, Any]:
        """Everything as plain numbers."""
        return {
            "gaussians": len(self.scene.opacities), "format": self.packing.packed.format.value, "clusters": len(self.packing.packed.table),
            "views": [
                {
                    "size": [view.camera.width, view.camera.height], "cycles": view.cycles, "interval": view.interval,
                    "frames_per_second": view.frames_per_second,
                    "bytes": view.bytes, "recorded": int(view.recorded.sum()), "tile_entries": int(view.tiles.sum()), "entries": int(view.entries.sum()),
                    "visits": int(view.visits.sum()), "seen": int((view.peak > 0).sum()),
                }
                for view in self.views
            ],
            "findings": [vars(finding) for finding in self.findings()], "dearest": self.dearest(),
        }


def frame_cost(front: FrontFrame, dram: DramConfig, config: RenderConfig = CONFIG) -> tuple[dict[str, int], dict[str, int]]:
    """Cycles of each half of a chip, bytes of both by purpose."""
    first, second = halves(front, config, dram)
    bytes_ = dict(first.bytes)
    for name, more in second.bytes.items():
        bytes_[name] = bytes_.get(name, 0) + more
    cycles = {"front end": first.cycles, "rendering": second.cycles}
    if config.port_bits != LINE_BITS:
        cycles["memory port"] = shared_cycles(first, second, dram)
    return cycles, bytes_


def view_cost(
    packing: Packing, gaussians: int, camera: Camera, dram: DramConfig | None, order: SortOrder = SortOrder.DEPTH, config: RenderConfig = CONFIG,
) -> ViewCost:
    """One view of a packed scene of so many Gaussians in its file. dram: None: without cycles and bytes of the halves, which take most of the time. order: of
    the lists. config: of the chip, with records of 16 bytes."""
    packed = packing.packed
    front = run_front(packed, camera, order=order)
    cycles, bytes_ = frame_cost(front, dram, config) if dram else ({}, {})
    weight, peak, visits, visited, entry = _entries(front)
    lists = front.subtile_lists()
    number = packing.order[front.gaussian]  # in the file, of each record
    sums = lambda values: np.bincount(number[lists.entry], values, minlength=gaussians)  # noqa: E731
    largest = np.zeros(gaussians)
    np.maximum.at(largest, number[lists.entry], peak)
    seen = np.where(entry >= 0, number[lists.entry[entry]], -1) if len(lists.entry) else entry
    fetched, recorded = np.zeros((2, gaussians), np.bool_)
    kept = cull(packed, FrameSetup.of(camera))
    fetched[packing.order[kept[packed.cluster]]] = True
    recorded[number] = True
    return ViewCost(
        camera, cycles, bytes_, sums(None).astype(np.int64),
        np.bincount(number[front.entry_splat], minlength=gaussians), sums(visits).astype(np.int64), sums(weight), largest, fetched, recorded, visited, seen,
        kept,
    )


def _entries(front: FrontFrame) -> tuple[np.ndarray, ...]:
    lists = front.subtile_lists()
    whole = whole_pairs(lists)
    order, core_start = stream_order(whole, walk=chip_walk(whole))
    mask, _, _ = cat_masks(whole, CONFIG, order, core_start)  # entries stand as in `lists`: the sub-tiles beyond are empty
    splats = front.splats()
    n = len(lists.entry)
    weight, peak, visits = np.zeros(n), np.zeros(n), np.zeros(n, np.int64)
    height, width = front.camera.height, front.camera.width
    visited, seen = np.zeros((height, width), np.int32), np.full((height, width), -1)
    _give(
        splats.mean / (1 << MEAN_FRACTION), splats.shape, splats.opacity, lists.start, lists.entry, mask.astype(np.int64), lists.cols, width, height,
        weight, peak, visits, visited, seen,
    )
    return weight, peak, visits, visited, seen


def packed_for_cost(scene: Scene, form: PackedFormat | None = None, steps: Steps | None = None) -> tuple[Scene, Packing]:
    """A scene in memory (`packing_of`) and its Gaussians in the order that `Packing.order` counts in."""
    packing = packing_of(scene, form, steps)
    if scene.rejected and not packing.left_out:  # the file's Gaussians as they are, with those that loading left out
        with np.errstate(over="ignore"):
            scene = decode(packing.packed)
    return scene, packing


def scene_cost(
    scene: Scene, cameras: Sequence[Camera], *, form: PackedFormat | None = None, config: RenderConfig = CONFIG, steps: Steps | None = None,
) -> SceneCost:
    """Look at a scene through cameras, as `packing_of` puts it into memory. form: None: that of a packed scene, else chunk. config: of the chip.
    FlickerError where it cannot be packed."""
    steps = steps or Steps()
    scene, packing = packed_for_cost(scene, form, steps)
    views = []
    with steps.bar("views") as report:
        for k, camera in enumerate(cameras):
            report(k, len(cameras))
            views.append(view_cost(packing, len(scene), camera, DramConfig(port_bits=config.port_bits), config=config))
    return SceneCost(scene, packing, views)
