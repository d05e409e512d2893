"""Small scenes in every file format, for the tests of scenes and pictures."""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import factorial, pi, sqrt
from pathlib import Path

import gsply
import imagecodecs
import numpy as np

from flicker.scene.camera import Camera
from flicker.scene.files import Scene, save_ply
from flicker.scene.packed import PackedFormat
from flicker.scene.packing import pack

C0 = 0.28209479177387814


def thinned(scene: Scene, step: int) -> Scene:
    """Every step-th Gaussian of a scene."""
    return replace(scene, **{name: getattr(scene, name)[::step] for name in ("means", "scales", "quats", "opacities", "sh")})


def random_scene(seed: int, count: int = 300, degree: int = 3) -> Scene:
    """Gaussians in a 2 x 2 x 2 cube around the origin; values that every format can hold."""
    rng = np.random.default_rng(seed)
    quats = rng.normal(size=(count, 4))
    quats *= np.sign(quats[:, :1])
    return Scene(
        means=rng.uniform(-1, 1, (count, 3)),
        scales=np.exp(rng.uniform(-5, -2, (count, 3))),
        quats=quats / np.linalg.norm(quats, axis=1, keepdims=True),
        opacities=rng.uniform(0.05, 0.99, count),
        sh=np.concatenate([rng.uniform(-1, 1, (count, 1, 3)), rng.uniform(-0.4, 0.4, (count, (degree + 1) ** 2 - 1, 3))], axis=1),
    )


def least_scales(means: np.ndarray, cameras: Sequence[Camera], pixels: float) -> np.ndarray:
    """(N,): the size of `pixels` in the camera that sees a Gaussian largest."""
    distance = [np.linalg.norm(means.astype(np.float64) - camera.position, axis=1) / max(camera.fx, camera.fy) for camera in cameras]
    return pixels * np.min(distance, axis=0)


def as_gsply(scene: Scene) -> gsply.GSData:
    """Log scales and logit opacities, said so: gsply would otherwise guess from the values."""
    o = scene.opacities.astype(np.float64)
    return gsply.GSData.from_arrays(
        means=scene.means, scales=np.log(scene.scales), quats=scene.quats, opacities=np.log(o / (1 - o)).astype(np.float32),
        sh0=np.ascontiguousarray(scene.sh[:, 0]), shN=np.ascontiguousarray(scene.sh[:, 1:]) if scene.sh.shape[1] > 1 else None,
        format="ply",
    )


def half_turn(scene: Scene) -> Scene:
    """The scene turned by half a turn about x, harmonics included, by fitting them anew (no table of signs)."""
    turn = np.diag([1.0, -1.0, -1.0])
    rng = np.random.default_rng(0)
    way = rng.normal(size=(64, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    count = scene.sh.shape[1]
    values = np.einsum("dk,nkc->ndc", basis(way @ turn)[:, :count], scene.sh)
    sh = np.einsum("kd,ndc->nkc", np.linalg.pinv(basis(way)[:, :count]), values)
    w, x, y, z = scene.quats.T
    return Scene(scene.means @ turn, scene.scales, np.stack([-x, w, -z, y], axis=1), scene.opacities, sh)


def basis(way: np.ndarray) -> np.ndarray:
    """Real spherical harmonics (N, 16) at unit vectors (N, 3), from their definition by associated Legendre functions."""
    x, y, z = way.T
    rho, phi = np.hypot(x, y), np.arctan2(y, x)
    legendre = {
        (0, 0): 1 + 0 * z, (1, 0): z, (1, 1): rho, (2, 0): (3 * z**2 - 1) / 2, (2, 1): 3 * z * rho, (2, 2): 3 * rho**2,
        (3, 0): (5 * z**3 - 3 * z) / 2, (3, 1): 1.5 * (5 * z**2 - 1) * rho, (3, 2): 15 * z * rho**2, (3, 3): 15 * rho**3,
    }  # without the Condon-Shortley phase
    out = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            m = abs(order)
            k = sqrt((2 * degree + 1) / (4 * pi) * factorial(degree - m) / factorial(degree + m))
            angle = np.sin(m * phi) if order < 0 else np.cos(m * phi)
            # The INRIA order has the phase (-1)^m and, for m > 0, the factor sqrt(2).
            out.append((-1) ** m * k * (sqrt(2) if m else 1) * legendre[degree, m] * angle)
    return np.stack(out, axis=1)


def write_splat(path: Path, scene: Scene) -> None:
    """32-byte records."""
    with path.open("wb") as file:
        rgba = np.column_stack([0.5 + C0 * scene.sh[:, 0], scene.opacities])
        rgba = np.clip(np.rint(rgba * 255), 0, 255).astype(np.uint8)
        quats = np.clip(np.rint(scene.quats * 128 + 128), 0, 255).astype(np.uint8)
        for k in range(len(scene)):
            file.write(scene.means[k].tobytes() + scene.scales[k].tobytes() + rgba[k].tobytes() + quats[k].tobytes())


def _webp(values: np.ndarray, width: int) -> bytes:
    """uint8 (N, 4) as a lossless picture `width` pixels wide."""
    rows = -(-len(values) // width)
    picture = np.zeros((rows * width, 4), np.uint8)
    picture[: len(values)] = values
    return imagecodecs.webp_encode(picture.reshape(rows, width, 4), lossless=True)


def sog_files(scene: Scene) -> dict[str, bytes]:
    """The files of a SOG bundle, version 2, quantised as its specification says."""
    count, bands = len(scene), scene.sh.shape[1] - 1
    width = 4 * max(1, int(np.ceil(np.sqrt(count) / 4)))
    log_means = np.sign(scene.means) * np.log1p(np.abs(scene.means))
    low, high = log_means.min(axis=0), log_means.max(axis=0)
    fixed = np.rint((log_means - low) / (high - low) * 65535).astype(int)
    alpha = np.full((count, 1), 255)

    biggest = np.argmax(np.abs(scene.quats), axis=1)
    quats = scene.quats * np.sign(scene.quats[np.arange(count), biggest])[:, None]
    rest = np.stack([np.delete(q, k) for q, k in zip(quats, biggest, strict=True)])

    def codes(values: np.ndarray) -> tuple[np.ndarray, list[float]]:
        book = np.linspace(values.min(), values.max(), 256)
        return np.abs(values[..., None] - book).argmin(axis=-1), book.tolist()

    scale_codes, scale_book = codes(np.log(scene.scales))
    colour_codes, colour_book = codes(scene.sh[:, 0])
    meta = {
        "version": 2, "count": count, "antialias": False,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": scale_book, "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": colour_book, "files": ["sh0.webp"]},
    }
    files = {
        "means_l.webp": _webp(np.hstack([fixed & 255, alpha]), width),
        "means_u.webp": _webp(np.hstack([fixed >> 8, alpha]), width),
        "scales.webp": _webp(np.hstack([scale_codes, alpha]), width),
        "quats.webp": _webp(np.hstack([np.rint((rest * np.sqrt(2) + 1) * 127.5), (252 + biggest)[:, None]]), width),
        "sh0.webp": _webp(np.hstack([colour_codes, np.rint(scene.opacities * 255)[:, None]]), width),
    }
    if bands:
        sh_codes, sh_book = codes(scene.sh[:, 1:])  # one palette entry a Gaussian, 64 in a row
        palette = np.zeros((-(-count // 64) * 64, bands, 4), np.uint8)
        palette[:count] = np.concatenate([sh_codes, np.full((count, bands, 1), 255)], axis=2)
        label = np.arange(count)
        meta["shN"] = {
            "count": count, "bands": scene.sh_degree, "codebook": sh_book, "files": ["shN_centroids.webp", "shN_labels.webp"],
        }
        files["shN_centroids.webp"] = _webp(palette.reshape(-1, 4), 64 * bands)
        files["shN_labels.webp"] = _webp(np.stack([label & 255, label >> 8, 0 * label, 0 * label + 255], axis=1), width)
    return {"meta.json": json.dumps(meta).encode()} | files


def sog_files_v1(scene: Scene) -> dict[str, bytes]:
    """The same as version 1 without higher harmonics: values linear between bounds instead of codebooks."""
    files = sog_files(scene)
    meta = json.loads(files["meta.json"])
    count, o = len(scene), scene.opacities[:, None].astype(np.float64)

    def linear(values: np.ndarray) -> tuple[np.ndarray, dict[str, list[float]]]:
        low, high = values.min(axis=0), values.max(axis=0)
        return np.rint((values - low) / (high - low) * 255), {"mins": low.tolist(), "maxs": high.tolist()}

    width = 4 * max(1, int(np.ceil(np.sqrt(count) / 4)))
    scales, scale_bounds = linear(np.log(scene.scales))
    colours, colour_bounds = linear(np.hstack([scene.sh[:, 0], np.log(o / (1 - o))]))
    files["scales.webp"] = _webp(np.hstack([scales, np.full((count, 1), 255)]), width)
    files["sh0.webp"] = _webp(np.hstack([colours[:, :3], np.maximum(colours[:, 3:], 1)]), width)
    meta = {
        "means": meta["means"] | {"shape": [count, 3]}, "quats": meta["quats"],
        "scales": scale_bounds | {"files": ["scales.webp"]}, "sh0": colour_bounds | {"files": ["sh0.webp"]},
    }
    return files | {"meta.json": json.dumps(meta).encode()}


def write_spz2(path: Path, scene: Scene) -> None:
    """SPZ version 2: as version 3, but quaternions are three bytes (x, y, z with w positive)."""
    gsply.write_spz(path, as_gsply(scene), version=3)
    data = gzip.decompress(path.read_bytes())
    count = len(scene)
    rotations = 16 + 16 * count
    quats = scene.quats[:, 1:] * np.sign(scene.quats[:, :1])
    packed = np.rint((quats + 1) * 127.5).astype(np.uint8).tobytes()
    data = data[:4] + (2).to_bytes(4, "little") + data[8:rotations] + packed + data[rotations + 4 * count :]
    path.write_bytes(gzip.compress(data))


def sog_bundle(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as bundle:
        for name, data in files.items():
            bundle.writestr(name, data)
    return out.getvalue()


def write_ply_with_normals(path: Path, scene: Scene) -> None:
    """The layout that the INRIA training writes: normals (zero) after the position."""
    count, bands = len(scene), scene.sh.shape[1] - 1
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{k}" for k in range(3)), *(f"f_rest_{k}" for k in range(3 * bands))]
    names += ["opacity", *(f"scale_{k}" for k in range(3)), *(f"rot_{k}" for k in range(4))]
    o = scene.opacities[:, None].astype(np.float64)
    rest = scene.sh[:, 1:].transpose(0, 2, 1).reshape(count, -1)
    data = np.hstack([scene.means, 0 * scene.means, scene.sh[:, 0], rest, np.log(o / (1 - o)), np.log(scene.scales), scene.quats])
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    path.write_bytes(header.encode() + data.astype("<f4").tobytes())


# Format: file name, and what writes a scene to a file of it.
WRITERS: dict[str, tuple[str, Callable[[Path, Scene], object]]] = {
    "ply": ("a.ply", lambda path, scene: save_ply(scene, path)),
    "ply_normals": ("a.ply", write_ply_with_normals),
    "compressed": ("a.compressed.ply", lambda path, scene: gsply.plywrite(path, as_gsply(scene))),
    "spz2": ("a.spz", write_spz2),
    "spz3": ("a.spz", lambda path, scene: gsply.write_spz(path, as_gsply(scene), version=3)),
    "spz4": ("a.spz", lambda path, scene: gsply.write_spz(path, as_gsply(scene), version=4)),
    "sog": ("a.sog", lambda path, scene: path.write_bytes(sog_bundle(sog_files(scene)))),
    "sog1": ("a.sog", lambda path, scene: path.write_bytes(sog_bundle(sog_files_v1(scene)))),
    "splat": ("a.splat", write_splat),
    "flk": ("a.flk", lambda path, scene: path.write_bytes(pack(scene).packed.image())),
    "flk16": ("a.flk", lambda path, scene: path.write_bytes(pack(scene, PackedFormat.FP16_LOCAL).packed.image())),
}


def write(folder: Path, name: str, scene: Scene) -> Path:
    """The scene as a file of the format `name`."""
    file, writer = WRITERS[name]
    writer(folder / file, scene)
    return folder / file
