"""Formats of a scene in memory: FP16 parameters (the paper) and chunk-quantised parameters (PlayCanvas' compressed PLY).

Each format stores a Gaussian in two places, as the two-step fetch needs it: geometry (mean, scale, rotation) in one
array, opacity and colour in another, both in the order of the clusters. Encoders and decoders work on the bits;
`decode` gives the scene that the chip sees.

| format | geometry | opacity and colour, K coefficients | cluster header |
|---|---|---|---|
| FP16 | 10 x FP16 = 20 bytes | (1 + 3 K) x FP16 | 32 bytes |
| FP16, cluster-local | the same, mean relative to the cluster | the same | 32 bytes (its box gives the origin) |
| chunks | position 11-10-11, rotation 2-10-10-10, log scale 11-10-11 bits | 8-8-8-8 bits, 8 bits a coefficient | 72 bytes: bounds |
| chunks, scaled SH | the same | the same, in units of the chunk's largest coefficient | 76 bytes |

The chunk format is that of PlayCanvas' splat-transform: values are rounded to the nearest code; SH codes are bins of
1/32 decoded at their middle, so that no code means 0. The last format is ours and differs in the SH codes only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import numpy as np

from ..errors import FlickerError, say
from .gaussians import SH_C0, Scene
from .ply import ANTIALIASED, Header, Ply, open_ply
from .raw import KEPT, cut_note, degree_of

CHUNK = 256  # Gaussians
CLUSTER_HEADER_BYTES = 32  # of FP16: box of the means (6 float32), largest standard deviation, first Gaussian and count
_MAX_FP16 = 65504.0
_TINY_FP16 = 2.0**-24
_SCALE_LOG_LIMIT = 20.0
_SQRT2 = np.sqrt(2.0)


class MemoryFormat(str, Enum):
    """How parameters lie in DRAM."""

    FP16 = "fp16"  # world coordinates
    FP16_LOCAL = "fp16-local"  # means relative to the centre of their cluster
    CHUNK = "chunk"  # 256 Gaussians with common bounds
    CHUNK_SH = "chunk-sh"  # the same, SH scaled by the largest coefficient of the chunk

    @property
    def chunked(self) -> bool:
        return self in (MemoryFormat.CHUNK, MemoryFormat.CHUNK_SH)


@dataclass(frozen=True)
class Layout:
    """Bytes of a format: a Gaussian's geometry, its opacity and colour, a cluster's header."""

    geometry: int
    colour: int
    header: int

    def total(self, gaussians: int, clusters: int) -> int:
        """Bytes of a scene."""
        return gaussians * (self.geometry + self.colour) + clusters * self.header


def layout(form: MemoryFormat, coefficients: int) -> Layout:
    """Bytes of a format for scenes with `coefficients` SH coefficients a colour."""
    if form.chunked:
        return Layout(12, 4 + 3 * (coefficients - 1), 76 if form is MemoryFormat.CHUNK_SH else 72)
    return Layout(20, 2 * (1 + 3 * coefficients), CLUSTER_HEADER_BYTES)


# ---- FP16 --------------------------------------------------------------------------------------


@dataclass(eq=False)
class Fp16Scene:
    """geometry: uint16 (N, 10) bits of mean, scale, quaternion. colour: uint16 (N, 1 + 3 K) bits of opacity, SH.

    size: Gaussians a cluster. origin: float32 (C, 3) of the clusters' means, or None for world coordinates.
    clamped: values beyond FP16, set to its largest number.
    """

    geometry: np.ndarray
    colour: np.ndarray
    size: int
    origin: np.ndarray | None
    clamped: int


def _fp16(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Bits of the nearest FP16 numbers; values beyond the largest finite one are clamped and counted."""
    values = np.asarray(values, np.float64)
    beyond = np.abs(values) > _MAX_FP16
    return np.clip(values, -_MAX_FP16, _MAX_FP16).astype(np.float16).view(np.uint16), int(beyond.sum())


def encode_fp16(scene: Scene, size: int = CHUNK, local: bool = False) -> Fp16Scene:
    """Round all parameters to FP16. local: means relative to the middle of the box of their cluster of `size` Gaussians.

    A scale or opacity that would become 0 becomes the smallest FP16 number.
    """
    means = scene.means.astype(np.float64)
    origin = None
    if local:
        start = np.arange(0, len(scene), size)
        low = np.minimum.reduceat(scene.means, start).astype(np.float64)
        high = np.maximum.reduceat(scene.means, start)
        origin = ((low + high) / 2).astype(np.float32)
        means = means - np.repeat(origin, size, axis=0)[: len(scene)]
    geometry, clamped = _fp16(np.concatenate([means, np.maximum(scene.scales, _TINY_FP16), scene.quats], axis=1))
    opacity = np.maximum(scene.opacities, _TINY_FP16)[:, None]
    colour, more = _fp16(np.concatenate([opacity, scene.sh.reshape(len(scene), -1)], axis=1))
    return Fp16Scene(geometry, colour, size, origin, clamped + more)


def decode_fp16(data: Fp16Scene, path: Path | None = None) -> Scene:
    """The scene that the bits say."""
    geometry = data.geometry.view(np.float16).astype(np.float32)
    colour = data.colour.view(np.float16).astype(np.float32)
    means = geometry[:, :3]
    if data.origin is not None:
        means = means + np.repeat(data.origin, data.size, axis=0)[: len(means)]
    quats = geometry[:, 6:].astype(np.float64)
    return Scene(means, geometry[:, 3:6], quats / np.linalg.norm(quats, axis=1, keepdims=True), colour[:, 0],
                 colour[:, 1:].reshape(len(colour), -1, 3), path)


# ---- chunks ------------------------------------------------------------------------------------


@dataclass(eq=False)
class ChunkScene:
    """bounds: float32 (C, 18): low and high corner of position, log scale and colour, in the order of the PLY element `chunk`.

    packed: uint32 (N, 4): position, rotation, scale, colour. sh: uint8 (N, 3 (K - 1)), channel by channel (f_rest_*).
    sh_scale: float32 (C,), largest coefficient of a chunk, codes then being 128 + 127 coefficient / largest; None for PlayCanvas' codes.
    antialiased: as in Scene.
    """

    bounds: np.ndarray
    packed: np.ndarray
    sh: np.ndarray
    sh_scale: np.ndarray | None = None
    antialiased: bool = False


def _unit(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Place of the values between the bounds of their chunk, 0 to 1; 0 where the bounds coincide."""
    low, high = (np.repeat(b.astype(np.float64), CHUNK, axis=0)[: len(values)] for b in (low, high))
    extent = high - low
    return np.clip(np.divide(values - low, extent, out=np.zeros_like(extent), where=extent > 0), 0.0, 1.0)


def _code(unit: np.ndarray, bits: int) -> np.ndarray:
    return np.floor(unit * ((1 << bits) - 1) + 0.5).astype(np.uint32)


def _pack_111011(unit: np.ndarray) -> np.ndarray:
    x, y, z = (_code(unit[:, i], bits) for i, bits in enumerate((11, 10, 11)))
    return x << 21 | y << 11 | z


def rotation_word(quats: np.ndarray) -> np.ndarray:
    """uint32 (N,), 2-10-10-10: number of the largest component of a quaternion (N, 4), codes of the other three in order."""
    quats = quats / np.linalg.norm(quats.astype(np.float64), axis=1, keepdims=True)
    largest = np.argmax(np.abs(quats), axis=1)
    quats *= np.where(np.take_along_axis(quats, largest[:, None], axis=1) < 0, -1.0, 1.0)
    others = quats[np.arange(4) != largest[:, None]].reshape(len(quats), 3)
    word = largest.astype(np.uint32) << 30
    for i in range(3):
        word |= _code(np.clip(others[:, i] * (_SQRT2 / 2) + 0.5, 0.0, 1.0), 10) << np.uint32(20 - 10 * i)
    return word


def rotation_of(word: np.ndarray) -> np.ndarray:
    """float64 (N, 4): the quaternion of a rotation word; the largest component makes it a unit, or is 0 where the others are too long for that."""
    three = ((word[:, None] >> np.array([20, 10, 0], np.uint32) & np.uint32(1023)) / 1023.0 - 0.5) * _SQRT2
    largest = word >> 30
    quats = np.empty((len(word), 4))
    quats[np.arange(4) != largest[:, None]] = three.ravel()
    quats[np.arange(len(word)), largest] = np.sqrt(np.maximum(0.0, 1.0 - (three**2).sum(axis=1)))
    return quats


def encode_chunks(scene: Scene, bounds: np.ndarray | None = None, scaled_sh: bool = False) -> ChunkScene:
    """Quantise in chunks of 256 in the order of the scene.

    bounds: chunk bounds to use instead of the tightest, float32 (C, 18). scaled_sh: SH codes scaled by chunk.
    """
    n = len(scene)
    logs = np.clip(np.log(scene.scales.astype(np.float64)), -_SCALE_LOG_LIMIT, _SCALE_LOG_LIMIT)
    colours = 0.5 + SH_C0 * scene.sh[:, 0].astype(np.float64)
    parts = (scene.means.astype(np.float64), logs, colours)
    if bounds is None:
        start = np.arange(0, n, CHUNK)
        bounds = np.concatenate([f.reduceat(p, start) for p in parts for f in (np.minimum, np.maximum)], axis=1).astype(np.float32)
    elif bounds.shape != (-(-n // CHUNK), 18):
        raise FlickerError(f"chunks: bounds are {bounds.shape}, not {(-(-n // CHUNK), 18)}")
    units = [_unit(p, bounds[:, 6 * i : 6 * i + 3], bounds[:, 6 * i + 3 : 6 * i + 6]) for i, p in enumerate(parts)]
    packed = np.empty((n, 4), np.uint32)
    packed[:, 0] = _pack_111011(units[0])
    packed[:, 2] = _pack_111011(units[1])
    opacity = np.clip(scene.opacities.astype(np.float64), 0.0, 1.0)
    rgba = [_code(units[2][:, i], 8) for i in range(3)] + [_code(opacity, 8)]
    packed[:, 3] = rgba[0] << 24 | rgba[1] << 16 | rgba[2] << 8 | rgba[3]
    packed[:, 1] = rotation_word(scene.quats)
    rest = scene.sh[:, 1:].transpose(0, 2, 1).reshape(n, -1).astype(np.float64)
    if not scaled_sh:
        return ChunkScene(bounds, packed, np.clip(np.floor(rest * 32.0 + 128.0), 0, 255).astype(np.uint8), antialiased=scene.antialiased)
    largest = np.zeros(len(bounds), np.float32)
    if rest.shape[1]:
        largest = np.maximum.reduceat(np.abs(rest).max(axis=1), np.arange(0, n, CHUNK)).astype(np.float32)
    scale = np.repeat(np.where(largest > 0, largest, 1).astype(np.float64), CHUNK)[:n, None]
    codes = np.clip(np.floor(rest / scale * 127.0 + 128.5), 1, 255).astype(np.uint8)
    return ChunkScene(bounds, packed, codes, largest, scene.antialiased)


def _unpack_111011(word: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    unit = np.stack([(word >> 21) / 2047.0, (word >> 11 & 1023) / 1023.0, (word & 2047) / 2047.0], axis=1)
    return _between(unit, low, high)


def _between(unit: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    low, high = (np.repeat(b.astype(np.float64), CHUNK, axis=0)[: len(unit)] for b in (low, high))
    return low + unit * (high - low)


def decode_chunks(data: ChunkScene, path: Path | None = None) -> Scene:
    """The scene that the bits say; an opacity code of 0, which never contributes, becomes 2^-24."""
    b, packed = data.bounds, data.packed
    n = len(packed)
    means = _unpack_111011(packed[:, 0], b[:, 0:3], b[:, 3:6])
    scales = np.exp(_unpack_111011(packed[:, 2], b[:, 6:9], b[:, 9:12]))
    rgba = (packed[:, 3:4] >> np.array([24, 16, 8, 0], np.uint32) & np.uint32(255)) / 255.0
    opacities = np.maximum(rgba[:, 3], _TINY_FP16)
    quats = rotation_of(packed[:, 1])
    sh = np.empty((n, data.sh.shape[1] // 3 + 1, 3))
    sh[:, 0] = (_between(rgba[:, :3], b[:, 12:15], b[:, 15:18]) - 0.5) / SH_C0
    rest = (data.sh - 127.5) / 32.0
    if data.sh_scale is not None:
        rest = (data.sh - 128.0) / 127.0 * np.repeat(data.sh_scale.astype(np.float64), CHUNK)[:n, None]
    sh[:, 1:] = rest.reshape(n, 3, -1).transpose(0, 2, 1)
    return Scene(means, scales, quats / np.linalg.norm(quats, axis=1, keepdims=True), opacities, sh, path, antialiased=data.antialiased)


_BOUNDS = [f"{m}_{v}" for group in ("{}", "scale_{}") for m in ("min", "max") for v in map(group.format, "xyz")]
_BOUNDS += [f"{m}_{v}" for m in ("min", "max") for v in "rgb"]
_PACKED = [f"packed_{v}" for v in ("position", "rotation", "scale", "color")]


def chunk_bytes(data: ChunkScene) -> bytes:
    """The compressed PLY file of codes of PlayCanvas."""
    n, rest = data.sh.shape
    header = ["ply", "format binary_little_endian 1.0", *(["comment SplatRenderMode: mip"] if data.antialiased else [])]
    header += [f"element chunk {len(data.bounds)}", *(f"property float {name}" for name in _BOUNDS)]
    header += [f"element vertex {n}"] + [f"property uint {name}" for name in _PACKED]
    if rest:
        header += [f"element sh {n}"] + [f"property uchar f_rest_{k}" for k in range(rest)]
    body = [data.bounds.astype("<f4").tobytes(), data.packed.astype("<u4").tobytes(), data.sh.tobytes()]
    return "\n".join([*header, "end_header", ""]).encode() + b"".join(body)


def save_chunks(data: ChunkScene, path: str | Path) -> None:
    """Write a compressed PLY file. Raises OSError, and FlickerError for SH codes that the file format does not know."""
    if data.sh_scale is not None:
        raise FlickerError(f"{path}: compressed PLY has no SH codes scaled by chunk")
    Path(path).write_bytes(chunk_bytes(data))


def is_chunked(header: Header) -> bool:
    """Whether a PLY file holds chunks, as PlayCanvas writes them."""
    vertex = header.element("vertex")
    return header.element("chunk") is not None and vertex is not None and any(p.name.startswith("packed_") for p in vertex.properties)


def chunks_of(file: Ply) -> tuple[ChunkScene, tuple[str, ...]]:
    """The bits of a compressed PLY file, and what was left out. Files of older writers, which have no bounds of colours, get 0 and 1. FlickerError for
    properties that are missing and counts that do not match."""
    path, header = file.path, file.header
    counts = {e.name: e.count for e in header.elements}
    chunks, n = counts["chunk"], counts["vertex"]
    if n == 0:
        raise FlickerError(f"{path}: no Gaussians")
    properties = {e.name: [p.name for p in e.properties] for e in header.elements}
    coloured = any(name in properties["chunk"] for name in _BOUNDS[12:])
    file.require("chunk", _BOUNDS[: 18 if coloured else 12], ("f4", "f8"), "float")
    file.require("vertex", _PACKED, ("u4", "i4"), "uint")
    rest = sum(name.startswith("f_rest_") for name in properties.get("sh", []))
    count = rest // 3 + 1
    if rest % 3 or degree_of(count) is None:
        raise FlickerError(f"{path}: {rest} properties f_rest_*, which no SH degree has: 0, 9, 24 or 45")
    file.require("sh", [f"f_rest_{k}" for k in range(rest)], ("u1",), "uchar")
    for name, number in (("chunk", -(-n // CHUNK)), ("sh", n)):
        if counts.get(name, number) != number:
            raise FlickerError(f"{path}: element '{name}': count {counts[name]}, not {number}")
    bounds = np.tile(np.array([0.0] * 15 + [1.0] * 3, np.float32), (chunks, 1))
    bounds[:, : 18 if coloured else 12] = file.numbers("chunk", _BOUNDS[: 18 if coloured else 12])
    kept = [f"f_rest_{c * (count - 1) + k}" for c in range(3) for k in range(min(count, KEPT) - 1)]
    sh = file.numbers("sh", kept, "u1") if kept else np.empty((n, 0), np.uint8)
    packed = file.numbers("vertex", _PACKED, "i8").astype(np.uint32)
    return ChunkScene(bounds, packed, sh, antialiased=header.mode == ANTIALIASED), cut_note(count) + header.mode_notes


def load_chunks(path: str | Path) -> ChunkScene:
    """The bits of a compressed PLY file. FlickerWarning for what is left out; FlickerError, naming file and field, for what is none."""
    file = open_ply(Path(path))
    if not is_chunked(file.header):
        raise FlickerError(f"{path}: not a compressed PLY file: elements chunk and vertex, the latter with packed_position, are missing")
    data, notes = chunks_of(file)
    for note in notes:
        say(path, note)
    return data


def through_memory(scene: Scene, form: MemoryFormat, size: int = CHUNK) -> Scene:
    """The scene as it comes back out of memory in a format. It must be in the order of its clusters (`build_clusters`)."""
    if form.chunked:
        decoded = decode_chunks(encode_chunks(scene, scaled_sh=form is MemoryFormat.CHUNK_SH), scene.path)
    else:
        decoded = decode_fp16(encode_fp16(scene, size, form is MemoryFormat.FP16_LOCAL), scene.path)
    return replace(decoded, antialiased=scene.antialiased)
