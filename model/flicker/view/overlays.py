"""Maps that lie over a picture, and how they are drawn: colours, legend, two pictures beside each other."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..explore.facts import MAPS, Scale, imbalance, pixel_grid, visited_counts
from ..explore.machine import Counters, subtile_cycles
from ..front.binning import bin_boxes, pixel_boxes
from ..front.projection import Projected
from ..params import CHANNELS, SUBTILE, TILE, RenderConfig
from ..perf.lanes import pixels_of_lanes
from ..perf.work import Work
from ..scene.camera import Camera

OVERLAYS = {
    "visited": MAPS["gaussians"],
    "cycles": Scale("core cycles per tile", MAPS["cycles"].colours, True),
    "imbalance": Scale("busiest channel or lane / mean", MAPS["imbalance"].colours, low=1.0),
    "error": MAPS["error"],
    "entries": Scale("Gaussians listed per tile", "viridis", True),
    "cost": Scale("cycles of the Gaussian seen", "magma", True),
}
OF_STAGE = ("visited", "cycles", "imbalance")  # need a stage and the model's masks
BAR = (150, 8)  # of a legend, pixels
MARGIN = 6


def spread(values: np.ndarray, side: int, camera: Camera) -> np.ndarray:
    """Values of squares of so many pixels (rows, columns) to a picture (H, W)."""
    return np.repeat(np.repeat(values, side, axis=0), side, axis=1)[: camera.height, : camera.width]


def by_tile(values: np.ndarray, cols: int, rows: int) -> np.ndarray:
    """Sums over tiles of values of sub-tiles (S,): (rows of tiles, columns of tiles)."""
    side = TILE // SUBTILE
    whole = np.zeros((-(-rows // side) * side, -(-cols // side) * side))
    whole[:rows, :cols] = values.reshape(rows, cols)
    return whole.reshape(whole.shape[0] // side, side, -1, side).sum(axis=(1, 3))


def visited_map(work: Work, camera: Camera) -> np.ndarray:
    """(H, W): Gaussians that are visited at each pixel before it is finished."""
    return pixel_grid(visited_counts(work), work.cols, work.rows)[: camera.height, : camera.width].astype(np.float64)


def tile_cycles(work: Work, counters: Counters) -> np.ndarray:
    """(rows, columns) of tiles: cycles of the four cores on their sub-tiles of it, each from the end of the sub-tile before to its own, summed."""
    return by_tile(subtile_cycles(work, counters), work.cols, work.rows)


def imbalance_map(work: Work, config: RenderConfig) -> np.ndarray:
    """(rows, columns) of sub-tiles: pixels of the busiest channel, or of the busiest lane of a core, over the mean."""
    count = visited_counts(work)
    if config.by_lanes:
        slots = count[:, pixels_of_lanes(config.lanes // config.cores)].sum(axis=2)
    else:
        slots = count.reshape(len(count), CHANNELS, -1).sum(axis=2)
    return imbalance(slots).reshape(work.rows, work.cols)


def tile_entries(projected: Projected, camera: Camera) -> np.ndarray:
    """(rows, columns) of tiles: Gaussians whose 3-sigma box meets the tile."""
    cols, rows = -(-camera.width // TILE), -(-camera.height // TILE)
    start, _ = bin_boxes(pixel_boxes(projected.mean, projected.radii, TILE, cols, rows, camera.width, camera.height), cols, rows)
    return np.diff(start).reshape(rows, cols)


def normalised(values: np.ndarray, scale: Scale, limits: tuple[float, float]) -> np.ndarray:
    """Place of values on a scale, 0 to 1."""
    low, high = limits
    if scale.logarithmic:
        return np.clip(np.log(np.maximum(values, low) / low) / np.log(high / low), 0.0, 1.0)
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def painted(picture: np.ndarray, values: np.ndarray, scale: Scale, limits: tuple[float, float], opacity: float) -> np.ndarray:
    """A map over a picture (H, W, 3) in [0, 1]; nothing where a value is NaN."""
    there = np.isfinite(values)
    colours = matplotlib.colormaps[scale.colours](normalised(np.where(there, values, limits[0]), scale, limits))[..., :3]
    return np.where(there[..., None], opacity * colours + (1.0 - opacity) * picture, picture)


def add_legend(picture: Image.Image, scale: Scale, limits: tuple[float, float], right: bool = False) -> None:
    """Colour bar with its title and end values, in a lower corner."""
    draw, font = ImageDraw.Draw(picture, "RGBA"), ImageFont.load_default(11)
    width, height = BAR
    x = picture.width - width - 2 * MARGIN if right else MARGIN
    y = picture.height - height - 28 - MARGIN
    draw.rectangle((x - MARGIN, y - MARGIN, x + width + MARGIN, picture.height), fill=(0, 0, 0, 170))
    draw.text((x, y - 3), scale.title, font=font, fill="white")
    bar = matplotlib.colormaps[scale.colours](np.linspace(0, 1, width))[None, :, :3].repeat(height, axis=0)
    picture.paste(Image.fromarray(np.rint(bar * 255).astype(np.uint8)), (x, y + 13))
    low, high = (f"{v:,.0f}" if v >= 10 or v == int(v) else f"{v:.2f}" for v in limits)
    middle = f"{np.sqrt(limits[0] * limits[1]):,.0f}" if scale.logarithmic else ""
    for text, anchor, at in ((low, "la", x), (middle, "ma", x + width // 2), (high, "ra", x + width)):
        draw.text((at, y + 14 + height), text, font=font, fill="white", anchor=anchor)


def as_image(picture: np.ndarray, size: tuple[int, int]) -> Image.Image:
    """A float picture, rounded to 8 bits as files have it, enlarged to a size (width, height)."""
    image = Image.fromarray(np.rint(np.clip(np.nan_to_num(picture), 0.0, 1.0) * 255.0).astype(np.uint8))
    return image if image.size == size else image.resize(size, Image.Resampling.BILINEAR)


def beside(pictures: Sequence[Image.Image], split: float) -> Image.Image:
    """The left part of the first picture, the rest of the second, with a line between; the first alone where there is one."""
    if len(pictures) == 1:
        return pictures[0]
    left, out = round(split * pictures[0].width), pictures[1].copy()
    out.paste(pictures[0].crop((0, 0, left, out.height)), (0, 0))
    if 0 < left < out.width:
        ImageDraw.Draw(out).line((left, 0, left, out.height), fill="white", width=1)
    return out
