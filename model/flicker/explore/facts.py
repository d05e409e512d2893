"""What single figures show of a view beside the rows of its configurations: maps, duplicates for tile sizes, FIFO depths."""

from __future__ import annotations

import numpy as np

from ..front.projection import Projected
from ..params import CHANNELS, MINITILE, SUBTILE
from ..perf.render_stage import StageCycles, simulate
from ..perf.work import MINITILE_PIXELS, Work
from ..scene.metrics import flip_map
from .evaluate import Evaluation, channel_slots
from .machine import Configuration, subtile_cycles
from .stages.lanes import Lanes

TILE_SIZES = (4, 8, 16, 32)
FIFO_DEPTHS = (1, 2, 4, 8, 16, 32, 64, 128)


def _pixel_grid(values: np.ndarray, cols: int, rows: int) -> np.ndarray:
    """(S, 4, 16) per pixel of a mini-tile to a picture (8 rows, 8 cols), border included."""
    side = SUBTILE // MINITILE
    grid = values.reshape(rows, cols, side, side, MINITILE, MINITILE)
    return grid.transpose(0, 2, 4, 1, 3, 5).reshape(rows * SUBTILE, cols * SUBTILE)


def heat_maps(evaluation: Evaluation, reference: np.ndarray) -> dict[str, np.ndarray]:
    """`gaussians`: uint16 (H, W), Gaussians that the VRUs visit at each pixel. `cycles`: float32 (rows, cols), cycles between the end of
    a sub-tile and that of the one before it in the same core; absent when the stage gives no
    times or deals sub-tiles out otherwise. `imbalance`: float32 (rows, cols),
    busiest channel over the mean, NaN where nothing is visited. `error`: float32 (H, W), FLIP."""
    work = evaluation.work
    height, width = reference.shape[:2]
    visited = work.visit_masks() & work.unfinished()
    count = np.empty((work.subtiles, CHANNELS, MINITILE_PIXELS), np.uint16)
    for pixel in range(MINITILE_PIXELS):
        bits = (visited >> np.uint16(pixel)) & 1
        sums = np.concatenate([np.zeros((1, CHANNELS), np.int64), bits.cumsum(axis=0, dtype=np.int64)])
        count[:, :, pixel] = np.minimum(sums[work.start[1:]] - sums[work.start[:-1]], 65535)
    slots = channel_slots(work).astype(np.float64)
    with np.errstate(invalid="ignore"):
        imbalance = np.where(slots.sum(axis=1) > 0, CHANNELS * slots.max(axis=1) / slots.sum(axis=1), np.nan)
    maps = {
        "gaussians": _pixel_grid(count, work.cols, work.rows)[:height, :width],
        "imbalance": imbalance.reshape(work.rows, work.cols).astype(np.float32),
        "error": flip_map(evaluation.image, reference).astype(np.float32),
    }
    if isinstance(evaluation.counters, StageCycles) and not isinstance(evaluation.configuration.stage, Lanes):
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
