"""A picture of parameters, and the derivatives of a function of it in all of them.

    frame = render(parameters, camera)
    gradient = backward(frame, slope_of_image)        # dL/d image (H, W, 3) gives dL/d parameters[frame.index]

The rules are those of the reference renderer (docs/reference/reference_renderer.md): projection and colours are its own functions. Where a derivative does
not exist, at the clamp of alpha, of a colour, of the Jacobian, it is that of the side on which the value lies; skipped pairs and finished pixels give nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..explore.machine import Configuration
from ..front.binning import bin_boxes
from ..front.projection import COLUMNS, FACTOR, Projected, colours, geometry, slope_range
from ..params import TILE
from ..scene.camera import Camera
from . import raster
from .chain import chain
from .engines import Back, Engine, processor
from .parameters import Parameters
from .through import ALL, tile_masks


@dataclass(eq=False)
class Frame:
    """A view of parameters and what its way back needs. M Gaussians are in front of the camera, E entries in the lists of 16x16 tiles.

    image: (H, W, 3), neither clamped nor quantised. transmittance: (H, W). index: int64 (M,), those Gaussians, ascending.
    rows: (M, COLUMNS), `raster`, of the precision in which pictures are blended. start: int64 (tiles + 1,), entry: int32 (E,), into index, near to far; used:
    bool (E,), blended in a pixel or finishing one, as far as the engine tells. mask: uint16 (E,), 4x4 pixels of the tile that are visited (`through`).
    bad: bool (M,), Gaussians that were left out for a number that is not finite. table: float64 (N, COLUMNS), of `front.projection.geometry`.
    back: the engine's way back.
    """

    parameters: Parameters
    camera: Camera
    image: np.ndarray
    transmittance: np.ndarray
    index: np.ndarray
    rows: np.ndarray
    start: np.ndarray
    entry: np.ndarray
    mask: np.ndarray
    used: np.ndarray
    bad: np.ndarray
    table: np.ndarray
    back: Back


@dataclass(eq=False)
class Gradient:
    """values: float32 (S, P), dL/d parameters.values[index]. screen: float64 (S, 2), dL/d mean in pixels. index: int64 (S,), those of the frame that are in its
    picture, ascending; the others' derivatives are 0."""

    values: np.ndarray
    screen: np.ndarray
    index: np.ndarray


def _masks(
    through: Configuration, frame: tuple[np.ndarray, ...], opacity: np.ndarray, depth: np.ndarray, camera: Camera, start: np.ndarray, entry: np.ndarray,
) -> np.ndarray:
    """Masks of the entries. frame: order, index, table, rgb, bad; order: int64 (M,), places in index, near to far; the rest of `Frame`."""
    order, index, table, rgb, bad = frame
    good = order[~bad[order]]
    number = np.empty(len(index), np.int32)
    number[good] = np.arange(len(good))
    projected = Projected.of(table, depth, opacity, rgb[good], index[good])
    return tile_masks(through, projected, camera, start, number[entry])


def render(
    parameters: Parameters, camera: Camera, background: Sequence[float] = (0.0, 0.0, 0.0), through: Configuration | None = None,
    precision: type[np.floating] = np.float64, engine: Engine = processor,
) -> Frame:
    """The picture over an RGB background; through: only where the masks of that machine let a Gaussian through (`through.through`). precision: of blending, and
    of its derivatives. engine: what does both (`engines`)."""
    count, (width, height) = len(parameters), (camera.width, camera.height)
    with np.errstate(all="ignore"):  # what is not finite is found below
        scales = np.exp(parameters.log_scales.astype(np.float64))
        opacity = 1.0 / (1.0 + np.exp(-parameters.logits.astype(np.float64)))
    table, depth = np.empty((count, COLUMNS)), np.empty(count, np.float32)
    geometry(parameters.means, scales, parameters.quats, camera, table, depth)
    # By depth, then number: both in one key.
    index = np.flatnonzero(depth)
    if parameters.antialiased:
        opacity[index] *= table[index, FACTOR]
    key = np.sort(depth[index].view(np.uint32).astype(np.uint64) << np.uint64(32) | np.arange(len(index), dtype=np.uint64))
    order = (key & np.uint64(0xFFFFFFFF)).astype(np.int64)
    rgb = np.empty((len(index), 3))
    colours(parameters.means, parameters.sh, index, camera.position, rgb)
    rows: np.ndarray = np.empty((len(index), raster.COLUMNS), precision)
    box, bad = np.empty((len(index), 4), np.int32), np.empty(len(index), np.bool_)
    raster.make_rows(index, table, opacity, rgb, width, height, rows, box, bad)
    tiles_x, tiles_y = -(-width // TILE), -(-height // TILE)
    start, entry = bin_boxes(box[order], tiles_x, tiles_y)
    entry = order.astype(np.int32)[entry]
    image: np.ndarray = np.empty((height, width, 3), precision)
    transmittance: np.ndarray = np.empty((height, width), precision)
    used = np.zeros(len(entry), np.bool_)
    if through is None:
        mask = np.full(len(entry), ALL, np.uint16)
    else:
        mask = _masks(through, (order, index, table, rgb, bad), opacity, depth, camera, start, entry)
    back = engine(rows, start, entry, mask, np.asarray(background, precision), image, transmittance, used)
    return Frame(parameters, camera, image, transmittance, index, rows, start, entry, mask, used, bad, table, back)


Draw = Callable[[Parameters, Camera], Frame]  # `render` over black, or through a machine's masks


def backward(frame: Frame, slope_of_image: np.ndarray, coefficients: int = 16) -> Gradient:
    """Derivatives of L in the parameters, given dL/d image (H, W, 3).

    coefficients: how many SH coefficients a channel are trained; the others' derivatives are 0.
    """
    camera, values = frame.camera, frame.parameters.values
    total, seen = frame.back(slope_of_image)
    place = np.flatnonzero(seen)
    gradient, screen = np.empty((len(place), values.shape[1]), np.float32), np.empty((len(place), 2))
    chain(
        values, frame.index, place, frame.table, frame.rows, total, np.ascontiguousarray(camera.rotation.T), camera.position, camera.fx, camera.fy,
        slope_range(camera), frame.parameters.antialiased, coefficients, gradient, screen,
    )
    return Gradient(gradient, screen, frame.index[place])
