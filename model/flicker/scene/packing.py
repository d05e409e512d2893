"""Making memory images (`scene.packed`): clusters, codes, bounds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from ..progress import Steps
from .clusters import cluster_order, cut_clusters, reorder
from .files import has_chunks, load_scene, scene_kind, scene_title
from .gaussians import SH_C0, SH_DEGREES, Scene
from .memory import ChunkScene, load_chunks, rotation_word
from .packed import (
    BEAT,
    CLUSTER_LIMIT,
    DC_BITS,
    FULL_SH_BITS,
    POSITION_BITS,
    ROTATION_BITS,
    SCALE_BITS,
    SH_BITS,
    SLOT_LIMIT,
    SLOT_STEP,
    TABLE_ENTRY,
    PackedFormat,
    PackedScene,
    bounds,
    coefficients,
    load_packed,
    narrowed,
    slope_codes,
    split,
    too_long,
)

VISIBLE = 1.0 / 255.0  # opacity below which a Gaussian never is: pixels skip alphas below
CUTS = 0.015
_LOG2_LIMIT = 30.0  # of scales in chunks
_NORMAL = 126.0  # log2 of scales that are normal float32 numbers
_MAX_FP16 = 65504.0
_TINY_FP16 = 2.0**-24


class ShSteps(str, Enum):
    """What has a step of its SH codes of its own within a cluster."""

    PLAYCANVAS = "1/32 everywhere, no zero"  # the codes of compressed PLY
    CLUSTER = "cluster"
    DEGREE = "degree"
    CHANNEL = "degree and channel"


@dataclass(frozen=True)
class Recipe:
    """Choices in making chunks. cuts: bytes that may be spent on cutting clusters further, as a share of the Gaussians' bytes. sh: steps of SH codes. sh_bits:
    of a code, in all clusters (one of `SH_BITS`); or what chooses them, int64 (C,), for a scene whose Gaussians are in the clusters' order, from the number of
    each cluster's first one; None: 8, or those of a file that brings its own."""

    cuts: float = CUTS
    sh: ShSteps = ShSteps.CHANNEL
    sh_bits: int | Callable[[Scene, np.ndarray], np.ndarray] | None = None

    def bits(self, scene: Scene, start: np.ndarray) -> np.ndarray:
        """int64 (C,): those of the clusters, which begin with Gaussians `start`."""
        found = np.asarray(self.sh_bits(scene, start)) if callable(self.sh_bits) else np.full(len(start), self.sh_bits or FULL_SH_BITS)
        wrong = ~np.isin(found, SH_BITS if self.sh is not ShSteps.PLAYCANVAS else (FULL_SH_BITS,))
        if wrong.any():
            raise FlickerError(f"SH bits: {found[wrong][0]}, not {', '.join(map(str, SH_BITS[:-1]))} or {FULL_SH_BITS}")
        return found


@dataclass(eq=False)
class Packing:
    """A packed scene and how it came about.

    order: int64 (N,), number in the source of each Gaussian. clamped: values that were changed beyond rounding, by reason. left_out: Gaussians of the
    source that are not in it, by reason. kept_chunks: codes and clusters are those of the source, a compressed PLY; brought: of that or of an image.
    """

    packed: PackedScene
    order: np.ndarray
    clamped: dict[str, int] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    kept_chunks: bool = False
    brought: bool = False


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


def _sh_codes(
    rest: np.ndarray, start: np.ndarray, counts: np.ndarray, steps: ShSteps, bits: np.ndarray, path: Path | None,
) -> tuple[np.ndarray, np.ndarray]:
    """step: float32 (C, 3, 3) of half a code, codes: uint8 (N, K - 1, 3), 2 to the power of bits - 1 for zero. bits: int64 (C,)."""
    step = np.zeros((len(start), 3, 3), np.float32)
    if steps is ShSteps.PLAYCANVAS:
        step[:, : SH_DEGREES[rest.shape[1] + 1]] = 1 / 64
        return step, np.clip(np.floor(rest * 32.0 + 128.0), 0, 255).astype(np.uint8)
    zero = np.repeat(1 << bits - 1, counts)[:, None, None]
    codes = np.broadcast_to(zero, rest.shape).astype(np.uint8)
    parts = [slice(coefficients(d - 1) - 1, coefficients(d) - 1) for d in range(1, SH_DEGREES[rest.shape[1] + 1] + 1)]
    for degree, of in enumerate(parts):
        largest = np.maximum.reduceat(np.abs(rest[:, of]).max(axis=1), start)
        step[:, degree] = _float32(largest / ((1 << bits) - 2)[:, None], "sh_step", path)
    if steps is not ShSteps.CHANNEL:
        step[:] = step.max(axis=2 if steps is ShSteps.DEGREE else (1, 2), keepdims=True)
    for degree, of in enumerate(parts):
        wide = 2 * np.repeat(step[:, degree].astype(np.float64), counts, axis=0)[:, None]
        part = rest[:, of]
        scaled = np.divide(part, wide, out=np.zeros_like(part), where=wide > 0)
        codes[:, of] = np.clip(np.floor(scaled + zero + 0.5), 1, 2 * zero - 1)
    step[:, len(parts) :] = 0
    return step, codes


def coded_sh(scene: Scene, start: np.ndarray, bits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """float32 (N, K, 3): `scene.sh` as codes of int64 (C,) bits have it, in clusters that begin at `start`; int64 (C,): their degrees."""
    counts = np.diff(np.append(start, len(scene)))
    step, codes = _sh_codes(scene.sh[:, 1:].astype(np.float64), start, counts, ShSteps.CHANNEL, bits, scene.path)
    half = 2 * codes.astype(np.int16) - np.repeat(1 << bits, counts).astype(np.int16)[:, None, None]
    sh = scene.sh.astype(np.float32, copy=True)
    for degree in range(1, SH_DEGREES[sh.shape[1]] + 1):
        of = slice(coefficients(degree - 1), coefficients(degree))
        sh[:, of] = half[:, of.start - 1 : of.stop - 1] * np.repeat(step[:, degree - 1], counts, axis=0)[:, None]
    return sh, _degrees((half != 0).any(axis=2), start)


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
    kind, words = form.geometry
    packed = PackedScene(form, table, headers, np.zeros((slots, words), kind), np.zeros(0, np.uint8), path)
    strides, bits = packed.colour_strides, packed.sh_bits
    beats = -(-strides * counts // BEAT)
    headers["colour"] = np.cumsum(beats) - beats
    packed.colour = np.zeros(int(beats.sum()) * BEAT, np.uint8)
    packed.geometry[packed.slot] = geometry
    for k, degree in enumerate(degrees.tolist()):
        first, last, stride = packed.colour_span(k)
        here, size = rows[start[k] : start[k] + counts[k]], form.colour_bytes(degree)
        out = packed.colour[first:last].reshape(-1, stride)
        out[:, : min(size, stride)] = here[:, :size] if bits[k] == FULL_SH_BITS else narrowed(here[:, :size], int(bits[k]), stride)
    low, high, sigma = bounds(packed)
    for name, box in (("low", low), ("high", high)):
        table[name] = _float32(box, name, path)
    if (sigma >= 0x7F80).any() or (sigma == 0).any():
        raise FlickerError(f"{path or 'scene'}: sigma: not a positive float32 number")
    table["sigma"] = sigma
    table["flags"] |= slope_codes(packed) << 2
    return packed


def pack(scene: Scene, form: PackedFormat = PackedFormat.CHUNK, recipe: Recipe = Recipe(), steps: Steps | None = None) -> Packing:
    """Put a scene into Morton order and clusters, and those into a format. Gaussians that no pixel can show (opacity below 1/255) are left out.

    Raises FlickerError, naming the scene's file, where a field of the image is too narrow.
    """
    steps = steps or Steps()
    where = scene.path or "scene"
    left_out = dict(scene.rejected)
    with steps.step("clusters"):
        visible = scene.opacities.astype(np.float64) >= VISIBLE
        if not visible.any():
            raise FlickerError(f"{where}: no visible Gaussian: every opacity is below 1/255")
        if unseen := int((~visible).sum()):
            left_out["opacity below 1/255"] = unseen
        if int(visible.sum()) > SLOT_LIMIT:
            raise FlickerError(f"{where}: {int(visible.sum())} Gaussians, more than {SLOT_LIMIT}: a record's number has 24 bits")
        order = np.flatnonzero(visible)
        reach = math.inf if form is PackedFormat.CHUNK else 2.0 * _MAX_FP16
        along, start, near = cluster_order(scene.means[order], CLUSTER_LIMIT, reach)
        order = order[along]
        scene = reorder(scene, order)
        if form is PackedFormat.CHUNK and recipe.cuts > 0:
            gaussian = 12 + form.colour_stride(scene.sh_degree)
            far = start[start >= near]
            start = cut_clusters(
                scene.means[:near], start[start < near], int(recipe.cuts * gaussian * near), tuple((1 << bits) - 1 for bits in POSITION_BITS),
                TABLE_ENTRY.itemsize + form.header.itemsize + BEAT // 2, 12, SLOT_STEP,
            )
            start = np.concatenate([start, far])
        counts = np.diff(np.append(start, len(scene)))
    with steps.step("codes"):
        if form is PackedFormat.CHUNK:
            packed, clamped = _chunks(scene, start, counts, recipe)
        else:
            packed, clamped = _fp16(scene, form, start, counts)
    packed.antialiased = scene.antialiased
    return Packing(packed, order, clamped, left_out)


def pack_file(
    path: str | Path, form: PackedFormat = PackedFormat.CHUNK, recipe: Recipe = Recipe(), steps: Steps | None = None, rechunk: bool = False,
) -> Packing:
    """Pack what `load_scene` reads. A compressed PLY keeps its chunks in the chunk format, an image that has the format already stays as it is, and both
    refuse other SH bits than their own; rechunk: both are decoded and their clusters made anew.

    Raises FlickerError naming file and field.
    """
    path, steps = Path(path), steps or Steps()

    def kept(packing: Packing) -> Packing:
        own = packing.packed.sh_bits[packing.packed.degrees > 0]
        if recipe.sh_bits is not None and (callable(recipe.sh_bits) or (own != recipe.sh_bits).any()):
            raise FlickerError(f"{path}: brings its own SH codes: other bits need clusters that are made anew (--rechunk)")
        return packing

    title = scene_title(path)
    kind = "decoded" if rechunk else scene_kind(path)
    if kind == "image":
        with steps.step(f"loading {title}"):
            packed = load_packed(path)
        if packed.format is form:
            return kept(Packing(packed, np.arange(len(packed)), brought=True))
    if kind == "PLY" and form is PackedFormat.CHUNK:
        with steps.step(f"loading {title}"):
            chunks = load_chunks(path) if has_chunks(path) else None
        if chunks is not None:
            with steps.step("codes"):
                return kept(pack_chunks(chunks, path))
    with steps.step(f"loading {title}"):
        scene = load_scene(path)
    return pack(scene, form, recipe, steps)


def _chunks(scene: Scene, start: np.ndarray, counts: np.ndarray, recipe: Recipe) -> tuple[PackedScene, dict[str, int]]:
    path = scene.path
    headers = np.zeros(len(start), PackedFormat.CHUNK.header)
    logs = np.log2(scene.scales.astype(np.float64))
    parts = {
        "position": (scene.means.astype(np.float64), POSITION_BITS), "scale": (logs.clip(-_LOG2_LIMIT, _LOG2_LIMIT), SCALE_BITS),
        "dc": (0.5 + SH_C0 * scene.sh[:, 0].astype(np.float64), DC_BITS),
    }
    codes = {}
    for name, (values, bits) in parts.items():
        headers[f"{name}_low"], headers[f"{name}_step"], codes[name] = _quantised(values, start, counts, bits, name, path)
    geometry = np.stack([_join(codes["position"], POSITION_BITS), rotation_word(scene.quats), _join(codes["scale"], SCALE_BITS)], axis=1)
    opacity = np.floor(scene.opacities.astype(np.float64).clip(0, 1) * 255 + 0.5).astype(np.int64)
    playcanvas = recipe.sh is ShSteps.PLAYCANVAS
    sh_bits = recipe.bits(scene, start)
    headers["sh_step"], sh = _sh_codes(scene.sh[:, 1:].astype(np.float64), start, counts, recipe.sh, sh_bits, path)
    rows = _colour_rows(_join(np.column_stack([codes["dc"], opacity]), (*DC_BITS, 8)), sh)
    degrees = np.full(len(start), scene.sh_degree) if playcanvas else _degrees((sh != np.repeat(1 << sh_bits - 1, counts)[:, None, None]).any(axis=2), start)
    headers["sh_zero"] = 255 if playcanvas else np.where(degrees > 0, 1 << sh_bits, 1 << FULL_SH_BITS)
    clamped = {}
    for reason, values in (("log2 of a scale beyond -30 to 30", np.abs(logs) > _LOG2_LIMIT), ("opacity above 1", scene.opacities > 1)):
        if count := int(values.sum()):
            clamped[reason] = count
    return _assemble(PackedFormat.CHUNK, headers, geometry, rows, start, counts, degrees, path), clamped


def _colour_rows(colour: np.ndarray, sh: np.ndarray) -> np.ndarray:
    return np.concatenate([colour.astype("<u4")[:, None].view(np.uint8), sh.reshape(len(sh), -1)], axis=1)


def pack_chunks(data: ChunkScene, path: Path | None = None) -> Packing:
    """Take over the chunks of a compressed PLY with their codes: nothing is rounded but the bounds, to low ends and steps in float32.

    Rotations whose three components alone are longer than 1, which no writer makes, are made shorter. Raises FlickerError naming file, chunk and bounds.
    """
    where, n = path or "chunks", len(data.packed)
    if n == 0:
        raise FlickerError(f"{where}: no Gaussians")
    start = np.arange(0, n, CLUSTER_LIMIT)
    counts = np.diff(np.append(start, n))
    headers = np.zeros(len(start), PackedFormat.CHUNK.header)
    limits = data.bounds.astype(np.float64)
    for i, (name, bits, unit) in enumerate((("position", POSITION_BITS, 1.0), ("scale", SCALE_BITS, math.log2(math.e)), ("dc", DC_BITS, 1.0))):
        low, high = (limits[:, 6 * i + 3 * k : 6 * i + 3 * k + 3] * unit for k in (0, 1))
        faults = {"not finite": ~(np.isfinite(low) & np.isfinite(high)), "min above max": low > high}
        if name == "scale":
            faults["not a normal float32 number"] = (low < -_NORMAL) | (high > _NORMAL)
        for reason, wrong in faults.items():
            if wrong.any():
                raise FlickerError(f"{where}: chunk {np.flatnonzero(wrong.any(axis=1))[0]}: bounds of {_BOUNDS_OF[name]}: {reason}")
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
    packed.antialiased = data.antialiased
    return Packing(packed, np.arange(n), {"rotation longer than 1": int(long.sum())} if long.any() else {}, kept_chunks=True, brought=True)


_BOUNDS_OF = {"position": "position", "scale": "scale", "dc": "colour"}


def _shortened(rotation: np.ndarray) -> np.ndarray:
    """Rotation words whose three components are longer than 1: of length 1, each rounded towards 0."""
    codes = split(rotation, ROTATION_BITS)
    three = 2 * codes[:, 1:] - 1023  # in units of sqrt(1/2) / 1023, odd
    short = three * (np.sqrt(2.0) * 1023 / np.sqrt((three**2).sum(axis=1, keepdims=True)))
    codes[:, 1:] = (np.sign(short) * (2 * np.floor((np.abs(short) - 1) / 2) + 1) + 1023) / 2
    return _join(codes, ROTATION_BITS)


def _bits(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Bits of the nearest FP16 numbers, and how many were beyond the largest and became it."""
    beyond = np.abs(values) > _MAX_FP16
    return np.clip(values, -_MAX_FP16, _MAX_FP16).astype(np.float16).view(np.uint16), int(beyond.sum())


def _fp16(scene: Scene, form: PackedFormat, start: np.ndarray, counts: np.ndarray) -> tuple[PackedScene, dict[str, int]]:
    headers = np.zeros(len(start), form.header)
    means = scene.means.astype(np.float64)
    if form is PackedFormat.FP16_LOCAL:
        low, high = _merge(start, means)
        headers["origin"] = (low + high) / 2
        means = means - np.repeat(headers["origin"].astype(np.float64), counts, axis=0)
    n = len(scene)
    fields = {
        "mean": means, "scale": np.maximum(scene.scales.astype(np.float64), _TINY_FP16), "quat": scene.quats.astype(np.float64),
        "opacity": scene.opacities.astype(np.float64).clip(0, 1)[:, None], "sh": scene.sh.reshape(n, -1).astype(np.float64),
    }
    bits, clamped = {}, {}
    for name, values in fields.items():
        bits[name], beyond = _bits(values)
        if beyond:
            clamped[f"{name} beyond FP16"] = beyond
    for reason, wrong in (("scale below FP16", scene.scales < _TINY_FP16), ("opacity above 1", scene.opacities > 1)):
        if count := int(wrong.sum()):
            clamped[reason] = count
    geometry = np.concatenate([bits["mean"], bits["scale"], bits["quat"]], axis=1)
    colour = np.concatenate([bits["opacity"], bits["sh"]], axis=1).astype("<u2")
    degrees = _degrees(np.any(bits["sh"].reshape(n, -1, 3)[:, 1:] & 0x7FFF, axis=2), start)
    return _assemble(form, headers, geometry, colour.view(np.uint8), start, counts, degrees, scene.path), clamped
