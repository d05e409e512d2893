"""The warping error of Lai, Huang, Wang, Shechtman, Yumer, Yang: "Learning Blind Video Temporal Consistency", ECCV 2018, Sec. 4.2: a frame against the next
one, warped back along the flow, over pixels that both see. A published witness beside `scene.temporal`, which needs no reference of the same pose.

The flow is not estimated: it follows from the depth of the reference and the two cameras. A pixel counts where flow and flow back agree and no edge of a motion
lies (Ruder, Dosovitskiy, Brox: "Artistic Style Transfer for Videos", GCPR 2016, equations 5 and 6, which Lai et al. take).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from .pinhole import Camera


def flow(depth: np.ndarray, camera: Camera, other: Camera) -> np.ndarray:
    """float64 (2, H, W): how far, in pixels right and down, what `camera` sees at each pixel lies from it in the picture of `other`. depth: float64 (H, W), z
    along the axis of `camera`. NaN where there is no depth, or the point lies behind `other`."""
    y, x = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    ray = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)])
    turn = other.rotation.T @ camera.rotation
    shift = other.rotation.T @ (camera.position - other.position)
    point = np.tensordot(turn, ray * depth, 1) + shift[:, None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        there = np.where(point[2] > 0.0, point[:2] / point[2], np.nan)
    return np.stack([other.fx * there[0] + other.cx - x, other.fy * there[1] + other.cy - y])


def _sampled(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """values (H, W) at places (2, H, W), x first, between pixels; NaN outside the picture and beside NaN."""
    return map_coordinates(values, at[::-1], order=1, mode="constant", cval=np.nan, prefilter=False)


def seen_by_both(there: np.ndarray, back: np.ndarray) -> np.ndarray:
    """bool (H, W): pixels of the first frame that the second one sees, too. there, back: flows from the first to the second and from the second to the
    first."""
    y, x = np.mgrid[: there.shape[1], : there.shape[2]].astype(np.float64)
    at = np.stack([x, y]) + there
    returned = np.stack([_sampled(part, at) for part in back])
    with np.errstate(invalid="ignore"):
        length = (there**2).sum(axis=0)
        agree = ((there + returned) ** 2).sum(axis=0) < 0.01 * (length + (returned**2).sum(axis=0)) + 0.5
        steep = sum(gradient**2 for part in there for gradient in np.gradient(part))
        return agree & (steep < 0.01 * length + 0.002)


def warping_error(image: np.ndarray, following: np.ndarray, there: np.ndarray, counted: np.ndarray) -> float | None:
    """Mean square of the difference between a picture (H, W, 3) and the one that follows, warped back along the flow `there`, over the pixels `counted` (H,
    W) and all channels; clamped to [0, 1]. None where no pixel counts."""
    y, x = np.mgrid[: there.shape[1], : there.shape[2]].astype(np.float64)
    at = (np.stack([x, y]) + there)[:, counted]
    if not at.size:
        return None
    image, following = np.clip(image, 0.0, 1.0), np.clip(following, 0.0, 1.0)
    return float(np.mean([np.mean((image[..., k][counted] - _sampled(following[..., k].astype(np.float64), at)) ** 2) for k in range(3)]))
