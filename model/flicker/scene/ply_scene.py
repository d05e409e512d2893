"""Gaussians in PLY files: the INRIA layout with what other trainers make of it, and PlayCanvas' compressed layout (decoded by gsply).

| what | becomes |
|---|---|
| `x y z`, `f_dc_*`, `f_rest_*`, `opacity`, `scale_*`, `rot_*`: float, double, half, half as ushort | Gaussians |
| two scales | flat Gaussians (2DGS) |
| `red green blue` in place of `f_dc_*`: uchar, ushort, or float from 0 to 1 | colours without higher harmonics |
| comments `SplatRenderMode: mip` (brush, gsplat) and `antialiased 1` (Postshot) | antialiased |
| other elements, other properties | passed over; properties that are not commonly there are told |
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line
from .memory import chunk_bytes, chunks_of, is_chunked
from .ply import ANTIALIASED, Ply, open_ply
from .raw import FLAT_NOTE, KEPT, Raw, cut_note, degree_of, of_gsply, sh_of_colours, sigmoid

TRAINED = "point_cloud/iteration_N/point_cloud.ply"  # the scene in an output folder of the INRIA code
_COLOURS = ["red", "green", "blue"]
_FLOATS = ("f2", "f4", "f8", "u2")
_KNOWN = re.compile(r"[xyz]|n[xyz]|f_dc_\d+|f_rest_\d+|red|green|blue|alpha|opacity|scale_\d|rot_\d")
# Properties without which a file is not drawn as it is meant, and what helps.
_REFUSED = {
    "filter_3D": "a 3D filter that is not fused into scales and opacities; fuse it with create_fused_ply.py of Mip-Splatting",
    "trbf_center": "Gaussians that move in time; only scenes that stand still are read: export one moment",
    "f_anchor_feat_0": "anchors of Scaffold-GS, of which a network makes Gaussians for each view; export Gaussians with its trainer",
}


def has_chunks(path: Path) -> bool:
    """Whether a PLY file is a compressed one. FlickerError for a header that is not PLY."""
    return is_chunked(open_ply(path).header)


def read_ply(path: Path) -> Raw:
    """FlickerError naming file, element and property; OSError."""
    file = open_ply(path)
    if not is_chunked(file.header):
        return _gaussians(file)
    chunks, notes = chunks_of(file)
    import gsply  # loads numba

    raw = of_gsply(gsply.decompress_from_bytes(chunk_bytes(chunks)))
    raw.antialiased, raw.notes = chunks.antialiased, notes
    return raw


def _checked(file: Ply) -> tuple[list[str], list[str], int]:
    """Properties of the colour and of the scales, and the number of properties f_rest_*; all that Gaussians need is there."""
    path, vertex = file.path, file.header.element("vertex")
    if vertex is None:
        raise FlickerError(f"{path}: elements {', '.join(e.name for e in file.header.elements) or 'none'}, but no vertex")
    names = {p.name for p in vertex.properties}
    for name, why in _REFUSED.items():
        if name in names:
            raise FlickerError(f"{path}: element 'vertex': property '{name}': {why}")
    if not any(name.startswith(("scale_", "rot_", "opacity", "f_dc_")) for name in names):
        hint = f"a trained scene is {TRAINED} in most output folders"
        raise FlickerError(f"{path}: points, not Gaussians: element 'vertex': property 'scale_0' is missing; {hint}")
    colour = _COLOURS if "f_dc_0" not in names and names >= set(_COLOURS) else [f"f_dc_{k}" for k in range(3)]
    rest = sum(name.startswith("f_rest_") for name in names)
    if rest % 3 or degree_of(rest // 3 + 1) is None:
        raise FlickerError(f"{path}: {rest} properties f_rest_*, which no SH degree has: 0, 9, 24 or 45")
    scales = [f"scale_{k}" for k in range(2 if "scale_1" in names and not names & {"scale_2", "scale_3"} else 3)]
    wanted = ["x", "y", "z", *(f"f_rest_{k}" for k in range(rest)), "opacity", *scales, *(f"rot_{k}" for k in range(4))]
    if colour is _COLOURS:
        file.require("vertex", colour, ("u1", *_FLOATS), "uchar, ushort or float")
    else:
        wanted += colour
    file.require("vertex", wanted, _FLOATS, "float, double or half")
    if vertex.count == 0:
        raise FlickerError(f"{path}: no Gaussians")
    return colour, scales, rest


def _gaussians(file: Ply) -> Raw:
    colour, scale_names, rest = _checked(file)
    columns = file.columns["vertex"]
    notes = _notes(file, len(scale_names))
    means, logits, quats = (file.numbers("vertex", names) for names in (["x", "y", "z"], ["opacity"], [f"rot_{k}" for k in range(4)]))
    scales = np.zeros((len(means), 3), np.float32)
    with np.errstate(over="ignore"):
        scales[:, : len(scale_names)] = np.exp(file.numbers("vertex", scale_names))
    count = rest // 3 + 1
    kept = min(count, KEPT)
    sh = np.empty((len(means), kept, 3), np.float32)
    if colour is _COLOURS:
        rgb = file.numbers("vertex", colour, "f8", halves=False)
        kind = columns["red"].dtype
        most = np.iinfo(kind).max if kind.kind == "u" else 1.0
        if kind.kind == "f" and (rgb > 1.0).any():
            raise FlickerError(f"{file.path}: element 'vertex': property red, green or blue of {rgb.max():g}, not a colour from 0 to 1")
        sh[:, :1] = sh_of_colours(rgb / most)
    else:
        sh[:, 0] = file.numbers("vertex", colour)
    names = [f"f_rest_{c * (count - 1) + k}" for c in range(3) for k in range(kept - 1)]  # channel by channel
    if names:
        sh[:, 1:] = file.numbers("vertex", names).reshape(len(means), 3, -1).transpose(0, 2, 1)
    notes += cut_note(count)
    return Raw(means, scales, quats, sigmoid(logits[:, 0]), sh, file.header.mode == ANTIALIASED, notes)


def _notes(file: Ply, scales: int) -> tuple[str, ...]:
    vertex = file.header.element("vertex")
    properties = [] if vertex is None else vertex.properties
    notes = [*file.header.mode_notes]
    if scales == 2 or file.header.mode == "2dgs":
        notes.append(FLAT_NOTE)
    if any(p.kind == "u2" and not p.length and p.name not in _COLOURS and _KNOWN.fullmatch(p.name) for p in properties):
        notes.append("values of type ushort are taken for half floats")
    if others := [one_line(p.name) for p in properties if not _KNOWN.fullmatch(p.name)]:
        notes.append(f"properties that are not used: {', '.join(others[:4])}{', ...' if len(others) > 4 else ''}")
    return tuple(notes)
