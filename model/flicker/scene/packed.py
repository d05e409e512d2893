"""The memory image of a scene (`.flk`): what lies in the chip's memory, bit for bit, its reader and its meaning (docs/reference/memory_image.md).

Five parts, each beginning at a multiple of 64 bytes (a beat): image header, cluster table (32 bytes a cluster), cluster headers (128 bytes, or 64
for FP16), geometry array, colour array. All numbers little endian. Offsets count beats from the image's first byte, which lies at a multiple of 4096.

A Gaussian has a slot: its place in the geometry array. The slots of a cluster begin at a multiple of 16, so that its geometry begins with a beat; slots
behind its last Gaussian are zero. Its colours begin with a beat too and take as many coefficients as the cluster needs.

| format | meaning |
|---|---|
| chunk | codes; low ends and steps in the cluster header: position 11-10-11, rotation 2-10-10-10, log2 scale 11-10-11, colour 8-8-8, opacity 8, SH 3 to 8 |
| fp16-local | FP16; means relative to the origin in the cluster header |
| fp16 | FP16; the origins are zero |
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line
from . import slopes
from .gaussians import SH_C0, Scene
from .memory import rotation_of

BEAT = 64  # bytes
HEADER_BYTES = 256
MAGIC = b"FLKSCENE"
VERSION = 1  # of images whose SH codes all have 8 bits
VERSION_SH_BITS = 2  # of others
CLUSTER_LIMIT = 256  # Gaussians
SLOT_STEP = 16  # slots of a cluster begin at a multiple
SLOT_LIMIT = 1 << 24  # a record's number has 24 bits
POSITION_BITS = SCALE_BITS = (11, 10, 11)
ROTATION_BITS = (2, 10, 10, 10)
DC_BITS = (8, 8, 8)
SH_BITS = (3, 4, 5, 6, 8)  # of a cluster's SH codes; `sh_zero` says which
FULL_SH_BITS = SH_BITS[-1]
_TINY = 2.0**-24  # opacity of a code of 0, which is never seen, in a Scene, whose opacities are positive
_SECTIONS = ("table", "headers", "geometry", "colour")


class PackedFormat(str, Enum):
    """How a Gaussian lies in the image."""

    CHUNK = "chunk"
    FP16_LOCAL = "fp16-local"
    FP16 = "fp16"

    @property
    def code(self) -> int:
        """As the image header says it."""
        return list(PackedFormat).index(self)

    @property
    def header(self) -> np.dtype:
        """Of a cluster."""
        return CHUNK_HEADER if self is PackedFormat.CHUNK else FP16_HEADER

    @property
    def geometry(self) -> tuple[np.dtype, int]:
        """Type and number of a Gaussian's words."""
        return (np.dtype("<u4"), 3) if self is PackedFormat.CHUNK else (np.dtype("<u2"), 10)

    def colour_bytes(self, degree: int, sh_bits: int = FULL_SH_BITS) -> int:
        """Of opacity and colour of a Gaussian, without padding. sh_bits: of a code of chunks."""
        k = (degree + 1) ** 2
        return 4 - (-3 * (k - 1) * sh_bits // 8) if self is PackedFormat.CHUNK else 2 * (1 + 3 * k)

    def colour_stride(self, degree: int, sh_bits: int = FULL_SH_BITS) -> int:
        """Bytes from a Gaussian to the next: padded to a multiple of 4, not where SH codes have fewer than 8 bits."""
        size = self.colour_bytes(degree, sh_bits)
        return size if sh_bits < FULL_SH_BITS else -(-size // 4) * 4


def _record(size: int, *fields: tuple) -> np.dtype:
    dtype = np.dtype(list(fields))
    assert dtype.itemsize == size, (dtype.itemsize, size)
    return dtype


IMAGE_HEADER = _record(
    HEADER_BYTES,
    ("magic", "S8"),
    ("version", "<u2"),
    ("format", "<u2"),
    ("degree", "<u4"),  # the largest of a cluster
    ("gaussians", "<u4"),
    ("clusters", "<u4"),
    ("slots", "<u4"),
    ("beats", "<u4"),  # of the image
    *((f"{section}_{what}", "<u4") for section in _SECTIONS for what in ("offset", "beats", "crc")),
    ("low", "<f4", 3),  # box of the cluster boxes
    ("high", "<f4", 3),
    ("sigma", "<f4"),  # the largest of a cluster
    ("flags", "<u4"),  # bit 0: antialiased
    ("reserved", "V140"),
    ("crc", "<u4"),  # of the bytes before
)
TABLE_ENTRY = _record(
    32,
    ("low", "<f4", 3),
    ("high", "<f4", 3),
    ("sigma", "<u2"),  # upper half of a float32
    ("last", "u1"),  # Gaussians - 1
    ("flags", "u1"),  # bits 1:0: SH degree; bits 7:2: slope of the colours (`scene.slopes`)
    ("first", "<u4"),  # slot / 16
)
CHUNK_HEADER = _record(
    128,
    ("position_low", "<f4", 3),
    ("colour", "<u4"),  # beats from the colour array's first
    ("position_step", "<f4", 3),
    ("sh_zero", "<u4"),  # half codes of 0: 2 to the power of the codes' bits, or 255 for 8 bits and bins without a zero
    ("scale_low", "<f4", 3),
    ("reserved_0", "<u4"),
    ("scale_step", "<f4", 3),
    ("reserved_1", "<u4"),
    ("dc_low", "<f4", 3),
    ("reserved_2", "<u4"),
    ("dc_step", "<f4", 3),
    ("sh_step", "<f4", (3, 3)),  # of half a code; by degree 1 to 3 and channel
)
FP16_HEADER = _record(64, ("origin", "<f4", 3), ("colour", "<u4"), ("reserved", "V48"))


def _padded(data: np.ndarray) -> bytes:
    raw = data.tobytes()
    return raw + bytes(-len(raw) % BEAT)


def sh_bits_of(sh_zero: np.ndarray) -> np.ndarray:
    """int64: bits of SH codes by the headers' `sh_zero`, as the chip takes it: 8 for what is none of 8, 16, 32 and 64."""
    narrow = {1 << bits: bits for bits in SH_BITS}
    return np.array([narrow.get(zero, FULL_SH_BITS) for zero in np.asarray(sh_zero).tolist()], np.int64)


def _unpacked(raw: np.ndarray, bits: int, size: int) -> np.ndarray:
    """uint8 (n, size): colours of which each SH code has a byte. raw: uint8 (n, stride), SH codes of `bits`, the first in the lowest bits behind byte 4."""
    codes = size - 4
    flat = np.unpackbits(np.ascontiguousarray(raw[:, 4:]), axis=1, bitorder="little")[:, : codes * bits].reshape(len(raw), codes, bits)
    return np.concatenate([raw[:, :4], np.packbits(flat, axis=2, bitorder="little")[:, :, 0]], axis=1) if codes else raw[:, :size]


def narrowed(rows: np.ndarray, bits: int, stride: int) -> np.ndarray:
    """uint8 (n, stride): the opposite of what the reader makes of a cluster's colours. rows: uint8 (n, size), an SH code a byte."""
    out = np.zeros((len(rows), stride), np.uint8)
    out[:, :4] = rows[:, :4]
    flat = np.unpackbits(np.ascontiguousarray(rows[:, 4:, None]), axis=2, bitorder="little")[:, :, :bits].reshape(len(rows), -1)
    words = np.packbits(flat, axis=1, bitorder="little")
    out[:, 4 : 4 + words.shape[1]] = words
    return out


def coefficients(degree: int) -> int:
    """SH coefficients of a colour."""
    return (degree + 1) ** 2


@dataclass(eq=False)
class PackedScene:
    """A scene as it lies in memory: C clusters, S slots (a multiple of 16), N Gaussians in the order of their slots.

    table: TABLE_ENTRY (C,). headers: CHUNK_HEADER or FP16_HEADER (C,). geometry: chunk: uint32 (S, 3), words of position, rotation, log2 scale; FP16:
    uint16 (S, 10), bits of mean, scale, quaternion (w first). colour: uint8 (B,), B a multiple of 64. antialiased: as in `Scene`.
    """

    format: PackedFormat
    table: np.ndarray
    headers: np.ndarray
    geometry: np.ndarray
    colour: np.ndarray
    path: Path | None = None
    antialiased: bool = False

    def __len__(self) -> int:
        """Gaussians."""
        return int(self.counts.sum())

    @cached_property
    def counts(self) -> np.ndarray:
        """int64 (C,): Gaussians of each cluster."""
        return self.table["last"].astype(np.int64) + 1

    @cached_property
    def start(self) -> np.ndarray:
        """int64 (C + 1,): number of each cluster's first Gaussian, and N."""
        return np.concatenate([[0], np.cumsum(self.counts)])

    @property
    def degrees(self) -> np.ndarray:
        """int64 (C,): SH degree of each cluster."""
        return (self.table["flags"] & 3).astype(np.int64)

    @property
    def slopes(self) -> np.ndarray:
        """uint8 (C,): codes of how fast each cluster's colours turn with the direction at most (`scene.slopes`); 0: not known."""
        return self.table["flags"] >> 2

    @property
    def degree(self) -> int:
        """The largest of a cluster."""
        return int(self.degrees.max())

    @property
    def first(self) -> np.ndarray:
        """int64 (C,): first slot of each cluster."""
        return self.table["first"].astype(np.int64) * SLOT_STEP

    @property
    def sigma(self) -> np.ndarray:
        """float32 (C,): bound of each cluster's standard deviations."""
        return (self.table["sigma"].astype(np.uint32) << 16).view(np.float32)

    @cached_property
    def cluster(self) -> np.ndarray:
        """int64 (N,): cluster of each Gaussian."""
        return np.repeat(np.arange(len(self.table)), self.counts)

    @cached_property
    def slot(self) -> np.ndarray:
        """int64 (N,): slot of each Gaussian, ascending."""
        return np.arange(len(self)) + np.repeat(self.first - self.start[:-1], self.counts)

    @property
    def sh_bits(self) -> np.ndarray:
        """int64 (C,): bits of each cluster's SH codes; 8 in FP16, which has none."""
        return sh_bits_of(self.headers["sh_zero"]) if self.format is PackedFormat.CHUNK else np.full(len(self.table), FULL_SH_BITS)

    @property
    def colour_strides(self) -> np.ndarray:
        """int64 (C,): bytes of opacity and colour of each cluster's Gaussians."""
        return np.array([self.format.colour_stride(d, b) for d, b in zip(self.degrees.tolist(), self.sh_bits.tolist())], np.int64)

    def colour_span(self, cluster: int) -> tuple[int, int, int]:
        """First byte in the colour array, one past the last, and bytes a Gaussian."""
        bits = int(sh_bits_of(self.headers["sh_zero"][cluster : cluster + 1])[0]) if self.format is PackedFormat.CHUNK else FULL_SH_BITS
        stride = self.format.colour_stride(int(self.table["flags"][cluster] & 3), bits)
        first = int(self.headers["colour"][cluster]) * BEAT
        return first, first + stride * (int(self.table["last"][cluster]) + 1), stride

    @cached_property
    def colour_rows(self) -> np.ndarray:
        """uint8 (N, bytes of the largest degree): each Gaussian's opacity and colour, an SH code a byte; zero where its cluster has fewer coefficients."""
        rows = np.zeros((len(self), self.format.colour_bytes(self.degree)), np.uint8)
        begin = self.headers["colour"].astype(np.int64) * BEAT
        for k, (degree, bits, stride) in enumerate(zip(self.degrees.tolist(), self.sh_bits.tolist(), self.colour_strides.tolist())):
            used, count = self.format.colour_bytes(degree), int(self.counts[k])
            raw = self.colour[begin[k] : begin[k] + stride * count].reshape(count, stride)
            rows[self.start[k] : self.start[k + 1], :used] = raw[:, :used] if bits == FULL_SH_BITS else _unpacked(raw, bits, used)
        return rows

    def sections(self) -> dict[str, bytes]:
        """The parts behind the image header, by name, in order."""
        return dict(zip(_SECTIONS, map(_padded, (self.table, self.headers, self.geometry, self.colour))))

    def image(self) -> bytes:
        """The whole image. Raises FlickerError where a field is too narrow for the scene."""
        header = np.zeros((), IMAGE_HEADER)
        header["magic"], header["format"], header["degree"] = MAGIC, self.format.code, self.degree
        header["version"] = VERSION if (self.sh_bits == FULL_SH_BITS).all() else VERSION_SH_BITS
        header["gaussians"], header["clusters"], header["slots"] = len(self), len(self.table), len(self.geometry)
        header["low"], header["high"] = self.table["low"].min(axis=0), self.table["high"].max(axis=0)
        header["sigma"] = self.sigma.max()
        header["flags"] = self.antialiased
        parts = self.sections()
        offset = HEADER_BYTES // BEAT
        for name, part in parts.items():
            beats = len(part) // BEAT
            if offset + beats >= 1 << 32:
                raise FlickerError(f"{self.path or 'scene'}: {name}: ends at beat {offset + beats}, beyond 32 bits")
            header[f"{name}_offset"], header[f"{name}_beats"], header[f"{name}_crc"] = offset, beats, zlib.crc32(part)
            offset += beats
        header["beats"] = offset
        header["crc"] = zlib.crc32(header.tobytes()[:-4])
        return b"".join([header.tobytes(), *parts.values()])


# ---- what the bits say ---------------------------------------------------------------------------------------------------------------


def split(words: np.ndarray, bits: tuple[int, ...]) -> np.ndarray:
    """int64 (N, len(bits)): codes in words (N,), the first in the upper bits."""
    shift = np.cumsum(bits[::-1])[::-1] - np.array(bits)
    return words[:, None].astype(np.int64) >> shift & ((1 << np.array(bits)) - 1)


@dataclass(frozen=True, eq=False)
class ChunkCodes:
    """The codes of all Gaussians of a scene in chunks, integers.

    position, scale: (N, 3). rotation: (N, 4): number of the largest component, codes of the other three in order. opacity: (N,). dc: (N, 3).
    sh: (N, K - 1, 3): half codes from zero, 2 code - sh_zero, -256 to 255; 0 where the cluster has no such coefficient.
    """

    position: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    opacity: np.ndarray
    dc: np.ndarray
    sh: np.ndarray


def chunk_codes(packed: PackedScene) -> ChunkCodes:
    """Codes of a scene in chunks."""
    words = packed.geometry[packed.slot]
    rows = packed.colour_rows
    colour = np.ascontiguousarray(rows[:, :4]).view("<u4")[:, 0]
    rgba = split(colour, (8, 8, 8, 8))
    sh = 2 * rows[:, 4:].astype(np.int16).reshape(len(rows), -1, 3)
    sh -= packed.headers["sh_zero"].astype(np.int16)[packed.cluster, None, None]
    sh[np.arange(1, sh.shape[1] + 1) >= (packed.degrees[packed.cluster, None] + 1) ** 2] = 0
    return ChunkCodes(
        split(words[:, 0], POSITION_BITS), split(words[:, 1], ROTATION_BITS), split(words[:, 2], SCALE_BITS), rgba[:, 3], rgba[:, :3], sh,
    )


def slope_codes(packed: PackedScene) -> np.ndarray:
    """uint8 (C,): slopes of a scene in chunks (`scene.slopes`), from its decoded coefficients; 0 in other formats, whose colours are not kept."""
    if packed.format is not PackedFormat.CHUNK:
        return np.zeros(len(packed.table), np.uint8)
    codes = chunk_codes(packed).sh
    sh = np.zeros((len(codes), codes.shape[1] + 1, 3), np.float32)
    for degree in range(1, packed.degree + 1):
        of = slice(coefficients(degree - 1), coefficients(degree))
        sh[:, of] = codes[:, of.start - 1 : of.stop - 1] * packed.headers["sh_step"][:, degree - 1][packed.cluster, None]
    return slopes.codes_of(sh, packed.start[:-1])


@dataclass(frozen=True, eq=False)
class Fp16Bits:
    """Bits of the FP16 numbers of all Gaussians, uint16. mean (from the origin of the cluster), scale: (N, 3). quat: (N, 4). opacity: (N,). sh: (N, K, 3)."""

    mean: np.ndarray
    scale: np.ndarray
    quat: np.ndarray
    opacity: np.ndarray
    sh: np.ndarray


def fp16_bits(packed: PackedScene) -> Fp16Bits:
    """FP16 numbers of a scene that has them."""
    words = packed.geometry[packed.slot]
    colour = packed.colour_rows.view("<u2")
    return Fp16Bits(words[:, :3], words[:, 3:6], words[:, 6:], colour[:, 0], colour[:, 1:].reshape(len(colour), -1, 3))


@dataclass(frozen=True, eq=False)
class Values:
    """What the bits of a scene mean, float64, in the order of the slots. means, scales: (N, 3). quats: (N, 4), in FP16 as they are, not normalised.

    opacities: (N,), in [0, 1]. sh: (N, K, 3), as in Scene; 0 beyond a cluster's degree.
    """

    means: np.ndarray
    scales: np.ndarray
    quats: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray


def means_and_scales(packed: PackedScene) -> tuple[np.ndarray, np.ndarray]:
    """Those of `values`, without the rest."""
    words, cluster, headers = packed.geometry[packed.slot], packed.cluster, packed.headers
    if packed.format is not PackedFormat.CHUNK:
        numbers = words[:, :6].view(np.float16).astype(np.float64)
        return numbers[:, :3] + headers["origin"].astype(np.float64)[cluster], numbers[:, 3:]

    def linear(name: str, codes: np.ndarray) -> np.ndarray:
        low, step = (headers[f"{name}_{what}"].astype(np.float64)[cluster] for what in ("low", "step"))
        return low + codes * step

    return linear("position", split(words[:, 0], POSITION_BITS)), np.exp2(linear("scale", split(words[:, 2], SCALE_BITS)))


def values(packed: PackedScene) -> Values:
    """The numbers in the image, exact but for float64's own rounding: colours are turned back into coefficients, log2 scales into scales."""
    means, scales = means_and_scales(packed)
    if packed.format is not PackedFormat.CHUNK:
        bits = fp16_bits(packed)
        quats, opacities, sh = (x.view(np.float16).astype(np.float64) for x in (bits.quat, bits.opacity, np.ascontiguousarray(bits.sh)))
        return Values(means, scales, quats, opacities, sh)
    codes, headers, cluster = chunk_codes(packed), packed.headers, packed.cluster
    sh = np.empty((len(packed), coefficients(packed.degree), 3))
    low, step = (headers[name].astype(np.float64)[cluster] for name in ("dc_low", "dc_step"))
    sh[:, 0] = (low + codes.dc * step - 0.5) / SH_C0
    for degree in range(1, packed.degree + 1):
        of = slice(coefficients(degree - 1), coefficients(degree))
        sh[:, of] = codes.sh[:, of.start - 1 : of.stop - 1] * headers["sh_step"][:, degree - 1].astype(np.float64)[cluster, None]
    return Values(means, scales, rotation_of(packed.geometry[packed.slot, 1]), codes.opacity / 255.0, sh)


def decode(packed: PackedScene) -> Scene:
    """The scene that the image holds, in float32, Gaussian i being that of `packed.slot[i]`. Rotations are normalised; an opacity of 0 becomes 2^-24."""
    v = values(packed)
    quats = v.quats / np.linalg.norm(v.quats, axis=1, keepdims=True)
    return Scene(v.means, v.scales, quats, np.maximum(v.opacities, _TINY), v.sh, packed.path, antialiased=packed.antialiased)


# ---- bounds of the clusters ----------------------------------------------------------------------------------------------------------


def _below(values: np.ndarray) -> np.ndarray:
    """float32, rounded down."""
    near = values.astype(np.float32)
    return np.where(near > values, np.nextafter(near, np.float32(-np.inf)), near)


def upper_half(values: np.ndarray) -> np.ndarray:
    """uint16: upper halves of float32 numbers that are no smaller than positive values; 0x7F80 (infinity) and beyond for what is too large."""
    bits = (-_below(-np.asarray(values, np.float64))).view(np.uint32)
    return ((bits + np.uint32(0xFFFF)) >> 16).astype(np.uint16)


def bounds(packed: PackedScene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """low, high: float32 (C, 3), box of the decoded means, rounded outward; sigma: uint16 (C,), upper half of float32, largest decoded scale, rounded up."""
    means, scales = means_and_scales(packed)
    start = packed.start[:-1]
    low, high = np.minimum.reduceat(means, start), np.maximum.reduceat(means, start)
    with np.errstate(over="ignore"):
        return _below(low), -_below(-high), upper_half(np.maximum.reduceat(scales.max(axis=1), start))


# ---- reading -------------------------------------------------------------------------------------------------------------------------


def is_image(head: bytes) -> bool:
    """Whether a file's first bytes are those of an image, of whatever version."""
    return head[: len(MAGIC)] == MAGIC


def load_packed(path: str | Path) -> PackedScene:
    """Read an image and check every field of it. Raises FlickerError naming file and field."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)})") from None
    return parse(data, path)


def parse(data: bytes, path: Path) -> PackedScene:
    """The scene in the bytes of an image, checked. path: of messages."""
    header, form = _image_header(data, path)
    clusters, slots = int(header["clusters"]), int(header["slots"])
    parts = {name: memoryview(data)[int(header[f"{name}_offset"]) * BEAT :][: int(header[f"{name}_beats"]) * BEAT] for name in _SECTIONS}
    for name, part in parts.items():
        if (found := zlib.crc32(part)) != header[f"{name}_crc"]:
            raise FlickerError(f"{path}: {name}: checksum is {found:08x}, not {header[f'{name}_crc']:08x}")
    kind, words = form.geometry
    packed = PackedScene(
        form, np.frombuffer(parts["table"], TABLE_ENTRY, clusters), np.frombuffer(parts["headers"], form.header, clusters),
        np.frombuffer(parts["geometry"], kind, slots * words).reshape(slots, words), np.frombuffer(parts["colour"], np.uint8), path,
        bool(header["flags"] & 1),
    )
    _check_table(packed, header, path)
    _check_headers(packed, int(header["version"]), path)
    _check_gaussians(packed, path)
    return packed


def _image_header(data: bytes, path: Path) -> tuple[np.ndarray, PackedFormat]:
    if not is_image(data):
        raise FlickerError(f"{path}: magic: not a memory image")
    if len(data) < HEADER_BYTES:
        raise FlickerError(f"{path}: truncated: {len(data)} bytes, the image header has {HEADER_BYTES}")
    header = np.frombuffer(data, IMAGE_HEADER, 1)[0]
    if header["version"] not in (VERSION, VERSION_SH_BITS):
        raise FlickerError(f"{path}: version: {header['version']}, not {VERSION} or {VERSION_SH_BITS}")
    if (found := zlib.crc32(data[: HEADER_BYTES - 4])) != header["crc"]:
        raise FlickerError(f"{path}: image header: checksum is {found:08x}, not {header['crc']:08x}")
    if header["format"] >= len(PackedFormat):
        raise FlickerError(f"{path}: format: {header['format']}, not 0 to {len(PackedFormat) - 1}")
    form = list(PackedFormat)[int(header["format"])]
    for name in ("gaussians", "clusters"):
        if header[name] == 0:
            raise FlickerError(f"{path}: {name}: 0")
    clusters, slots, beats = (int(header[name]) for name in ("clusters", "slots", "beats"))
    if slots % SLOT_STEP or slots > SLOT_LIMIT:
        raise FlickerError(f"{path}: slots: {slots}, not a multiple of {SLOT_STEP} up to {SLOT_LIMIT}")
    if len(data) != beats * BEAT:
        what = "truncated" if len(data) < beats * BEAT else "beats"
        raise FlickerError(f"{path}: {what}: the file has {len(data)} bytes, the image header says {beats * BEAT}")
    kind, words = form.geometry
    sizes = {"table": clusters * TABLE_ENTRY.itemsize, "headers": clusters * form.header.itemsize, "geometry": slots * words * kind.itemsize}
    end = HEADER_BYTES // BEAT
    for name in _SECTIONS:
        offset, size = (int(header[f"{name}_{what}"]) for what in ("offset", "beats"))
        if offset != end:
            raise FlickerError(f"{path}: {name}_offset: {offset}, not {end}, where the part before ends")
        if name in sizes and size != -(-sizes[name] // BEAT):
            raise FlickerError(f"{path}: {name}_beats: {size}, not {-(-sizes[name] // BEAT)}")
        end += size
    if end != beats:
        raise FlickerError(f"{path}: colour_beats: ends at beat {end}, the image has {beats}")
    if header["flags"] > 1:
        raise FlickerError(f"{path}: flags: {header['flags']}: reserved bits are not zero")
    if any(header["reserved"].tobytes()):
        raise FlickerError(f"{path}: reserved: not zero")
    return header, form


def _refuse(path: Path, wrong: np.ndarray, what: str, says: str) -> None:
    """Name the first cluster of (C, ...) flags that is wrong."""
    bad = np.flatnonzero(wrong.reshape(len(wrong), -1).any(axis=1))
    if len(bad):
        raise FlickerError(f"{path}: cluster {bad[0]}: {what}: {says}")


def _check_table(packed: PackedScene, header: np.ndarray, path: Path) -> None:
    table = packed.table
    for name in ("low", "high"):
        _refuse(path, ~np.isfinite(table[name]), name, "not finite")
    _refuse(path, table["low"] > table["high"], "low", "above high")
    _refuse(path, (table["sigma"] == 0) | (table["sigma"] >= 0x7F80), "sigma", "not a positive number")
    if packed.format is not PackedFormat.CHUNK:
        _refuse(path, table["flags"] > 3, "flags", "reserved bits are not zero")
    used = -(-packed.counts // SLOT_STEP)
    _refuse(path, packed.table["first"] != np.cumsum(used) - used, "first", "not where the slots of the cluster before end")
    expected = {
        "gaussians": len(packed), "slots": int(used.sum()) * SLOT_STEP, "degree": packed.degree, "low": table["low"].min(axis=0),
        "high": table["high"].max(axis=0), "sigma": packed.sigma.max(),
    }
    for name, value in expected.items():
        if not np.array_equal(header[name], value):
            raise FlickerError(f"{path}: {name}: {header[name]}, the cluster table says {value}")


def _check_headers(packed: PackedScene, version: int, path: Path) -> None:
    headers = packed.headers
    for name in headers.dtype.names or ():
        kind = headers.dtype[name].base.kind
        if kind == "f":
            _refuse(path, ~np.isfinite(headers[name]), name, "not finite")
            if name.endswith("step"):
                _refuse(path, headers[name] < 0, name, "negative")
        elif name.startswith("reserved"):
            raw = np.ascontiguousarray(headers[name]).view(np.uint8).reshape(len(headers), -1)
            _refuse(path, raw != 0, name, "not zero")
    if packed.format is PackedFormat.CHUNK:
        legal = (255, *(1 << bits for bits in SH_BITS if version == VERSION_SH_BITS or bits == FULL_SH_BITS))
        _refuse(path, ~np.isin(headers["sh_zero"], legal), "sh_zero", f"none of {', '.join(map(str, sorted(legal)))}")
    if packed.format is PackedFormat.FP16:
        _refuse(path, headers["origin"] != 0, "origin", "not zero")
    end = headers["colour"].astype(np.int64) * BEAT + packed.colour_strides * packed.counts
    _refuse(path, end > len(packed.colour), "colour", "ends outside the colour array")
    _refuse(path, headers["colour"] != np.concatenate([[0], -(-end[:-1] // BEAT)]), "colour", "not where the colours of the cluster before end")
    if -(-end[-1] // BEAT) * BEAT != len(packed.colour):
        raise FlickerError(f"{path}: colour_beats: {len(packed.colour) // BEAT}, the clusters use {-(-end[-1] // BEAT)}")


def _check_gaussians(packed: PackedScene, path: Path) -> None:
    empty = np.ones(len(packed.geometry), bool)
    empty[packed.slot] = False
    if packed.geometry[empty].any():
        raise FlickerError(f"{path}: geometry: slot {np.flatnonzero(empty & packed.geometry.any(axis=1))[0]}: not used, but not zero")
    _check_numbers(packed, path)
    with np.errstate(over="ignore"):
        low, high, sigma = bounds(packed)
        _, scales = means_and_scales(packed)
    _refuse(path, ~((low >= packed.table["low"]) & (high <= packed.table["high"])), "low, high", "a mean lies outside")
    _refuse(path, sigma > packed.table["sigma"], "sigma", "below a standard deviation")
    if packed.format is PackedFormat.CHUNK:
        least = slope_codes(packed)  # 0: beyond what a code can say
        _refuse(path, (packed.slopes > 0) & ((packed.slopes < least) | (least == 0)), "slope", "below that of its colours")
    if packed.format is PackedFormat.CHUNK and (small := (scales < 2.0**-126).any(axis=1)).any():
        raise FlickerError(f"{path}: scale: slot {packed.slot[np.flatnonzero(small)[0]]}: below 2^-126")


def _check_numbers(packed: PackedScene, path: Path) -> None:
    """Rotations of length 1 in chunks; in FP16 no infinities, NaN, sizes that are not positive, rotations of length 0."""
    def refuse(wrong: np.ndarray, field: str, says: str) -> None:
        bad = np.flatnonzero(wrong.reshape(len(wrong), -1).any(axis=1))
        if len(bad):
            raise FlickerError(f"{path}: {field}: slot {packed.slot[bad[0]]}: {says}")

    if packed.format is PackedFormat.CHUNK:
        refuse(too_long(packed.geometry[packed.slot, 1]), "rotation", "longer than 1")
        return
    bits = fp16_bits(packed)
    for name in ("mean", "scale", "quat", "opacity", "sh"):
        refuse((getattr(bits, name) & 0x7C00) == 0x7C00, name, "not finite")
    refuse((bits.scale == 0) | (bits.scale > 0x7FFF), "scale", "not positive")
    refuse(bits.opacity > 0x3C00, "opacity", "not 0 to 1")
    refuse(((bits.quat & 0x7FFF) == 0).all(axis=1), "quat", "zero")


def too_long(rotation: np.ndarray) -> np.ndarray:
    """bool (N,): rotation words (N,) whose three components alone are longer than 1: (2 code - 1023)^2 sum to more than 2 * 1023^2."""
    return ((2 * split(rotation, ROTATION_BITS)[:, 1:] - 1023) ** 2).sum(axis=1) > 2 * 1023**2
