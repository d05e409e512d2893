"""Colours by least squares: with geometry and opacities fixed, a picture is linear in the SH coefficients.

A picture over black is sum_i w_i max(0, 1/2 + b(d_i) . x_i): w = alpha T of `fit.raster`, b the harmonics in the direction d_i of Gaussian i, x_i its
coefficients. The Gauss-Newton step minimises |A delta - r|^2 + ridge |delta|^2 over all views, r being what the full scene's pictures have more, by conjugate
gradients on the normal equations with the diagonal as preconditioner (Hestenes and Stiefel 1952; Saad, "Iterative Methods for Sparse Linear Systems", 2003,
algorithm 9.1). Colours that are clamped at 0 in a view, and channels of pixels that are saturated in both pictures, have no part in A.

A's weights are kept, five bytes for each pixel that a Gaussian is blended in, so that an iteration costs no exponentials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from ..fit.chain import _basis
from ..fit.parameters import MEAN, SH, Parameters
from ..fit.raster import BLUE, GREEN, LANES, RED, new_tile, spans, visit, window
from ..fit.render import Draw, Frame, render
from ..params import TILE
from ..progress import Steps
from ..scene.camera import Camera

SH_BAND = np.repeat(np.arange(4), (1, 3, 5, 7))  # of each coefficient
RIDGE = (0.1, 30.0, 30.0, 30.0)  # of each band, in pixels of weight 1: what a coefficient's change costs beside the pictures' error
ITERATIONS = 8
MEMORY = 3 << 30  # bytes of kept weights at most: more views than that are left out of the fit, evenly
_PAIR_BYTES = 5


@numba.njit(error_model="numpy", cache=True)
def _weigh_tile(t, rows, start, entry, mask, tiles_x, height, width, used, offset, pixel, weight, fill):
    """Count the pixels of each used entry into offset[e + 1], or, to fill, write their places in the tile and alpha T from offset[e] on."""
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    state = new_tile(0, columns, lines, rows.dtype)
    first, last = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    for e in range(start[t], start[t + 1]):
        if not used[e]:
            continue
        row, at = rows[entry[e]], offset[e] if fill else 0
        low, high = spans(row, left, top, columns - 1.0, lines - 1.0, first, last)
        for y in range(low, high):
            for x in range(first[y], last[y] + 1, LANES):
                common, place = window(row, np.uint64(mask[e]), left, top, y, np.uint64(x))
                for k in range(np.uint64(LANES)):
                    _, alpha, before, _ = visit(k, common, state, place, rows.dtype.type)
                    if alpha > 0.0:
                        if fill:
                            pixel[at] = y * np.uint64(TILE) + np.uint64(x) + k
                            weight[at] = alpha * before
                        at += 1
        if not fill:
            offset[e + 1] = at


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _weigh(rows, start, entry, mask, tiles_x, height, width, used, offset, pixel, weight, fill):
    for t in numba.prange(len(start) - 1):
        _weigh_tile(np.int64(t), rows, start, entry, mask, tiles_x, height, width, used, offset, pixel, weight, fill)


@numba.njit(error_model="numpy", cache=True)
def _colour(k, gaussian, shown, values, position, x, rgb):
    i = gaussian[k]
    dx, dy, dz = values[i, MEAN] - position[0], values[i, MEAN + 1] - position[1], values[i, MEAN + 2] - position[2]
    per = 1.0 / np.sqrt(dx * dx + dy * dy + dz * dz)
    count = x.shape[1]
    basis = np.empty(16)
    _basis(dx * per, dy * per, dz * per, count, basis)
    for c in range(3):
        total = 0.0
        if shown[k, c]:
            for n in range(count):
                total += basis[n] * x[i, n, c]
        rgb[k, c] = total


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _colours(gaussian, shown, values, position, x, rgb):
    for k in numba.prange(len(gaussian)):
        _colour(np.int64(k), gaussian, shown, values, position, x, rgb)


@numba.njit(error_model="numpy", cache=True)
def _colour_back(k, gaussian, shown, values, position, rgb, square, x):
    i = gaussian[k]
    dx, dy, dz = values[i, MEAN] - position[0], values[i, MEAN + 1] - position[1], values[i, MEAN + 2] - position[2]
    per = 1.0 / np.sqrt(dx * dx + dy * dy + dz * dz)
    count = x.shape[1]
    basis = np.empty(16)
    _basis(dx * per, dy * per, dz * per, count, basis)
    for c in range(3):
        if shown[k, c]:
            for n in range(count):
                x[i, n, c] += (basis[n] * basis[n] if square else basis[n]) * rgb[k, c]


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _colours_back(gaussian, shown, values, position, rgb, square, x):
    for k in numba.prange(len(gaussian)):
        _colour_back(np.int64(k), gaussian, shown, values, position, rgb, square, x)


@numba.njit(error_model="numpy", cache=True)
def _paint_tile(t, start, slot, offset, pixel, weight, rgb, tiles_x, mask, image):
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    colour = np.zeros((TILE * TILE, 3))
    for e in range(start[t], start[t + 1]):
        k = slot[e]
        red, green, blue = rgb[k, 0], rgb[k, 1], rgb[k, 2]
        for p in range(offset[e], offset[e + 1]):
            w, place = weight[p], np.uint64(pixel[p])
            colour[place, 0] += w * red
            colour[place, 1] += w * green
            colour[place, 2] += w * blue
    for y in range(min(TILE, height - top)):
        for x in range(min(TILE, width - left)):
            for c in range(3):
                image[top + y, left + x, c] = colour[y * TILE + x, c] if mask[top + y, left + x, c] else 0.0


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _paint(start, slot, offset, pixel, weight, rgb, tiles_x, mask, image):
    for t in numba.prange(len(start) - 1):
        _paint_tile(np.int64(t), start, slot, offset, pixel, weight, rgb, tiles_x, mask, image)


@numba.njit(error_model="numpy", cache=True)
def _collect_tile(t, start, offset, pixel, weight, tiles_x, mask, image, square, sums):
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    colour = np.zeros((TILE * TILE, 3))
    for y in range(min(TILE, height - top)):
        for x in range(min(TILE, width - left)):
            for c in range(3):
                if mask[top + y, left + x, c]:
                    colour[y * TILE + x, c] = 1.0 if square else image[top + y, left + x, c]
    for e in range(start[t], start[t + 1]):
        red = green = blue = 0.0
        for p in range(offset[e], offset[e + 1]):
            w, place = np.float64(weight[p]), np.uint64(pixel[p])
            if square:
                w *= w
            red += w * colour[place, 0]
            green += w * colour[place, 1]
            blue += w * colour[place, 2]
        sums[e, 0] = red
        sums[e, 1] = green
        sums[e, 2] = blue


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _collect(start, offset, pixel, weight, tiles_x, mask, image, square, sums):
    for t in numba.prange(len(start) - 1):
        _collect_tile(np.int64(t), start, offset, pixel, weight, tiles_x, mask, image, square, sums)


@numba.njit(error_model="numpy", cache=True)
def _gather(slot, sums, rgb):
    for e in range(len(slot)):
        for c in range(3):
            rgb[slot[e], c] += sums[e, c]


@dataclass(eq=False)
class ViewMatrix:
    """A of one view: coefficients float64 (N, K, 3) to a picture float64 (H, W, 3), and its transpose.

    gaussian: int64 (m,), those that the view shows; shown: bool (m, 3), their channels that are not clamped at 0. start: int64 (tiles + 1,); slot: int32 (E,),
    into gaussian, by entry of the tiles' lists; offset: int64 (E + 1,) into pixel (uint8, place in the 16x16 tile) and weight (float32, alpha T). mask: bool
    (H, W, 3), channels of pixels that count.
    """

    values: np.ndarray
    position: np.ndarray
    gaussian: np.ndarray
    shown: np.ndarray
    start: np.ndarray
    slot: np.ndarray
    offset: np.ndarray
    pixel: np.ndarray
    weight: np.ndarray
    mask: np.ndarray

    @classmethod
    def of(cls, frame: Frame, mask: np.ndarray | None = None) -> ViewMatrix:
        """Of a view that `fit.render.render` has drawn over black. mask: None: all pixels count."""
        height, width = frame.image.shape[:2]
        tiles_x = -(-width // TILE)
        offset = np.zeros(len(frame.entry) + 1, np.int64)
        nothing = np.empty(0, np.uint8), np.empty(0, np.float32)
        _weigh(frame.rows, frame.start, frame.entry, frame.mask, tiles_x, height, width, frame.used, offset, *nothing, False)
        offset = np.cumsum(offset)
        pixel, weight = np.empty(offset[-1], np.uint8), np.empty(offset[-1], np.float32)
        _weigh(frame.rows, frame.start, frame.entry, frame.mask, tiles_x, height, width, frame.used, offset, pixel, weight, True)
        entry = frame.entry[frame.used]
        seen = np.zeros(len(frame.index), np.bool_)
        seen[entry] = True
        number = np.cumsum(seen) - 1
        kept = np.concatenate([[0], np.cumsum(frame.used)])
        return cls(
            frame.parameters.values, frame.camera.position, frame.index[seen], frame.rows[seen][:, (RED, GREEN, BLUE)] > 0.0, kept[frame.start],
            number[entry].astype(np.int32), np.append(offset[:-1][frame.used], offset[-1]), pixel, weight,
            np.ones((height, width, 3), np.bool_) if mask is None else mask,
        )

    @property
    def _tiles_x(self) -> int:
        return -(-self.mask.shape[1] // TILE)

    def forward(self, x: np.ndarray) -> np.ndarray:
        """A x."""
        rgb, image = np.empty((len(self.gaussian), 3)), np.empty(self.mask.shape)
        _colours(self.gaussian, self.shown, self.values, self.position, x, rgb)
        _paint(self.start, self.slot, self.offset, self.pixel, self.weight, rgb, self._tiles_x, self.mask, image)
        return image

    def back(self, image: np.ndarray, x: np.ndarray, square: bool = False) -> None:
        """Add A^T image to x; square: of the squares of A's elements, the picture not being looked at."""
        sums, rgb = np.empty((len(self.slot), 3)), np.zeros((len(self.gaussian), 3))
        _collect(self.start, self.offset, self.pixel, self.weight, self._tiles_x, self.mask, image, square, sums)
        _gather(self.slot, sums, rgb)
        _colours_back(self.gaussian, self.shown, self.values, self.position, rgb, square, x)


def refit(
    parameters: Parameters, cameras: Sequence[Camera], pictures: Sequence[np.ndarray], coefficients: np.ndarray | None = None, *,
    ridge: Sequence[float] = RIDGE, iterations: int = ITERATIONS, steps: Steps | None = None, draw: Draw = render,
) -> Parameters:
    """Parameters with the SH coefficients of a Gauss-Newton step; those of before where they fit the pictures no better.

    pictures: float32 (H, W, 3) of each camera, over black. coefficients: int64 (N,), how many of each Gaussian may change (the others stay); None: all.
    draw: what makes a view's frame.
    """
    steps = steps or Steps()
    x0 = parameters.sh.astype(np.float64)
    free = np.ones(x0.shape[:2], np.bool_) if coefficients is None else np.arange(x0.shape[1]) < coefficients[:, None]
    right, diagonal = np.zeros_like(x0), np.zeros_like(x0)
    matrices: list[ViewMatrix] = []
    used = list(range(len(cameras)))
    before, pairs = 0.0, 0
    with steps.bar("least squares: weights") as report:
        while len(matrices) < len(used):
            n = len(matrices)
            report(n, len(used))
            number = used[n]
            frame = draw(parameters, cameras[number])
            image, wanted = frame.image, np.clip(pictures[number], 0.0, 1.0)
            mask = ~((image > 1.0) & (wanted >= 1.0))
            matrix = ViewMatrix.of(frame, mask)
            pairs += len(matrix.weight)
            if n == 0 and len(used) * len(matrix.weight) * _PAIR_BYTES > MEMORY:
                most = max(1, MEMORY // max(1, len(matrix.weight) * _PAIR_BYTES))
                used = [k * len(used) // most for k in range(most)]
            left = np.where(mask, wanted - image, 0.0)
            before += float(((np.clip(image, 0.0, 1.0) - wanted) ** 2).sum())
            matrix.back(left, right)
            matrix.back(image, diagonal, square=True)
            matrices.append(matrix)
    right *= free[:, :, None]
    delta, residual = np.zeros_like(x0), right
    weights = np.asarray(ridge, np.float64)[SH_BAND[: x0.shape[1]], None]
    precondition = free[:, :, None] / (diagonal + weights)
    direction = precondition * residual
    size = float((residual * direction).sum())
    with steps.bar("least squares") as report:
        for done in range(iterations):
            report(done, iterations)
            if not size > 0.0:
                break
            product = weights * direction
            for matrix in matrices:
                matrix.back(matrix.forward(direction), product)
            product *= free[:, :, None]
            step = size / float((direction * product).sum())
            delta += step * direction
            residual = residual - step * product
            scaled = precondition * residual
            size, old = float((residual * scaled).sum()), size
            direction = scaled + (size / old) * direction
    values = parameters.values.copy()
    values[:, SH:] = (x0 + delta).reshape(len(values), -1)
    found = parameters.like(values)
    good = found.finite()
    values[~good] = parameters.values[~good]
    after = 0.0
    for number in used:
        wanted = np.clip(pictures[number], 0.0, 1.0)
        after += float(((np.clip(draw(found, cameras[number]).image, 0.0, 1.0) - wanted) ** 2).sum())
    return found if after < before else parameters
