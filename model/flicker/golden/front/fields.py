"""Records of 16 bytes with fields of other widths than theirs, for measurements: what they would mean, rounded from the same numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from ...arithmetic.ff import ff_round
from ...errors import FlickerError
from .colour import COLOUR_FRACTION
from .frame import OPACITY_LIMIT, FrontFrame, scaled_opacity
from .record import SHAPE_MANTISSA, RecordKind, Splats, decode_shape, encode_shape


@dataclass(frozen=True)
class Fields:
    """shape: mantissa bits of l0, l1, l2. colour: fraction bits; there is one bit above. opacity: bits; None: as it is in the image, not rounded."""

    shape: int = SHAPE_MANTISSA
    colour: int = COLOUR_FRACTION
    opacity: int | None = OPACITY_LIMIT.bit_length()


FIELDS = Fields()


@numba.njit(cache=True)
def _shapes(numbers, bits):
    out = np.empty(numbers.shape, np.int64)
    for i in range(numbers.shape[0]):
        for k in range(3):
            out[i, k] = encode_shape(abs(numbers[i, k]), bits)
    return out


@numba.njit(cache=True)
def _opacities(opacity, limit, M):
    out = np.empty(len(opacity))
    for i in range(len(opacity)):
        out[i] = scaled_opacity(1.0 * limit, ff_round(opacity[i], M), M, limit) / limit
    return out


def splats_of(frame: FrontFrame, fields: Fields = FIELDS) -> Splats:
    """What the records of a frame would mean with these fields; with the default ones `frame.splats()`.

    Its lists are those of opacities of 8 bits: with others, take them of `ListKind.BOX`, which no opacity changes.
    """
    if frame.kind is not RecordKind.FACTORED16 or frame.unrounded is None:
        raise FlickerError("fields: of the golden model's records of 16 bytes only")
    shape, opacity, rgb = frame.unrounded[:, :3], frame.unrounded[:, 3], frame.unrounded[:, 4:]
    if fields.opacity is not None:
        opacity = _opacities(opacity, (1 << fields.opacity) - 1, frame.formats.shape)
    colours = np.minimum(np.floor(np.ldexp(rgb, fields.colour) + 0.5), (2 << fields.colour) - 1)
    return replace(
        frame.splats(), shape=np.copysign(decode_shape(_shapes(shape, fields.shape), fields.shape), shape), opacity=opacity,
        rgb=np.ldexp(colours, -fields.colour),
    )
