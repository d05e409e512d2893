"""PLY files in general: the header, and the records of every element, binary in both byte orders and as text, plain or in gzip.

Numbers are taken out of records in blocks, whatever their types. Nothing is allocated by a count of the header before the file is known to be long enough.
"""

from __future__ import annotations

import gzip
import re
import zlib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "half": "f2", "float16": "f2", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}
LAYOUTS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
ANTIALIASED = "mip"
_MOST = 1 << 20  # bytes of a header
_BLOCK = 4096  # records


# Comments that say how a scene is rendered: key, values, what they mean.
_MODES = {
    "splatrendermode": {"default": "default", ANTIALIASED: ANTIALIASED, "2dgs": "2dgs"},
    "antialiased": {"0": "default", "false": "default", "1": ANTIALIASED, "true": ANTIALIASED},
}


@dataclass(frozen=True)
class Property:
    """type: as the header spells it. kind: of the value, or of a list's items. length: kind of a list's length; empty for no list."""

    name: str
    type: str
    kind: str
    length: str = ""


@dataclass(frozen=True)
class Element:
    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def lists(self) -> bool:
        return any(p.length for p in self.properties)


@dataclass(frozen=True)
class Header:
    """layout: a key of LAYOUTS. comments: without the word. size: bytes up to the data. newline: what ends a line."""

    layout: str
    elements: list[Element]
    comments: list[str]
    size: int
    newline: bytes

    def element(self, name: str) -> Element | None:
        return next((e for e in self.elements if e.name == name), None)

    @property
    def _modes(self) -> list[tuple[str, str]]:
        """Keys and values of the comments that say how the scene is rendered."""
        found = []
        for comment in self.comments:
            key, _, value = comment.lower().replace(":", " ").replace("=", " ").partition(" ")
            if key in _MODES:
                found.append((key, value.strip()))
        return found

    @property
    def mode(self) -> str:
        """How the comments say that the scene is rendered, as brush, gsplat and Postshot write it: default, mip (antialiased) or 2dgs; the last one holds."""
        return next((_MODES[key][value] for key, value in reversed(self._modes) if value in _MODES[key]), "default")

    @property
    def mode_notes(self) -> tuple[str, ...]:
        """What is said of ways of rendering that are not known."""
        return tuple(f"{key} '{one_line(value)}' is not known: drawn as {self.mode}" for key, value in self._modes if value not in _MODES[key])


@dataclass(eq=False)
class Ply:
    """An opened file. body: uint8, what lies behind the header."""

    path: Path
    header: Header
    body: np.ndarray

    @cached_property
    def columns(self) -> dict[str, dict[str, np.ndarray]]:
        """By element and property, the values of all records as they lie in the file, without lists. FlickerError where the data do not fit the header."""
        return (_text if self.header.layout == "ascii" else _binary)(self.path, self.header, self.body)

    def require(self, element: str, names: list[str], kinds: tuple[str, ...], says: str) -> None:
        """FlickerError where one of the properties is missing, is there twice or is of another kind than these of TYPES, which messages call `says`."""
        have = self.header.element(element)
        properties = [] if have is None else have.properties
        for name in names:
            found = [p for p in properties if p.name == name]
            if not found:
                raise FlickerError(f"{self.path}: element '{element}': property '{name}' is missing")
            if len(found) > 1:
                raise FlickerError(f"{self.path}: element '{element}': property '{name}' is there twice")
            if found[0].length or found[0].kind not in kinds:
                raise FlickerError(f"{self.path}: element '{element}': property '{name}' is {found[0].type}, not {says}")

    def numbers(self, element: str, names: list[str], kind: str = "f4", halves: bool = True) -> np.ndarray:
        """(N, len(names)) of a kind of TYPES. halves: unsigned integers of 16 bits are the bits of half floats."""
        columns = [self.columns[element][name] for name in names]
        out = np.empty((len(columns[0]), len(names)), kind)
        for start in range(0, len(out), _BLOCK):
            rows = slice(start, start + _BLOCK)
            for k, column in enumerate(columns):
                values = column[rows]
                if halves and values.dtype.kind == "u" and values.dtype.itemsize == 2:
                    values = values.astype(np.uint16).view(np.float16)
                out[rows, k] = values
        return out


def is_ply(head: bytes) -> bool:
    """Whether a file with these first bytes is a PLY file, plain or in gzip."""
    if head[:3] == b"\x1f\x8b\x08":
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, 16)
        except zlib.error:
            return False
    return re.match(rb"ply[ \t]*[\r\n]", head) is not None


def _parse(path: Path, head: bytes) -> Header:
    start = re.match(rb"ply[ \t]*(\r\n|\n|\r)", head)
    if start is None:
        raise FlickerError(f"{path}: not a PLY file")
    newline = b"\r" if start[1] == b"\r" else b"\n"
    layout, elements, comments = "", [], []
    place, number = start.end(), 1
    while True:
        end = head.find(newline, place)
        if end < 0:
            raise FlickerError(f"{path}: header without end_header")
        text, place, number = head[place:end], end + 1, number + 1
        try:
            words = text.decode("ascii", "replace").split()
            if not words:
                continue
            if words[0] in ("comment", "obj_info"):
                comments.append(text.decode("utf-8", "replace").strip()[len(words[0]) :].strip())
                continue
            if not text.decode("ascii").strip().isprintable():
                raise ValueError
            if words == ["end_header"]:
                break
            if words[0] == "format":
                layout = words[1]
            elif words[0] == "element":
                elements.append(Element(words[1], int(words[2])))
            elif words[0] == "property":
                elements[-1].properties.append(_property(path, number, words))
            else:
                raise ValueError
        except (IndexError, ValueError):
            raise FlickerError(f"{path}: line {number} of the header is not PLY") from None
    if layout not in LAYOUTS:
        raise FlickerError(f"{path}: format '{layout}', not {', '.join(LAYOUTS)}")
    names = [e.name for e in elements]
    for element in elements:
        if element.count < 0:
            raise FlickerError(f"{path}: element '{element.name}': count {element.count}")
        if names.count(element.name) > 1:
            raise FlickerError(f"{path}: element '{element.name}' is there twice")
    return Header(layout, elements, comments, place, newline)


def _property(path: Path, number: int, words: list[str]) -> Property:
    is_list = words[1] == "list"
    if len(words) != (5 if is_list else 3):
        raise ValueError
    for kind in words[2:4] if is_list else words[1:2]:
        if kind not in TYPES:
            raise FlickerError(f"{path}: line {number} of the header: type '{kind}' is not known; known are {', '.join(TYPES)}")
    if not is_list:
        return Property(words[2], words[1], TYPES[words[1]])
    if TYPES[words[2]][0] == "f":
        raise FlickerError(f"{path}: line {number} of the header: the length of a list is {words[2]}")
    return Property(words[4], " ".join(words[1:4]), TYPES[words[3]], TYPES[words[2]])


def open_ply(path: Path) -> Ply:
    """Parse the header. FlickerError naming file and line; OSError."""
    with path.open("rb") as file:
        head = file.read(_MOST)
    if head[:2] == b"\x1f\x8b":
        try:
            with gzip.open(path) as stream:
                head = stream.read(_MOST)
                header = _parse(path, head)
                body = np.frombuffer(head[header.size :] + stream.read(), np.uint8)
        except EOFError:
            raise FlickerError(f"{path}: truncated: the gzip stream ends early") from None
        except (zlib.error, gzip.BadGzipFile) as error:
            raise FlickerError(f"{path}: damaged gzip ({one_line(error)})") from None
    else:
        header = _parse(path, head)
        size = path.stat().st_size
        body = np.memmap(path, np.uint8, "r", header.size) if size > header.size else np.zeros(0, np.uint8)
    return Ply(path, header, body)


# ---- binary --------------------------------------------------------------------------------------------------------------------------


def _binary(path: Path, header: Header, body: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    order = LAYOUTS[header.layout]
    offset, out = 0, {}
    for element in header.elements:
        truncated = f"{path}: truncated: element '{element.name}' ends at byte {{}}, the file has {header.size + len(body)}"
        if element.lists:
            offset, out[element.name] = _with_lists(path, element, body, offset, order, truncated)
            continue
        record = np.dtype([(str(k), order + p.kind) for k, p in enumerate(element.properties)])
        end = offset + element.count * record.itemsize
        if end > len(body):
            raise FlickerError(truncated.format(header.size + end))
        records = np.ndarray(element.count if record.itemsize else 0, record, body, offset) if end > offset else np.empty(0, record)
        out[element.name] = {p.name: records[str(k)] for k, p in reversed(list(enumerate(element.properties)))}
        offset = end
    if offset < len(body):
        raise FlickerError(f"{path}: {len(body) - offset} bytes after the last element of the header")
    return out


def _with_lists(
    path: Path, element: Element, body: np.ndarray, offset: int, order: str, truncated: str,
) -> tuple[int, dict[str, np.ndarray]]:
    """End of an element with lists, and its columns. Runs of values between lists are found by walking from record to record."""
    runs: list[list[Property]] = [[]]
    lists = []
    for p in element.properties:
        if p.length:
            lists.append(p)
            runs.append([])
        else:
            runs[-1].append(p)
    kinds = [np.dtype([(str(k), order + p.kind) for k, p in enumerate(run)]) for run in runs]
    sizes = [kind.itemsize for kind in kinds]
    least = sum(sizes) + sum(np.dtype(p.length).itemsize for p in lists)
    if offset + element.count * least > len(body):
        raise FlickerError(truncated.format(f"{offset + element.count * least} or later"))
    lengths = [(np.dtype(p.length).itemsize, p.length[0] == "i", np.dtype(p.kind).itemsize) for p in lists]
    data = body.data
    starts = np.empty((len(runs), element.count), np.int64)
    place = offset
    for n in range(element.count):
        for k, size in enumerate(sizes):
            starts[k, n] = place
            place += size
            if k < len(lengths):
                width, signed, item = lengths[k]
                length = int.from_bytes(data[place : place + width], "little" if order == "<" else "big", signed=signed)
                if length < 0:
                    raise FlickerError(f"{path}: element '{element.name}': property '{lists[k].name}': a list of {length} items")
                place += width + length * item
        if place > len(body):
            raise FlickerError(truncated.format(f"{place} or later"))
    columns: dict[str, np.ndarray] = {}
    for run, kind, start in zip(runs, kinds, starts):
        if run:
            rows = np.ascontiguousarray(body[start[:, None] + np.arange(kind.itemsize)]).view(kind)[:, 0]
            columns |= {p.name: rows[str(k)] for k, p in enumerate(run)}
    return place, columns


# ---- text ----------------------------------------------------------------------------------------------------------------------------


def _text(path: Path, header: Header, body: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    """A record a line; empty lines are passed over."""
    ends = np.append(np.flatnonzero(body == header.newline[0]), len(body))
    begins = np.append(0, ends[:-1] + 1)
    full = ends > begins
    full[full] &= (ends - begins > 1)[full] | (body[begins[full]] != 13)
    begins, ends = begins[full], ends[full]
    line, out = 0, {}
    for element in header.elements:
        if line + element.count > len(begins):
            raise FlickerError(f"{path}: truncated: element '{element.name}' has {element.count} lines, the file has {len(begins) - line}")
        if element.count:
            text = body[begins[line] : ends[line + element.count - 1]].tobytes()
            out[element.name] = _text_columns(path, element, text, header.newline)
        else:
            out[element.name] = {p.name: np.empty(0, p.kind) for p in element.properties if not p.length}
        line += element.count
    if line < len(begins) and body[begins[line] :].tobytes().strip():
        raise FlickerError(f"{path}: {len(begins) - line} lines after the last element of the header")
    return out


def _text_columns(path: Path, element: Element, text: bytes, newline: bytes) -> dict[str, np.ndarray]:
    where = f"{path}: element '{element.name}'"
    plain = [p for p in element.properties if not p.length]
    if element.lists:  # a record is a line here
        text = b" ".join(b" ".join(_without_lists(where, element, line.split())) for line in text.split(newline) if line.strip())
    if not plain:
        return {}
    if b"#" in text:  # as one compiler's library writes what is not finite
        text = re.sub(rb"1\.#INF\d*", b"inf", re.sub(rb"1\.#(IND|QNAN|SNAN)\d*", b"nan", text))
    try:
        values = np.fromstring(text, np.float64, sep=" ")
    except ValueError:
        raise FlickerError(f"{where}: not a number among its values") from None
    if len(values) != element.count * len(plain):
        raise FlickerError(f"{where}: {len(values)} values, not {element.count} records of {len(plain)}")
    table = values.reshape(element.count, -1)
    columns = {}
    for k, p in reversed(list(enumerate(plain))):
        column = table[:, k]
        if p.kind[0] != "f":
            limits = np.iinfo(p.kind)
            if not ((column >= limits.min) & (column <= limits.max)).all():
                raise FlickerError(f"{where}: property '{p.name}': a value that is no {p.type}")
            column = column.astype(p.kind)
        columns[p.name] = column
    return columns


def _without_lists(where: str, element: Element, words: list[bytes]) -> list[bytes]:
    """The words of a record that belong to no list."""
    kept, place = [], 0
    try:
        for p in element.properties:
            if p.length:
                length = int(words[place])
                if length < 0:
                    raise ValueError
                place += 1 + length
            else:
                kept.append(words[place])
                place += 1
    except (IndexError, ValueError):
        raise FlickerError(f"{where}: a record that does not fit its lists") from None
    return kept
