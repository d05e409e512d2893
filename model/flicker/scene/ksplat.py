"""KSPLAT files of GaussianSplats3D: a header, headers of sections, and in each section centres of buckets and records.

Compression level 0 has floats; 1 has half floats, and positions of 16 bits around the centre of a bucket; 2 has harmonics of 8 bits besides.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from .raw import Raw, sh_of_colours

_HEADER, _SECTION = 4096, 1024
_RANGE = 32767  # of positions, where a section says none
_SH_RANGE = 1.5  # of harmonics of 8 bits, where the header says none


def is_ksplat(head: bytes) -> bool:
    """Whether a file's first 4096 bytes are a header: version 0.1, a compression level, and nothing behind the fields."""
    return head[:4] == b"\0\1\0\0" and len(head) >= _HEADER and head[20] <= 2 and not any(head[44:_HEADER])


def _record(level: int, degree: int) -> np.dtype:
    number = "<f4" if level == 0 else "<f2"
    return np.dtype([
        ("mean", number if level == 0 else "<u2", 3), ("scale", number, 3), ("quat", number, 4), ("rgba", "u1", 4),
        ("sh", ("<f4", "<f2", "u1")[level], 3 * ((degree + 1) ** 2 - 1)),
    ])


def read_ksplat(path: Path) -> Raw:
    """FlickerError naming file and field; OSError."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADER)
    if len(head) < _HEADER:
        raise FlickerError(f"{path}: truncated: {len(head)} bytes, the header of a .ksplat has {_HEADER}")
    sections, total, level = struct.unpack_from("<I8xIH", head, 4)
    if head[:2] != b"\0\1":
        raise FlickerError(f"{path}: version {head[0]}.{head[1]} of .ksplat, or none: 0.1 is read")
    if level > 2:
        raise FlickerError(f"{path}: compression level {level}: 0, 1 and 2 are read")
    place = _HEADER + sections * _SECTION
    if place > size:
        raise FlickerError(f"{path}: truncated: {sections} headers of sections end at byte {place}, the file has {size}")
    low, high = (value or default for value, default in zip(struct.unpack_from("<ff", head, 36), (-_SH_RANGE, _SH_RANGE)))
    data = np.memmap(path, np.uint8, "r")
    parts = []
    for k in range(sections):
        at = _HEADER + k * _SECTION
        section = data[at : at + _SECTION].tobytes()
        count, room, bucket, buckets = struct.unpack_from("<IIII", section, 0)
        width, step, reach = struct.unpack_from("<fHxxI", section, 16)
        full, partial = struct.unpack_from("<II", section, 32)
        degree = struct.unpack_from("<H", section, 40)[0]
        if degree > 3:
            raise FlickerError(f"{path}: section {k}: SH degree {degree}: 0 to 3 are read")
        record = _record(level, degree)
        end = place + 4 * partial + step * buckets + record.itemsize * max(room, count)
        if end > size:
            raise FlickerError(f"{path}: truncated: section {k} ends at byte {end}, the file has {size}")
        records = np.ndarray(count, record, data, end - record.itemsize * max(room, count))
        means = records["mean"].astype(np.float64)
        if level > 0 and count:
            if step < 12:
                raise FlickerError(f"{path}: section {k}: buckets of {step} bytes, not 12")
            lengths = np.concatenate([np.full(min(full, buckets), bucket, np.int64), data[place : place + 4 * partial].view("<u4").astype(np.int64)])
            if len(lengths) > buckets or lengths.sum() < count:
                raise FlickerError(f"{path}: section {k}: {len(lengths)} of {buckets} buckets hold {lengths.sum()} Gaussians of {count}")
            of = np.searchsorted(np.cumsum(lengths), np.arange(count), side="right")
            centres = data[place + 4 * partial :][: step * buckets].reshape(buckets, step)[:, :12].copy().view("<f4")
            reach = reach or _RANGE
            means = centres[of] + (means - reach) * (width / 2 / reach)
        sh = np.zeros((count, 16, 3), np.float32)
        rgba = records["rgba"] / 255.0
        sh[:, :1] = sh_of_colours(rgba[:, :3])
        rest = records["sh"].astype(np.float32)
        if level == 2:
            rest = low + rest * np.float32((high - low) / 255)
        for d in range(1, degree + 1):  # degree by degree, channel by channel
            of_degree = slice(d * d, (d + 1) ** 2)
            sh[:, of_degree] = rest[:, 3 * (d * d - 1) : 3 * ((d + 1) ** 2 - 1)].reshape(count, 3, 2 * d + 1).transpose(0, 2, 1)
        parts.append((degree, means, records["scale"].astype(np.float32), records["quat"].astype(np.float32), rgba[:, 3], sh))
        place = end
    found = sum(len(means) for _, means, *_ in parts)
    if found != total:
        raise FlickerError(f"{path}: the sections have {found} Gaussians, the header says {total}")
    if total == 0:
        raise FlickerError(f"{path}: no Gaussians")
    most = max(degree for degree, means, *_ in parts if len(means))
    means, scales, quats, opacities, sh = (np.concatenate(part) for part in list(zip(*parts))[1:])
    return Raw(means, scales, quats, opacities, sh[:, : (most + 1) ** 2])
