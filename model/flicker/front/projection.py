"""Projection of a scene into a camera in float64: EWA splatting with the rules of the INRIA rasterizer.

Source: Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field Rendering" (2023), Sec. 4 and the published
rasterizer. For a Gaussian with mean m, rotation R and scales s, seen by a camera with world-to-camera rotation W:
t = W (m - position), mean = (fx t_x / t_z + cx, ...), cov = J W R S S^T R^T W^T J^T + 0.3 I. The Jacobian J is taken at t with
t_x / t_z and t_y / t_z clamped to the slopes of the picture's edges and 0.3 times the tangent of half the field of view beyond (`slope_range`).

Of an antialiased scene (Yu et al., "Mip-Splatting" (2024), Sec. 4.2) an opacity is multiplied by sqrt(det of cov without 0.3 I / det of cov). The numerator
is never below 0, as in gsplat (`rasterize_mode="antialiased"`); the code of Mip-Splatting has a floor of 0.000025 under the ratio, which keeps 1/200 of an
opacity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..params import SPIKY_AXIS_RATIO, TILE, SortOrder
from ..scene.camera import Camera
from ..scene.files import Scene

NEAR = 0.2
DILATION = 0.3
_CLAMP = 1.3
_LEAST_FACTOR = 1e-150  # opacities stay positive
# Columns of the geometry table that the first pass fills. FACTOR: of the opacity in antialiased scenes.
X, Y, XX, XY, YY, A, B, C, RADIUS, SPIKY, FACTOR = range(11)
COLUMNS = 11

# Real spherical harmonics, in the order and with the signs of the INRIA code.
_C0 = 0.28209479177387814
_C1 = 0.4886025119029199
_C2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
_C3 = (
    -0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154,
    -0.4570457994644658, 1.445305721320277, -0.5900435899266435,
)


@dataclass
class Projected:
    """Gaussians in front of the camera whose box touches the picture, near to far (M of them).

    Sorted by depth, or by distance to the camera (`project`), both in float32; equal ones keep scene order.

    mean: float64 (M, 2), x and y in pixels. cov2d: float64 (M, 3), xx, xy, yy in px^2, dilated.
    conic: float64 (M, 3), a, b, c: the inverse of cov2d, [[a, b], [b, c]]. depth: float32 (M,), camera-space z.
    opacity: float64 (M,), of antialiased scenes with its factor. rgb: float64 (M, 3), max(0, 0.5 + SH). spiky: bool (M,), axis ratio >= 3 after dilation.
    index: int64 (M,), position in the scene. radii: float64 (M, 2), 3 standard deviations along x and y.
    circle: float64 (M,), the radius of the INRIA rasterizer: 3 standard deviations along the long axis, rounded up.
    """

    mean: np.ndarray
    cov2d: np.ndarray
    conic: np.ndarray
    depth: np.ndarray
    opacity: np.ndarray
    rgb: np.ndarray
    spiky: np.ndarray
    index: np.ndarray
    radii: np.ndarray
    circle: np.ndarray

    @classmethod
    def of(cls, table: np.ndarray, depth: np.ndarray, opacity: np.ndarray, rgb: np.ndarray, index: np.ndarray) -> Projected:
        """From the outcome of `geometry`: table, depth and opacity of all Gaussians of the scene, rgb of those in `index`."""
        table = table[index]
        cov2d = np.ascontiguousarray(table[:, XX : YY + 1])
        return cls(
            mean=np.ascontiguousarray(table[:, X : Y + 1]),
            cov2d=cov2d,
            conic=np.ascontiguousarray(table[:, A : C + 1]),
            depth=depth[index],
            opacity=opacity[index].astype(np.float64),
            rgb=rgb,
            spiky=table[:, SPIKY] != 0.0,
            index=index,
            radii=3.0 * np.sqrt(cov2d[:, ::2]),
            circle=np.ascontiguousarray(table[:, RADIUS]),
        )

    @property
    def n_visible(self) -> int:
        """Number of splats M."""
        return len(self.depth)


def slope_range(camera: Camera) -> np.ndarray:
    """float64 (2, 2): least and largest x / z and y / z (rows) that the Jacobian is taken at.

    The INRIA rasterizer takes 1.3 times the tangent of half the field of view either way. With a principal point off the middle the edges of the picture lie
    at other slopes: each side's is taken, and the same 0.3 times beyond it, as gsplat does.
    """
    size, focal = np.array([camera.width, camera.height]), np.array([camera.fx, camera.fy])
    half, off = _CLAMP * 0.5 * size, np.array([camera.cx, camera.cy]) - 0.5 * (size - 1)
    with np.errstate(over="ignore"):
        return np.stack([(-half - off) / focal, (half - off) / focal], axis=1)


@numba.njit(cache=True)
def tile_range(centre, radius, tiles):
    """First and one-past-last tile of centre +- radius, with the roundings of the INRIA rasterizer."""
    first = np.int64(min(max((centre - radius) / TILE, 0.0), float(tiles)))
    last = np.int64(min(max((centre + radius + (TILE - 1)) / TILE, 0.0), float(tiles)))
    return first, last


@numba.njit(parallel=True, cache=True)
def _geometry(means, scales, quats, view, position, width, height, fx, fy, cx, cy, slope, table, depth):
    tiles_x = (width + TILE - 1) // TILE
    tiles_y = (height + TILE - 1) // TILE
    for i in numba.prange(means.shape[0]):
        depth[i] = 0.0
        dx = means[i, 0] - position[0]
        dy = means[i, 1] - position[1]
        dz = means[i, 2] - position[2]
        z = view[2, 0] * dx + view[2, 1] * dy + view[2, 2] * dz
        if not z > NEAR:
            continue
        tx = (view[0, 0] * dx + view[0, 1] * dy + view[0, 2] * dz) / z
        ty = (view[1, 0] * dx + view[1, 1] * dy + view[1, 2] * dz) / z
        x = fx * tx + cx
        y = fy * ty + cy
        jx = -fx * min(max(tx, slope[0, 0]), slope[0, 1]) / z
        jy = -fy * min(max(ty, slope[1, 0]), slope[1, 1]) / z
        w = np.float64(quats[i, 0])
        p = np.float64(quats[i, 1])
        q = np.float64(quats[i, 2])
        r = np.float64(quats[i, 3])
        n = 2.0 / (w * w + p * p + q * q + r * r)
        # Rows u, v of J W R S: the covariance is their Gram matrix, its determinant the square of their cross product.
        u0 = u1 = u2 = v0 = v1 = v2 = 0.0
        for k in range(3):
            if k == 0:
                r0, r1, r2 = 1.0 - n * (q * q + r * r), n * (p * q + w * r), n * (p * r - w * q)
            elif k == 1:
                r0, r1, r2 = n * (p * q - w * r), 1.0 - n * (p * p + r * r), n * (q * r + w * p)
            else:
                r0, r1, r2 = n * (p * r + w * q), n * (q * r - w * p), 1.0 - n * (p * p + q * q)
            s = np.float64(scales[i, k])
            c2 = (view[2, 0] * r0 + view[2, 1] * r1 + view[2, 2] * r2) * s
            u = fx / z * (view[0, 0] * r0 + view[0, 1] * r1 + view[0, 2] * r2) * s + jx * c2
            v = fy / z * (view[1, 0] * r0 + view[1, 1] * r1 + view[1, 2] * r2) * s + jy * c2
            if k == 0:
                u0, v0 = u, v
            elif k == 1:
                u1, v1 = u, v
            else:
                u2, v2 = u, v
        xx = u0 * u0 + u1 * u1 + u2 * u2
        yy = v0 * v0 + v1 * v1 + v2 * v2
        xy = u0 * v0 + u1 * v1 + u2 * v2
        c0 = u1 * v2 - u2 * v1
        c1 = u2 * v0 - u0 * v2
        c2 = u0 * v1 - u1 * v0
        gram = c0 * c0 + c1 * c1 + c2 * c2
        det = gram + DILATION * (xx + yy) + DILATION * DILATION
        xx += DILATION
        yy += DILATION
        mid = 0.5 * (xx + yy)
        gap = 0.25 * (xx - yy) ** 2 + xy * xy
        long = mid + np.sqrt(gap)
        radius = np.ceil(3.0 * np.sqrt(mid + np.sqrt(max(0.1, gap))))
        first_x, last_x = tile_range(x, radius, tiles_x)
        first_y, last_y = tile_range(y, radius, tiles_y)
        if first_x >= last_x or first_y >= last_y:
            continue
        depth[i] = z
        table[i, X] = x
        table[i, Y] = y
        table[i, XX] = xx
        table[i, XY] = xy
        table[i, YY] = yy
        table[i, A] = yy / det
        table[i, B] = -xy / det
        table[i, C] = xx / det
        table[i, RADIUS] = radius
        table[i, SPIKY] = long * long >= SPIKY_AXIS_RATIO**2 * det
        table[i, FACTOR] = max(np.sqrt(gram / det), _LEAST_FACTOR)


def geometry(means: np.ndarray, scales: np.ndarray, quats: np.ndarray, camera: Camera, table: np.ndarray, depth: np.ndarray) -> None:
    """Fill the table, float64 (N, COLUMNS), and the depth, float32 (N,) (0: not visible), of every Gaussian."""
    _geometry(
        means, scales, quats, np.ascontiguousarray(camera.rotation.T), camera.position, camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy,
        slope_range(camera), table, depth,
    )


@numba.njit(parallel=True, cache=True)
def colours(means, sh, index, position, rgb):
    """max(0, 0.5 + SH) of the Gaussians `index`, seen from `position`."""
    count = sh.shape[1]
    for i in numba.prange(len(index)):
        j = index[i]
        x = means[j, 0] - position[0]
        y = means[j, 1] - position[1]
        z = means[j, 2] - position[2]
        n = np.sqrt(x * x + y * y + z * z)
        x /= n
        y /= n
        z /= n
        xx = x * x
        yy = y * y
        zz = z * z
        for c in range(3):
            v = 0.5 + _C0 * sh[j, 0, c]
            if count > 1:
                v += _C1 * (-y * sh[j, 1, c] + z * sh[j, 2, c] - x * sh[j, 3, c])
            if count > 4:
                v += _C2[0] * x * y * sh[j, 4, c] + _C2[1] * y * z * sh[j, 5, c]
                v += _C2[2] * (2.0 * zz - xx - yy) * sh[j, 6, c]
                v += _C2[3] * x * z * sh[j, 7, c] + _C2[4] * (xx - yy) * sh[j, 8, c]
            if count > 9:
                v += _C3[0] * y * (3.0 * xx - yy) * sh[j, 9, c] + _C3[1] * x * y * z * sh[j, 10, c]
                v += _C3[2] * y * (4.0 * zz - xx - yy) * sh[j, 11, c]
                v += _C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * sh[j, 12, c]
                v += _C3[4] * x * (4.0 * zz - xx - yy) * sh[j, 13, c]
                v += _C3[5] * z * (xx - yy) * sh[j, 14, c] + _C3[6] * x * (xx - 3.0 * yy) * sh[j, 15, c]
            rgb[i, c] = max(0.0, v)


def distances(means: np.ndarray, position: np.ndarray) -> np.ndarray:
    """float32 (N,): of means (N, 3) to a camera's position (3,). From differences in world axes, in float64, so that no turn of the camera changes a bit."""
    x, y, z = (means - position).T
    return np.sqrt(x * x + y * y + z * z).astype(np.float32)


def project(scene: Scene, camera: Camera, order: SortOrder = SortOrder.DEPTH) -> Projected:
    """Project a scene into a camera and sort it near to far: by depth along the axis, or by distance."""
    count = len(scene.means)
    table = np.empty((count, COLUMNS))
    depth = np.empty(count, np.float32)
    geometry(scene.means, scene.scales, scene.quats, camera, table, depth)
    index = np.flatnonzero(depth)
    by = depth[index] if order is SortOrder.DEPTH else distances(scene.means[index], camera.position)
    index = index[np.argsort(by, kind="stable")]
    rgb = np.empty((len(index), 3))
    colours(scene.means, scene.sh, index, camera.position, rgb)
    projected = Projected.of(table, depth, scene.opacities, rgb, index)
    if scene.antialiased:
        projected.opacity *= table[index, FACTOR]
    return projected
