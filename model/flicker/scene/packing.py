"""Making memory images (`scene.packed`): clusters, codes, bounds."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from .clusters import morton_order, reorder
from .gaussians import SH_C0, SH_DEGREES, Scene
from .memory import ChunkScene, rotation_word
from .packed import (
    BEAT,
    CLUSTER_LIMIT,
    POSITION_BITS,
    ROTATION_BITS,
    SCALE_BITS,
    SLOT_LIMIT,
    SLOT_STEP,
    TABLE_ENTRY,
    PackedFormat,
    PackedScene,
    bounds,
    coefficients,
    split,
    too_long,
)

_LOG2_LIMIT = 30.0  # of scales in chunks
_MAX_FP16 = 65504.0
_TINY_FP16 = 2.0**-24


@dataclass(eq=False)
class Packing:
    """A packed scene and what happened to it. clamped: values that were changed beyond rounding, by reason."""

    packed: PackedScene
    clamped: dict[str, int] = field(default_factory=dict)


def _merge(start: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.minimum.reduceat(values, start), np.maximum.reduceat(values, start)


def _join(codes: np.ndarray, bits: tuple[int, ...]) -> np.ndarray:
    """uint32 (N,): the opposite of `split`."""
    word = np.zeros(len(codes), np.uint32)
    for i, width in enumerate(bits):
        word = word << np.uint32(width) | codes[:, i].astype(np.uint32)
    return word


def _float32(values: np.ndarray, what: str, path: Path | None) -> np.ndarray:
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.asarray(values).astype(np.float32)
    if not np.isfinite(found).all():
        raise FlickerError(f"{path or 'scene'}: {what}: not a finite float32")
    return found


def _quantised(values: np.ndarray, start: np.ndarray, counts: np.ndarray, bits: tuple[int, ...], what: str, path: Path | None):
    """low, step: float32 (C, n), codes: int64 (N, n), nearest."""
    low, high = _merge(start, values)
    most = (1 << np.array(bits)) - 1
    low32 = _float32(low, f"{what} low", path)
    step = _float32((high - low32) / most, f"{what} step", path).clip(0)
    wide = np.repeat(step.astype(np.float64), counts, axis=0)
    codes = np.divide(values - np.repeat(low32.astype(np.float64), counts, axis=0), wide, out=np.zeros_like(values), where=wide > 0)
    return low32, step, np.clip(np.floor(codes + 0.5), 0, most).astype(np.int64)


def _sh_codes(rest: np.ndarray, start: np.ndarray, counts: np.ndarray, path: Path | None) -> tuple[np.ndarray, np.ndarray]:
    """step: float32 (C, 3, 3) of half a code, codes: uint8 (N, K - 1, 3), 128 for zero."""
    step = np.zeros((len(start), 3, 3), np.float32)
    codes = np.full(rest.shape, 128, np.uint8)
    for degree in range(1, 4):
        of = slice(coefficients(degree - 1) - 1, coefficients(degree) - 1)
        if of.start >= rest.shape[1]:
            break
        part = rest[:, of]
        largest = np.maximum.reduceat(np.abs(part).max(axis=1), start)
        step[:, degree - 1] = _float32(largest / 254, "sh_step", path)
        wide = 2 * np.repeat(step[:, degree - 1].astype(np.float64), counts, axis=0)[:, None]
        scaled = np.divide(part, wide, out=np.zeros_like(part), where=wide > 0)
        codes[:, of] = np.clip(np.floor(scaled + 128.5), 1, 255)
    return step, codes


def _degrees(used: np.ndarray, start: np.ndarray) -> np.ndarray:
    """int64 (C,): smallest degree that keeps every coefficient in use. used: bool (N, K - 1)."""
    degrees = np.zeros(len(start), np.int64)
    for degree in range(1, 4):
        of = slice(coefficients(degree - 1) - 1, coefficients(degree) - 1)
        if of.start < used.shape[1]:
            degrees[np.maximum.reduceat(used[:, of].any(axis=1), start)] = degree
    return degrees


def _assemble(
    form: PackedFormat, headers: np.ndarray, geometry: np.ndarray, rows: np.ndarray, start: np.ndarray, counts: np.ndarray, degrees: np.ndarray,
    path: Path | None,
) -> PackedScene:
    """The packed scene. geometry: (N, words); rows: uint8 (N, bytes of a Gaussian's colour); headers lack the place of the colours."""
    used = -(-counts // SLOT_STEP)
    slots = int(used.sum()) * SLOT_STEP
    if slots > SLOT_LIMIT:
        raise FlickerError(f"{path or 'scene'}: {slots} slots, more than {SLOT_LIMIT}: a record's number has 24 bits")
    table = np.zeros(len(start), TABLE_ENTRY)
    table["last"], table["flags"], table["first"] = counts - 1, degrees, np.cumsum(used) - used
    strides = np.array([form.colour_stride(d) for d in range(4)])[degrees]
    beats = -(-strides * counts // BEAT)
    headers["colour"] = np.cumsum(beats) - beats
    kind, words = form.geometry
    packed = PackedScene(form, table, headers, np.zeros((slots, words), kind), np.zeros(int(beats.sum()) * BEAT, np.uint8), path)
    packed.geometry[packed.slot] = geometry
    for k, degree in enumerate(degrees.tolist()):
        first, last, stride = packed.colour_span(k)
        size = form.colour_bytes(degree)
        packed.colour[first:last].reshape(-1, stride)[:, :size] = rows[start[k] : start[k] + counts[k], :size]
    low, high, sigma = bounds(packed)
    for name, box in (("low", low), ("high", high)):
        table[name] = _float32(box, name, path)
    if (sigma >= 0x7F80).any() or (sigma == 0).any():
        raise FlickerError(f"{path or 'scene'}: sigma: not a positive float32 number")
    table["sigma"] = sigma
    return packed


def pack(scene: Scene, form: PackedFormat = PackedFormat.CHUNK) -> Packing:
    """Put a scene into Morton order and clusters, and those into a format."""
    scene = reorder(scene, morton_order(scene.means))
    start = np.arange(0, len(scene), CLUSTER_LIMIT)
    counts = np.diff(np.append(start, len(scene)))
    return (_pack_chunks if form is PackedFormat.CHUNK else _pack_fp16)(scene, form, start, counts)


def _pack_chunks(scene: Scene, form: PackedFormat, start: np.ndarray, counts: np.ndarray) -> Packing:
    path = scene.path
    headers = np.zeros(len(start), form.header)
    logs = np.log2(scene.scales.astype(np.float64))
    beyond = int((np.abs(logs) > _LOG2_LIMIT).any(axis=1).sum())
    parts = {
        "position": (scene.means.astype(np.float64), POSITION_BITS), "scale": (logs.clip(-_LOG2_LIMIT, _LOG2_LIMIT), SCALE_BITS),
        "dc": (0.5 + SH_C0 * scene.sh[:, 0].astype(np.float64), (8, 8, 8)),
    }
    codes = {}
    for name, (values, bits) in parts.items():
        headers[f"{name}_low"], headers[f"{name}_step"], codes[name] = _quantised(values, start, counts, bits, name, path)
    geometry = np.stack([_join(codes["position"], POSITION_BITS), rotation_word(scene.quats), _join(codes["scale"], SCALE_BITS)], axis=1)
    opacity = np.floor(scene.opacities.astype(np.float64).clip(0, 1) * 255 + 0.5).astype(np.int64)
    headers["sh_zero"] = 256
    headers["sh_step"], sh = _sh_codes(scene.sh[:, 1:].astype(np.float64), start, counts, path)
    rows = _colour_rows(_join(np.column_stack([codes["dc"], opacity]), (8, 8, 8, 8)), sh)
    degrees = _degrees((sh != 128).any(axis=2), start)
    clamped = {"scale beyond 2^-30 to 2^30": beyond} if beyond else {}
    return Packing(_assemble(form, headers, geometry, rows, start, counts, degrees, path), clamped)


def _colour_rows(colour: np.ndarray, sh: np.ndarray) -> np.ndarray:
    return np.concatenate([colour.astype("<u4")[:, None].view(np.uint8), sh.reshape(len(sh), -1)], axis=1)


def pack_chunks(data: ChunkScene, path: Path | None = None) -> Packing:
    """Take over chunks with their codes: nothing is rounded but the bounds, to float32 low ends and steps."""
    n = len(data.packed)
    start = np.arange(0, n, CLUSTER_LIMIT)
    counts = np.diff(np.append(start, n))
    headers = np.zeros(len(start), PackedFormat.CHUNK.header)
    limits = data.bounds.astype(np.float64)
    if not np.isfinite(limits).all():
        raise FlickerError(f"{path or 'chunks'}: chunk {np.flatnonzero(~np.isfinite(limits).all(axis=1))[0]}: bounds not finite")
    for i, (name, bits, unit) in enumerate((("position", POSITION_BITS, 1.0), ("scale", SCALE_BITS, np.log2(np.e)), ("dc", (8, 8, 8), 1.0))):
        low, high = (limits[:, 6 * i + 3 * k : 6 * i + 3 * k + 3] * unit for k in (0, 1))
        if (low > high).any():
            raise FlickerError(f"{path or 'chunks'}: chunk {np.flatnonzero((low > high).any(axis=1))[0]}: {name}: min above max")
        headers[f"{name}_low"] = _float32(low, f"{name} low", path)
        headers[f"{name}_step"] = _float32((high - low) / ((1 << np.array(bits)) - 1), f"{name} step", path)
    rotation = data.packed[:, 1].copy()
    long = too_long(rotation)
    rotation[long] = _shortened(rotation[long])
    sh = data.sh.reshape(n, 3, -1).transpose(0, 2, 1)
    headers["sh_zero"] = 255
    degree = SH_DEGREES[sh.shape[1] + 1]
    headers["sh_step"][:, :degree] = 1 / 64
    rows = _colour_rows(data.packed[:, 3], sh)
    geometry = np.column_stack([data.packed[:, 0], rotation, data.packed[:, 2]])
    packed = _assemble(PackedFormat.CHUNK, headers, geometry, rows, start, counts, np.full(len(start), degree), path)
    return Packing(packed, {"rotation longer than 1": int(long.sum())} if long.any() else {})


def _shortened(rotation: np.ndarray) -> np.ndarray:
    """Rotation words whose three components are longer than 1: of length 1, each rounded towards 0."""
    codes = split(rotation, ROTATION_BITS)
    three = 2 * codes[:, 1:] - 1023  # in units of sqrt(1/2) / 1023, odd
    short = three * (np.sqrt(2.0) * 1023 / np.sqrt((three**2).sum(axis=1, keepdims=True)))
    codes[:, 1:] = (np.sign(short) * (2 * np.floor((np.abs(short) - 1) / 2) + 1) + 1023) / 2
    return _join(codes, ROTATION_BITS)


def _fp16(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Bits of the nearest FP16 numbers, and how many were beyond the largest and became it."""
    beyond = np.abs(values) > _MAX_FP16
    return np.clip(values, -_MAX_FP16, _MAX_FP16).astype(np.float16).view(np.uint16), int(beyond.sum())


def _pack_fp16(scene: Scene, form: PackedFormat, start: np.ndarray, counts: np.ndarray) -> Packing:
    headers = np.zeros(len(start), form.header)
    means = scene.means.astype(np.float64)
    if form is PackedFormat.FP16_LOCAL:
        low, high = _merge(start, means)
        headers["origin"] = (low + high) / 2
        means = means - np.repeat(headers["origin"].astype(np.float64), counts, axis=0)
    n = len(scene)
    fields = {
        "mean": means, "scale": np.maximum(scene.scales.astype(np.float64), _TINY_FP16), "quat": scene.quats.astype(np.float64),
        "opacity": np.clip(scene.opacities.astype(np.float64), _TINY_FP16, 1)[:, None], "sh": scene.sh.reshape(n, -1).astype(np.float64),
    }
    bits, clamped = {}, {}
    for name, values in fields.items():
        bits[name], beyond = _fp16(values)
        if beyond:
            clamped[f"{name} beyond FP16"] = beyond
    if small := int((scene.scales < _TINY_FP16).sum()):
        clamped["scale below FP16"] = small
    geometry = np.concatenate([bits["mean"], bits["scale"], bits["quat"]], axis=1)
    colour = np.concatenate([bits["opacity"], bits["sh"]], axis=1).astype("<u2")
    degrees = _degrees((bits["sh"].reshape(n, -1, 3)[:, 1:] & 0x7FFF).any(axis=2), start)
    return Packing(_assemble(form, headers, geometry, colour.view(np.uint8), start, counts, degrees, scene.path), clamped)
