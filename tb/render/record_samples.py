"""Records and sub-tiles for flk_record_to_splat: everything from all over its range, and beside what is rounded, clipped or saturated."""

from __future__ import annotations

import random
from collections.abc import Iterator

from flicker.golden.front.record import MEAN_FIELD, RecordKind, encode_mean
from flicker.params import SUBTILE_COORD_BITS

Item = tuple[int, int, int]  # eos, record, sub-tile: row above column
LAST = (1 << SUBTILE_COORD_BITS) - 1
STEP = 1024  # 1/128 pixel a sub-tile
LIMIT = 65504 * 128  # the largest FP16 number; from LIMIT + 16 * 128 on it would round to infinity


def places(rng: random.Random) -> Iterator[int]:
    """Columns or rows: of the first sub-tiles, of pictures of 4096 pixels, of all that the coordinate holds."""
    while True:
        yield rng.choice((0, 1, rng.randrange(512), 511, rng.randrange(LAST + 1), LAST))


def distances(rng: random.Random) -> Iterator[int]:
    """Means relative to a sub-tile in 1/128 pixel: every length, halfway between two FP16 numbers and beside it, about the limit."""
    while True:
        bits = rng.randrange(12, 24)
        half = 1 << bits - 12  # of the last place of an FP16 number of so many bits
        sign = rng.choice((1, -1))
        yield sign * (((rng.getrandbits(10) | 1 << 10) * 2 + 1) * half + rng.choice((-half, -1, 0, 0, 1)))
        yield sign * (LIMIT + rng.choice((-1, 0, 1, 2047, 2048, 2049, rng.randrange(1 << 20))))
        yield sign * rng.getrandbits(rng.randrange(1, 32))
        yield sign * rng.choice((0, 1, 1 << 24, (1 << 24) - 1, (1 << 24) + 1, 1 << rng.randrange(25)))


def mean_field(rng: random.Random, kind: RecordKind, place: int, distance: int) -> int:
    """The field of a mean at this distance from a sub-tile; sometimes any bits."""
    conic = kind is RecordKind.CONIC32
    bits = 32 if conic else MEAN_FIELD + 3
    if rng.random() < 0.1:
        return rng.choice((rng.getrandbits(bits), 0, (1 << bits) - 1, 1 << bits - 1, (1 << bits - 1) - 1, 1 << MEAN_FIELD - 1))
    absolute = distance + place * STEP
    if conic:
        return max(min(absolute, (1 << 31) - 1), -(1 << 31)) & (1 << 32) - 1
    return encode_mean(max(min(absolute, (1 << 32) - 1), -(1 << 32)))


def records(rng: random.Random, kind: RecordKind, count: int) -> list[Item]:
    """Items without ends of lists. All codes of shape (in turn), opacity and colour come up where there are enough of them."""
    place, distance = places(rng), distances(rng)
    found = []
    code = rng.getrandbits(14)
    for i in range(count):
        subtile = [next(place), next(place)]
        x, y = (mean_field(rng, kind, p, next(distance)) for p in subtile)
        if kind is RecordKind.CONIC32:
            record = x | y << 32 | rng.getrandbits(192) << 64
        else:
            record = x | y << 23
            for low in (46, 60, 75):
                record |= code % (1 << 14) << low
                code += 1
            record |= rng.getrandbits(1) << 74 | i % 256 << 89 | rng.getrandbits(1) << 127
            for k in range(3):
                record |= (i + 341 * k) % 1024 << 97 + 10 * k
        found.append((0, record, subtile[0] | subtile[1] << SUBTILE_COORD_BITS))
    return found


def lists(rng: random.Random, kind: RecordKind, count: int) -> list[Item]:
    """Items with ends of lists between them, whose records are any bits."""
    return [
        (1, rng.getrandbits(8 * kind.bytes), rng.getrandbits(2 * SUBTILE_COORD_BITS)) if rng.random() < 0.1 else item for item in records(rng, kind, count)
    ]
