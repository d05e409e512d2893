"""SOG bundles written: version 2, lossless pictures. Codebooks and palette as its specification has them (PlayCanvas)."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import imagecodecs
import numpy as np

from ..errors import FlickerError
from .gaussians import Scene

_PALETTE = 1 << 16  # entries for harmonics, one a Gaussian here
_ROW = 64  # of them in a row of their picture
_BOOK = 256
_PASSES = 8


def _webp(values: np.ndarray, width: int) -> bytes:
    """Values (N, 4), 0 to 255, as a lossless picture `width` pixels wide."""
    rows = -(-len(values) // width)
    picture = np.zeros((rows * width, 4), np.uint8)
    picture[: len(values)] = values
    return bytes(imagecodecs.webp_encode(picture.reshape(rows, width, 4), lossless=True))


def _codes(values: np.ndarray) -> tuple[np.ndarray, list[float]]:
    """Codes of values and the codebook of 256 numbers: from their quantiles and their range alike, then moved to the means of what has them (Lloyd)."""
    flat = np.sort(values.astype(np.float64).ravel())
    ranks = np.linspace(0, len(flat) - 1, _BOOK // 2).astype(np.int64)
    book = np.sort(np.concatenate([flat[ranks], np.linspace(flat[0], flat[-1], _BOOK // 2)]))
    total = np.concatenate([[0.0], np.cumsum(flat)])
    for _ in range(_PASSES):
        edge = np.concatenate([[0], np.searchsorted(flat, (book[1:] + book[:-1]) / 2), [len(flat)]])
        count = np.diff(edge)
        book = np.sort(np.where(count > 0, np.diff(total[edge]) / np.maximum(count, 1), book))
    return np.searchsorted((book[1:] + book[:-1]) / 2, values.astype(np.float64)), book.tolist()


def save_sog(scene: Scene, path: Path) -> None:
    """Write a scene as a SOG bundle. FlickerError for more harmonics than a palette holds; OSError."""
    count, bands = len(scene), scene.sh.shape[1] - 1
    if bands and count > _PALETTE:
        raise FlickerError(
            f"{scene.path or 'scene'}: {count:,} Gaussians with harmonics: a SOG is written with up to {_PALETTE:,} of these; --degree 0 writes it without, "
            "splat-transform of PlayCanvas makes palettes"
        )
    width = 4 * max(1, int(np.ceil(np.sqrt(count) / 4)))
    alpha = np.full((count, 1), 255)
    logs = np.sign(scene.means) * np.log1p(np.abs(scene.means.astype(np.float64)))
    low, high = logs.min(axis=0), logs.max(axis=0)
    fixed = np.rint((logs - low) / np.where(high > low, high - low, 1.0) * 65535).astype(np.int64)
    largest = np.argmax(np.abs(scene.quats), axis=1)
    quats = scene.quats * np.where(np.take_along_axis(scene.quats, largest[:, None], axis=1) < 0, -1.0, 1.0)
    rest = quats[np.arange(4) != largest[:, None]].reshape(count, 3)
    scales, scale_book = _codes(np.log(scene.scales.astype(np.float64)))
    colours, colour_book = _codes(scene.sh[:, 0])
    opacity = np.rint(scene.opacities.astype(np.float64).clip(0, 1) * 255)[:, None]
    meta = {
        "version": 2, "count": count, "antialias": scene.antialiased,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": scale_book, "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": colour_book, "files": ["sh0.webp"]},
    }
    files = {
        "means_l.webp": _webp(np.hstack([fixed & 255, alpha]), width),
        "means_u.webp": _webp(np.hstack([fixed >> 8, alpha]), width),
        "scales.webp": _webp(np.hstack([scales, alpha]), width),
        "quats.webp": _webp(np.hstack([np.rint((rest * np.sqrt(2) + 1) * 127.5).clip(0, 255), (252 + largest)[:, None]]), width),
        "sh0.webp": _webp(np.hstack([colours, opacity]), width),
    }
    if bands:
        codes, book = _codes(scene.sh[:, 1:])
        palette = np.zeros((-(-count // _ROW) * _ROW, bands, 4), np.uint8)
        palette[:count] = np.concatenate([codes, np.full((count, bands, 1), 255)], axis=2)
        label = np.arange(count)
        meta["shN"] = {"count": count, "bands": scene.sh_degree, "codebook": book, "files": ["shN_centroids.webp", "shN_labels.webp"]}
        files["shN_centroids.webp"] = _webp(palette.reshape(-1, 4), _ROW * bands)
        files["shN_labels.webp"] = _webp(np.stack([label & 255, label >> 8, 0 * label, 0 * label + 255], axis=1), width)
    bundle = io.BytesIO()
    with zipfile.ZipFile(bundle, "w") as archive:
        for name, data in {"meta.json": json.dumps(meta).encode(), **files}.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    path.write_bytes(bundle.getvalue())
