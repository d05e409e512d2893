"""SPZ files (Niantic), versions 1 to 4, decoded here: gsply misreads version 1, refuses SH degree 4 and keeps neither flags nor axes.

Versions 1 to 3 are one gzip stream (or lie plain): a header of 16 bytes, then the sections one after another. Version 4 has a plain header of 32 bytes,
records of extensions, a table of sizes and a zstd stream for each section. Sections: positions (fixed point of 24 bits; half floats in version 1), alphas,
colours, log scales, rotations (x, y, z in 8 bits each; from version 3 the three smaller components in 10), harmonics; one byte a value.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line
from .raw import KEPT, Raw, cut_note
from .turns import ABOUT_X, ABOUT_Y, ABOUT_Z, half_turn

MAGIC = b"NGSP"
_LATEST = 4
_MOST_DEGREE = 4
_ANTIALIASED, _EXTENDED = 1, 2  # flags
_AXES = 0xADBE0003  # type of the extension that names the axes
_COLOUR = 0.15  # a colour is 0.5 + 0.15 SH
_EXTENSIONS = 1 << 24  # bytes that may follow the sections
# Numbers of the axes that differ from right, down, front by half a turn at most; the others mirror or exchange axes.
_TURNS = {0: ABOUT_X, 1: ABOUT_Y, 4: ABOUT_X, 6: None, 7: ABOUT_Z}


def is_spz(head: bytes) -> bool:
    """Whether a file with these first bytes is SPZ, plain or in gzip."""
    if head[:3] == b"\x1f\x8b\x08":
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, 4)
        except zlib.error:
            return False
    return head[:4] == MAGIC


def read_spz(path: Path) -> Raw:
    """Turned from the axes of the file, right, up, back unless it says others, to right, down, front. FlickerError naming file and field; OSError."""
    raw, axes = decode_spz(path.read_bytes(), str(path))
    if axes not in _TURNS:
        raise FlickerError(f"{path}: axes: coordinate system {axes} mirrors or exchanges axes; write it as right, up, back (RUB)")
    signs = _TURNS[axes]
    return raw if signs is None else half_turn(raw, signs)


def decode_spz(data: bytes, where: str) -> tuple[Raw, int]:
    """The Gaussians in the axes of the file, and the number of these axes (0: not said). where: what messages call the file."""
    if data[:4] == MAGIC and len(data) >= 8 and struct.unpack_from("<I", data, 4)[0] >= _LATEST:
        return _streams(data, where)
    if data[:4] == MAGIC:
        take, rest = _plain(data, where)
    elif data[:2] != b"\x1f\x8b":
        raise FlickerError(f"{where}: not an SPZ file")
    else:
        take, rest = _gzip(data, where)
    version, count, degree, bits, flags, _ = _header(take(16), "<IIBBBB", where)
    sizes = _sizes(version, count, degree)
    sections = [np.frombuffer(take(size), np.uint8) for size in sizes]
    extensions = rest()
    return _decoded(sections, version, degree, bits, flags, extensions if flags & _EXTENDED else b"", where)


def _header(head: bytes, layout: str, where: str) -> tuple[int, ...]:
    """Version, Gaussians, SH degree, bits of fractions, flags and what follows."""
    if head[:4] != MAGIC:
        raise FlickerError(f"{where}: not an SPZ file: gzip of something else")
    version, count, degree, bits, *others = struct.unpack_from(layout, head, 4)
    if not 1 <= version <= _LATEST:
        raise FlickerError(f"{where}: SPZ version {version}: versions 1 to {_LATEST} are read")
    if count == 0:
        raise FlickerError(f"{where}: no Gaussians")
    if degree > _MOST_DEGREE:
        raise FlickerError(f"{where}: SH degree {degree}: 0 to {_MOST_DEGREE} are read")
    if bits > 24:
        raise FlickerError(f"{where}: {bits} fraction bits of positions that have 24")
    return version, count, degree, bits, *others


def _sizes(version: int, count: int, degree: int) -> list[int]:
    """Bytes of the sections."""
    return [count * size for size in (6 if version == 1 else 9, 1, 3, 3, 3 if version < 3 else 4, 3 * (degree + 1) ** 2 - 3)]


def _plain(data: bytes, where: str) -> tuple[Callable[[int], bytes], Callable[[], bytes]]:
    place = 0

    def take(size: int) -> bytes:
        nonlocal place
        place += size
        if place > len(data):
            raise FlickerError(f"{where}: truncated: {len(data)} bytes")
        return data[place - size : place]

    return take, lambda: data[place:]


def _gzip(data: bytes, where: str) -> tuple[Callable[[int], bytes], Callable[[], bytes]]:
    """Take so many bytes out of the stream; take the rest and check that it ends."""
    stream, source = zlib.decompressobj(wbits=31), data

    def some(size: int) -> bytes:
        nonlocal source
        try:
            out = stream.decompress(source, size) if size else b""
        except zlib.error as error:
            raise FlickerError(f"{where}: damaged gzip ({one_line(error)})") from None
        if size:
            source = stream.unconsumed_tail
        return out

    def take(size: int) -> bytes:
        out = some(size)
        if len(out) < size:
            raise FlickerError(f"{where}: truncated: the gzip stream ends early")
        return out

    def rest() -> bytes:
        out = some(_EXTENSIONS)
        if not stream.eof:
            raise FlickerError(f"{where}: " + (f"more than {_EXTENSIONS} bytes after the Gaussians" if source else "truncated: the gzip stream ends early"))
        return out

    return take, rest


def _streams(data: bytes, where: str) -> tuple[Raw, int]:
    """Version 4."""
    import zstandard

    if len(data) < 32:
        raise FlickerError(f"{where}: truncated: {len(data)} bytes, the header has 32")
    version, count, degree, bits, flags, streams, table = _header(data[:32], "<IIBBBBI", where)
    sizes = [size for size in _sizes(version, count, degree) if size]
    if streams != len(sizes):
        raise FlickerError(f"{where}: {streams} streams, not {len(sizes)} as SH degree {degree} needs")
    place = table + 16 * streams
    if table < 32 or place > len(data):
        raise FlickerError(f"{where}: truncated: table of streams at byte {table}, the file has {len(data)}")
    sections = []
    for k, wanted in enumerate(sizes):
        packed, size = struct.unpack_from("<QQ", data, table + 16 * k)
        if size != wanted:
            raise FlickerError(f"{where}: stream {k}: {size} bytes, not {wanted} as {count} Gaussians have")
        if place + packed > len(data):
            raise FlickerError(f"{where}: truncated: stream {k} ends at byte {place + packed}, the file has {len(data)}")
        parts, found = [], 0
        try:
            for part in zstandard.ZstdDecompressor().read_to_iter(memoryview(data)[place : place + packed]):
                found += len(part)
                if found > size:
                    break
                parts.append(part)
        except zstandard.ZstdError as error:
            raise FlickerError(f"{where}: stream {k}: damaged ({one_line(error)})") from None
        if found != size:
            raise FlickerError(f"{where}: stream {k}: damaged: holds {'more than ' if found > size else ''}{min(found, size)} bytes, not {size}")
        sections.append(np.frombuffer(b"".join(parts), np.uint8))
        place += packed
    if degree == 0:
        sections.append(np.zeros(0, np.uint8))
    return _decoded(sections, version, degree, bits, flags, data[32:table] if flags & _EXTENDED else b"", where)


def _decoded(sections: list[np.ndarray], version: int, degree: int, bits: int, flags: int, extensions: bytes, where: str) -> tuple[Raw, int]:
    positions, alphas, colours, scales, rotations, rest = sections
    count = len(alphas)
    if version == 1:
        means = positions.view("<f2").astype(np.float32).reshape(count, 3)
    else:
        parts = positions.reshape(count, 3, 3).astype(np.int32)
        fixed = (parts[..., 0] << 8 | parts[..., 1] << 16 | parts[..., 2] << 24) >> 8
        means = np.ldexp(fixed.astype(np.float32), -bits)
    coefficients = (degree + 1) ** 2
    kept = min(coefficients, KEPT)
    sh = np.empty((count, kept, 3), np.float32)
    sh[:, 0] = (colours.reshape(count, 3) / 255.0 - 0.5) / _COLOUR
    sh[:, 1:] = (rest.reshape(count, coefficients - 1, 3)[:, : kept - 1].astype(np.float32) - 128.0) / 128.0
    axes, notes = _axes(extensions, where)
    raw = Raw(
        means, np.exp(scales.reshape(count, 3) / 16.0 - 10.0).astype(np.float32), _quats(rotations, version), alphas / np.float32(255), sh,
        bool(flags & _ANTIALIASED), cut_note(coefficients) + notes,
    )
    return raw, axes


def _quats(rotations: np.ndarray, version: int) -> np.ndarray:
    """float64 (N, 4), w first."""
    if version < 3:
        xyz = rotations.reshape(-1, 3) / 127.5 - 1.0
        return np.column_stack([np.sqrt(np.maximum(0.0, 1.0 - (xyz**2).sum(axis=1))), xyz])
    words = rotations.view("<u4")
    codes = words[:, None] >> np.array([20, 10, 0], np.uint32)
    three = (codes & 511) / (511 * np.sqrt(2.0)) * np.where(codes & 512, -1.0, 1.0)
    largest = words >> 30
    out = np.empty((len(words), 4))  # x, y, z, w
    out[np.arange(4) != largest[:, None]] = three.ravel()
    out[np.arange(len(words)), largest] = np.sqrt(np.maximum(0.0, 1.0 - (three**2).sum(axis=1)))
    return np.roll(out, 1, axis=1)


def _axes(extensions: bytes, where: str) -> tuple[int, tuple[str, ...]]:
    """Number of the axes, and what is said of extensions that are passed over."""
    axes, others, place = 0, [], 0
    while place + 8 <= len(extensions):
        kind, size = struct.unpack_from("<II", extensions, place)
        place += 8 + size
        if place > len(extensions):
            raise FlickerError(f"{where}: truncated: extension {kind:#010x} of {size} bytes")
        if kind == _AXES and size == 4:
            axes = struct.unpack_from("<I", extensions, place - 4)[0]
        elif kind >> 16 != _AXES >> 16:  # the other ones of that vendor are of cameras
            others.append(f"{kind:#010x}")
    return axes, (f"extensions that are not used: {', '.join(others[:4])}",) if others else ()
