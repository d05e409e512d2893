"""In-memory layout of the packed structs that RTL, simulation harness and tests share: described here, once.

`scripts/gen_params.py` writes `rtl/generated/flk_pkg.sv` from it, `flicker.sim.generate` the C++ header of the harness; tests take offsets and
widths from `place` and `fields`. Formats and field meanings: docs/reference/number_formats.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .errors import FlickerError
from .params import SUBTILE_COORD_BITS

FP16_BITS = 16


@dataclass(frozen=True)
class Field:
    """A member of a packed struct. type: bits (1: a plain `logic`), "fp16", or the name of a record; alias: SystemVerilog text for the bits."""

    name: str
    type: int | str
    note: str = ""
    alias: str = ""


@dataclass(frozen=True)
class Record:
    """A packed struct `<name>_t`, most significant field first, of a package."""

    name: str
    note: str
    fields: tuple[Field, ...]
    package: str = "flk_pkg"


def _record(name: str, note: str, *fields: tuple, package: str = "flk_pkg") -> Record:
    return Record(name, note, tuple(Field(*field) for field in fields), package)


_COORD = "flk_param_pkg::SUBTILE_COORD_BITS"
# Of AXI4 inside the chip; a record of a channel goes beside its valid and ready.
AXI_ID_BITS, AXI_ADDR_BITS, AXI_DATA_BITS = 4, 40, 512
_ID, _ADDR, _DATA = ((bits, "", f"AXI_{name}_BITS") for name, bits in (("ID", AXI_ID_BITS), ("ADDR", AXI_ADDR_BITS), ("DATA", AXI_DATA_BITS)))

RECORDS: dict[str, Record] = {
    record.name: record
    for record in (
        _record(
            "feature", "The numbers a VRU needs of one splat.",
            ("red", "fp16"), ("green", "fp16"), ("blue", "fp16"), ("opacity", "fp16"), ("shape2", "fp16"), ("shape1", "fp16"),
            ("shape0", "fp16"), ("mean_y", "fp16"), ("mean_x", "fp16"),
        ),
        _record("splat", "The record of the sorted list.", ("spiky", 1), ("feature", "feature")),
        _record(
            "subtile", "Position of a sub-tile in the picture; in an end-of-sub-tile element it lies in the low bits.",
            ("row", SUBTILE_COORD_BITS, "", _COORD), ("col", SUBTILE_COORD_BITS, "", _COORD),
        ),
        _record("splat_elem", "Stream element between sorting unit and mask generator.", ("eos", 1), ("splat", "splat")),
        _record(
            "record_elem", "Stream element of the lanes: a record of 16 bytes as it lies in memory, and the sub-tile whose list it is in.",
            ("eos", 1), ("record", 128), ("subtile", "subtile"), package="flk_lane_pkg",
        ),
        _record("feature_elem", "Stream element of a feature FIFO; a mask generator sends it below its mask.", ("eos", 1), ("feature", "feature")),
        _record("pixel", "State of one pixel.", ("transmittance", "fp16"), ("red", "fp16"), ("green", "fp16"), ("blue", "fp16")),
        _record("channel_pixel", "Finished pixel of a channel: index within the mini-tile.", ("subtile", "subtile"), ("index", 4), ("pixel", "pixel")),
        _record(
            "core_pixel", "Finished pixel of a core.",
            ("subtile", "subtile"), ("minitile", 2), ("index", 4), ("pixel", "pixel"),
        ),
        _record(
            "generator_events", "What a mask generator did in a cycle, for the performance counters.",
            ("busy", 1, "started a test or took a token"), ("stalled", 1, "had input, could not take it"), ("idle", 1, "had no input"),
            ("token", 1, "took an end of sub-tile"), ("splat", 1, "took a splat"), ("rejected", 1, "a splat's mask came out empty"),
            ("tested", 3, "mini-tiles in the mask"),
        ),
        _record(
            "dispatch_events", "What the dispatch of a core did in a cycle.",
            ("delivered", 3, "splats written into feature FIFOs"), ("filtered", 3, "mini-tiles dropped because the channel was finished"),
        ),
        _record(
            "channel_events", "What a channel did in a cycle.",
            ("fifo_full", 1), ("vru_busy", 1, "issued a pixel to each VRU"), ("sent", 1, "a splat met the unfinished mini-tile, in program order"),
            ("discarded", 1, "dropped a splat of the finished mini-tile"), ("finished", 3, "pixels that ended, at most one in each VRU"),
        ),
        _record("axi_ax", "AR, AW.", ("id", *_ID), ("addr", *_ADDR), ("len", 8), ("size", 3), ("burst", 2), package="flk_axi_pkg"),
        _record("axi_r", "R.", ("id", *_ID), ("last", 1), ("resp", 2), ("data", *_DATA), package="flk_axi_pkg"),
        _record("axi_w", "W.", ("last", 1), ("strb", AXI_DATA_BITS // 8, "", "AXI_DATA_BITS/8"), ("data", *_DATA), package="flk_axi_pkg"),
        _record("axi_b", "B.", ("id", *_ID), ("resp", 2), package="flk_axi_pkg"),
    )
}
# Records whose size the package gives a name.
SIZED = ("splat_elem", "feature_elem", "channel_pixel", "core_pixel")


@dataclass(frozen=True)
class Place:
    """Bits of a field: offset of the lowest one, and their number."""

    at: int
    bits: int


def _width(type_: int | str) -> int:
    if isinstance(type_, int):
        return type_
    return FP16_BITS if type_ == "fp16" else bits(type_)


def bits(record: str) -> int:
    """Bits of a record."""
    return sum(_width(field.type) for field in RECORDS[record].fields)


def words(record: str) -> int:
    """Whole 32-bit words that hold a record."""
    return -(-bits(record) // 32)


def fields(record: str) -> dict[str, Place]:
    """The record's own fields, most significant first."""
    at, found = bits(record), {}
    for field in RECORDS[record].fields:
        at -= _width(field.type)
        found[field.name] = Place(at, _width(field.type))
    return found


def leaves(record: str) -> dict[str, Place]:
    """Fields that are no records, by their dotted path."""
    found: dict[str, Place] = {}
    for field in RECORDS[record].fields:
        own = fields(record)[field.name]
        if field.type in RECORDS:
            found |= {f"{field.name}.{path}": Place(own.at + place.at, place.bits) for path, place in leaves(str(field.type)).items()}
        else:
            found[field.name] = own
    return found


def place(record: str, path: str) -> Place:
    """Bits of a field by its dotted path, for example place("splat_elem", "splat.feature.mean_x")."""
    first, _, rest = path.partition(".")
    own = fields(record)[first]
    if not rest:
        return own
    inner = place(str(next(field.type for field in RECORDS[record].fields if field.name == first)), rest)
    return Place(own.at + inner.at, inner.bits)


def pack(record: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Records as the harness reads them: uint32 (N, words), bit 0 of the record in bit 0 of word 0.

    columns: a column of N integers by the last part of each field's path; fields that have none of that name are an error, `eos` is 0.
    """
    count = len(next(iter(columns.values())))
    packed = np.zeros((count, words(record)), np.uint32)
    for path, where in leaves(record).items():
        name = path.rpartition(".")[2]
        if name == "eos":
            continue
        if name not in columns:
            raise FlickerError(f"record {record}: field {path}: lists have no {name} (they have {', '.join(columns)})")
        value = np.asarray(columns[name]).astype(np.uint64) << np.uint64(where.at % 32)
        packed[:, where.at // 32] |= value.astype(np.uint32)
        if where.at % 32 + where.bits > 32:
            packed[:, where.at // 32 + 1] |= (value >> np.uint64(32)).astype(np.uint32)
    return packed


def typedef(record: Record) -> str:
    """SystemVerilog text of a record."""

    def type_of(field: Field) -> str:
        if isinstance(field.type, str):
            other = "" if field.type == "fp16" or RECORDS[field.type].package == record.package else f"{RECORDS[field.type].package}::"
            return f"{other}{field.type}_t"
        if field.alias:
            return f"logic [{field.alias}-1:0]"
        return "logic" if field.type == 1 else f"logic [{field.type - 1}:0]"

    wide = max(len(type_of(field)) for field in record.fields)
    noted = max(len(field.name) for field in record.fields)
    lines = []
    for field in record.fields:
        note = f"{' ' * (noted - len(field.name))}  // {field.note}" if field.note else ""
        lines.append(f"    {type_of(field):{wide}} {field.name};{note}")
    return "\n".join([f"  // {record.note}", "  typedef struct packed {", *lines, f"  }} {record.name}_t;", ""])
