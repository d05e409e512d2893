"""Kinds of lists: what each core streams before any mask is made.

Every list is a `SubtileLists` of 8x8 sub-tiles, so that one VRU model serves all kinds: in `tile_lists` the four sub-tiles of a
16x16 tile have the same splats.
"""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np

from ..arithmetic.fp import fp16_value
from ..arithmetic.thresholds import EPSILON, radii
from ..errors import FlickerError
from ..params import SUBTILE, TILE, Coords, Form, RenderConfig
from ..scene.camera import Camera
from .binning import bin_boxes, circle_boxes, pairs
from .projection import Projected
from .records import MAX_FP16, SubtileLists, build_lists, local_means

OBB_AXIS_RATIO = 2.0  # GSCore: the oriented box is tested for splats more elongated than this
_SIGMAS = 3.0


def _with_entries(lists: SubtileLists, projected: Projected, start: np.ndarray, entry: np.ndarray, tile_pairs: int) -> SubtileLists:
    mean = np.empty((len(entry), 2), np.uint16)
    local_means(projected.mean, start, entry, lists.cols, False, mean)
    return replace(lists, start=start, entry=entry, mean=mean, tile_pairs=tile_pairs)


def absolute_means(lists: SubtileLists, projected: Projected, origin: tuple[int, int]) -> np.ndarray:
    """uint16 (E, 2): means of the entries when they are rounded to FP16 in screen coordinates first (`Coords.ABSOLUTE`)."""
    screen = np.clip(projected.mean + origin, -MAX_FP16, MAX_FP16).astype(np.float16).astype(np.float64) - origin
    mean = np.empty((len(lists.entry), 2), np.uint16)
    local_means(screen, lists.start, lists.entry, lists.cols, False, mean)
    return mean


def tile_lists(lists: SubtileLists, projected: Projected, camera: Camera) -> SubtileLists:
    """Lists of vanilla 3DGS: a splat meets a 16x16 tile when the bounding square of its 3-sigma circle does (INRIA rasterizer)."""
    side = TILE // SUBTILE
    tiles = circle_boxes(projected.mean, projected.circle, -(-lists.cols // side), -(-lists.rows // side))
    box = np.minimum(side * tiles, np.array([lists.cols, lists.cols, lists.rows, lists.rows], np.int32))
    start, entry = bin_boxes(box, lists.cols, lists.rows)
    return _with_entries(lists, projected, start, entry, pairs(tiles))


@numba.njit
def _obb_meets(mean_x, mean_y, xx, xy, yy, x0, y0, x1, y1):
    """Whether a splat of mean and covariance is listed in a rectangle of pixel centres, edges included."""
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    mid = 0.5 * (xx + yy)
    gap = np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
    long = mid + gap
    short = (xx * yy - xy * xy) / long
    if long <= OBB_AXIS_RATIO**2 * short:
        return True
    # Unit vector of the long axis, from the row of (cov - short I) that does not vanish.
    if xx > yy:
        ax, ay = xx - short, xy
    else:
        ax, ay = xy, yy - short
    norm = np.sqrt(ax * ax + ay * ay)
    ax /= norm
    ay /= norm
    dx = mean_x - (x0 + half_x)
    dy = mean_y - (y0 + half_y)
    # Separating axes: the two of the oriented box and, as its own bounding box, the two of the picture.
    e0 = _SIGMAS * np.sqrt(long)
    e1 = _SIGMAS * np.sqrt(short)
    return (
        abs(dx * ax + dy * ay) <= e0 + half_x * abs(ax) + half_y * abs(ay)
        and abs(dy * ax - dx * ay) <= e1 + half_x * abs(ay) + half_y * abs(ax)
        and abs(dx) <= half_x + e0 * abs(ax) + e1 * abs(ay)
        and abs(dy) <= half_y + e0 * abs(ay) + e1 * abs(ax)
    )


@numba.njit(parallel=True, cache=True)
def _obb_keep(mean, cov, start, entry, cols, width, height, keep):
    for s in numba.prange(len(start) - 1):
        x0 = (s % cols) * SUBTILE
        y0 = (s // cols) * SUBTILE
        x1, y1 = min(x0 + SUBTILE, width) - 1, min(y0 + SUBTILE, height) - 1
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            keep[n] = _obb_meets(mean[i, 0], mean[i, 1], cov[i, 0], cov[i, 1], cov[i, 2], x0, y0, x1, y1)


@numba.njit(parallel=True, cache=True)
def obb_masks(mean, cov, splat, tile, mask, cols, width, height):
    """Masks of the front end's list entries, without the sub-tiles that a splat's oriented box does not meet. Arrays as in `FrontFrame`; mean float64
    (R, 2), pixels, cov (R, 3); cols: of tiles."""
    out = np.zeros(len(mask), np.uint8)
    for e in numba.prange(len(mask)):
        i = splat[e]
        for k in range(4):
            if mask[e] >> k & 1:
                x0 = tile[e] % cols * TILE + k % 2 * SUBTILE
                y0 = tile[e] // cols * TILE + k // 2 * SUBTILE
                x1, y1 = min(x0 + SUBTILE, width) - 1, min(y0 + SUBTILE, height) - 1
                if _obb_meets(mean[i, 0], mean[i, 1], cov[i, 0], cov[i, 1], cov[i, 2], x0, y0, x1, y1):
                    out[e] |= 1 << k
    return out


def obb_lists(lists: SubtileLists, projected: Projected, camera: Camera) -> SubtileLists:
    """GSCore's lists: entries of `lists`, those with an axis ratio > 2 only where their oriented 3-sigma box meets the sub-tile."""
    keep = np.zeros(len(lists.entry), np.bool_)
    _obb_keep(projected.mean, projected.cov2d, lists.start, lists.entry, lists.cols, camera.width, camera.height, keep)
    start = np.concatenate([[0], np.cumsum(keep)])[lists.start]
    return replace(lists, start=start, entry=lists.entry[keep], mean=lists.mean[keep])


@numba.njit(parallel=True, cache=True)
def _reach_keep(gauss, rho, start, entry, mean, box_only, keep):
    last = SUBTILE - 1.0
    for s in numba.prange(len(start) - 1):
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            r = rho[gauss[i, 5]]
            l0 = np.float64(fp16_value(gauss[i, 2]))
            l1 = np.float64(fp16_value(gauss[i, 3]))
            l2 = np.float64(fp16_value(gauss[i, 4]))
            x0, y0 = -np.float64(fp16_value(mean[n, 0])), -np.float64(fp16_value(mean[n, 1]))
            x1, y1 = x0 + last, y0 + last
            # What the VRU's roundings of u can come to (docs/reference/mask_bounds.md), at the farthest corner.
            r += 2.1 * EPSILON * (l0 * max(-x0, x1) + abs(l1) * max(-y0, y1)) + 2.0**-20
            if r <= 2.0**-20 or not l0 > 0.0 or not l2 > 0.0:
                keep[n] = r > 2.0**-20
                continue
            if box_only:  # extents of the ellipse u^2 + v^2 = r^2
                half_y = r / l2
                half_x = r * np.sqrt(1.0 + (l1 / l2) ** 2) / l0
                keep[n] = x0 <= half_x and x1 >= -half_x and y0 <= half_y and y1 >= -half_y
                continue
            if x0 <= 0.0 <= x1 and y0 <= 0.0 <= y1:
                keep[n] = True
                continue
            best = np.inf
            if x0 > 0.0 or x1 < 0.0:
                x = x0 if x0 > 0.0 else x1
                y = min(max(-l0 * l1 / (l1 * l1 + l2 * l2) * x, y0), y1)
                best = (l0 * x + l1 * y) ** 2 + (l2 * y) ** 2
            if y0 > 0.0 or y1 < 0.0:
                y = y0 if y0 > 0.0 else y1
                x = min(max(-l1 / l0 * y, x0), x1)
                best = min(best, (l0 * x + l1 * y) ** 2 + (l2 * y) ** 2)
            keep[n] = best <= r * r * (1.0 + 1e-9)


def _reach_lists(lists: SubtileLists, box_only: bool) -> SubtileLists:
    if lists.form != Form.FACTORED:
        raise FlickerError("lists by reach: factored form only")
    keep = np.zeros(len(lists.entry), np.bool_)
    _reach_keep(lists.gauss, radii(lists.form), lists.start, lists.entry, lists.mean, box_only, keep)
    start = np.concatenate([[0], np.cumsum(keep)])[lists.start]
    return replace(lists, start=start, entry=lists.entry[keep], mean=lists.mean[keep])


def reach_lists(lists: SubtileLists, projected: Projected, camera: Camera) -> SubtileLists:
    """Entries of `lists` whose sub-tile meets the bounding box of the ellipse alpha = 1/255: faint splats reach less than 3 sigma.

    float64, on the host, with the VRU's roundings allowed for: no contributing entry is lost.
    """
    return _reach_lists(lists, True)


def ellipse_lists(lists: SubtileLists, projected: Projected, camera: Camera) -> SubtileLists:
    """Entries of `lists` whose sub-tile meets the ellipse alpha = 1/255 itself: one exact-rectangle test per entry when lists are made."""
    return _reach_lists(lists, False)


def subtile_lists(
    projected: Projected, camera: Camera, form: Form, coords: Coords = Coords.LOCAL, origin: tuple[int, int] = (0, 0),
) -> SubtileLists:
    """A splat meets an 8x8 sub-tile when its 3-sigma box (per axis, after dilation) contains a pixel centre of it. coords, origin: as in `View`."""
    lists = build_lists(projected, camera, RenderConfig(form=form))
    if coords == Coords.ABSOLUTE:
        lists.mean = absolute_means(lists, projected, origin)
    return lists


def square_lists(lists: SubtileLists, projected: Projected, camera: Camera) -> SubtileLists:
    """`ellipse_lists` of `tile_lists`: they end where those of the float64 reference do, not at the 3-sigma boxes, beyond which alpha is up to 2.8/255."""
    return ellipse_lists(tile_lists(lists, projected, camera), projected, camera)


# Kinds made from `subtile`: `tile` is vanilla's, `obb` GSCore's; `reach`, `ellipse` and `squares` leave out entries that cannot contribute (factored form).
DERIVED = {"tile": tile_lists, "obb": obb_lists, "reach": reach_lists, "ellipse": ellipse_lists, "squares": square_lists}
LISTS = ("subtile", *DERIVED)
