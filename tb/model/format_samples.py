"""Writers of scene files that no library here writes: PLY of every kind, SPZ of every version, glTF, KSPLAT. From the descriptions of the formats."""

from __future__ import annotations

import base64
import gzip
import json
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scene_samples as samples
import zstandard

from flicker.scene.gaussians import Scene

CODES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8", "half": "f2", "int8": "i1",
    "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "float16": "f2", "int64": "i8",
}
Property = tuple[str, str, Sequence]  # type ("list uchar int" for lists), name, a value (a list of values) for each record


def logit(o: np.ndarray) -> np.ndarray:
    o = o.astype(np.float64)
    with np.errstate(divide="ignore"):
        return np.log(o) - np.log(1 - o)


def vertex(scene: Scene, kind: str = "float", rest: np.ndarray | None = None) -> list[Property]:
    """Properties of the INRIA layout. rest: float (N, K - 1, 3) in place of the scene's."""
    with np.errstate(divide="ignore"):
        scales = np.log(scene.scales.astype(np.float64))
    rest = scene.sh[:, 1:] if rest is None else rest
    columns = {"x": scene.means[:, 0], "y": scene.means[:, 1], "z": scene.means[:, 2]}
    columns |= {f"f_dc_{k}": scene.sh[:, 0, k] for k in range(3)}
    columns |= {f"f_rest_{c * rest.shape[1] + k}": rest[:, k, c] for c in range(3) for k in range(rest.shape[1])}
    columns |= {"opacity": logit(scene.opacities)} | {f"scale_{k}": scales[:, k] for k in range(3)} | {f"rot_{k}": scene.quats[:, k] for k in range(4)}
    return [(kind, name, values) for name, values in columns.items()]


def ply(
    elements: list[tuple[str, list[Property]]], layout: str = "binary_little_endian", newline: bytes = b"\n", comments: Sequence[str] = (),
) -> bytes:
    """A PLY file. An element whose properties have no values is empty."""
    lines = ["ply", f"format {layout} 1.0", *comments]
    body = []
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[layout]
    for name, properties in elements:
        count = len(properties[0][2])
        lines += [f"element {name} {count}", *(f"property {kind} {what}" for kind, what, _ in properties)]
        for n in range(count):
            words: list = []
            for kind, _, values in properties:
                of = kind.split()
                words += [(of[1], len(values[n])), *((of[2], v) for v in values[n])] if len(of) == 3 else [(kind, values[n])]
            if layout == "ascii":
                body.append(" ".join(str(v) for _, v in words).encode() + newline)
            else:
                body.append(b"".join(np.array(v).astype(order + CODES[kind]).tobytes() for kind, v in words))
    return newline.join(line.encode() for line in [*lines, "end_header", ""]) + b"".join(body)


# ---- SPZ -----------------------------------------------------------------------------------------------------------------------------


def spz(scene: Scene, version: int, rest: np.ndarray | None = None, flags: int = 0, extensions: bytes = b"", plain: bool = False, bits: int = 12) -> bytes:
    """An SPZ file with the values of the scene as they are (no turn). rest: (N, K - 1, 3) in place of the scene's."""
    n = len(scene)
    rest = scene.sh[:, 1:] if rest is None else rest
    degree = int(np.sqrt(rest.shape[1] + 1)) - 1
    if version == 1:
        positions = scene.means.astype("<f2").tobytes()
    else:
        fixed = np.rint(scene.means.astype(np.float64) * 2**bits).astype("<i4")
        positions = np.ascontiguousarray(fixed).view(np.uint8).reshape(n, 3, 4)[..., :3].tobytes()
    q = scene.quats[:, [1, 2, 3, 0]].astype(np.float64)
    if version < 3:
        q *= np.where(q[:, 3:] < 0, -1, 1)
        rotations = np.rint((q[:, :3] + 1) * 127.5).astype(np.uint8).tobytes()
    else:
        words = np.zeros(n, np.uint32)
        for k in range(n):
            largest = int(np.argmax(np.abs(q[k])))
            word = largest
            for i in range(4):
                if i != largest:
                    negative = int((q[k, i] < 0) ^ (q[k, largest] < 0))
                    word = word << 10 | negative << 9 | int(511 * abs(q[k, i]) * np.sqrt(2) + 0.5)
            words[k] = word
        rotations = words.astype("<u4").tobytes()

    def codes(values: np.ndarray) -> bytes:
        return np.clip(np.rint(values), 0, 255).astype(np.uint8).tobytes()

    sections = [
        positions, codes(scene.opacities * 255), codes(scene.sh[:, 0] * 0.15 * 255 + 127.5), codes((np.log(scene.scales) + 10) * 16), rotations,
        codes(rest * 128 + 128),
    ]
    if version < 4:
        whole = struct.pack("<4sIIBBBB", b"NGSP", version, n, degree, bits, flags, 0) + b"".join(sections) + extensions
        return whole if plain else gzip.compress(whole)
    streams = [zstandard.ZstdCompressor().compress(s) for s in sections if s]
    sizes = [len(s) for s in sections if s]
    head = struct.pack("<4sIIBBBBI12x", b"NGSP", version, n, degree, bits, flags, len(streams), 32 + len(extensions))
    return head + extensions + b"".join(struct.pack("<QQ", len(s), size) for s, size in zip(streams, sizes, strict=True)) + b"".join(streams)


# ---- glTF ----------------------------------------------------------------------------------------------------------------------------

SPLATS = "KHR_gaussian_splatting"


def gltf_attributes(scene: Scene) -> dict[str, np.ndarray]:
    """Attributes of a primitive, with the values of the scene as they are (no turn)."""
    found = {
        "POSITION": scene.means, f"{SPLATS}:ROTATION": scene.quats[:, [1, 2, 3, 0]], f"{SPLATS}:SCALE": scene.scales, f"{SPLATS}:OPACITY": scene.opacities,
    }
    for d in range(scene.sh_degree + 1):
        found |= {f"{SPLATS}:SH_DEGREE_{d}_COEF_{k}": scene.sh[:, d * d + k] for k in range(2 * d + 1)}
    return found


def gltf(attributes: dict[str, np.ndarray], nodes: list | None = None, interleaved: bool = False) -> tuple[dict, bytes]:
    """The JSON (without a uri of its buffer) and the buffer. Integer attributes are normalised."""
    types = {np.dtype("f4"): 5126, np.dtype("u1"): 5121, np.dtype("i1"): 5120, np.dtype("u2"): 5123, np.dtype("i2"): 5122}
    views, accessors, parts, numbers = [], [], [], {}
    place = 0
    if interleaved:
        fields = [(str(k), a.dtype, a.shape[1:]) for k, a in enumerate(attributes.values())]
        record = np.zeros(len(next(iter(attributes.values()))), fields)
        for k, a in enumerate(attributes.values()):
            record[str(k)] = a
        parts, views = [record.tobytes()], [{"buffer": 0, "byteLength": record.nbytes, "byteStride": record.itemsize}]
    for k, (name, values) in enumerate(attributes.items()):
        width = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[1 if values.ndim == 1 else values.shape[1]]
        if not interleaved:
            data = values.tobytes() + bytes(-values.nbytes % 4)
            views.append({"buffer": 0, "byteOffset": place, "byteLength": len(data)})
            parts.append(data)
            place += len(data)
        accessors.append({
            "bufferView": 0 if interleaved else k, "componentType": types[values.dtype], "count": len(values), "type": width,
            **({"byteOffset": record.dtype.fields[str(k)][1]} if interleaved else {}), **({} if values.dtype == "f4" else {"normalized": True}),
        })
        numbers[name] = k
    buffer = b"".join(parts)
    return {
        "asset": {"version": "2.0"}, "extensionsUsed": [SPLATS], "buffers": [{"byteLength": len(buffer)}], "bufferViews": views, "accessors": accessors,
        "meshes": [{"primitives": [{
            "attributes": numbers, "mode": 0, "extensions": {SPLATS: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}},
        }]}],
        "nodes": nodes or [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0,
    }, buffer


def glb(document: dict, buffer: bytes) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    buffer += bytes(-len(buffer) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write_gltf(path: Path, document: dict, buffer: bytes, form: str) -> Path:
    """form: glb, embedded (a data URI) or beside (a file)."""
    if form == "glb":
        path = path.with_suffix(".glb")
        path.write_bytes(glb(document, buffer))
        return path
    path = path.with_suffix(".gltf")
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    if form == "beside":
        uri = "the%20buffer.bin"
        (path.parent / "the buffer.bin").write_bytes(buffer)
    path.write_text(json.dumps(document | {"buffers": [{"byteLength": len(buffer), "uri": uri}]}))
    return path


# ---- KSPLAT --------------------------------------------------------------------------------------------------------------------------


def ksplat(scenes: list[Scene], level: int, room: int = 0, bucket: int = 16, block: float = 5.0) -> bytes:
    """A section for each scene. room: places for further Gaussians at the end of each. In levels 1 and 2, Gaussians lie within half a block of the origin."""
    total = sum(map(len, scenes))
    head = struct.pack("<BBxxIIII", 0, 1, len(scenes), len(scenes), total, total) + struct.pack("<Hxxfffff", level, 0, 0, 0, -1.5, 1.5)
    headers, sections = [], []
    for scene in scenes:
        n, degree = len(scene), scene.sh_degree
        full, left = divmod(n, bucket)
        buckets = full + bool(left)
        centres = np.random.default_rng(n).uniform(-0.1, 0.1, (buckets, 3)).astype("<f4")
        of = np.arange(n) // bucket
        number = "<f4" if level == 0 else "<f2"
        record = np.zeros(n + room, [
            ("mean", number if level == 0 else "<u2", 3), ("scale", number, 3), ("quat", number, 4), ("rgba", "u1", 4),
            ("sh", ("<f4", "<f2", "u1")[level], 3 * ((degree + 1) ** 2 - 1)),
        ])
        record["mean"][:n] = scene.means if level == 0 else np.rint((scene.means - centres[of]) / (block / 2 / 32767) + 32767)
        record["scale"][:n], record["quat"][:n] = scene.scales, scene.quats
        record["rgba"][:n] = np.rint(255 * np.column_stack([0.5 + samples.C0 * scene.sh[:, 0], scene.opacities]).clip(0, 1))
        rest = [scene.sh[:, d * d : (d + 1) ** 2].transpose(0, 2, 1).reshape(n, -1) for d in range(1, degree + 1)]
        if rest:
            rest = np.hstack(rest)
            record["sh"][:n] = np.floor((rest.clip(-1.5, 1.5) + 1.5) / 3 * 255) if level == 2 else rest
        packed = level > 0
        headers.append(struct.pack(
            "<IIIIfHxxIIIIH", n, n + room, bucket * packed, buckets * packed, block * packed, 12 * packed, 32767 * packed, 0, full * packed,
            bool(left) * packed, degree,
        ).ljust(1024, b"\0"))
        sections.append((struct.pack("<I", left) * bool(left) + centres.tobytes() if packed else b"") + record.tobytes())
    return head.ljust(4096, b"\0") + b"".join(headers) + b"".join(sections)
