"""glTF 2.0 and GLB with the extension KHR_gaussian_splatting, uncompressed or as SPZ.

Buffers inside a GLB, beside the file or in the JSON as base64. Every node that shows Gaussians places them with its transform and those above it. The axes of
glTF are left, up, front; the whole is turned by half a turn about z to right, down, front.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..errors import FlickerError, one_line
from .raw import Raw
from .spz import decode_spz
from .turns import ABOUT_Z, half_turn, matrices, moved

MAGIC = b"glTF"
SPLATS = "KHR_gaussian_splatting"
_SPZ = ("KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz")
_DRAFTS = ("KHR_spz_gaussian_splats_compression", "KHR_spz_compression")  # on the primitive itself
_HARMLESS = {SPLATS, *_SPZ, *_DRAFTS, "KHR_materials_unlit", "KHR_mesh_quantization", "KHR_node_visibility"}  # extensions that a file may require
_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def is_gltf(head: bytes) -> bool:
    """Whether a file with these first bytes is a GLB, or looks like the JSON of a glTF."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return head[:4] == MAGIC or (text[:1] == b"{" and any(f'"{key}"'.encode() in text for key in ("accessors", "bufferViews", "meshes", SPLATS)))


def gltf_files(path: Path) -> list[Path]:
    """The file and the buffers beside it that it names."""
    file = _File(path)
    return [path, *(path.parent / uri for k in range(len(file.list("buffers"))) if (uri := file.outside(k)) is not None)]


def read_gltf(path: Path) -> Raw:
    """FlickerError naming file and field; OSError."""
    file = _File(path)
    for name in file.list("extensionsRequired"):
        if name not in _HARMLESS:
            raise FlickerError(f"{path}: needs the extension {one_line(name)}, which is not read; export without it")
    primitives: dict[tuple[int, int], Raw] = {}
    parts, notes, others = [], [], 0
    for mesh, matrix in file.placed():
        for k, primitive in enumerate(file.entry("meshes", mesh, "a node").get("primitives", [])):
            if not primitive.get("extensions", {}).keys() & {SPLATS, *_DRAFTS}:
                others += 1
                continue
            where = f"meshes[{mesh}].primitives[{k}]"
            if (mesh, k) not in primitives:
                primitives[mesh, k] = file.gaussians(primitive, where)
                notes += [note for note in primitives[mesh, k].notes if note not in notes]
            try:
                parts.append(moved(primitives[mesh, k], matrix))
            except ValueError as error:
                raise FlickerError(f"{path}: {where}: the transform of its node {error}; apply it before exporting") from None
    if not parts:
        raise FlickerError(f"{path}: no Gaussians: no node shows a primitive with the extension {SPLATS}" + (f", {others} without" if others else ""))
    if others:
        notes.append(f"{others} primitives without Gaussians (meshes, points) are left out")
    if file.list("animations"):
        notes.append("animations are not played: everything stands where its nodes put it")
    antialiased = all(part.antialiased for part in parts)
    if not antialiased and any(part.antialiased for part in parts):
        notes.append("some primitives were trained antialiased, others not: all are drawn as the latter")
    most = max(part.sh.shape[1] for part in parts)
    sh = np.zeros((sum(len(part.means) for part in parts), most, 3), np.float32)
    start = 0
    for part in parts:
        sh[start : start + len(part.means), : part.sh.shape[1]] = part.sh
        start += len(part.means)
    means, scales, quats, opacities = (np.concatenate([getattr(p, name) for p in parts]) for name in ("means", "scales", "quats", "opacities"))
    return half_turn(Raw(means, scales, quats, opacities, sh, antialiased, tuple(notes)), ABOUT_Z)


class _File:
    """The JSON of a file, and its buffers, read on first use."""

    def __init__(self, path: Path) -> None:
        self.path = path
        data = path.read_bytes()
        self._chunk: bytes | memoryview | None = None
        self._buffers: dict[int, bytes | memoryview] = {}
        if data[:4] == MAGIC:
            data = self._split(data)
        try:
            self.json = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise FlickerError(f"{path}: not JSON ({one_line(error)})") from None
        if not isinstance(self.json, dict) or not isinstance(self.json.get("asset"), dict):
            raise FlickerError(f"{path}: not glTF: 'asset' is missing")
        if (version := str(self.json["asset"].get("version"))).split(".")[0] != "2":
            raise FlickerError(f"{path}: glTF version {one_line(version)}: 2.0 is read")

    def _split(self, data: bytes) -> bytes:
        """The JSON of a GLB; keeps its binary chunk."""
        if len(data) < 20:
            raise FlickerError(f"{self.path}: truncated: {len(data)} bytes")
        version, length, size, kind = struct.unpack_from("<III4s", data, 4)
        if version != 2:
            raise FlickerError(f"{self.path}: GLB version {version}: 2 is read")
        if length > len(data):
            raise FlickerError(f"{self.path}: truncated: the header says {length} bytes, the file has {len(data)}")
        if kind != b"JSON" or 20 + size > length:
            raise FlickerError(f"{self.path}: damaged GLB: the first chunk is no JSON within the file")
        place = 20 + size
        while place + 8 <= length:
            chunk, kind = struct.unpack_from("<I4s", data, place)
            if place + 8 + chunk > length:
                raise FlickerError(f"{self.path}: truncated: a chunk ends at byte {place + 8 + chunk} of {length}")
            if kind == b"BIN\0" and self._chunk is None:
                self._chunk = memoryview(data)[place + 8 : place + 8 + chunk]
            place += 8 + chunk
        return data[20 : 20 + size]

    def list(self, name: str) -> list[Any]:
        found = self.json.get(name, [])
        if not isinstance(found, list):
            raise FlickerError(f"{self.path}: {name}: not a list")
        return found

    def entry(self, name: str, index: Any, where: str) -> dict[str, Any]:
        found = self.list(name)
        if type(index) is not int or not 0 <= index < len(found) or not isinstance(found[index], dict):
            raise FlickerError(f"{self.path}: {where}: {name}[{one_line(index)}] is missing")
        return found[index]

    def _number(self, entry: dict[str, Any], key: str, where: str, default: int | None = None) -> int:
        value = entry.get(key, default)
        if type(value) is not int or value < 0:
            raise FlickerError(f"{self.path}: {where}: {key}: not a number from 0")
        return value

    def outside(self, index: int) -> str | None:
        """Name of the file beside this one that a buffer is; None for a buffer that is here."""
        uri = self.entry("buffers", index, "buffers").get("uri")
        if uri is None or (isinstance(uri, str) and uri.startswith("data:")):
            return None
        name = unquote(str(uri))
        if "://" in name or Path(name).is_absolute() or ".." in Path(name).parts or not name.isprintable():
            raise FlickerError(f"{self.path}: buffers[{index}].uri: '{one_line(uri)}' is not a name beside the file")
        return name

    def _buffer(self, index: Any, where: str) -> bytes | memoryview:
        entry = self.entry("buffers", index, where)
        if index not in self._buffers:
            name, uri = self.outside(index), entry.get("uri")
            if name is not None:
                try:
                    found: bytes | memoryview = (self.path.parent / name).read_bytes()
                except OSError as error:
                    raise FlickerError(f"{self.path}: buffers[{index}]: {name}: cannot be read ({error.strerror})") from None
            elif uri is not None:
                try:
                    found = base64.b64decode(uri.partition(";base64,")[2], validate=True)
                except (binascii.Error, ValueError) as error:
                    raise FlickerError(f"{self.path}: buffers[{index}].uri: damaged base64 ({one_line(error)})") from None
            elif self._chunk is not None and index == 0:
                found = self._chunk
            else:
                raise FlickerError(f"{self.path}: buffers[{index}]: neither a uri nor the binary chunk of a GLB")
            size = self._number(entry, "byteLength", f"buffers[{index}]")
            if len(found) < size:
                raise FlickerError(f"{self.path}: truncated: buffers[{index}] has {len(found)} bytes, not {size}")
            self._buffers[index] = memoryview(found)[:size]
        return self._buffers[index]

    def _view(self, index: Any, where: str) -> tuple[memoryview, int]:
        """Bytes of a buffer view, and its stride (0: none)."""
        view = self.entry("bufferViews", index, where)
        here = f"bufferViews[{index}]"
        if any("compression" in str(name) for name in view.get("extensions", {})):
            raise FlickerError(f"{self.path}: {here}: compressed ({one_line(', '.join(view['extensions']))}), which is not read; export without it")
        buffer = self._buffer(view.get("buffer"), here)
        start, size = self._number(view, "byteOffset", here, 0), self._number(view, "byteLength", here)
        if start + size > len(buffer):
            raise FlickerError(f"{self.path}: truncated: {here} ends at byte {start + size} of a buffer of {len(buffer)}")
        return memoryview(buffer)[start : start + size], self._number(view, "byteStride", here, 0)

    def array(self, index: Any, width: int, where: str) -> np.ndarray:
        """float32 (N, width) of an accessor."""
        accessor = self.entry("accessors", index, where)
        here = f"accessors[{index}] ({where})"
        kind, count = _TYPES.get(accessor.get("componentType", 0)), self._number(accessor, "count", here)
        if kind is None or _WIDTHS.get(accessor.get("type", "")) != width:
            wanted = next(name for name, w in _WIDTHS.items() if w == width)
            raise FlickerError(f"{self.path}: {here}: {one_line(accessor.get('type'))} of type {one_line(accessor.get('componentType'))}, not {wanted}")
        if "sparse" in accessor or "bufferView" not in accessor:
            raise FlickerError(f"{self.path}: {here}: sparse or without a buffer view, which is not read; export it whole")
        data, stride = self._view(accessor["bufferView"], here)
        item = np.dtype(kind).itemsize
        stride, start = stride or item * width, self._number(accessor, "byteOffset", here, 0)
        end = start + (stride * (count - 1) + item * width if count else 0)
        if stride < item * width or end > len(data):
            raise FlickerError(f"{self.path}: truncated: {here} ends at byte {end} of a buffer view of {len(data)}")
        if count == 0:
            return np.empty((0, width), np.float32)
        found = np.ndarray((count, width), kind, data, start, (stride, item))
        if accessor.get("normalized") and found.dtype.kind != "f":
            return np.maximum(found.astype(np.float64) / np.iinfo(found.dtype).max, -1.0).astype(np.float32)
        return found.astype(np.float32)

    def gaussians(self, primitive: dict[str, Any], where: str) -> Raw:
        """Of a primitive, in the axes of the mesh."""
        for name in _DRAFTS:
            if name in primitive["extensions"]:
                return self._spz(primitive["extensions"][name], where)
        extension, attributes = primitive["extensions"][SPLATS], primitive.get("attributes", {})
        if not isinstance(extension, dict) or not isinstance(attributes, dict):
            raise FlickerError(f"{self.path}: {where}: {SPLATS}, attributes: not objects")
        for key, known, default in (("kernel", ("ellipse",), "ellipse"), ("projection", ("perspective",), "perspective")):
            if (value := extension.get(key, default)) not in known:
                raise FlickerError(f"{self.path}: {where}: {key} '{one_line(value)}', not {', '.join(known)}")
        space = extension.get("colorSpace", "srgb_rec709_display")
        notes: tuple[str, ...] = ()
        if space != "srgb_rec709_display":
            notes = (f"colour space {one_line(space)}: colours are drawn as if they were sRGB",)
        if (sorting := extension.get("sortingMethod", "zDepth")) != "zDepth":
            known = sorting == "cameraDistance"
            notes += ("is to be sorted by distance to the camera: --order distance does so, the default is depth along its axis" if known else
                      f"sortingMethod '{one_line(sorting)}' is not known: splats are sorted by depth along the camera's axis",)
        for name, more in extension.get("extensions", {}).items():
            if name not in _SPZ:
                raise FlickerError(f"{self.path}: {where}: {one_line(name)}, which is not read; export without it")
            raw = self._spz(more, where)
            raw.notes += notes
            return raw

        def attribute(name: str, width: int) -> np.ndarray:
            if name not in attributes:
                raise FlickerError(f"{self.path}: {where}: attribute '{name}' is missing")
            return self.array(attributes[name], width, f"{where}, {name}")

        means, quats = attribute("POSITION", 3), attribute(f"{SPLATS}:ROTATION", 4)
        scales, opacities = attribute(f"{SPLATS}:SCALE", 3), attribute(f"{SPLATS}:OPACITY", 1)[:, 0]
        degree = max((d for d in range(4) if any(name.startswith(f"{SPLATS}:SH_DEGREE_{d}_") for name in attributes)), default=0)
        coefficients = [attribute(f"{SPLATS}:SH_DEGREE_{d}_COEF_{k}", 3) for d in range(degree + 1) for k in range(2 * d + 1)]
        if len({len(a) for a in (means, quats, scales, opacities, *coefficients)}) > 1:
            raise FlickerError(f"{self.path}: {where}: its attributes differ in count")
        if any(name.startswith(f"{SPLATS}:SH_DEGREE_4_") for name in attributes):
            notes += ("SH of degree 4 cut to 3: 9 of 25 coefficients a colour are left out",)
        if beyond := int((opacities > 1).sum()):
            notes += (f"{beyond} opacities above 1 are taken for 1",)
        return Raw(means, scales, np.roll(quats, 1, axis=1), np.minimum(opacities, 1), np.stack(coefficients, axis=1), notes=notes)

    def _spz(self, extension: dict[str, Any], where: str) -> Raw:
        data, _ = self._view(extension.get("bufferView"), where)
        return decode_spz(bytes(data), f"{self.path}: {where}")[0]

    def placed(self) -> Iterator[tuple[int, np.ndarray]]:
        """Meshes and where nodes put them, (4, 4); each mesh once, where it is, in a file without nodes."""
        nodes = self.list("nodes")
        if not nodes:
            yield from ((k, np.eye(4)) for k in range(len(self.list("meshes"))))
            return
        if self.list("scenes"):
            roots = self.entry("scenes", self.json.get("scene", 0), "scene").get("nodes", [])
        else:
            below = {child for node in nodes if isinstance(node, dict) for child in node.get("children", [])}
            roots = [k for k in range(len(nodes)) if k not in below]
        todo, seen = [(root, np.eye(4)) for root in reversed(roots)], set()
        while todo:
            index, above = todo.pop()
            node = self.entry("nodes", index, "scenes, nodes")
            if index in seen:
                raise FlickerError(f"{self.path}: nodes[{index}]: below itself or below two nodes")
            seen.add(index)
            if node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible") is False:
                continue  # with all below it
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                raise FlickerError(f"{self.path}: nodes[{index}]: EXT_mesh_gpu_instancing, which is not read; export without it")
            matrix = above @ self._matrix(node, index)
            if "mesh" in node:
                yield node["mesh"], matrix
            todo += [(child, matrix) for child in reversed(node.get("children", []))]

    def _matrix(self, node: dict[str, Any], index: int) -> np.ndarray:
        """Of a node, as `matrix` (column by column) or as translation, rotation (x, y, z, w) and scale."""
        def values(key: str, default: list[float]) -> np.ndarray:
            try:
                found = np.array(node.get(key, default), np.float64)
            except (TypeError, ValueError):
                found = np.zeros(0)
            if found.shape != (len(default),) or not np.isfinite(found).all():
                raise FlickerError(f"{self.path}: nodes[{index}]: {key}: not {len(default)} numbers")
            return found

        if "matrix" in node:
            return values("matrix", list(np.eye(4).ravel())).reshape(4, 4).T
        x, y, z, w = values("rotation", [0, 0, 0, 1])
        if not any((x, y, z, w)):
            raise FlickerError(f"{self.path}: nodes[{index}]: rotation: zero")
        matrix = np.eye(4)
        matrix[:3, :3] = matrices(np.array([[w, x, y, z]]))[0] * values("scale", [1, 1, 1])
        matrix[:3, 3] = values("translation", [0, 0, 0])
        return matrix
