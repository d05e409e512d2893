"""Result of a lane's pixel against golden.lanes: every S that a pixel may have, every value of each colour."""

from __future__ import annotations

import ctypes
import re
from functools import cache
from pathlib import Path

import numba
import numpy as np
import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import seed

from flicker.golden.lanes.formats import FORMATS, tables
from flicker.golden.lanes.lane import colour_bits, transmittance_bits
from flicker.toolchain import ROOT, sources_of, verilate

T = tables(FORMATS)
RESULT_BITS, PLACES, C_BITS = 17, 3, 16  # of S as it comes; places of S below them; of a colour
ONE = 0x3C00


@cache
def library(registered: int) -> ctypes.CDLL:
    path = verilate(
        "flk_lane_result", parameters={"Registered": registered}, cpp=[Path(__file__).with_name("lane_result_harness.cpp")], args=["--output-split", "0"],
        cflags=f"-DFLK_REGISTERED={registered}", shared=True, name="lane_result",
    )
    return ctypes.CDLL(str(path))


def convert(s: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """uint16 (n, 4): blue, green, red, transmittance of s (n,) and colours (n, 3), red first; the same with and without a register."""
    s = np.ascontiguousarray(s, np.uint32)
    red, green, blue = colour.astype(np.uint64).T
    packed = np.ascontiguousarray(red << np.uint64(2 * C_BITS) | green << np.uint64(C_BITS) | blue)
    pixels = np.zeros((2, len(s)), np.uint64)
    for registered, pixel in enumerate(pixels):
        library(registered).run(ctypes.c_int64(len(s)), *(ctypes.c_void_p(a.ctypes.data) for a in (s, packed, pixel)))
    same(pixels[1], pixels[0], s)
    return pixels[0].view(np.uint16).reshape(-1, 4)


@numba.njit(cache=True)
def golden_transmittance(total, t, out):
    for i in range(len(total)):
        out[i] = transmittance_bits(total[i], t)


@numba.njit(cache=True)
def golden_colours(t, out):
    for c in range(len(out)):
        out[c] = colour_bits(c, t)


def same(got: np.ndarray, want: np.ndarray, inputs: np.ndarray) -> None:
    bad = np.flatnonzero(got != want)
    assert not len(bad), f"{len(bad)} of {len(got)} differ, first at input {inputs[bad[0]]}: {got[bad[0]]:#06x} instead of {want[bad[0]]:#06x}"


def test_every_transmittance() -> None:
    """All S with all their places, up to T = 1e-4; colours are noise."""
    total = np.arange(T.s_max + 1)
    want = np.zeros(len(total), np.uint16)
    golden_transmittance(total, T, want)
    s = np.arange((T.s_max >> PLACES) + 1)
    assert s[-1] < 1 << RESULT_BITS
    pixels = convert(s, np.random.default_rng(seed()).integers(0, 1 << C_BITS, (len(s), 3)))
    same(pixels[total >> PLACES, 3], want, total)
    assert want[0] == ONE and want[-1] == np.float16(1e-4).view(np.uint16)
    assert (np.diff(want.astype(int)) <= 0).all()


def test_every_colour() -> None:
    """All values of each colour, in another order each; S is noise."""
    n = 1 << C_BITS
    want = np.zeros(n, np.uint16)
    golden_colours(T, want)
    assert np.array_equal(want, (np.arange(n) / 2.0**FORMATS.accumulator).astype(np.float16).view(np.uint16))
    rng = np.random.default_rng([seed(), 1])
    colour = np.stack([rng.permutation(n) for _ in range(3)], axis=1)
    pixels = convert(rng.integers(0, (T.s_max >> PLACES) + 1, n), colour)
    for k in range(3):
        same(pixels[:, 2 - k], want[colour[:, k]], colour[:, k])


@pytest.mark.parametrize(("name", "value"), [("C_BITS", 11), ("ACCUMULATOR", 15)])
def test_illegal_formats(name: str, value: int, tmp_path: Path) -> None:
    """Of the package, which no parameter changes."""
    sources = sources_of("flk_lane_result")
    package = ROOT / "rtl" / "generated" / "flk_lane_pkg.sv"
    text, count = re.subn(rf"(\b{name} = )\d+;", rf"\g<1>{value};", package.read_text())
    assert count == 1
    other = tmp_path / package.name
    other.write_text(text)
    refused("flk_lane_result", {}, "colours must have 12 bits or more", sources=[other if path == package else path for path in sources])
