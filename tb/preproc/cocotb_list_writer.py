"""cocotb tests of flk_list_writer; settings: pointers (held), lists (at most)."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config, four_state, netlist, rounds
from flicker_tb.streams import Monitor, Stream, StreamSink, StreamSource

from flicker.golden.lists import COUNT_BITS, HEADER_AT, LINK_BITS, MAX_CHUNKS, entry_words, pointer_lines, write_lists

LIST_BASE, POINTER_BASE = 0x2_12FF_FFC0, 0x1_0000_0077  # lists: lines from 64 on carry through all parts of an address
PATTERNS = [("never", "never"), ("half", "half"), ("never", "heavy"), ("heavy", "never"), ("bursts", "bursts"), ("rare", "alternate")]


STEPS = (0, 1, 2, 40, 510, 511, 512, 513)  # of records: 511 is near, 512 is not
TURNS = (0, 1, -1, 900, (1 << 16) - 1, 1 << 16, (1 << 16) + 1, -(1 << 16) + 1, -(1 << 16), -(1 << 16) - 1)  # of keys, behind those before: 2^16 is near


def walk_entries(rng, tiles: list[tuple[int, int]], stays: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Keys and records: of each list near those before it for a while, at the limits of what is near, or far from them. stays: share of those near, None: any;
    0: none is near."""
    key: list[int] = []
    record: list[int] = []
    last: dict[tuple[int, int], tuple[int, int]] = {}
    apart = stays == 0
    stays = rng.choice((0.1, 0.6, 0.9, 0.97, 1.0)) if stays is None else stays
    for tile in tiles:
        k, r = last.get(tile, (rng.getrandbits(24), rng.getrandbits(24)))
        far = rng.random() >= stays
        step, turn = (rng.choice(STEPS), rng.choice(TURNS)) if far else (rng.randrange(512), rng.randrange(-(1 << 16) + 1, (1 << 16) + 1))
        if apart:
            k, r, step, turn = (k + (1 << 23)) % (1 << 24), r, 0, 0
        elif far and rng.random() < 0.3:
            k, r = rng.getrandbits(24), rng.getrandbits(24)
        elif far and rng.random() < 0.2:  # from one end of the keys to the other, which is not near
            k, step, turn = (0 if k >> 23 else (1 << 24) - 1), 1, 0
        k, r = k + turn if 0 <= k + turn < 1 << 24 else k, r + step if r + step < 1 << 24 else r
        last[tile] = k, r
        key.append(k)
        record.append(r)
    return np.array(key, np.int64), np.array(record, np.int64)


class Frame:
    """Entries of one writer and what it writes. cols, rows: tiles of the picture."""

    def __init__(self, rng, writer: int, cols: int, rows: int, tiles: list[tuple[int, int]], chunks: int | None = None,
                 stays: float | None = None, like: Frame | None = None):
        """like: the frame whose tiles they are, for the same keys and records."""
        self.writer, self.cols, self.rows = writer, cols, rows
        u, v = np.array(tiles, np.int64).reshape(-1, 2).T
        tile = 2 * u + (writer & 1) + cols * (2 * v + (writer >> 1))
        n = len(tile)
        splat, mask = np.arange(n), np.array([rng.randrange(1, 16) for _ in range(n)], np.int64)
        self.values = key, record = walk_entries(rng, tiles, stays) if like is None else like.values
        image = write_lists(splat, tile, mask, key, record, cols, rows, chunks, config()["pointers"])
        self.chunks, self.image = image.chunks, image
        self.items = [(0, int(a), int(b), int(w)) for a, b, w in zip(u, v, entry_words(splat, mask, key, record))] + [(1, 0, 0, rng.getrandbits(52))]
        self.written = [(LIST_BASE + int(line), int.from_bytes(image.memory[line].tobytes(), "little")) for line in image.writes[writer]]
        self.pointer_lines = pointer_lines(cols, rows) // 4
        self.table = [int.from_bytes(part.tobytes(), "little") for part in image.pointers.reshape(-1, 4, 16)[:, writer]]
        self.written += [(POINTER_BASE + 4 * line + writer, self.table[line]) for line in image.closed[writer].tolist()]
        self.ahead = 0

    def move(self, chunks: int) -> None:
        """The same with so many chunks taken before the first one."""
        def line(at: int, data: int) -> tuple[int, int]:
            linked = data >> HEADER_AT + COUNT_BITS + LINK_BITS & 1
            return at + 32 * chunks, data + (linked * chunks << HEADER_AT + COUNT_BITS)

        def pointers(data: int) -> int:
            return data + sum(chunks << at for at in range(0, 512, 32) if data >> at & 0xFFFFFFFF)

        lists = len(self.image.writes[self.writer])
        self.written = [line(*item) for item in self.written[:lists]] + [(at, pointers(data)) for at, data in self.written[lists:]]
        self.table = [pointers(data) for data in self.table]
        self.chunks += chunks
        self.ahead = chunks


class Mover:
    """Who moves lines of pointers: takes a request after a while, reads the line that goes pointer by pointer, keeps it, gives the one that comes. `lines`: the
    table, None: noise. moves: of the frame: lines written until then, numbers as in `ListImage.moves`."""

    def __init__(self, dut, bench, lines):
        self.dut, self.bench, self.lines = dut, bench, lines
        self.table: dict[int, int] = {}
        self.moves: list[tuple[int, int, int]] = []
        self.slow = True
        for name in ("ready", "index", "read", "write", "pointer", "done"):
            getattr(dut, f"move_{name}_i").value = 0
        cocotb.start_soon(self.run())

    async def wait(self):
        for _ in range(self.bench.rng.choice((0, 0, 1, 2, 30)) if self.slow else 0):
            await RisingEdge(self.dut.clk_i)

    async def run(self):
        dut, rng = self.dut, self.bench.rng
        while True:
            await RisingEdge(dut.clk_i)
            if not int(dut.rst_ni.value) or not int(dut.move_valid_o.value):
                continue
            await self.wait()
            dut.move_ready_i.value = 1
            await RisingEdge(dut.clk_i)
            if not int(dut.rst_ni.value):
                dut.move_ready_i.value = 0
                continue
            put, get = (int(getattr(dut, f"move_{n}_line_o").value) if int(getattr(dut, f"move_{n}_o").value) else -1 for n in ("put", "get"))
            assert put >= 0 or get >= 0
            self.moves.append((len(self.lines), put, get))
            dut.move_ready_i.value = 0
            await self.wait()
            if put >= 0:
                word = 0
                for i in range(17):
                    dut.move_read_i.value = i < 16
                    dut.move_index_i.value = i % 16
                    await RisingEdge(dut.clk_i)
                    if i:  # the pointer of the cycle before is there in this one
                        word |= int(dut.move_pointer_o.value) << 32 * (i - 1)
                self.table[put] = word
            await self.wait()
            word = self.table[get] if get >= 0 else 0
            for i in range(16):
                dut.move_write_i.value = 1
                dut.move_index_i.value = i
                dut.move_pointer_i.value = word >> 32 * i & 0xFFFFFFF
                dut.move_done_i.value = i == 15
                await RisingEdge(dut.clk_i)
            dut.move_write_i.value = dut.move_done_i.value = 0
            dut.move_index_i.value = rng.randrange(16)


class Writer:
    """The design with its streams."""

    def __init__(self, dut, idle: str = "never", stall: str = "never"):
        self.dut, self.bench = dut, Bench(dut)
        several = int(dut.Banks.value) > 1
        entries, lines = Stream(dut, "in", ("end", *["bank"] * several, "u", "v", "entry")), Stream(dut, "out", ("address", "data"))
        self.source = StreamSource(entries, self.bench.stall(idle))
        self.sink = StreamSink(lines, self.bench.stall(stall))
        self.out: list[tuple[int, int]] = []
        self.output = Monitor(lines, self.out.append)
        self.input = Monitor(entries)
        self.mover = Mover(dut, self.bench, self.out)
        dut.start_i.value = dut.in_bank_i.value = 0
        for name, value in (("writer", 0), ("columns", 0), ("pointer_lines", 0), ("chunks", 0), ("list_base", LIST_BASE), ("pointer_base", POINTER_BASE)):
            getattr(dut, f"{name}_i").value = value

    async def start(self, frame: Frame) -> None:
        """Begin a frame: the configuration is there for one cycle."""
        dut = self.dut
        await self.bench.until(lambda: int(dut.idle_o.value) == 1, 5000, "idle")
        values = {"writer": frame.writer, "columns": -(-frame.cols // 2), "pointer_lines": frame.pointer_lines, "chunks": frame.chunks,
                  "list_base": LIST_BASE, "pointer_base": POINTER_BASE}
        for name, value in values.items():
            getattr(dut, f"{name}_i").value = value
        dut.start_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.start_i.value = 0
        for name, value in values.items():
            port = getattr(dut, f"{name}_i")
            port.value = value ^ (1 << len(port)) - 1
        self.out.clear()
        self.mover.moves.clear()
        self.mover.table.clear()
        if frame.ahead:
            await RisingEdge(dut.clk_i)
            dut.taken_q.value = frame.ahead
        self.source.send(frame.items)

    async def run(self, frame: Frame) -> None:
        """A whole frame, and what it must have written."""
        dut, image, w = self.dut, frame.image, frame.writer
        await self.start(frame)
        limit = 4000 + 40 * (len(frame.items) + 256 + 16 * frame.pointer_lines) + 200 * len(image.moves[w])
        await self.bench.until(lambda: int(dut.done_o.value) == 1, limit, "done")
        for i, (got, due) in enumerate(zip(self.out, frame.written)):
            assert got == due, f"line {i}: address {got[0] - LIST_BASE:#x}, data {got[1]:#x}; due {due[0] - LIST_BASE:#x}, {due[1]:#x}"
        assert len(self.out) == len(frame.written), f"{len(self.out)} lines, {len(frame.written)} due"
        moves = [tuple(m) for m in image.moves[w].tolist()]
        assert [m[1:] for m in self.mover.moves] == [m[1:] for m in moves], "lines of pointers moved"
        assert all(due - 2 <= got <= due for (got, *_), (due, *_) in zip(self.mover.moves, moves))
        left = self.mover.table | {(address - POINTER_BASE) // 4: data for address, data in self.out[image.lines[w] :]}
        assert all(left.get(line, 0) == due for line, due in enumerate(frame.table)), "pointers"
        counters = {"entries": image.entries, "lines": image.lines, "evicted": image.evicted, "taken": image.taken + frame.ahead, "failed": image.failed}
        for name, value in counters.items():
            assert int(getattr(dut, f"{name}_o").value) == value[w], f"{name}: {int(getattr(dut, f'{name}_o').value)}, due {value[w]}"


def size(rng, pointers: int) -> tuple[int, int]:
    """A picture with so many lists of a writer at most; one time in four of almost so many, where more than some fit."""
    while True:
        if config()["lists"] > config()["pointers"] and rng.random() < 0.25:
            cols = rng.randrange(2, min(256, pointers))
            return cols, max(1, min(256, 2 * (pointers // -(-cols // 2)) - rng.randrange(3)))
        cols, rows = rng.choice(((2, 2), (33, 6), (1, 3), (128, 1), (127, 2), (80, 6))) if rng.random() < 0.7 else (rng.randrange(1, 120), rng.randrange(1, 60))
        if pointer_lines(cols, rows) * 4 <= pointers:
            return cols, rows


def random_frame(rng, pointers: int, entries: int, wide: bool = False) -> Frame:
    """Entries in runs, of a few tiles, of tiles that share a set, of all tiles. wide: eight tiles in a set."""
    writer = rng.randrange(4)
    while True:
        cols, rows = (128, 2) if wide else size(rng, pointers)
        width, height = (cols - (writer & 1) + 1) // 2, (rows - (writer >> 1) + 1) // 2
        if width > 0 and height > 0:
            break
    tiles: list[tuple[int, int]] = []
    while len(tiles) < entries:
        kind = rng.randrange(4)
        u, v = rng.randrange(width), rng.randrange(height)
        n = rng.randrange(1, 60)
        if kind == 0:
            tiles += [(u, v)] * n
        elif kind == 1:  # two in turn
            tiles += [rng.choice(((u, v), (width - 1, v))) for _ in range(n)]
        elif kind == 2:  # one set
            same = [(x, y) for x in range(u % 8, width, 8) for y in range(v % 8, height, 8)]
            tiles += [rng.choice(same) for _ in range(n)]
        else:
            tiles += [(rng.randrange(width), rng.randrange(height)) for _ in range(n)]
    return Frame(rng, writer, cols, rows, tiles[:entries])


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PATTERNS))
async def frames(dut, idle, stall):
    """Frames one after the other: memory, pointers and counters are the model's."""
    test = Writer(dut, idle, stall)
    rng = test.bench.rng
    await test.bench.reset()
    evicted = 0
    large = [(300, True), (600, True), (rounds(600, 2000), False)]
    for entries, wide in ((0, False), (1, False), *large, (30, False), (9, False), (10, False), (rounds(300, 1200), True)):
        frame = random_frame(rng, config()["lists"], entries, wide)
        await test.run(frame)
        evicted += int(frame.image.evicted[frame.writer])
    assert evicted > rounds(25, 100)


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PATTERNS[rounds(1, 0) : rounds(2, 3)]))
async def out_of_memory(dut, idle, stall):
    """Chunks that just suffice, one too few, none, as many as there may be: what was written before stays the model's, and the next frame begins anew."""
    test = Writer(dut, idle, stall)
    rng = test.bench.rng
    await test.bench.reset()
    for _ in range(rounds(1, 3)):
        full = random_frame(rng, config()["lists"], 800)
        need = int(full.image.taken[full.writer])
        for chunks in (need, need - 1, rng.randrange(need), 0, need + 5):
            tiles = [(u, v) for end, u, v, _ in full.items if not end]
            frame = Frame(rng, full.writer, full.cols, full.rows, tiles, chunks, like=full)
            assert frame.image.failed[frame.writer] == (chunks < need)
            await test.run(frame)
        full.chunks = MAX_CHUNKS  # the largest region there is; the model's memory is as large as the lists need
        await test.run(full)


@cocotb.test(skip=netlist() or four_state())  # it sets a register
async def last_chunks(dut):
    """The last chunks of the largest region, the ones before counted as taken: as many as there are, and one too few."""
    test = Writer(dut)
    rng = test.bench.rng
    await test.bench.reset()
    need = 0
    while need <= 10:  # some frames have entries of few tiles
        full = random_frame(rng, config()["lists"], 800)
        need = int(full.image.taken[full.writer])
    tiles = [(u, v) for end, u, v, _ in full.items if not end]
    for chunks in (need, need - 1):
        frame = Frame(rng, full.writer, full.cols, full.rows, tiles, chunks, like=full)
        frame.move(MAX_CHUNKS - chunks)
        await test.run(frame)
        assert int(dut.taken_o.value) == MAX_CHUNKS and int(dut.failed_o.value) == (chunks < need)
    await test.run(full)


@cocotb.test()
async def corners(dut):
    """A picture with as many lists as there may be: entries in its corners and its middle."""
    test = Writer(dut)
    rng = test.bench.rng
    await test.bench.reset()
    lists = config()["lists"]
    width = 1 << (lists.bit_length() - 1 + 1) // 2
    places = [(u, v) for u in (0, width // 2, width - 1) for v in (0, lists // width // 2, lists // width - 1)]
    tiles = [rng.choice(places) for _ in range(120)]
    await test.run(Frame(rng, 3, 2 * width, 2 * (lists // width), tiles))


@cocotb.test()
async def one_set(dut):
    """Nine tiles of one set, one entry each in turn, and each line of one tile: the pipeline's registers stand in for the memories in every cycle. Entries near
    each other, apart, and at the limits."""
    test = Writer(dut)
    await test.bench.reset()
    cols, rows = (256, 1) if config()["lists"] >= 128 else (96, 1)
    for turns in (9, 5, 4, 3, 2, 1):
        tiles = [(8 * (i % turns) % (cols // 2), 0) for i in range(400)]
        for stays in (0.0, 0.5, 0.95, 1.0):
            await test.run(Frame(test.bench.rng, 0, cols, rows, tiles, stays=stays))


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PATTERNS[rounds(1, 0) : rounds(2, 6)]))
async def spilled(dut, idle, stall):
    """More lists than pointers that are held: lines of pointers that share a place in turn, that come back, that are never wanted; chunks that do not suffice
    in the midst of it; small frames between."""
    test = Writer(dut, idle, stall)
    rng = test.bench.rng
    held, lists = config()["pointers"], config()["lists"]
    await test.bench.reset()
    moved = np.zeros(2, np.int64)
    failed = skipped = 0
    for k in range(6):
        writer = rng.randrange(4)
        cols = min(256, 2 * rng.randrange(max(1, lists // 512), 40))
        rows = min(256, 2 * (lists // (cols // 2)))
        width, height = cols // 2, rows // 2
        assert held < width * height <= lists
        some = [(n % width, n // width) for n in range(rng.randrange(16), width * height, held)]  # of one place
        tiles: list[tuple[int, int]] = []
        while len(tiles) < 700:
            at = rng.randrange(width * height)
            few = some if rng.random() < 0.5 else [(at % width, at // width)]
            tiles += [rng.choice(few) for _ in range(rng.randrange(1, 30))]
        frame = Frame(rng, writer, cols, rows, tiles)
        if k % 3 == 2:
            frame = Frame(rng, writer, cols, rows, tiles, rng.randrange(int(frame.image.taken[writer])), like=frame)
        test.mover.slow = k % 2 == 0
        await test.run(frame)
        moved += frame.image.spilled[writer], frame.image.fetched[writer]
        failed += bool(frame.image.failed[writer] and frame.image.spilled[writer])
        skipped += frame.pointer_lines - len(frame.image.closed[writer]) > 0 and not frame.image.failed[writer]
        if k == 3:
            await test.run(random_frame(rng, held, 300))
    assert moved.min() > 50 and failed and skipped


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PATTERNS[:: rounds(2, 1)]))
async def banks(dut, idle, stall):
    """A writer of several banks, entries of all of them in turn: of each bank lines, moves, pointers and chunks are those of the model, which has a writer a
    bank; banks that run out of chunks, alone and all."""
    test = Writer(dut, idle, stall)
    rng = test.bench.rng
    count, held, lists = int(dut.Banks.value), config()["pointers"], config()["lists"]
    await test.bench.reset()
    failed = moved = 0
    for k in range(8):
        first = rng.randrange(4 // count)
        own = [first + 4 // count * j for j in range(count)]
        large = k % 2 == 1 and lists > held
        most = lists if large else held
        least = max(2, most // 128)
        columns = rng.randrange(least, max(least + 1, min(128, most) // 4))
        rows = min(128, most // columns)
        cols, lines = 2 * columns, pointer_lines(2 * columns, 2 * rows) // 4
        assert (16 * lines > held) == large
        places = [(rng.randrange(columns), rng.randrange(rows)) for _ in range(12)]
        tiles: list[tuple[int, int, int]] = []
        while len(tiles) < rounds(500, 1000):
            u, v = rng.choice(places) if rng.random() < 0.7 else (rng.randrange(columns), rng.randrange(rows))
            turn = own if rng.random() < 0.5 else [rng.choice(own)]
            tiles += [(2 * u + (b & 1), 2 * v + (b >> 1), b) for b in turn for _ in range(rng.randrange(1, 20))]
        key, record = walk_entries(rng, [tile[:2] for tile in tiles], None)
        splat, mask = np.arange(len(tiles)), np.array([rng.randrange(1, 16) for _ in tiles], np.int64)
        number = np.array([x + cols * y for x, y, _ in tiles], np.int64)
        chunks = None
        if k % 4 >= 2:  # some banks or all run out of chunks
            need = write_lists(splat, number, mask, key, record, cols, 2 * rows, None, held).taken[own]
            chunks = int(rng.choice((need.max() - 1, need.min() - 1)))
        image = write_lists(splat, number, mask, key, record, cols, 2 * rows, chunks, held)
        words = [int(word) for word in entry_words(splat, mask, key, record)]
        await test.bench.until(lambda: int(dut.idle_o.value) == 1, 20_000, "idle")
        for name, value in (("writer", first), ("columns", columns), ("pointer_lines", lines), ("chunks", image.chunks)):
            getattr(dut, f"{name}_i").value = value
        dut.start_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.start_i.value = 0
        test.out.clear()
        test.mover.moves.clear()
        test.mover.table.clear()
        test.mover.slow = k % 3 == 0
        test.source.send([(0, own.index(b), x >> 1, y >> 1, word) for (x, y, b), word in zip(tiles, words)] + [(1, rng.randrange(count), 0, 0, 0)])
        limit = 4000 + 40 * (len(tiles) + 256 * count + 16 * lines * count) + 200 * sum(len(m) for m in image.moves)
        await test.bench.until(lambda: int(dut.done_o.value) == 1, limit, "done")
        lists_out = [(at - LIST_BASE, data) for at, data in test.out[: sum(image.lines[b] for b in own)]]
        table = {line: data for line, data in test.mover.table.items()} | {
            ((at - POINTER_BASE - first) * count // 4): data for at, data in test.out[len(lists_out) :]}
        assert len(test.out) == sum(int(image.lines[b]) + len(image.closed[b]) for b in own)
        for j, b in enumerate(own):
            due = [(int(at), int.from_bytes(image.memory[at].tobytes(), "little")) for at in image.writes[b]]
            assert [item for item in lists_out if item[0] >> 3 & 3 == b] == due, f"bank {b}: lines"
            got = [tuple(at // count if at >= 0 else -1 for at in (put, get)) for _, put, get in test.mover.moves if max(put, get) % count == j]
            assert got == [tuple(m[1:]) for m in image.moves[b].tolist()], f"bank {b}: moves"
            want = [int.from_bytes(part.tobytes(), "little") for part in image.pointers.reshape(-1, 4, 16)[:, b]]
            assert [table.get(count * line + j, 0) for line in range(lines)] == want, f"bank {b}: pointers"
            assert int(dut.taken_o.value) >> 25 * j & (1 << 25) - 1 == image.taken[b], f"bank {b}: chunks"
        for name in ("entries", "lines", "evicted"):
            assert int(getattr(dut, f"{name}_o").value) == getattr(image, name)[own].sum(), name
        assert int(dut.failed_o.value) == image.failed[own].any()
        failed += 0 < image.failed[own].sum() < count
        moved += len(test.mover.moves)
    assert failed and (moved > 20) == (lists > held)


@cocotb.test()
async def rate(dut):
    """An entry a cycle; a line six cycles after the entry that fills it, of nine or of fifteen; in a picture whose pointers are all held, too."""
    test = Writer(dut)
    await test.bench.reset()
    held = config()["pointers"]
    columns = max(8, held // 128)
    for stays, entries in ((0.0, 9), (1.0, 15)):
        frame = Frame(test.bench.rng, 3, 2 * columns, 2 * (held // columns), [(i % 8, 0) for i in range(720)], stays=stays)
        assert 16 * frame.pointer_lines == held and frame.image.lines[3] == 720 // entries
        test.input.count = test.output.count = 0
        await test.run(frame)
        assert test.input.last - test.input.first == 720
        assert test.output.first - test.input.first == 8 * (entries - 1) + 6
        assert test.output.count == 720 // entries + frame.pointer_lines


@cocotb.test()
async def reset_in_a_frame(dut):
    """What a frame that reset ended has left is gone."""
    test = Writer(dut, "rare", "rare")
    rng = test.bench.rng
    await test.bench.reset()
    for _ in range(2):
        frame = random_frame(rng, config()["lists"], 400)
        await test.start(frame)
        sent = test.source.sent
        await test.bench.until(lambda: test.source.sent - sent > rng.randrange(100, 350), 5000, "entries")
        dut.rst_ni.value = 0
        await test.bench.cycles(2)
        test.source.drop()
        await test.bench.reset()
        await test.run(random_frame(rng, config()["lists"], 500))
