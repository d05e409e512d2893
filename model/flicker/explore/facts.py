"""What single figures show of a view beside the rows of its configurations: maps, duplicates for tile sizes, FIFO depths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from ..front.projection import Projected
from ..params import CHANNELS, MINITILE, SUBTILE
from ..perf.render_stage import simulate
from ..perf.work import MINITILE_PIXELS, Work
from ..scene.metrics import flip_map
from .evaluate import Evaluation, channel_slots
from .machine import Configuration, subtile_cycles
from .stages.lanes import Lanes

TILE_SIZES = (4, 8, 16, 32)
FIFO_DEPTHS = (1, 2, 4, 8, 16, 32, 64, 128)


def pixel_grid(values: np.ndarray, cols: int, rows: int) -> np.ndarray:
    """Values of pixel 16 m + i of each sub-tile, (S, 64), to a picture (8 rows, 8 cols), border included."""
    side = SUBTILE // MINITILE
    grid = values.reshape(rows, cols, side, side, MINITILE, MINITILE)
    return grid.transpose(0, 2, 4, 1, 3, 5).reshape(rows * SUBTILE, cols * SUBTILE)


@dataclass(frozen=True)
class Scale:
    """How a map is drawn. title: what a value is. colours: a colour map of matplotlib. low: least value, of a linear scale."""

    title: str
    colours: str
    logarithmic: bool = False
    low: float = 0.0

    def limits(self, shown: Sequence[np.ndarray]) -> tuple[float, float]:
        """Least and largest value that maps have in common, cut at the 99.5 % quantile of the one that needs most; three decades of a logarithmic scale."""
        top = max((float(np.nanpercentile(m, 99.5)) for m in shown if np.isfinite(m).any()), default=1.0)
        high = max(top, self.low + 1e-6)
        return (max(high / 1000, 1.0), max(high, 2.0)) if self.logarithmic else (self.low, high)


MAPS = {
    "gaussians": Scale("Gaussians per pixel", "viridis", True), "cycles": Scale("cycles per sub-tile", "magma", True),
    "imbalance": Scale("busiest channel / mean", "cividis", low=1.0), "error": Scale("FLIP", "inferno"),
}


@numba.njit(parallel=True, cache=True)
def _visited(start, visit, pixel_finish, count):
    for s in numba.prange(len(start) - 1):
        for n in range(start[s], start[s + 1]):
            for p in range(count.shape[1]):
                if (visit[n, p // 16] >> (p % 16)) & 1 and n - start[s] <= pixel_finish[s, p]:
                    count[s, p] += 1


def visited_counts(work: Work) -> np.ndarray:
    """int64 (S, 64): Gaussians that the VRUs visit at pixel 16 m + i of each sub-tile before it is finished."""
    count = np.zeros((work.subtiles, CHANNELS * MINITILE_PIXELS), np.int64)
    _visited(work.start, work.visit_masks(), work.pixel_finish, count)
    return count


def imbalance(slots: np.ndarray) -> np.ndarray:
    """float64 (S,): pixels of the busiest channel (or lane) over the mean, NaN where nothing is visited. slots: (S, channels), pixels of each."""
    total = slots.sum(axis=1)
    with np.errstate(invalid="ignore"):
        return np.where(total > 0, slots.shape[1] * slots.max(axis=1) / total, np.nan)


def heat_maps(evaluation: Evaluation, reference: np.ndarray) -> dict[str, np.ndarray]:
    """`gaussians`: uint16 (H, W), Gaussians that the VRUs visit at each pixel. `cycles`: float32 (rows, cols), cycles between the end of
    a sub-tile and that of the one before it in the same core; absent when the stage gives no
    times or deals sub-tiles out otherwise. `imbalance`: float32 (rows, cols),
    busiest channel over the mean, NaN where nothing is visited. `error`: float32 (H, W), FLIP."""
    work = evaluation.work
    height, width = reference.shape[:2]
    maps = {
        "gaussians": np.minimum(pixel_grid(visited_counts(work), work.cols, work.rows)[:height, :width], 65535).astype(np.uint16),
        "imbalance": imbalance(channel_slots(work)).reshape(work.rows, work.cols).astype(np.float32),
        "error": flip_map(evaluation.image, reference).astype(np.float32),
    }
    if evaluation.counters is not None and not isinstance(evaluation.configuration.stage, Lanes):
        maps["cycles"] = subtile_cycles(work, evaluation.counters).reshape(work.rows, work.cols).astype(np.float32)
    return maps


def duplicates(projected: Projected, width: int, height: int) -> dict[str, int]:
    """Gaussian-tile pairs of the 3-sigma boxes (per axis) for every tile size; a pair when the box holds a pixel centre of the tile."""
    low = np.ceil(projected.mean - projected.radii)
    high = np.floor(projected.mean + projected.radii)
    limit = np.array([width, height]) - 1
    inside = ((low <= high) & (low <= limit) & (high >= 0)).all(axis=1)
    low = np.clip(low[inside], 0, limit).astype(np.int64)
    high = np.clip(high[inside], 0, limit).astype(np.int64)
    return {str(size): int((high // size - low // size + 1).prod(axis=1).sum()) for size in TILE_SIZES}


def fifo_sweep(work: Work, configuration: Configuration) -> dict[str, list]:
    """Cycles and CTU stall rate of one configuration's work for every FIFO depth, by the cycle model of the RTL."""
    config = configuration.render_config
    if config is None:
        raise ValueError(f"{configuration.name}: no RTL")
    stages = [simulate(work, config.with_(fifo_depth=depth)) for depth in FIFO_DEPTHS]
    return {
        "depth": list(FIFO_DEPTHS), "cycles": [s.cycles for s in stages], "stall_rate": [s.stall_rate for s in stages],
        "utilisation": [s.utilisation for s in stages],
    }


def as_bytes(image: np.ndarray) -> np.ndarray:
    """A float picture as uint8 (H, W, 3)."""
    return np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)
