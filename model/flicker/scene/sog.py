"""SOG scenes (PlayCanvas, versions 1 and 2): `meta.json` and the WebP pictures that it names, in a zip, in a folder of a zip, or unpacked.

All forms go the same way: the members that `meta.json` names are read and checked, packed into a zip in memory and given to gsply's decoder.
"""

from __future__ import annotations

import io
import json
import os
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FlickerError, one_line
from .fields import truth
from .raw import FLAT_NOTE, Raw, of_gsply

META = "meta.json"
LOD_META = "lod-meta.json"  # of a streamed SOG: an index of many SOG folders
_MODELS = (None, "", "default", "3dgs", "antialiased")  # ways of rendering, beside 2dgs
_GROUPS = {"means": 2, "scales": 1, "quats": 1, "sh0": 1, "shN": 2}  # group of meta.json: its pictures; shN may be missing


def parse_meta(where: str, text: bytes) -> dict[str, Any]:
    """The object in a `meta.json`. where: what messages call it. FlickerError for other JSON, `lod-meta.json` among it."""
    try:
        meta = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FlickerError(f"{where}: not JSON ({one_line(error)})") from None
    if isinstance(meta, dict) and isinstance(meta.get("filenames"), list):
        raise FlickerError(f"{where}: index of a streamed SOG, which is not read as a whole; {_lod_advice(meta)}")
    if not isinstance(meta, dict) or "means" not in meta:
        raise FlickerError(f"{where}: not the {META} of a SOG: 'means' is missing")
    if meta.get("shN", meta) is None:  # as if it were missing
        del meta["shN"]
    return meta


def _lod_advice(meta: dict[str, Any]) -> str:
    """Which file to give instead of a streamed SOG's index: of its finest level."""
    finest: set[int] = set()

    def walk(node: Any) -> None:
        for entry in node.get("lods", {}).items():
            if entry[0] == "0":
                finest.add(entry[1]["file"])
        for child in node.get("children", []):
            walk(child)

    try:
        walk(meta["tree"])
        names = [str(meta["filenames"][k]) for k in sorted(finest)]
    except (KeyError, IndexError, TypeError, AttributeError, RecursionError):
        names = []
    whole = "the .ply or .sog it was made from"
    if len(names) == 1:
        return f"give its finest level, {one_line(names[0])}"
    if names:
        return f"give {whole}, or one of the {len(names)} parts of its finest level, such as {one_line(names[0])}"
    return f"give {whole}, or the {META} of one of its folders"


def member_names(where: str, meta: dict[str, Any]) -> list[str]:
    """Names of the pictures that a `meta.json` asks for. FlickerError naming group and field."""
    names = []
    for group, count in _GROUPS.items():
        if group == "shN" and group not in meta:
            continue
        if group not in meta:
            raise FlickerError(f"{where}: '{group}' is missing")
        files = meta[group].get("files") if isinstance(meta[group], dict) else None
        if not isinstance(files, list) or len(files) != count or not all(isinstance(name, str) and name for name in files):
            raise FlickerError(f"{where}: {group}.files: not {'a name' if count == 1 else f'{count} names'}")
        for name in files:
            if not name.isprintable() or os.path.isabs(name) or ".." in name.replace("\\", "/").split("/"):
                raise FlickerError(f"{where}: {group}.files: '{one_line(name)}' is not a name beside {META}")
        names += files
    return names


def _numbers(where: str, meta: dict[str, Any], group: str, key: str, count: int) -> None:
    """gsply's kernels index these without a check."""
    if key not in meta[group]:
        raise FlickerError(f"{where}: {group}: '{key}' is missing")
    value = meta[group][key]
    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.array(None)
    if not isinstance(value, list) or array.shape != (count,):
        raise FlickerError(f"{where}: {group}.{key}: not {count} numbers")
    if not np.isfinite(array).all():
        raise FlickerError(f"{where}: {group}.{key}: not finite")


def _check(where: str, meta: dict[str, Any]) -> None:
    """Everything in `meta.json` but the names of the pictures."""
    version = meta.get("version")
    if version not in (None, 2):
        raise FlickerError(f"{where}: version: {one_line(json.dumps(version))}, not 2 (or none: version 1)")
    first = version is None
    if first:
        shape = meta["means"].get("shape")
        count = shape[0] if isinstance(shape, list) and shape else None
    elif "count" not in meta:
        raise FlickerError(f"{where}: 'count' is missing")
    else:
        count = meta["count"]
    if type(count) is not int or count < 0:
        raise FlickerError(f"{where}: {'means.shape' if first else 'count'}: not a number of Gaussians")
    if count == 0:
        raise FlickerError(f"{where}: no Gaussians")
    _numbers(where, meta, "means", "mins", 3)
    _numbers(where, meta, "means", "maxs", 3)
    for group, channels in (("scales", 3), ("sh0", 4)):
        for key in ("mins", "maxs") if first else ("codebook",):
            _numbers(where, meta, group, key, channels if first else 256)
    if "shN" in meta and not first:
        if meta["shN"].get("bands") not in (1, 2, 3):
            raise FlickerError(f"{where}: shN.bands: not 1, 2 or 3")
        if type(meta["shN"].get("count")) is not int:
            raise FlickerError(f"{where}: shN.count: not a number of palette entries")
        _numbers(where, meta, "shN", "codebook", 256)


def _decoded(path: Path, where: str, text: bytes, read: Callable[[str], bytes]) -> Raw:
    """text: `meta.json`, called `where` in messages. read: a member's content; raises FlickerError."""
    import gsply

    meta = parse_meta(where, text)
    names = member_names(where, meta)
    _check(where, meta)
    try:
        antialiased = truth(meta, "antialias") or meta.get("model") == "antialiased"
    except FlickerError as error:
        raise FlickerError(f"{where}: {error}") from None
    members = {name: read(name) for name in names}
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as bundle:
        for name, data in (members | {META: json.dumps(meta).encode()}).items():
            bundle.writestr(name, data)
    try:
        raw = of_gsply(gsply.sogread(packed.getvalue()))
        raw.antialiased = antialiased
        if meta.get("model") == "2dgs":
            raw.notes = (FLAT_NOTE,)
        elif meta.get("model") not in _MODELS:
            raw.notes = (f"model {one_line(json.dumps(meta['model']))} is not known: drawn as {'antialiased' if antialiased else 'default'}",)
        return raw
    except Exception:  # of several libraries; the culprit is looked for now, so that good files are decoded once
        import imagecodecs

        for name, data in members.items():
            try:
                imagecodecs.webp_decode(data)
            except Exception as error:
                raise FlickerError(f"{path}: {name}: not a WebP picture, or damaged ({one_line(error)})") from None
        raise


def read_folder(path: Path, meta: Path) -> Raw:
    """An unpacked SOG. path: what the user gave, the folder or its `meta.json`; meta: the latter."""
    def read(name: str) -> bytes:
        try:
            return (meta.parent / name).read_bytes()
        except OSError as error:
            raise FlickerError(f"{path}: {name}: cannot be read ({error.strerror})") from None

    where = str(path) if path == meta else f"{path}: {meta.name}"
    return _decoded(path, where, meta.read_bytes(), read)


@contextmanager
def _zip(path: Path) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo]]]:
    """An open zip and its members by name, with forward slashes; without the doubles that macOS adds."""
    try:
        bundle = zipfile.ZipFile(path)
    except OSError:
        raise
    except Exception:  # of several libraries
        raise FlickerError(f"{path}: not a zip (SOG bundle), or damaged") from None
    with bundle:
        members = {info.filename.replace("\\", "/"): info for info in bundle.infolist()}
        yield bundle, {
            name: info for name, info in members.items() if not name.endswith("/") and not name.startswith("__MACOSX/")
        }


def _member(path: Path, bundle: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], name: str) -> bytes:
    if name not in members:
        raise FlickerError(f"{path}: {name}: missing in the zip")
    try:
        return bundle.read(members[name])
    except Exception as error:  # damaged, encrypted, compressed in a way that Python does not know
        raise FlickerError(f"{path}: {name}: cannot be unpacked ({one_line(error)})") from None


def read_zip(path: Path, suffixes: tuple[str, ...], read: Callable[[Path], Raw]) -> Raw:
    """A zip: of a SOG, at its top or in one folder, else of a single scene file.

    suffixes: of scene files. read: takes such a file, unpacked for the time of the call; its
    FlickerErrors are told of zip and member.
    """
    with _zip(path) as (bundle, members):
        if META in members:
            metas = [META]
        else:
            metas = [name for name in members if name.endswith("/" + META)]
        lods = [name for name in members if name.rpartition("/")[2] == LOD_META]
        if lods and META not in members:
            parse_meta(f"{path}: {lods[0]}", _member(path, bundle, members, lods[0]))
        if len(metas) > 1:
            raise FlickerError(f"{path}: {len(metas)} SOG scenes ({', '.join(metas[:2])}{', ...' if len(metas) > 2 else ''}): unpack it, give one")
        if metas:
            top = metas[0].removesuffix(META)
            return _decoded(
                path, f"{path}: {metas[0]}", _member(path, bundle, members, metas[0]),
                lambda name: _member(path, bundle, members, top + name),
            )
        inside = [name for name in members if name.lower().endswith(suffixes)]
        if len(inside) > 1:
            raise FlickerError(
                f"{path}: {len(inside)} scene files ({', '.join(inside[:2])}{', ...' if len(inside) > 2 else ''}): unpack it, give one"
            )
        if not inside:
            others = f", and no other scene file is in it ({', '.join(suffixes)})" if suffixes else ""
            raise FlickerError(f"{path}: {META} is missing{others}")
        with tempfile.TemporaryDirectory(prefix="flicker-") as folder:
            file = Path(folder) / inside[0].rpartition("/")[2]
            file.write_bytes(_member(path, bundle, members, inside[0]))
            try:
                return read(file)
            except FlickerError as error:
                raise FlickerError(str(error).replace(str(file), f"{path}: {inside[0]}")) from None
