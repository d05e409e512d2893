"""Writes a first GTKWave view of a trace: the signals of the top module, structs by field.

Reads the header of a VCD file, or the hierarchy block of an FST file as Verilator writes it: a file
is a sequence of blocks (type, big-endian length, contents), the hierarchy is LZ4 compressed behind
its size.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path

from imagecodecs import lz4_decode

from flicker.errors import FlickerError

MARK = "[*] Signals of the top module; replaced by larger ones until saved by GTKWave"

_HIERARCHY_LZ4 = 6  # block type
_ATTRIBUTE, _ATTRIBUTE_END, _SCOPE, _UPSCOPE = 252, 253, 254, 255
_MODULE_SCOPE, _GENERATE_SCOPE, _OTHER_SCOPE = 0, 6, -1


def _hierarchy(path: Path) -> bytes:
    """Decompressed hierarchy block of an FST file."""
    contents, at = path.read_bytes(), 0
    while at + 9 <= len(contents):
        kind, length = struct.unpack_from(">BQ", contents, at)
        if kind == _HIERARCHY_LZ4:
            (size,) = struct.unpack_from(">Q", contents, at + 9)
            return bytes(lz4_decode(contents[at + 17 : at + 1 + length], out=size))
        at += 1 + length
    raise FlickerError(f"{path}: no signal hierarchy (trace incomplete?)")


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(0, at)
    return data[at:end].decode(), end + 1


def _varint(data: bytes, at: int) -> int:
    """Position behind a variable-length number."""
    while data[at] & 0x80:
        at += 1
    return at + 1


def signals(path: Path, top: str) -> Iterator[str]:
    """Full names of the signals declared in the module ``top`` of a trace, structs by field.

    Parameters and constants, which begin with a capital, are left out.
    """
    for scopes, name in _vcd_signals(path) if path.suffix == ".vcd" else _fst_signals(path):
        within = [kind for _, kind in scopes[1:]]
        if scopes[:1] == [(top, _MODULE_SCOPE)] and not (
            {_MODULE_SCOPE, _GENERATE_SCOPE} & set(within) or name[0].isupper()
        ):
            yield ".".join([*(scope for scope, _ in scopes), name.replace(" ", "")])


def _fst_signals(path: Path) -> Iterator[tuple[list[tuple[str, int]], str]]:
    """Scopes as (name, kind), outermost first, and name of every signal of an FST file."""
    data, at = _hierarchy(path), 0
    scopes: list[tuple[str, int]] = []
    while at < len(data):
        tag = data[at]
        if tag == _SCOPE:
            kind = data[at + 1]
            name, at = _text(data, at + 2)
            _, at = _text(data, at)
            scopes.append((name, kind))
        elif tag == _UPSCOPE:
            scopes.pop()
            at += 1
        elif tag == _ATTRIBUTE:
            _, at = _text(data, at + 3)
            at = _varint(data, at)
        elif tag == _ATTRIBUTE_END:
            at += 1
        else:
            name, at = _text(data, at + 2)
            at = _varint(data, _varint(data, at))
            yield scopes, name


def _vcd_signals(path: Path) -> Iterator[tuple[list[tuple[str, int]], str]]:
    """As ``_fst_signals``, of a VCD file; there a struct is a scope like a module, so names tell them apart: instances begin with
    ``i_``, generate blocks with ``gen_``."""
    scopes: list[tuple[str, int]] = []
    with path.open() as lines:
        for line in lines:
            words = line.split()
            match words[:1]:
                case ["$scope"]:
                    inner = not scopes or words[2].startswith(("i_", "gen_"))
                    scopes.append((words[2], _MODULE_SCOPE if inner else _OTHER_SCOPE))
                case ["$upscope"]:
                    scopes.pop()
                case ["$var"]:
                    yield scopes, "".join(words[4:-1])
                case ["$enddefinitions"]:
                    return
    raise FlickerError(f"{path}: no signal hierarchy (trace incomplete?)")


def save(trace: Path, top: str, view: Path) -> None:
    """Write the view of ``top``'s signals to ``view``.

    A view that GTKWave has saved is left alone, one of ours is replaced if the trace has more
    signals (the same module with larger parameters).
    """
    lines = [MARK, "[timestart] 0", *signals(trace, top)]
    old = view.read_text().splitlines() if view.exists() else [MARK]
    if old[:1] == [MARK] and len(lines) > len(old):
        view.parent.mkdir(parents=True, exist_ok=True)
        view.write_text("\n".join(lines) + "\n")


def fit(view: Path, trace: Path, top: str, fitted: Path) -> None:
    """Write ``view`` for one trace: signals by name, whatever range the parameters give them and whatever the trace's format."""
    names = {_key(name): name for name in signals(trace, top)}
    lines = view.read_text().splitlines()
    fitted.write_text("\n".join(names.get(_key(line), line) for line in lines) + "\n")


def _key(name: str) -> str:
    """A name without its range; an array is a scope of its own in FST (``a.a[0]``), not in VCD (``a[0]``)."""
    return re.sub(r"\b(\w+)\.\1(?=\[)", r"\1", re.sub(r"\[\d+:\d+\]$", "", name))
