"""Scenes: Gaussians with activated values, read from every common file format.

| what | format | read by |
|---|---|---|
| `.ply` | INRIA layout (with or without normals, SH degree 0 to 3) and PlayCanvas compressed layout | gsply |
| `.spz` | Niantic, gzip (versions 2 and 3) and zstd (version 4) container | gsply |
| `.sog`, `.zip`, a folder, its `meta.json` | PlayCanvas SOG, versions 1 and 2, packed or not; a zip of one scene file | `flicker.scene.sog`, gsply |
| `.splat` | 32-byte records | here |
| `.flk` | memory image of the chip | `flicker.scene.packed` |

Coordinates are those of the INRIA code (x right, y down, z forward for an upright scene). An SPZ file holds x right, y up,
z back and is turned by half a turn about x; the other formats keep the coordinates of the training.
"""

from __future__ import annotations

import hashlib
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FlickerError, FlickerWarning, one_line
from . import sog
from .gaussians import SH_C0, SH_DEGREES, Scene, logits
from .packed import decode, is_image, load_packed

if TYPE_CHECKING:
    import gsply  # loads numba: in the functions that decode

_REST_COUNTS = (0, 9, 24, 45)
_CHUNK = 256


def load_scene(path: str | Path) -> Scene:
    """Read a scene: a file, an unpacked SOG folder or its `meta.json`; the content says the format (`SCENE_SUFFIXES`, table above).

    Gaussians that make no sense (a value that is not finite, a zero quaternion, a size or an opacity that is not positive) are
    left out and counted in `Scene.rejected`. A file whose suffix says another format than its content is read with a FlickerWarning
    (`warnings`). Raises FlickerError, naming the file and the field, for anything that holds no scene.
    """
    path = Path(path)
    kind = "file"
    try:
        kind = scene_kind(path)
        if (said := _said_kind(path)) != kind:
            says = f"the suffix of {KINDS[said].title}" if said else f"the unknown suffix '{path.suffix}'"
            warnings.warn(FlickerWarning(f"{path}: has {says}, but holds {KINDS[kind].title}; read as such"), stacklevel=2)
        with np.errstate(all="ignore"):  # bad values are counted, not warned about
            return _checked(path, *KINDS[kind].read(path))
    except FlickerError:
        raise
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)})") from None
    except Exception as error:  # the decoders raise anything at all for a damaged file
        raise FlickerError(f"{path}: damaged {kind} ({one_line(error)})") from None


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
    kept = slice(None) if good.all() else good
    quats = np.asarray(quats, np.float64)[kept] / norm[kept, None]
    return Scene(means[kept], scales[kept], quats, opacities[kept], sh[kept], path, rejected)


def _activated(data: gsply.GSData) -> tuple[np.ndarray, ...]:
    """gsply gives every format as INRIA PLY holds it: log scales, logit opacities, quaternions w first, sh0 and shN (N, K, 3)."""
    rest = data.shN
    count = len(data.means)
    bands = 0 if rest is None else rest.shape[1]
    if bands + 1 not in SH_DEGREES:
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


def check_ply(path: Path) -> bool:
    """Check the header and size of a PLY file: INRIA, or compressed (True). gsply would take every float property of the file for one of the vertex."""
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
    return compressed


def _read_ply(path: Path) -> tuple[np.ndarray, ...]:
    check_ply(path)
    import gsply

    return _activated(gsply.plyread(path))


def _read_image(path: Path) -> tuple[np.ndarray, ...]:
    scene = decode(load_packed(path))
    return scene.means, scene.scales, scene.quats, scene.opacities, scene.sh


def _read_spz(path: Path) -> tuple[np.ndarray, ...]:
    import gsply

    means, scales, quats, opacities, sh = _activated(gsply.read_spz(path))
    if len(means) == 0:
        raise FlickerError(f"{path}: no Gaussians")
    return means * _TURN, scales, quats * np.append([1.0], _TURN), opacities, sh * _TURN_SH[: sh.shape[1], None]


def half_turn(scene: Scene) -> Scene:
    """The scene turned by half a turn about x, as it stands in an SPZ file."""
    return Scene(
        scene.means * _TURN, scene.scales, scene.quats * np.append([1.0], _TURN), scene.opacities, scene.sh * _TURN_SH[: scene.sh.shape[1], None],
        scene.path, scene.rejected,
    )


# Half a turn about x, from right-up-back to right-down-forward: y, z and the harmonics odd in (y, z) change sign. (A quaternion
# whose y and z change sign is the turned rotation with two axes of the Gaussian reversed: the same ellipsoid.)
_TURN = np.array([1, -1, -1], np.float32)
_TURN_SH = np.array([1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)


def _read_folder(path: Path) -> tuple[np.ndarray, ...]:
    return _activated(sog.read_folder(path, _meta_of(path)))


def _read_zip(path: Path) -> tuple[np.ndarray, ...]:
    # A zip within the zip may be a SOG, but nothing that is unpacked once more.
    return sog.read_zip(path, _activated, tuple(s for s in SCENE_SUFFIXES if s != ".zip"), _read_unpacked)


def _read_unpacked(path: Path) -> tuple[np.ndarray, ...]:
    """The scene file out of a zip."""
    kind = scene_kind(path)
    return sog.read_zip(path, _activated, (), _read_unpacked) if kind == "zip" else KINDS[kind].read(path)


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
        (rgba[:, None, :3] - 0.5) / SH_C0,
    )


# -- kinds of scenes ------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """A kind of scene. title: for messages. suffixes: of its files. holds: whether a file's first bytes are its; None: nothing tells.

    read: gives means, scales, quats, opacities, sh as in Scene, activated, unchecked.
    """

    title: str
    suffixes: tuple[str, ...]
    holds: Callable[[bytes], bool] | None
    read: Callable[[Path], tuple[np.ndarray, ...]]


def _is_ply(head: bytes) -> bool:
    return head[:16].split(b"\n")[0].strip() == b"ply"


def _is_spz(head: bytes) -> bool:
    """The zstd container; or gzip of SPZ, and not of anything else."""
    if head[:4] == b"NGSP":
        return True
    if head[:3] != b"\x1f\x8b\x08":
        return False
    try:
        return zlib.decompressobj(wbits=31).decompress(head, 4) == b"NGSP"
    except zlib.error:
        return False


# In the order in which contents are asked.
KINDS: dict[str, Kind] = {
    "image": Kind("a memory image", (".flk",), is_image, _read_image),
    "PLY": Kind("a PLY file", (".ply",), _is_ply, _read_ply),
    "SPZ": Kind("an SPZ file", (".spz",), _is_spz, _read_spz),
    "zip": Kind("a SOG bundle (zip)", (".sog", ".zip"), lambda head: head[:4] in (b"PK\x03\x04", b"PK\x05\x06"), _read_zip),
    "SOG": Kind("an unpacked SOG (meta.json)", (), None, _read_folder),
    "splat": Kind("a .splat file", (".splat",), None, _read_splat),
}
SCENE_SUFFIXES: tuple[str, ...] = tuple(s for kind in KINDS.values() for s in kind.suffixes)
_HEAD = 4096  # bytes that tell a kind; a header of gzip may name a file


def _meta_of(path: Path) -> Path:
    """`meta.json` of an unpacked SOG, given the folder or the file."""
    return path / sog.META if path.is_dir() else path


def _said_kind(path: Path) -> str | None:
    """Kind that the name says."""
    if path.suffix.lower() == ".json" or path.is_dir():
        return "SOG"
    return next((name for name, kind in KINDS.items() if path.suffix.lower() in kind.suffixes), None)


def scene_kind(path: str | Path) -> str:
    """Name in `KINDS` of what a path holds: by the first bytes, else by the suffix.

    Reads no more than it must; the rest of the file may yet be damaged. FlickerError, as of `load_scene`, for no scene.
    """
    path = Path(path)
    try:
        if path.is_dir():
            _check_folder(path)
            return "SOG"
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(_HEAD)
        if size == 0:
            raise FlickerError(f"{path}: empty file")
        said = _said_kind(path)
        if said == "SOG":
            sog.parse_meta(str(path), path.read_bytes())
            return said
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)})") from None
    for name, kind in KINDS.items():
        if kind.holds is not None and kind.holds(head):
            return name
    if said is None:
        raise FlickerError(f"{path}: unknown format '{path.suffix}'; known are {', '.join(SCENE_SUFFIXES)}, a SOG folder and its {sog.META}")
    return said


def _check_folder(path: Path) -> None:
    """A folder must be an unpacked SOG; else say what to give."""
    if (path / sog.META).is_file():
        return
    if (path / sog.LOD_META).is_file():
        sog.parse_meta(f"{path}: {sog.LOD_META}", (path / sog.LOD_META).read_bytes())
    inside = sorted(p.name for p in path.iterdir() if p.suffix.lower() in SCENE_SUFFIXES)
    hint = f"; a scene file in it: {one_line(inside[0])}" if inside else ""
    raise FlickerError(f"{path}: a folder without {sog.META}, so not an unpacked SOG{hint}")


def is_scene_path(path: str | Path) -> bool:
    """Whether `load_scene` would try to read what is there."""
    try:
        scene_kind(path)
    except FlickerError:
        return False
    return True


def scene_folders(path: str | Path) -> list[Path]:
    """Folders in which a scene's cameras may lie, nearest first: a file's folder; an unpacked SOG's own and the one around it."""
    path = Path(path)
    if _said_kind(path) != "SOG":
        return [path.parent]
    own = _meta_of(path).parent
    return [own, own.absolute().parent]


def scene_title(path: str | Path) -> str:
    """What a scene is called: a file's name, an unpacked SOG's folder's."""
    path = Path(path)
    return _meta_of(path).resolve().parent.name if _said_kind(path) == "SOG" else path.name


def scene_name(path: str | Path) -> str:
    """Short name of a scene, for tables: a file's up to the first dot, an unpacked SOG's folder's."""
    title = scene_title(path)
    return title if _said_kind(Path(path)) == "SOG" else title.split(".")[0]


def scene_files(path: str | Path) -> list[Path]:
    """The files that make a scene, all that `load_scene` reads: one, or `meta.json` and its pictures. FlickerError for no scene."""
    path = Path(path)
    if scene_kind(path) != "SOG":
        return [path]
    meta = _meta_of(path)
    try:
        text = meta.read_bytes()
    except OSError as error:
        raise FlickerError(f"{meta}: cannot be read ({error.strerror})") from None
    return [meta, *(meta.parent / name for name in sog.member_names(str(meta), sog.parse_meta(str(meta), text)))]


def scene_digest(path: str | Path) -> str:
    """SHA-256 of a scene's content, hexadecimal: of a file that of the file, whatever its name. FlickerError for what cannot be read."""
    digests = []
    for file in scene_files(path):
        try:
            with file.open("rb") as opened:
                digests.append(hashlib.file_digest(opened, "sha256").hexdigest())
        except OSError as error:
            raise FlickerError(f"{file}: cannot be read ({error.strerror})") from None
    return digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()


def save_ply(scene: Scene, path: str | Path) -> None:
    """Write a scene as an INRIA PLY file (log scales, logit opacities). Raises OSError."""
    import gsply

    gsply.plywrite(path, gsply.GSData.from_arrays(
        means=scene.means, scales=np.log(scene.scales), quats=scene.quats,
        opacities=logits(scene.opacities).astype(np.float32), sh0=np.ascontiguousarray(scene.sh[:, 0]),
        shN=np.ascontiguousarray(scene.sh[:, 1:]) if scene.sh.shape[1] > 1 else None, format="ply",
    ))
