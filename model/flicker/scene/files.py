"""Scenes: Gaussians with activated values, read from every common file format.

| suffix | format | read by |
|---|---|---|
| `.ply` | INRIA layout (with or without normals, SH degree 0 to 3) and PlayCanvas compressed layout | gsply |
| `.spz` | Niantic, gzip (versions 1 to 3) and zstd (version 4) container | gsply |
| `.sog` | PlayCanvas bundle, versions 1 and 2 | gsply |
| `.splat` | 32-byte records | here |

Coordinates are those of the INRIA code (x right, y down, z forward for an upright scene). An SPZ file holds x right, y up,
z back and is turned by half a turn about x; the other formats keep the coordinates of the training.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gsply
import numpy as np

from ..errors import FlickerError

_SH_C0 = 0.28209479177387814
_SH_COUNTS = {1: 0, 4: 1, 9: 2, 16: 3}  # coefficients a channel: degree
_REST_COUNTS = (0, 9, 24, 45)
_CHUNK = 256


@dataclass(eq=False)
class Scene:
    """N Gaussians, values activated; contiguous float32 arrays.

    means: (N, 3). scales: (N, 3), standard deviations, > 0. quats: (N, 4), unit, w first. opacities: (N,), in (0, 1].
    sh: (N, K, 3), K = (degree + 1)^2 coefficients a colour, constant term first, order and signs of the INRIA code.
    path: the file. rejected: Gaussians of the file that were left out, by reason.
    """

    means: np.ndarray
    scales: np.ndarray
    quats: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray
    path: Path | None = None
    rejected: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("means", "scales", "quats", "opacities", "sh"):
            setattr(self, name, np.ascontiguousarray(getattr(self, name), np.float32))

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        return _SH_COUNTS[self.sh.shape[1]]


def load_scene(path: str | Path) -> Scene:
    """Read a scene; the suffix says the format (table above).

    Gaussians that make no sense (a value that is not finite, a zero quaternion, a size or an opacity that is not positive) are
    left out and counted in `Scene.rejected`. Raises FlickerError, naming the file and the field, for any file that holds no scene.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if path.is_dir():
        raise FlickerError(f"{path}: a folder, not a scene file")
    if reader is None:
        known = ", ".join(_READERS)
        raise FlickerError(f"{path}: unknown format '{path.suffix}'; known are {known}")
    try:
        if path.stat().st_size == 0:
            raise FlickerError(f"{path}: empty file")
        with np.errstate(all="ignore"):  # bad values are counted, not warned about
            return _checked(path, *reader(path))
    except FlickerError:
        raise
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror or _one_line(error)})") from None
    except Exception as error:  # the decoders raise anything at all for a damaged file
        raise FlickerError(f"{path}: damaged {path.suffix.lower()} file ({_one_line(error)})") from None


def _one_line(error: Exception) -> str:
    text = " ".join("".join(c if c.isprintable() else " " for c in str(error)).split())
    return text[:120] or type(error).__name__


def _checked(path: Path, means: Any, scales: Any, quats: Any, opacities: Any, sh: Any) -> Scene:
    """Leave out bad Gaussians, normalise rotations. Arrays as in Scene, activated."""
    count = len(means)
    if count == 0:
        raise FlickerError(f"{path}: no Gaussians")
    norm = np.linalg.norm(np.asarray(quats, np.float64), axis=1)
    faults = {
        "position not finite": ~np.isfinite(means).all(axis=1),
        "scale not finite": ~np.isfinite(scales).all(axis=1),
        "rotation not finite": ~np.isfinite(norm),
        "opacity not finite": ~np.isfinite(opacities),
        "colour not finite": ~np.isfinite(sh).all(axis=(1, 2)),
        "scale not positive": ~(scales > 0).all(axis=1),
        "rotation is zero": ~(norm > 0),
        "opacity not positive": ~(opacities > 0),
    }
    good = np.ones(count, bool)
    rejected = {}
    for reason, bad in faults.items():
        if (first := int((bad & good).sum())) > 0:
            rejected[reason] = first
            good &= ~bad
    if not good.any():
        reasons = ", ".join(f"{reason}: {n}" for reason, n in rejected.items())
        raise FlickerError(f"{path}: no usable Gaussian ({reasons})")
    if good.all():
        good = slice(None)
    quats = np.asarray(quats, np.float64)[good] / norm[good, None]
    return Scene(means[good], scales[good], quats, opacities[good], sh[good], path, rejected)


def _activated(data: gsply.GSData) -> tuple[np.ndarray, ...]:
    """gsply gives every format as INRIA PLY holds it: log scales, logit opacities, quaternions w first, sh0 and shN (N, K, 3)."""
    rest = data.shN
    count = len(data.means)
    bands = 0 if rest is None else rest.shape[1]
    if bands + 1 not in _SH_COUNTS:
        raise ValueError(f"{bands} SH coefficients a colour")
    sh = np.empty((count, bands + 1, 3), np.float32)
    sh[:, 0] = data.sh0
    if bands:
        sh[:, 1:] = rest
    scales = np.exp(data.scales)
    logits = data.opacities.astype(np.float64).reshape(count)
    opacities = (1.0 / (1.0 + np.exp(-logits))).astype(np.float32)
    opacities[~np.isfinite(logits)] = np.nan
    return data.means, scales, data.quats, opacities, sh


def _ply_header(path: Path) -> tuple[str, list[tuple[str, int, list[tuple[str, str]]]], int]:
    """Format, elements (name, count, properties (type, name)) in order, and offset of the data."""
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []
    layout = ""
    with path.open("rb") as file:
        if file.readline(16).strip() != b"ply":
            raise FlickerError(f"{path}: not a PLY file")
        for number in range(2, 1000):
            try:
                line = file.readline(4096).decode("ascii").strip()
                words = line.split()
                if not line.isprintable():
                    raise ValueError
                if words == ["end_header"]:
                    return layout, elements, file.tell()
                if words[0] == "format":
                    layout = words[1]
                elif words[0] == "element":
                    elements.append((words[1], int(words[2]), []))
                elif words[0] == "property":
                    elements[-1][2].append((" ".join(words[1:-1]), words[-1]))
                elif words[0] not in ("comment", "obj_info"):
                    raise ValueError
            except (IndexError, ValueError):
                raise FlickerError(f"{path}: line {number} of the header is not PLY") from None
    raise FlickerError(f"{path}: header without end_header")


def _ply_properties(path: Path, element: str, kind: str, have: list[tuple[str, str]], wanted: list[str]) -> None:
    """Every wanted property there, all of one kind, none twice."""
    names = [name for _, name in have]
    for name in wanted:
        if name not in names:
            raise FlickerError(f"{path}: element '{element}': property '{name}' is missing")
    for i, (given, name) in enumerate(have):
        if given != kind:
            raise FlickerError(f"{path}: element '{element}': property '{name}' is {given}, not {kind}")
        if name in names[:i]:
            raise FlickerError(f"{path}: element '{element}': property '{name}' is there twice")


def _read_ply(path: Path) -> tuple[np.ndarray, ...]:
    """INRIA or compressed PLY. The header is checked here: gsply takes every float property of the file for one of the vertex."""
    layout, elements, offset = _ply_header(path)
    if layout != "binary_little_endian":
        raise FlickerError(f"{path}: format '{layout}', not binary_little_endian")
    names = [name for name, _, _ in elements]
    counts = {name: count for name, count, _ in elements}
    properties = {name: have for name, _, have in elements}
    compressed = "chunk" in names
    order = (["chunk", "vertex"], ["chunk", "vertex", "sh"]) if compressed else (["vertex"],)
    if names not in order:
        raise FlickerError(f"{path}: elements {', '.join(names) or 'none'}, not {' or '.join(', '.join(o) for o in order)}")
    for name, count in counts.items():
        if count < 0:
            raise FlickerError(f"{path}: element '{name}': count {count}")
    if counts["vertex"] == 0:
        raise FlickerError(f"{path}: no Gaussians")
    rest = [name for _, name in properties["sh" if "sh" in names else "vertex"] if name.startswith("f_rest_")]
    if len(rest) not in _REST_COUNTS:
        raise FlickerError(f"{path}: {len(rest)} properties f_rest_*, not one of {', '.join(map(str, _REST_COUNTS))}")
    wanted_rest = [f"f_rest_{k}" for k in range(len(rest))]
    if compressed:
        bounds = [f"{m}_{v}" for v in ("{}", "scale_{}") for m in ("min", "max") for v in map(v.format, "xyz")]
        bounds += [f"{m}_{v}" for m in ("min", "max") for v in "rgb"]
        packed = [f"packed_{v}" for v in ("position", "rotation", "scale", "color")]
        _ply_properties(path, "chunk", "float", properties["chunk"], bounds)
        _ply_properties(path, "vertex", "uint", properties["vertex"], packed)
        if "sh" in names:
            _ply_properties(path, "sh", "uchar", properties["sh"], wanted_rest)
        for name, number in (("chunk", -(-counts["vertex"] // _CHUNK)), ("sh", counts["vertex"])):
            if counts.get(name, number) != number:
                raise FlickerError(f"{path}: element '{name}': count {counts[name]}, not {number}")
    else:
        wanted = ["x", "y", "z", *(f"f_dc_{k}" for k in range(3)), *wanted_rest, "opacity"]
        wanted += [*(f"scale_{k}" for k in range(3)), *(f"rot_{k}" for k in range(4))]
        _ply_properties(path, "vertex", "float", properties["vertex"], wanted)
    size = path.stat().st_size
    for name, count, have in elements:
        offset += count * len(have) * (1 if name == "sh" else 4)
        if size < offset:
            raise FlickerError(f"{path}: truncated: element '{name}' ends at byte {offset}, the file has {size}")
    if size > offset:
        raise FlickerError(f"{path}: {size - offset} bytes after the last element of the header")
    return _activated(gsply.plyread(path))


def _read_spz(path: Path) -> tuple[np.ndarray, ...]:
    means, scales, quats, opacities, sh = _activated(gsply.read_spz(path))
    if len(means) == 0:
        raise FlickerError(f"{path}: no Gaussians")
    return means * _TURN, scales, quats * np.append([1.0], _TURN), opacities, sh * _TURN_SH[: sh.shape[1], None]


# Half a turn about x, from right-up-back to right-down-forward: y, z and the harmonics odd in (y, z) change sign. (A quaternion
# whose y and z change sign is the turned rotation with two axes of the Gaussian reversed: the same ellipsoid.)
_TURN = np.array([1, -1, -1], np.float32)
_TURN_SH = np.array([1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)


def _sog_numbers(path: Path, meta: Any, group: str, key: str, count: int) -> None:
    """gsply's kernels index these without a check."""
    value = meta[group][key]
    if not isinstance(value, list) or len(value) != count:
        raise FlickerError(f"{path}: meta.json: {group}.{key}: not {count} numbers")
    if not np.isfinite(np.array(value, np.float64)).all():
        raise FlickerError(f"{path}: meta.json: {group}.{key}: not finite")


def _read_sog(path: Path) -> tuple[np.ndarray, ...]:
    data = path.read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as bundle:
            names = bundle.namelist()
            text = bundle.read("meta.json") if "meta.json" in names else None
    except Exception:  # of several libraries
        raise FlickerError(f"{path}: not a SOG bundle (zip), or damaged") from None
    if text is None:
        raise FlickerError(f"{path}: meta.json is missing")
    try:
        meta = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FlickerError(f"{path}: meta.json: not JSON ({_one_line(error)})") from None
    first = meta.get("version") is None
    try:
        count = meta["means"]["shape"][0] if first else meta["count"]
        _sog_numbers(path, meta, "means", "mins", 3)
        _sog_numbers(path, meta, "means", "maxs", 3)
        for group, channels in (("scales", 3), ("sh0", 4)):
            for key in ("mins", "maxs") if first else ("codebook",):
                _sog_numbers(path, meta, group, key, channels if first else 256)
    except KeyError as error:
        raise FlickerError(f"{path}: meta.json: {error} is missing") from None
    if type(count) is not int or count < 0:
        raise FlickerError(f"{path}: meta.json: count: not a number of Gaussians")
    if count == 0:
        raise FlickerError(f"{path}: no Gaussians")
    return _activated(gsply.sogread(data))


def _read_splat(path: Path) -> tuple[np.ndarray, ...]:
    """Records of 32 bytes: position and linear scale as float32, RGBA as bytes, quaternion (b - 128) / 128, w first."""
    record = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])
    size = path.stat().st_size
    if size % record.itemsize:
        raise FlickerError(f"{path}: truncated: {size} bytes are not a multiple of {record.itemsize}")
    data = np.fromfile(path, record)
    rgba = data["rgba"].astype(np.float64) / 255.0
    return (
        data["mean"], data["scale"], (data["quat"].astype(np.float64) - 128.0) / 128.0, rgba[:, 3],
        (rgba[:, None, :3] - 0.5) / _SH_C0,
    )


_READERS = {".ply": _read_ply, ".spz": _read_spz, ".sog": _read_sog, ".splat": _read_splat}


def save_ply(scene: Scene, path: str | Path) -> None:
    """Write a scene as an INRIA PLY file (log scales, logit opacities). Raises OSError."""
    opacities = np.minimum(scene.opacities.astype(np.float64), 1.0 - 2.0**-25)
    gsply.plywrite(path, gsply.GSData.from_arrays(
        means=scene.means, scales=np.log(scene.scales), quats=scene.quats,
        opacities=np.log(opacities / (1.0 - opacities)).astype(np.float32), sh0=np.ascontiguousarray(scene.sh[:, 0]),
        shN=np.ascontiguousarray(scene.sh[:, 1:]) if scene.sh.shape[1] > 1 else None, format="ply",
    ))
