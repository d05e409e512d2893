"""Tile lists in DRAM: what is written is read back, each chunk belongs to one list, no overflow goes unnoticed; entries by the exact test; the study of
layouts."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from chip_samples import camera, prepared_view
from flicker_tb.runner import seed

from flicker.chip.list_layout import Chain, ListLayout, Replace, evaluate_layout, key_entries, read_cycles, visits, write
from flicker.errors import FlickerError
from flicker.front.entries import tile_entries
from flicker.front.projection import project
from flicker.golden import lists as golden
from flicker.golden.lists import HELD_POINTERS, ListError, ListImage, pointer_lines, pointer_place, read_lists, write_lists
from flicker.params import ALPHA_MIN


class Entries:
    """Entries of `splats` splats: splat, tile and mask in the order of the scene, keys and records."""

    def __init__(self, splat, tile, mask, cols: int, rows: int, splats: int, rng: np.random.Generator):
        self.splat, self.tile, self.mask, self.cols, self.rows = splat, tile, mask, cols, rows
        self.key = rng.integers(0, 1 << 24, splats).astype(np.uint32)
        self.record = (16 * np.arange(splats) % (1 << 24)).astype(np.uint32)
        if splats:
            self.key[rng.integers(0, splats, 3)] = (1 << 24) - 1
            self.record[-1] = (1 << 24) - 1

    def close(self, rng: np.random.Generator, at_limits: float = 0.0) -> Entries:
        """With keys that rise and fall by little, so that lines are short; now and then by as much as fits, or by one more."""
        turn = rng.integers(-(1 << 13), 1 << 13, len(self.key))
        limits = rng.random(len(turn)) < at_limits
        turn[limits] = rng.choice([(1 << 16) - 1, 1 << 16, -(1 << 16), -(1 << 16) - 1], np.count_nonzero(limits))
        step = rng.choice([1, 3, 16], len(turn))
        step[rng.random(len(turn)) < at_limits] = rng.choice([511, 512])
        self.key = (np.cumsum(turn) % (1 << 24)).astype(np.uint32)
        self.record = (np.cumsum(step) % (1 << 24)).astype(np.uint32)
        return self

    def write(self, chunks: int | None = None, held: int = HELD_POINTERS) -> ListImage:
        return write_lists(self.splat, self.tile, self.mask, self.key, self.record, self.cols, self.rows, chunks, held)

    def of(self, tile: int) -> list[tuple[int, int, int]]:
        here = self.tile == tile
        return sorted(zip(self.key[self.splat[here]].tolist(), self.record[self.splat[here]].tolist(), self.mask[here].tolist()))


def boxes(rng: np.random.Generator, cols: int, rows: int, splats: int, side: int) -> Entries:
    """Boxes of up to side x side tiles, with holes."""
    parts = []
    for i in range(splats):
        x, y = rng.integers(0, cols), rng.integers(0, rows)
        w, h = rng.integers(1, side + 1, 2)
        ty, tx = np.meshgrid(np.arange(y, min(y + h, rows)), np.arange(x, min(x + w, cols)), indexing="ij")
        tile = (tx + cols * ty).ravel()
        tile = tile[rng.random(len(tile)) < 0.8]
        parts.append(np.stack([np.full(len(tile), i), tile]))
    splat, tile = np.concatenate(parts, axis=1) if parts else np.zeros((2, 0), np.int64)
    return Entries(splat, tile, rng.integers(1, 16, len(tile)).astype(np.uint8), cols, rows, splats, rng)


def cases() -> dict[str, Entries]:
    rng = np.random.default_rng(seed())
    one = np.zeros(1, np.int64)
    full = np.full(1, 15, np.uint8)
    whole = np.arange(256 * 256)
    many = np.arange(40000)
    turns = np.arange(6000) % 5  # five tiles of one set in turn: every entry of every line but the last is evicted
    return {
        "random": boxes(rng, 67, 34, 3000, 4),
        "narrow": boxes(rng, 1, 300 // 16, 500, 3),
        "flat": boxes(rng, 33, 1, 500, 9),
        "large boxes": boxes(rng, 80, 45, 60, 80),
        "nothing": boxes(rng, 5, 3, 0, 1),
        "no entries": Entries(one[:0], one[:0], full[:0], 3, 3, 4, rng),
        "one": Entries(one, one, full, 1, 1, 1, rng),
        "last tile": Entries(one, one + 65535, full, 256, 256, 1, rng),
        "all in one tile": Entries(many, np.full(40000, 7), np.full(40000, 9, np.uint8), 5, 5, 40000, rng),
        "one splat over 4096x4096": Entries(0 * whole, whole, np.full(len(whole), 15, np.uint8), 256, 256, 1, rng),
        "close": boxes(rng, 67, 34, 3000, 4).close(rng),
        "close, in one tile": Entries(many, np.full(40000, 7), np.full(40000, 9, np.uint8), 5, 5, 40000, rng).close(rng, 0.1),
        "close, few tiles": boxes(rng, 4, 5, 4000, 3).close(rng, 0.02),
        "tiles of one set in turn": Entries(np.arange(6000), 16 * turns, np.full(6000, 1, np.uint8), 80, 45, 6000, rng),
    }


CASES = cases()


@pytest.mark.parametrize("name", CASES)
def test_lists_read_back_are_those_written(name):
    given = CASES[name]
    image = given.write()
    assert image.error is ListError.NONE and not image.failed.any()
    assert image.entries.sum() == len(given.tile) and image.taken.max() == image.chunks
    found = read_lists(image.memory, image.pointers, given.cols, given.rows)
    assert found.start[-1] == len(given.tile)
    for tile in np.unique(np.r_[given.tile, 0, given.cols * given.rows - 1]) if len(given.tile) < 50000 else np.unique(given.tile)[::977]:
        part = slice(found.start[tile], found.start[tile + 1])
        assert sorted(zip(found.key[part].tolist(), found.record[part].tolist(), found.mask[part].tolist())) == given.of(tile)
    assert np.array_equal(np.diff(found.start), np.bincount(given.tile, minlength=given.cols * given.rows))


def headers(image: ListImage, line: int) -> tuple[int, int, int, int]:
    """count, link, whether there is one, rest of a line's header."""
    value = sum(int(x) << 64 * i for i, x in enumerate(image.memory[line])) >> 472
    return value & 15, value >> 4 & 0xFFFFFF, value >> 28 & 1, value >> 29


@pytest.mark.parametrize("name", ["random", "narrow", "all in one tile", "close", "tiles of one set in turn"])
def test_each_chunk_belongs_to_one_list(name):
    given = CASES[name]
    image = given.write()
    owner: dict[int, int] = {}
    for tile in range(given.cols * given.rows):
        x, y = tile % given.cols, tile // given.cols
        writer = (x & 1) + 2 * (y & 1)
        pointer = int(image.pointers[pointer_place(tile, given.cols)])
        chunk, used = pointer & 0xFFFFFF, pointer >> 24
        assert 0 <= used <= 8 and (used > 0) == (given.tile == tile).any()
        while used:
            assert chunk < image.taken[writer]
            assert owner.setdefault(4 * chunk + writer, tile) == tile
            found = [headers(image, (4 * chunk + writer) * 8 + k) for k in range(8)]
            assert all(1 <= f[0] <= 15 and f[3] == 0 for f in found[:used]) and {f[1:] for f in found[1:used]} <= {(0, 0, 0)}
            assert found[used:] == [(0, 0, 0, 0)] * (8 - used)
            assert not found[0][2] or found[0][1] < chunk  # chains go back in the order of allocation, so they end
            chunk, used = found[0][1], 8 if found[0][2] else 0
    assert len(owner) == image.taken.sum()
    # Pointers of tiles beyond the picture are zero; each line is written once, chunks are begun in order, writers keep to their own.
    assert np.count_nonzero(image.pointers) == len(np.unique(given.tile))
    for writer, lines in enumerate(image.writes):
        assert len(np.unique(lines)) == len(lines) == image.lines[writer] and (lines // 8 % 4 == writer).all()
        first = lines[lines % 8 == 0] // 32
        assert np.array_equal(first, np.arange(image.taken[writer]))


def near(older: int, newer: int) -> bool:
    """As docs/reference/list_layout.md says it."""
    return 0 <= (newer >> 4 & 0xFFFFFF) - (older >> 4 & 0xFFFFFF) <= 511 and -65536 <= (older >> 28) - (newer >> 28) <= 65535


def line_bits(words: list[int]) -> int:
    """Bits of a line and its number of entries, which lie in the order of coming."""
    bits = words[-1] | len(words) << 472
    if len(words) <= 9:
        return bits | sum(x << 52 * i for i, x in enumerate(words[:-1], 1))
    gaps = [52 * (i + 1) + b for i in range(8) for b in (*range(13, 28), *range(45, 52))] + list(range(468, 472))
    for i, x in enumerate(words[:-1]):
        kept = x & 0x1FFF | (x >> 28 & 0x1FFFF) << 13
        places = [52 * (i + 1) + b for b in (*range(13), *range(28, 45))]
        if i >= 8:
            places = gaps[22 * (i - 8) : 22 * (i - 7)] + gaps[132 + 8 * (i - 8) : 132 + 8 * (i - 7)]
        bits |= sum((kept >> k & 1) << place for k, place in enumerate(places))
    return bits


def plain_writer(given: Entries, chunks: int) -> tuple[dict[int, bytes], list[list[int]], dict[int, int]]:
    """The writers of docs/reference/list_layout.md said once more: lines by number, lines of each writer in order, pointers by place."""
    memory: dict[int, bytes] = {}
    writes: list[list[int]] = [[], [], [], []]
    pointers: dict[int, int] = {}
    for b in range(4):
        ways: list[list[tuple[int, list[int]] | None]] = [[None] * 4 for _ in range(64)]
        turn = [0] * 64
        chunk, used, link = {}, {}, {}
        taken = 0

        def put(s: int, w: int) -> None:
            nonlocal taken
            t, words = ways[s][w]
            ways[s][w] = None
            if used.get(t, 8) == 8:
                link[t] = chunk.get(t)
                chunk[t], used[t] = taken, 0
                taken += 1
            head = 0 if link[t] is None or used[t] else link[t] << 4 | 1 << 28
            line = (4 * chunk[t] + b) * 8 + used[t]
            assert line not in memory
            memory[line] = (line_bits(words) | head << 472).to_bytes(64, "little")
            writes[b].append(line)
            used[t] += 1

        for i, t, m in zip(given.splat.tolist(), given.tile.tolist(), given.mask.tolist()):
            x, y = t % given.cols, t // given.cols
            if (x % 2, y % 2) != (b % 2, b // 2):
                continue
            s = y // 2 % 8 * 8 + x // 2 % 8
            held = [None if h is None else h[0] for h in ways[s]]
            entry = int(m) | int(given.record[i]) << 4 | int(given.key[i]) << 28
            if t in held:
                w = held.index(t)
                if len(ways[s][w][1]) >= 9 and not near(ways[s][w][1][-1], entry):
                    put(s, w)
                    if turn[s] == w:
                        turn[s] = (w + 1) % 4
            elif None in held:
                w = held.index(None)
            else:
                w = turn[s]
                turn[s] = (w + 1) % 4
                put(s, w)
            if ways[s][w] is None:
                ways[s][w] = (t, [])
            words = ways[s][w][1]
            words.append(entry)
            if len(words) == 15 or len(words) == 9 and not all(map(near, words[:-1], words[1:])):
                put(s, w)
        for s in range(64):
            for w in range(4):
                if ways[s][w] is not None:
                    put(s, w)
        assert taken <= chunks
        for t in chunk:
            number = t // given.cols // 2 * -(-given.cols // 2) + t % given.cols // 2
            pointers[number // 16 * 64 + 16 * b + number % 16] = chunk[t] | used[t] << 24
    return memory, writes, pointers


@pytest.mark.parametrize("name", [
    "random", "flat", "large boxes", "tiles of one set in turn", "all in one tile", "close", "close, in one tile", "close, few tiles",
])
def test_memory_is_that_of_a_plain_writer(name):
    given = CASES[name]
    image = given.write()
    memory, writes, pointers = plain_writer(given, image.chunks)
    assert [x.tolist() for x in image.writes] == writes
    assert all(image.memory[line].tobytes() == text for line, text in memory.items()) and np.count_nonzero(image.memory.any(axis=1)) == len(memory)
    assert {int(p): int(image.pointers[p]) for p in np.flatnonzero(image.pointers)} == pointers
    assert name in ("flat", "all in one tile", "close, in one tile", "close, few tiles") or image.evicted.sum() > 50
    counts = Counter(int(image.memory[line, 7]) >> 24 & 15 for line in memory)
    assert max(counts) <= 9 if not name.startswith("close") else name == "close" or set(counts) >= set(range(9, 16))


def test_bits_of_a_line():
    rng = np.random.default_rng(seed())
    given = Entries(np.arange(10), np.zeros(10, np.int64), np.arange(1, 11).astype(np.uint8), 2, 2, 10, rng)
    image = given.write()
    words = [int(m) | int(r) << 4 | int(k) << 28 for m, r, k in zip(given.mask[:9], given.record, given.key)]
    want = sum(word << 52 * i for i, word in enumerate([words[-1], *words[:-1]])) | 9 << 472
    assert image.memory[0].tobytes() == want.to_bytes(64, "little")
    last = int(given.mask[9]) | int(given.record[9]) << 4 | int(given.key[9]) << 28 | 1 << 472
    assert image.memory[1].tobytes() == last.to_bytes(64, "little") and not image.memory[2:].any()
    assert image.pointers.tolist() == [2 << 24] + 63 * [0]
    for each, splats in ((15, np.zeros(121, np.int64)), (9, np.arange(73) % 2)):  # 8 lines of so many and one entry
        given = Entries(splats, np.full(len(splats), 3), np.full(len(splats), 1, np.uint8), 2, 2, 2, rng)
        given.key[:] = 0, 1 << 20
        image = given.write()
        assert image.pointers[48] == 1 << 24 | 1 and image.pointers.sum() == image.pointers[48]
        assert headers(image, 32 + 24) == (1, 0, 1, 0) and headers(image, 24) == (each, 0, 0, 0)


def test_lines_at_their_limits():
    """First and last numbers of entries; the largest differences that fit, the first that do not: nine entries then, and the line as it was."""
    rng = np.random.default_rng(seed())
    middle = 1 << 23
    for record, key, fits in ((0, 0, True), (511, 65536, True), (511, -65535, True), (512, 0, False), (0, 65537, False), (1, -65536, False), (-1, 0, False)):
        word = [int(rng.integers(1, 16)) | middle << 4 | middle << 28, int(rng.integers(1, 16)) | middle + record << 4 | middle + key << 28]
        assert golden.near(*np.array(word, np.uint64)) == near(*word) == fits
        for count in range(9, 16):
            entries = [word[0]] * (count - 1) + [word[1]]
            if count > 9 and not fits:
                with pytest.raises(FlickerError, match="not near each other"):
                    golden.line_of(entries)
                continue
            line = golden.line_of(entries)
            assert line == line_bits(entries) and golden.line_entries(line, count) == entries[::-1]
    ends = [1 | 0 << 4 | 0 << 28, 2 | 511 << 4 | 65536 << 28]  # both ends of the number range, where differences may not wrap
    assert golden.near(*np.array(ends, np.uint64)) and not golden.near(*np.array([(1 << 24) - 1 << 4, 0], np.uint64))
    assert not golden.near(*np.array([0, (1 << 24) - 1 << 28], np.uint64)) and not golden.near(*np.array([(1 << 24) - 1 << 28, 0], np.uint64))
    for entries in ([], [1] * 16, [1 << 52]):
        with pytest.raises(FlickerError, match="lists: a line of"):
            golden.line_of(entries)


def test_pointer_table_has_no_line_of_two_writers():
    for cols, rows in ((80, 45), (1, 1), (2, 3), (33, 7), (256, 256)):
        tile = np.arange(cols * rows)
        place = pointer_place(tile, cols)
        assert len(np.unique(place)) == len(tile) and place.max() < 16 * pointer_lines(cols, rows)
        assert np.array_equal(place // 16 % 4, tile % cols % 2 + 2 * (tile // cols % 2))


@pytest.mark.parametrize("name", ["random", "all in one tile", "one", "tiles of one set in turn"])
def test_out_of_list_memory_ends_the_frame(name):
    given = CASES[name]
    full = given.write()
    same = given.write(full.chunks)
    assert same.error is ListError.NONE and np.array_equal(same.memory, full.memory) and np.array_equal(same.pointers, full.pointers)
    for chunks in {full.chunks - 1, full.chunks // 2, 0}:
        image = given.write(chunks)
        assert image.error is ListError.OUT_OF_MEMORY and np.array_equal(image.failed, full.taken > chunks)
        assert np.array_equal(image.entries, full.entries) and image.memory.shape == (32 * chunks, 8)
        for writer in range(4):
            lines = image.writes[writer]
            assert np.array_equal(lines, full.writes[writer][: len(lines)]) and np.array_equal(image.memory[lines], full.memory[lines])
            pointers = image.pointers.reshape(-1, 4, 16)[:, writer]
            assert np.array_equal(pointers, 0 * pointers if image.failed[writer] else full.pointers.reshape(-1, 4, 16)[:, writer])
        untouched = np.ones(len(image.memory), bool)
        untouched[np.concatenate(image.writes)] = False
        assert not image.memory[untouched].any()


def store(given: Entries, image: ListImage, writer: int, held: int) -> tuple[list[tuple[int, int, int]], list[int]]:
    """The store of pointers in plain Python: what moves, by the lines of the lists in order; lines written at the end."""
    places: dict[int, int] = {}
    spilled: set[int] = set()
    moves = []
    owner = {line: t for t, lines in chains(given, image, writer).items() for line in lines}
    for n, line in enumerate(image.writes[writer].tolist()):
        mine = owner[line] // 16
        old = places.get(mine % held)
        if old != mine:
            spilled |= {old} if old is not None else set()
            if old is not None or mine in spilled:
                moves.append((n, -1 if old is None else old, mine if mine in spilled else -1))
            places[mine % held] = mine
    return moves, [k for k in range(pointer_lines(given.cols, given.rows) // 4) if k not in spilled or places.get(k % held) == k]


def chains(given: Entries, image: ListImage, writer: int) -> dict[int, list[int]]:
    """Lines of memory of each list of a writer, by its number."""
    out: dict[int, list[int]] = {}
    for tile in np.unique(given.tile).tolist():
        x, y = tile % given.cols, tile // given.cols
        pointer = int(image.pointers[pointer_place(tile, given.cols)])
        if x % 2 + y % 2 * 2 != writer or not pointer:
            continue
        lines = out.setdefault(y // 2 * -(-given.cols // 2) + x // 2, [])
        chunk, used = pointer & 0xFFFFFF, pointer >> 24
        while used:
            first = (4 * chunk + writer) * 8
            lines += range(first, first + used)
            _, link, linked, _ = headers(image, first)
            chunk, used = link, 8 if linked else 0
    return out


@pytest.mark.parametrize("held", [16, 64, 256])
@pytest.mark.parametrize("name", ["random", "large boxes", "one splat over 4096x4096", "tiles of one set in turn", "last tile"])
def test_pointers_beyond_those_held(name, held):
    """Memory does not depend on how many pointers are held; what is spilled and fetched is that of a plain store."""
    given = CASES[name]
    few, all_ = given.write(held=held), given.write(held=16384)
    assert not all_.spilled.any() and not all_.fetched.any() and all(len(m) == 0 for m in all_.moves)
    for part in ("memory", "pointers", "entries", "lines", "evicted", "taken", "failed"):
        assert np.array_equal(getattr(few, part), getattr(all_, part)), part
    for writer in range(4):
        moves, closed = store(given, few, writer, held // 16) if pointer_lines(given.cols, given.rows) // 4 > held // 16 else ([], all_.closed[writer].tolist())
        assert [tuple(m) for m in few.moves[writer].tolist()] == moves and few.closed[writer].tolist() == closed
        assert few.spilled[writer] == sum(m[1] >= 0 for m in moves) and few.fetched[writer] == sum(m[2] >= 0 for m in moves)
    if name in ("random", "large boxes"):
        assert few.spilled.min() > 20 or held == 256
        assert few.fetched.min() > 10 or held == 256


def test_a_writer_that_fails_leaves_what_it_spilled():
    given = CASES["large boxes"]
    full = given.write(held=16)
    image = given.write(int(full.taken.min()) // 2, held=16)
    assert image.failed.all() and image.spilled.all()
    table = image.pointers.reshape(-1, 4, 16)
    for writer in range(4):
        here = np.flatnonzero(table[:, writer].any(axis=1))
        assert set(here) <= set(image.moves[writer][:, 1]) and len(image.closed[writer]) == 0


def test_broken_lists_are_refused():
    image = CASES["random"].write()
    first, other = [t for t in np.unique(CASES["random"].tile).tolist() if t % 67 % 2 == t // 67 % 2 == 0][:2]
    at = int(pointer_place(first, 67))
    line = (int(image.pointers[at]) & 0xFFFFFF) * 32
    for what, place, bits, message in (
        ("pointers", at, 0xFFFFFF, "chunk 16777215, but there are"), ("pointers", at, 9 << 24, f"tile {first % 67}, {first // 67}: pointer with"),
        ("memory", line, 0, "holds 0 entries"), ("memory", line, 1 << 63, "wrong bits"), ("memory", line, 1 << 53, "wrong bits"),
        ("memory", line, 1 << 20, "wrong bits"), ("memory", line, 1 << 23, "wrong bits"),
        ("pointers", int(pointer_place(other, 67)), None, f"tile {other % 67}, {other // 67}: chunk .* belongs to another list too"),
    ):
        memory, pointers = image.memory.copy(), image.pointers.copy()
        if what == "memory":
            memory[place, 7] = memory[place, 7] | np.uint64(bits) if bits else memory[place, 7] & np.uint64(~(15 << 24) & (1 << 64) - 1)
        elif bits is None:
            pointers[place] = pointers[at]
        else:
            pointers[place] |= np.uint32(bits)
        with pytest.raises(FlickerError, match=message):
            read_lists(memory, pointers, 67, 34)
    with pytest.raises(FlickerError, match="pointers for"):
        read_lists(image.memory, image.pointers[1:], 67, 34)
    with pytest.raises(FlickerError, match="shape"):
        read_lists(image.memory[1:], image.pointers, 67, 34)


def test_what_does_not_fit_is_refused():
    one = np.zeros(1, np.int64)
    good = (one, one, one + 1, one, one, 1, 1)
    write_lists(*good)
    for place, value, message in (
        (1, one + 1, "tile must be"), (2, one + 16, "mask"), (3, one + (1 << 24), "key"), (4, one - 1, "record"), (5, 257, "257x1 tiles"), (6, 0, "1x0 tiles"),
    ):
        with pytest.raises(FlickerError, match=message):
            write_lists(*good[:place], value, *good[place + 1 :])
    with pytest.raises(FlickerError, match="chunks"):
        write_lists(*good, chunks=(1 << 24) + 1)


# ---- entries by the exact test -----------------------------------------------------------------


def test_entries_are_those_of_the_pixels():
    view = prepared_view().view
    cam = replace(view.camera, width=93, height=70, cx=None, cy=None)
    p = project(view.scene, cam)
    order = np.argsort(p.index)[::7]
    found = tile_entries(p, order, cam)
    assert (found.cols, found.rows) == (6, 5) and found.mask.min() > 0
    assert (np.diff(found.splat) >= 0).all() and (np.diff(found.splat.astype(np.int64) * 30 + found.tile) > 0).all()
    want = {}
    y, x = np.mgrid[:70, :93]
    for r, i in enumerate(order):
        dx, dy = x - p.mean[i, 0], y - p.mean[i, 1]
        a, b, c = p.conic[i]
        inside = (a * dx * dx + 2 * b * dx * dy + c * dy * dy <= 2 * np.log(p.opacity[i] / ALPHA_MIN)) & (abs(dx) <= p.radii[i, 0]) & (abs(dy) <= p.radii[i, 1])
        row, column = np.nonzero(np.add.reduceat(np.add.reduceat(inside, range(0, 70, 8), 0), range(0, 93, 8), 1))
        for sy, sx in zip(row.tolist(), column.tolist()):
            key = (r, sx // 2 + 6 * (sy // 2))
            want[key] = want.get(key, 0) | 1 << (sy % 2 * 2 + sx % 2)
    assert {(s, t): m for s, t, m in zip(found.splat.tolist(), found.tile.tolist(), found.mask.tolist())} == want


# ---- the study ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keyed():
    return key_entries(prepared_view())


def test_recommended_layout_is_the_golden_one(keyed):
    e = keyed.entries
    image = write_lists(e.splat, e.tile, e.mask, keyed.key, np.arange(len(keyed.key)), e.cols, e.rows)
    written = write(keyed, ListLayout())
    for writer, lines in enumerate(image.writes):
        assert np.array_equal(written.address[written.address // 8 % 4 == writer], lines)
    assert written.pool == 8 * image.taken.sum() and np.array_equal(written.lines.sum(), image.lines.sum())
    ours = ListLayout()
    assert (ours.lines, ours.sets_x * ours.sets_y, ours.ways) == (golden.CHUNK_LINES, golden.COMBINER_SETS, golden.COMBINER_WAYS)


@pytest.mark.parametrize("layout", [
    ListLayout(lines=1, replace=Replace.LRU), ListLayout(lines=2, chain=Chain.FORWARD, mixed=False, ways=2, replace=Replace.FULLEST),
    ListLayout(lines=16, chain=Chain.GROWING, mixed=False), ListLayout(lines=2, chain=Chain.DIRECTORY, mixed=False, ways=2),
    ListLayout(chain=Chain.STREAM, mixed=False, bins=2), ListLayout(lines=4, ways=2, bins=4, quantiles=True),
])
def test_every_layout_reads_the_lines_it_wrote(keyed, layout):
    written = write(keyed, layout)
    assert written.entries.sum() == len(keyed.entries) and len(np.unique(written.address)) == len(written.address)
    read = np.repeat(written.group_first - np.cumsum(written.group_size) + written.group_size, written.group_size) + np.arange(written.group_size.sum())
    assert np.array_equal(np.sort(read), np.sort(written.address))
    assert np.array_equal(written.entries.reshape(-1, layout.bins).sum(axis=1), np.bincount(keyed.entries.tile, minlength=len(keyed.needed)))
    assert (written.group_wait < np.arange(len(written.group_wait)) - np.repeat(written.start[:-1], np.diff(written.start))).all()


def test_reading_takes_what_its_dependence_says(keyed):
    written = write(keyed, ListLayout(lines=1))
    tile = int(np.argmax(written.entries))
    chunks = int(written.lines[tile])
    for latency in (100, 300):  # one chain alone: a latency a chunk, less where the row is open, more where another is, and refreshes
        cycles = read_cycles(written, np.array([tile]), latency, 1)
        assert chunks * (latency - 25) <= cycles <= 1.1 * chunks * (latency + 20)
    walk = visits(keyed, written, 1, False)
    few, many, slow = (read_cycles(written, walk, *p) for p in ((100, 4), (100, 16), (200, 4)))
    assert many < few < slow
    assert evaluate_layout(keyed, ListLayout(chain=Chain.STREAM), ((200, 4),)).once_cycles[200, 4] < slow / 2
    # Never beyond the memory's rate.
    assert written.lines.sum() * 64 <= many * 51.2
    with pytest.raises(FlickerError, match="latency"):
        read_cycles(written, walk, 20, 4)
    with pytest.raises(FlickerError, match="lines must be a power of two"):
        ListLayout(lines=3)


def test_a_small_view_has_no_lists():
    view = prepared_view()
    away = project(view.view.scene, camera(distance=-50.0))
    found = tile_entries(away, np.arange(len(away.depth)), camera(distance=-50.0))
    assert len(found) == 0
