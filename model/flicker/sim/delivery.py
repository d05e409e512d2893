"""flk_delivery alone, verilated: cycles for the lists of a frame, units always with an entry, cores with a record a cycle (docs/reference/delivery.md)."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import FlickerError
from ..toolchain import verilate
from .half import HERE
from .memory import HEADERS, PortConfig, Timing

SUBTILES = 4  # of a tile
PORT = PortConfig(data_bits=256, max_reads=256, max_beats=1, latency=20)


class _Lists(ctypes.Structure):
    _fields_ = [
        ("tiles", ctypes.c_int64), ("limit", ctypes.c_int64), ("start", ctypes.c_void_p), ("entry", ctypes.c_void_p), ("finished", ctypes.c_void_p),
        ("borders", ctypes.c_void_p), ("records", ctypes.c_int64),
    ]


class _Result(ctypes.Structure):
    _fields_ = [("cycles", ctypes.c_int64), ("lines", ctypes.c_int64), ("given", ctypes.c_int64 * SUBTILES)]


@dataclass(frozen=True)
class Delivered:
    """cycles: from the start to the last end at the last core. lines: of 32 bytes, read. given: records that came for each sub-tile of a tile."""

    cycles: int
    lines: int
    given: tuple[int, ...]


def deliver(
    start: np.ndarray, record: np.ndarray, mask: np.ndarray, finished: np.ndarray | None = None, *, borders: np.ndarray | None = None,
    timing: Timing | None = None, parameters: Mapping[str, int] | None = None, seed: int = 1,
) -> Delivered:
    """Deliver sorted lists; each record is compared with the one that is due.

    start: int (T + 1,), of each tile of the walk. record, mask: int (E,). finished: int (T, 4), records after which a sub-tile is finished; -1, or
    None for all: never. borders: int (T, 2), of `golden.walk.borders`; None: no tile touches the next. timing: of the DRAM, 20 cycles on top; None: a
    perfect memory of that latency. FlickerError for a wrong record, an assertion of the design or a broken rule of AXI.
    """
    library = ctypes.CDLL(str(verilate(
        "flk_delivery", parameters=parameters or {}, args=["--assert", "--x-assign", "unique", "--x-initial", "unique"],
        cpp=[HERE / "delivery_harness.cpp"], depends=HEADERS,
        cflags=f"-I{HERE} -DFLK_CORES={(parameters or {}).get('Cores', SUBTILES)}", opt="-O3", shared=True, kind="sim",
    )))
    library.delivery_error.restype = ctypes.c_char_p
    tiles = len(start) - 1
    begin = np.ascontiguousarray(start, np.int64)
    entry = np.ascontiguousarray(np.asarray(record, np.uint32) << np.uint32(SUBTILES) | np.asarray(mask, np.uint32))
    until = np.ascontiguousarray(np.full((tiles, SUBTILES), -1) if finished is None else finished, np.int32)
    if until.shape != (tiles, SUBTILES):
        raise ValueError(f"finished: {until.shape}, not {(tiles, SUBTILES)}")
    touching = np.ascontiguousarray(np.zeros((tiles, 2)) if borders is None else borders, np.uint8)
    if touching.shape != (tiles, 2):
        raise ValueError(f"borders: {touching.shape}, not {(tiles, 2)}")
    lists = _Lists(
        tiles, 100 * (len(entry) + tiles) + 10_000, begin.ctypes.data, entry.ctypes.data, until.ctypes.data, touching.ctypes.data,
        int(np.max(record, initial=0)) + 1,
    )
    result = _Result()
    done = library.delivery_run(
        ctypes.byref(timing or Timing(*[1] * len(Timing._fields_))), timing is None, ctypes.byref(PORT.structure()), ctypes.byref(lists),
        ctypes.c_uint64(seed), ctypes.byref(result),
    )
    if done != 1:
        raise FlickerError(f"delivery: {library.delivery_error().decode() or f'no end within {lists.limit} cycles'}")
    return Delivered(result.cycles, result.lines, tuple(result.given))
