"""Scenes: Gaussians with activated values, read from every common file format.

| what | format | read by |
|---|---|---|
| `.ply`, `.ply.gz` | INRIA layout and what other trainers make of it, PlayCanvas compressed layout | `scene.ply_scene`, gsply for the latter |
| `.spz` | Niantic, versions 1 to 4 | `scene.spz` |
| `.sog`, `.zip`, a folder, its `meta.json` | PlayCanvas SOG, versions 1 and 2, packed or not; a zip of one scene file | `scene.sog`, gsply |
| `.glb`, `.gltf` | KHR_gaussian_splatting | `scene.gltf` |
| `.ksplat` | GaussianSplats3D | `scene.ksplat` |
| `.splat` | 32-byte records | `scene.splat` |
| `.flk` | memory image of the chip | `scene.packed` |

Coordinates are those of the INRIA code (x right, y down, z forward for an upright scene). SPZ (right, up, back) and glTF (left, up, front) are turned by half a
turn; the other formats keep the coordinates of the training.
"""

from __future__ import annotations

import codecs
import hashlib
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line, say
from . import sog
from .folders import trained_scene
from .gaussians import Scene, logits
from .gltf import gltf_files, is_gltf, read_gltf
from .ksplat import is_ksplat, read_ksplat
from .packed import decode, is_image, load_packed
from .ply import is_ply
from .ply_scene import has_chunks, read_ply
from .raw import FLAT_NOTE, Raw
from .splat import read_splat
from .spz import is_spz, read_spz
from .turns import ABOUT_X
from .turns import half_turn as turned

__all__ = ["Scene", "has_chunks", "load_scene", "save_ply"]  # and what the page lists
FLAT = 2.0**-16  # a scale of 0 becomes this share of the largest one
_LEAST = 2.0**-30  # and this at least


def load_scene(path: str | Path) -> Scene:
    """Read a scene: a file, an unpacked SOG folder or its `meta.json`; the content says the format (`SCENE_SUFFIXES`, table above).

    Gaussians that make no sense (a value that is not finite, a zero quaternion, a negative size, an opacity that is not positive) are left out and counted in
    `Scene.rejected`. A scale of 0 (log scale of -inf), which is flat, becomes 2^-16 of the largest. What is assumed, approximated or dropped besides, and a
    suffix that says another format, is a FlickerWarning (`warnings`). Raises FlickerError, naming the file and the field, for anything that holds no scene.
    """
    path = Path(path)
    kind = "file"
    try:
        kind = scene_kind(path)
        if (said := _said_kind(path)) != kind:
            says = f"the suffix of {KINDS[said].title}" if said else f"the unknown suffix '{path.suffix}'"
            say(path, f"has {says}, but holds {KINDS[kind].title}; read as such")
        with np.errstate(all="ignore"):  # bad values are counted, not warned about
            raw = KINDS[kind].read(path)
            for note in raw.notes:
                say(path, note)
            return _checked(path, raw)
    except FlickerError:
        raise
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)})") from None
    except MemoryError:
        raise FlickerError(f"{path}: larger than the memory of this machine") from None
    except Exception as error:  # the decoders raise anything at all for a damaged file
        raise FlickerError(f"{path}: damaged {kind} ({one_line(error)})") from None


def _checked(path: Path, raw: Raw) -> Scene:
    """Leave out bad Gaussians, normalise rotations, give flat ones a thickness."""
    count = len(raw.means)
    if count == 0:
        raise FlickerError(f"{path}: no Gaussians")
    norm = np.linalg.norm(np.asarray(raw.quats, np.float64), axis=1)
    scales = np.array(raw.scales, np.float32)
    faults = {
        "position not finite": ~np.isfinite(np.asarray(raw.means, np.float32)).all(axis=1),
        "scale not finite": ~np.isfinite(scales).all(axis=1),
        "rotation not finite": ~np.isfinite(norm),
        "opacity not finite": ~np.isfinite(raw.opacities),
        "colour not finite": ~np.isfinite(raw.sh).all(axis=(1, 2)),
        "scale negative": (scales < 0).any(axis=1),
        "rotation is zero": ~(norm > 0),
        "opacity not positive": ~(raw.opacities > 0),
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
    flat = good & (scales == 0).any(axis=1)
    if flat.any():
        thin = np.maximum(np.float32(FLAT) * scales[flat].max(axis=1, keepdims=True), np.float32(_LEAST))
        scales[flat] = np.where(scales[flat] == 0, thin, scales[flat])
        if FLAT_NOTE not in raw.notes:
            say(path, f"{int(flat.sum())} Gaussians have a scale of 0: drawn as flat, 2^-16 as thick as wide")
    kept = slice(None) if good.all() else good
    quats = np.asarray(raw.quats, np.float64)[kept] / norm[kept, None]
    return Scene(raw.means[kept], scales[kept], quats, raw.opacities[kept], raw.sh[kept], path, rejected, raw.antialiased)


def half_turn(scene: Scene) -> Scene:
    """The scene turned by half a turn about x, as it stands in an SPZ file."""
    raw = turned(Raw(scene.means, scene.scales, scene.quats, scene.opacities, scene.sh), ABOUT_X)
    return Scene(raw.means, raw.scales, raw.quats, raw.opacities, raw.sh, scene.path, scene.rejected, scene.antialiased)


def _read_image(path: Path) -> Raw:
    scene = decode(load_packed(path))
    return Raw(scene.means, scene.scales, scene.quats, scene.opacities, scene.sh, scene.antialiased)


def _read_folder(path: Path) -> Raw:
    return sog.read_folder(path, _meta_of(path))


def _read_zip(path: Path) -> Raw:
    # A zip within the zip may be a SOG, but nothing that is unpacked once more.
    return sog.read_zip(path, tuple(s for s in SCENE_SUFFIXES if s != ".zip"), _read_unpacked)


def _read_unpacked(path: Path) -> Raw:
    """The scene file out of a zip."""
    kind = scene_kind(path)
    return sog.read_zip(path, (), _read_unpacked) if kind == "zip" else KINDS[kind].read(path)


# -- kinds of scenes ------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """A kind of scene. title: for messages. suffixes: of its files. holds: whether a file's first bytes are its; None: nothing tells.

    read: gives what the file says; raises FlickerError and OSError.
    """

    title: str
    suffixes: tuple[str, ...]
    holds: Callable[[bytes], bool] | None
    read: Callable[[Path], Raw]


# In the order in which contents are asked.
KINDS: dict[str, Kind] = {
    "image": Kind("a memory image", (".flk",), is_image, _read_image),
    "PLY": Kind("a PLY file", (".ply", ".ply.gz"), is_ply, read_ply),
    "SPZ": Kind("an SPZ file", (".spz",), is_spz, read_spz),
    "zip": Kind("a SOG bundle (zip)", (".sog", ".zip"), lambda head: head[:4] in (b"PK\x03\x04", b"PK\x05\x06"), _read_zip),
    "glTF": Kind("a glTF file", (".glb", ".gltf"), is_gltf, read_gltf),
    "ksplat": Kind("a .ksplat file", (".ksplat",), is_ksplat, read_ksplat),
    "SOG": Kind("an unpacked SOG (meta.json)", (), None, _read_folder),
    "splat": Kind("a .splat file", (".splat",), None, read_splat),
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
    return next((name for name, kind in KINDS.items() if path.name.lower().endswith(kind.suffixes)), None) if path.suffix else None


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
        hint = _inside(path.parent) if isinstance(error, FileNotFoundError) else ""
        raise FlickerError(f"{path}: cannot be read ({error.strerror or one_line(error)}){hint and f'; a scene in that folder: {hint}'}") from None
    for name, kind in KINDS.items():
        if kind.holds is not None and kind.holds(head):
            return name
    text, packed = _text(head), "gzip of something that is neither PLY nor SPZ: unpack it"
    if said is not None and text and said != "glTF":
        raise FlickerError(f"{path}: {text}, not {KINDS[said].title}")
    if said not in (None, "PLY", "SPZ") and _unpacks(head):  # those two are read from gzip, and say more
        raise FlickerError(f"{path}: {packed}")
    if said is None:
        what = text or (packed if head[:2] == b"\x1f\x8b" else "")
        raise FlickerError(
            f"{path}: unknown format '{path.suffix}'{what and f' ({what})'}; known are {', '.join(SCENE_SUFFIXES)}, a SOG folder and its {sog.META}"
        )
    return said


def _unpacks(head: bytes) -> bool:
    """Whether a file's first bytes begin a gzip stream, and not records of a `.splat` that happen to begin as one."""
    try:
        return head[:3] == b"\x1f\x8b\x08" and len(zlib.decompressobj(wbits=31).decompress(head, 64)) > 0
    except zlib.error:
        return False


def _text(head: bytes) -> str:
    """What a file is whose first bytes are text; empty for none."""
    if head.startswith(b"version https://git-lfs"):
        return "a pointer of Git LFS (get the file with git lfs pull)"
    wide = head[: len(head) & ~1].decode("utf-16", "replace") if head[:2] in (b"\xff\xfe", b"\xfe\xff") else ""
    if wide and _readable(wide):
        return "text"
    plain = sum(32 <= byte < 127 or byte in b"\t\n\f\r" for byte in head)
    decoder = codecs.getincrementaldecoder("utf-8")("ignore" if plain > 0.9 * len(head) else "strict")
    try:
        words = decoder.decode(head)  # a character may be cut at the end
    except UnicodeDecodeError:
        return ""
    if b"\0" in head or not _readable(words):
        return ""
    return "a web page" if words.lstrip().startswith("<") else "text"


def _readable(words: str) -> bool:
    return all(c.isprintable() or c.isspace() for c in words)


def _check_folder(path: Path) -> None:
    """A folder must be an unpacked SOG; else say what to give."""
    if (path / sog.META).is_file():
        return
    if (path / sog.LOD_META).is_file():
        sog.parse_meta(f"{path}: {sog.LOD_META}", (path / sog.LOD_META).read_bytes())
    hint = _inside(path)
    raise FlickerError(f"{path}: a folder without {sog.META}, so not an unpacked SOG{hint and f'; a scene in it: {hint}'}")


_POINTS = ("input.ply", "points3d.ply", "sparse_pc.ply")  # what trainers start from


def _inside(folder: Path) -> str:
    """A scene in a folder, for hints: what a trainer ended with, else the first file that may be one; empty for none."""
    if (trained := trained_scene(folder)) is not None:
        return one_line(trained.relative_to(folder))
    names = sorted(p.name for p in folder.glob("*") if _said_kind(p) not in (None, "SOG") and p.name.lower() not in _POINTS)
    return one_line(names[0]) if names else ""


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
    """The files that make a scene, all that `load_scene` reads: one, a glTF and its buffers, or `meta.json` and its pictures. FlickerError for no scene."""
    path = Path(path)
    if (kind := scene_kind(path)) != "SOG":
        return gltf_files(path) if kind == "glTF" else [path]
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
    """Write a scene as an INRIA PLY file (log scales, logit opacities), with the comment `SplatRenderMode: mip` where it is antialiased. Raises OSError."""
    import gsply  # loads numba

    gsply.plywrite(path, gsply.GSData.from_arrays(
        means=scene.means, scales=np.log(scene.scales), quats=scene.quats,
        opacities=logits(scene.opacities).astype(np.float32), sh0=np.ascontiguousarray(scene.sh[:, 0]),
        shN=np.ascontiguousarray(scene.sh[:, 1:]) if scene.sh.shape[1] > 1 else None, format="ply",
    ))
    if scene.antialiased:
        first, end, rest = Path(path).read_bytes().partition(b" 1.0\n")  # behind the line of the format
        Path(path).write_bytes(first + end + b"comment SplatRenderMode: mip\n" + rest)
