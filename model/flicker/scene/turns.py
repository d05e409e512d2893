"""Scenes turned and moved: positions, ellipsoids and harmonics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .raw import Raw

# Signs of the axes x, y, z of half turns.
ABOUT_X = (1, -1, -1)
ABOUT_Y = (-1, 1, -1)
ABOUT_Z = (-1, -1, 1)
_ODD = ("", "y", "z", "x", "xy", "yz", "", "xz", "", "y", "xyz", "y", "z", "x", "z", "x")  # axes in which each harmonic is odd


def sh_signs(signs: tuple[int, int, int]) -> np.ndarray:
    """float32 (16,): what each harmonic is multiplied by when axes change their signs."""
    of = dict(zip("xyz", signs))
    return np.array([np.prod([of[axis] for axis in odd]) for odd in _ODD], np.float32)


def half_turn(raw: Raw, signs: tuple[int, int, int]) -> Raw:
    """Turned by half a turn, exactly. A quaternion whose vector part changes its signs so is the turned rotation with two axes of the Gaussian reversed:
    the same ellipsoid."""
    turn = np.array(signs, np.float32)
    return replace(raw, means=raw.means * turn, quats=raw.quats * np.append(np.float32(1), turn), sh=raw.sh * sh_signs(signs)[: raw.sh.shape[1], None])


def harmonics(way: np.ndarray) -> np.ndarray:
    """float64 (N, 16): the harmonics up to degree 3 of unit vectors (N, 3), in the order and with the signs of the INRIA code."""
    x, y, z = way.T
    c1, c2, c3 = np.sqrt(3 / np.pi) / 2, np.sqrt(15 / np.pi) / 2, np.sqrt(35 / (2 * np.pi)) / 4
    c4, c5, c6 = np.sqrt(21 / (2 * np.pi)) / 4, np.sqrt(105 / np.pi) / 2, np.sqrt(7 / np.pi) / 4
    return np.stack([
        np.full(len(way), np.sqrt(1 / np.pi) / 2), -c1 * y, c1 * z, -c1 * x,
        c2 * x * y, -c2 * y * z, np.sqrt(5 / np.pi) / 4 * (3 * z * z - 1), -c2 * x * z, c2 / 2 * (x * x - y * y),
        -c3 * y * (3 * x * x - y * y), c5 * x * y * z, -c4 * y * (5 * z * z - 1), c6 * z * (5 * z * z - 3), -c4 * x * (5 * z * z - 1),
        c5 / 2 * z * (x * x - y * y), -c3 * x * (x * x - 3 * y * y),
    ], axis=1)


def turned_sh(sh: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Coefficients (N, K, 3) of the same colours in a scene turned by the rotation matrix `turn`: a degree turns within itself."""
    spiral = np.arange(32) + 0.5  # directions spread evenly
    height, angle = 1 - spiral / 16, spiral * np.pi * (3 - np.sqrt(5))
    way = np.stack([np.cos(angle) * np.sqrt(1 - height**2), np.sin(angle) * np.sqrt(1 - height**2), height], axis=1)
    before, after = harmonics(way @ turn), harmonics(way)  # a colour seen from turn @ w is the old one from w
    out = np.array(sh, np.float64)
    for degree in range(1, int(np.sqrt(sh.shape[1]))):
        of = slice(degree**2, (degree + 1) ** 2)
        out[:, of] = np.einsum("kj,njc->nkc", np.linalg.lstsq(after[:, of], before[:, of], rcond=None)[0], sh[:, of])
    return out


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternion a (4,) times quaternions b (N, 4), w first."""
    w, v = b[:, :1], b[:, 1:]
    return np.hstack([a[0] * w - v @ a[1:, None], a[0] * v + w * a[1:] + np.cross(a[1:], v)])


def matrices(quats: np.ndarray) -> np.ndarray:
    """(N, 3, 3) of quaternions (N, 4), w first, of any length but 0."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    return np.stack([
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ], axis=1).reshape(-1, 3, 3)


def _quats(matrices: np.ndarray) -> np.ndarray:
    """(N, 4), w first, of rotation matrices (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrices).as_quat(scalar_first=True)


def moved(raw: Raw, matrix: np.ndarray) -> Raw:
    """Through an affine map (4, 4), float64. ValueError for one that mirrors or flattens, or is not finite.

    Ellipsoids become what their covariances say; harmonics turn with the rotation in the map.
    """
    linear, shift = matrix[:3, :3], matrix[:3, 3]
    if not np.isfinite(matrix).all() or np.linalg.det(linear) <= 0:
        raise ValueError("mirrors, flattens or is not finite")
    if np.array_equal(matrix, np.eye(4)):
        return raw
    left, stretch, right = np.linalg.svd(linear)
    turn = left @ right
    quats, scales = np.asarray(raw.quats, np.float64), np.asarray(raw.scales, np.float64)
    if stretch[0] - stretch[2] < 1e-6 * stretch[0]:
        quats, scales = _product(_quats(turn[None])[0], quats), scales * stretch.mean()
    else:
        good = np.isfinite(quats).all(axis=1) & np.isfinite(scales).all(axis=1) & (np.linalg.norm(quats, axis=1) > 0)
        axes, scales[good], _ = np.linalg.svd(linear @ matrices(quats[good]) * scales[good, None])
        axes[np.linalg.det(axes) < 0, :, 2] *= -1
        quats[good] = _quats(axes)
    return replace(raw, means=raw.means @ linear.T + shift, scales=scales, quats=quats, sh=turned_sh(raw.sh, turn))
