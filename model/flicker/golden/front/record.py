"""Records, bit for bit: 16 bytes with the factored shape, 32 bytes with the conic one (docs/reference/front_end.md has the tables), and the splats that the
stage makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numba
import numpy as np

from ...arithmetic.ff import ff_round
from ...params import SUBTILE, Form
from .colour import COLOUR_FRACTION
from .setup import MEAN_FRACTION

MEAN_FIELD = 20
MEAN_EXPONENTS = 8
SHAPE_MANTISSA = 9
SHAPE_BIAS = 30


class RecordKind(str, Enum):
    """Layout of a record in memory."""

    FACTORED16 = "factored-16"
    CONIC32 = "conic-32"

    @staticmethod
    def of(form: Form) -> RecordKind:
        return RecordKind.FACTORED16 if form is Form.FACTORED else RecordKind.CONIC32

    @property
    def form(self) -> Form:
        return Form.FACTORED if self is RecordKind.FACTORED16 else Form.CONIC

    @property
    def bytes(self) -> int:
        return 16 if self is RecordKind.FACTORED16 else 32


@numba.njit
def encode_mean(x):
    """Field of 23 bits of a mean in 1/128 pixel, of at most 33 bits: 20 bits in two's complement, times 4^e, the smallest of e = 0 to 7 that holds it."""
    for e in range(MEAN_EXPONENTS):
        m = (x + ((1 << (2 * e)) >> 1)) >> (2 * e)
        if -(1 << (MEAN_FIELD - 1)) <= m < 1 << (MEAN_FIELD - 1):
            break
    return (e << MEAN_FIELD) | (m & ((1 << MEAN_FIELD) - 1))


@numba.njit
def decode_mean(field):
    """1/128 pixel."""
    m = field & ((1 << MEAN_FIELD) - 1)
    m -= (m >> (MEAN_FIELD - 1)) << MEAN_FIELD
    return m << (2 * (field >> MEAN_FIELD))


@numba.njit
def encode_shape(v, bits=SHAPE_MANTISSA):
    """14 bits of a positive ff number: exponent (bias 30) and 9 `bits` of mantissa; too small: 0, too large: the largest."""
    r = ff_round(v, bits)
    if r <= 0.0:
        return 0
    mantissa, exponent = math.frexp(r)
    code = ((exponent - 1 + SHAPE_BIAS) << bits) + np.int64((2.0 * mantissa - 1.0) * (1 << bits))
    return 0 if code < 1 << bits else min(code, (1 << (bits + 5)) - 1)


def decode_shape(code: np.ndarray, bits: int = SHAPE_MANTISSA) -> np.ndarray:
    """float64 of the 14 bits."""
    exponent, mantissa = code >> bits, code & ((1 << bits) - 1)
    return np.where(exponent > 0, np.ldexp(1.0 + mantissa / (1 << bits), exponent.astype(np.int32) - SHAPE_BIAS), 0.0)


@dataclass(frozen=True, eq=False)
class Splats:
    """What records mean, N of them. mean: int64 (N, 2) in 1/128 pixel. shape: float64 (N, 3): l0, l1, l2, or a / 2, b, c / 2. opacity: float64 (N,).
    rgb: float64 (N, 3).

    spiky: bool (N,).
    """

    mean: np.ndarray
    shape: np.ndarray
    opacity: np.ndarray
    rgb: np.ndarray
    spiky: np.ndarray


def _field(words: np.ndarray, low: int, bits: int) -> np.ndarray:
    """int64: `bits` bits from bit `low` on of rows of uint64 words."""
    word, shift = divmod(low, 64)
    value = words[:, word] >> np.uint64(shift)
    if shift + bits > 64:
        value = value | words[:, word + 1] << np.uint64(64 - shift)
    return (value & np.uint64((1 << bits) - 1)).astype(np.int64)


def decode_records(records: np.ndarray, kind: RecordKind) -> Splats:
    """Splats of records, uint8 (N, bytes of the kind)."""
    if kind is RecordKind.CONIC32:
        mean = np.ascontiguousarray(records[:, :8]).view("<i4").astype(np.int64)
        words = np.ascontiguousarray(records[:, 8:24]).view("<u2")
        numbers = words[:, :7].view(np.float16).astype(np.float64)
        return Splats(mean, numbers[:, :3], numbers[:, 3], numbers[:, 4:], (words[:, 7] & 1).astype(bool))
    words = np.ascontiguousarray(records).view("<u8")
    mean = np.stack([_decode_means(_field(words, low, 23)) for low in (0, 23)], axis=1)
    shape = np.stack([decode_shape(_field(words, low, 14)) for low in (46, 60, 75)], axis=1)
    shape[:, 1] *= np.where(_field(words, 74, 1) == 1, -1.0, 1.0)
    rgb = np.stack([_field(words, 97 + 10 * k, 10) for k in range(3)], axis=1) / (1 << COLOUR_FRACTION)
    return Splats(mean, shape, _field(words, 89, 8) / 255.0, rgb, _field(words, 127, 1) == 1)


@numba.njit(cache=True)
def _decode_means(fields):
    out = np.empty(len(fields), np.int64)
    for i in range(len(fields)):
        out[i] = decode_mean(fields[i])
    return out


def to_fp16(numbers: np.ndarray) -> np.ndarray:
    """float16: nearest, ties to even, at most 65504."""
    return np.clip(numbers, -65504.0, 65504.0).astype(np.float16)


def fp16_features(splats: Splats) -> np.ndarray:
    """uint16 (N, 9) in the order of `feature_t` (blue first among the colours), means left 0: `flk_record_to_splat` but for the means."""
    gauss = np.zeros((len(splats.opacity), 9), np.uint16)
    with np.errstate(over="ignore"):
        gauss[:, 2:5] = splats.shape.astype(np.float16).view(np.uint16)
        gauss[:, 5] = splats.opacity.astype(np.float16).view(np.uint16)
        gauss[:, 6:9] = np.ascontiguousarray(splats.rgb[:, ::-1]).astype(np.float16).view(np.uint16)
    return gauss


def fp16_means(splats: Splats, start: np.ndarray, entry: np.ndarray, cols: int) -> np.ndarray:
    """uint16 (E, 2): means relative to the sub-tile of each entry, FP16."""
    subtile = np.repeat(np.arange(len(start) - 1), np.diff(start))
    origin = np.stack([subtile % cols, subtile // cols], axis=1) * (SUBTILE << MEAN_FRACTION)
    with np.errstate(over="ignore"):
        local = ((splats.mean[entry] - origin) / (1 << MEAN_FRACTION)).astype(np.float16)
    top = np.float16(65504.0)
    return np.ascontiguousarray(np.clip(local, -top, top)).view(np.uint16)
