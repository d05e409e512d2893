"""cocotb tests of flk_frame_writer: pixels of a grid of tiles in, a memory of bytes out, compared with the golden frame buffer."""

from __future__ import annotations

from collections import deque

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb import stalls
from flicker_tb.bench import Bench, config, rounds

from flicker.golden.frame_buffer import PAIR, PixelFormat, frame_buffer, least_stride
from flicker.params import SUBTILE_COORD_BITS, TILE
from flicker.perf.lanes import pixels_of_lanes

PAIRS = config().get("pairs", 4)  # that the design holds
LANES = config().get("lanes", 0)
CORES = config().get("cores", 4)
GROUPS = [list(map(int, pixels)) for pixels in (pixels_of_lanes(LANES // CORES) if LANES else np.arange(64).reshape(4, 16))]  # pixels of each
PIXEL_BITS = 64 + 4 + 2 + 2 * SUBTILE_COORD_BITS
SPECIAL = np.array([0, 0x8000, 1, 0x3FF, 0x400, 0x3BFF, 0x3C00, 0x3C01, 0x3FFF, 0x4000, 0x7BFF, 0x7C00, 0xB800, 0xBC00, 0x1C00, 0x1C04], np.uint16)


class Writer:
    """The design between cores and memory."""

    def __init__(self, dut) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.numbers = np.random.default_rng(self.rng.getrandbits(32))
        for name in ("clear", "start", "rgba", "background", "base", "stride", "pairs", "in_valid", "in_data", "out_ready", "stop"):
            getattr(dut, f"{name}_i").value = 0

    def pixels(self, cols: int, rows: int) -> np.ndarray:
        """uint16 (S, 64, 4) of a grid of sub-tiles: a tenth special values, the rest as pictures have them."""
        shape = (cols * rows, 64, 4)
        plain = self.numbers.random(shape).astype(np.float16).view(np.uint16)
        out = np.where(self.numbers.random(shape) < 0.1, self.numbers.choice(SPECIAL, shape), plain)
        out[..., 0] = np.where(out[..., 0] > 0x3C00, 0x3C00, out[..., 0])  # transmittance is never above 1, nor negative
        return out

    async def frame(self, cols: int, rows: int, form: PixelFormat, idle: list[str], stall: str, gap: int = 0, walk: str = "rows", stop: int = 0, late: int = 0,
                    order: str = "any", at: tuple[int, int] = (0, 0), stride: int = 0, top: bool = False) -> int:
        """A frame of cols x rows sub-tiles; cycles from its first pixel to done. gap: bursts between rows. stop: abort in that cycle.
        late: stop_i from that cycle on; the pairs that have left, checked when it says that it has stopped, if it does before the frame ends.
        at: pair of tiles where it begins in a larger picture with that stride, in bytes. top: its last row is the last of the address space.
        order: of a core's groups of pixels, any, ahead (as far apart as they may be) or pairs (one pair after the other)."""
        dut, rng, edge = self.dut, self.rng, RisingEdge(self.dut.clk_i)
        across, down = -(-cols * 8 // PAIR), -(-rows * 8 // TILE)
        cols, rows = 4 * across, 2 * down
        pixels = self.pixels(cols, rows)
        width, height = 8 * cols, 8 * rows
        stride = stride or least_stride(width, form) + 32 * gap
        background = [rng.choice((0, 255, rng.randrange(256))) for _ in range(3)]
        begin = TILE * at[1] * stride + at[0] * least_stride(PAIR, form)  # byte of its first pixel
        base = (1 << len(dut.base_i)) - -(-(begin + height * stride) // 64) if top else rng.randrange(1 << 20)
        pairs = [(x, y) for y in range(down) for x in range(across)]
        if walk == "any":
            rng.shuffle(pairs)
        # By core and group: pair and pixel, in order; a core's stream takes from any of its groups.
        work: list[list[deque[tuple[int, int]]]] = [[deque() for _ in GROUPS] for _ in range(CORES)]
        for number, (x, y) in enumerate(pairs):
            first = rng.getrandbits(1) if walk == "any" else 0
            for tile in (first, 1 - first):
                for k in range(CORES):
                    for m, group in enumerate(GROUPS):
                        places = [(s, i) for s in range(k, 4, CORES) for i in group]
                        rng.shuffle(places)
                        for s, i in places:
                            col, row = 4 * x + 2 * tile + s % 2, 2 * y + s // 2
                            t, r, g, b = (int(v) for v in pixels[row * cols + col, i])
                            position = row + 2 * at[1] << SUBTILE_COORD_BITS | col + 4 * at[0]
                            work[k][m].append((number, position << 70 | i << 64 | t << 48 | r << 32 | g << 16 | b))
        expected = frame_buffer(pixels, cols, rows, width, height, form, stride, background)
        memory = np.zeros(expected.size + 64, np.uint8)
        written = np.zeros(memory.size, np.bool_)
        dut.rgba_i.value, dut.base_i.value = int(form is PixelFormat.RGBA16F), base
        dut.background_i.value = background[0] | background[1] << 8 | background[2] << 16
        dut.stride_i.value, dut.pairs_i.value = stride // 32, len(pairs)
        assert int(dut.idle_o.value) == 1
        dut.start_i.value = 1
        await edge
        dut.start_i.value = 0
        idles, stalled = [stalls.make(p, rng) for p in idle], stalls.make(stall, rng)
        cycle, first, freed, held = 0, -1, 0, None
        while True:
            valid = data = 0
            for k in range(CORES):
                open_ = [m for m in range(len(GROUPS)) if work[k][m] and work[k][m][0][0] < freed + PAIRS]
                if order == "ahead":
                    open_ = open_[:1]
                elif order == "pairs":
                    open_ = sorted(open_, key=lambda m: work[k][m][0][0])[:1]
                give = bool(open_) and not next(idles[k])
                valid |= give << k
                data |= (work[k][rng.choice(open_)].popleft()[1] if give else rng.getrandbits(PIXEL_BITS)) << PIXEL_BITS * k
            first = cycle + 1 if first < 0 and valid else first
            ready = not next(stalled)
            dut.in_valid_i.value, dut.in_data_i.value, dut.out_ready_i.value = valid, data, int(ready)
            dut.stop_i.value = int(0 < late <= cycle)
            await edge
            cycle += 1
            freed += int(dut.freed_o.value)
            if int(dut.out_valid_o.value):
                got = (int(dut.out_beat_o.value), int(dut.out_strobe_o.value), int(dut.out_data_o.value))
                assert held in (None, got), "line changed before its transfer"
                held = None if ready else got
                if ready:
                    where = (got[0] - base) * 64 - begin
                    assert got[1] in (3, 12, 15), "not whole bursts"
                    for q in range(4):
                        if got[1] >> q & 1:
                            part = slice(where + 16 * q, where + 16 * q + 16)
                            assert not written[part].any(), "written twice"
                            written[part] = True
                            memory[part] = np.frombuffer((got[2] >> 128 * q & (1 << 128) - 1).to_bytes(16, "little"), np.uint8)
            else:
                assert held is None, "valid fell"
            if stop and cycle >= stop:
                dut.clear_i.value = 1
                dut.in_valid_i.value = 0
                await edge
                dut.clear_i.value = 0
                await edge
                assert int(dut.idle_o.value) == 1 and int(dut.out_valid_o.value) == 0
                return cycle
            left = int(dut.left_o.value)
            if int(dut.done_o.value) or (int(dut.stopped_o.value) and left):
                break
            assert stall != "never" or not 0 < late < cycle - 142, "not stopped behind the pair that leaves"
            assert cycle < 2000 + 3000 * 4 // CORES * len(pairs), f"stands still after {freed} of {len(pairs)} pairs"
        dut.in_valid_i.value = 0
        assert freed == len(pairs) - left and (left or not any(any(w) for w in work)) and int(dut.idle_o.value) == (left == 0)
        row = least_stride(PAIR, form)
        mask = np.zeros(expected.shape, np.bool_)
        for x, y in pairs[:freed]:
            mask[TILE * y : TILE * (y + 1), row * x : row * (x + 1)] = True
        if left:
            dut.out_ready_i.value = 1
            for _ in range(20):  # it stays stopped
                await edge
                assert int(dut.out_valid_o.value) == 0 and int(dut.stopped_o.value) == 1 and int(dut.left_o.value) == left
            dut.clear_i.value = 1
            await edge
            dut.clear_i.value = dut.stop_i.value = 0
            await edge
        assert np.array_equal(written[: expected.size], mask.ravel()) and not written[expected.size :].any()
        assert np.array_equal(memory[: expected.size][mask.ravel()], expected.ravel()[mask.ravel()])
        return left if late else cycle - first


@cocotb.test()
@cocotb.parametrize(("form", list(PixelFormat)), ("kind", ["never never", "half half", "heavy never", "never heavy", "bursts bursts", "mixed"]))
async def bytes_of_frames(dut, form, kind):
    """Frames of several sizes one after the other, rows with and without a gap."""
    test = Writer(dut)
    await test.bench.reset()
    heavy = CORES < 4 and ("heavy" in kind or kind == "mixed")  # the fewer cores, the longer a pair takes
    for cols, rows in ((1, 1), (5, 3), (12, 2))[: 1 if heavy else rounds(2, 3)]:
        pick = lambda: test.rng.choice(stalls.PATTERNS)  # noqa: E731
        idle, stall = ([pick() for _ in range(CORES)], pick()) if kind == "mixed" else ([kind.split()[0]] * CORES, kind.split()[1])
        walk, order = test.rng.choice(("rows", "any")), test.rng.choice(("any", "ahead", "pairs"))
        await test.frame(cols, rows, form, idle, stall, gap=test.rng.randrange(3), walk=walk, order=order)


@cocotb.test()
@cocotb.parametrize(("form", list(PixelFormat)))
async def largest_picture(dut, form):
    """First and last pair of tiles of 4096x4096 pixels, in rows as short and as long as there are, at the end of the address space."""
    test = Writer(dut)
    await test.bench.reset()
    last = 4096 // PAIR - 1, 4096 // TILE - 1
    for stride in (least_stride(4096, form), (1 << 17) - 32):
        for at in (last, (0, last[1]), (last[0], 0)):
            await test.frame(4, 2, form, ["never"] * CORES, "never", at=at, stride=stride, top=at == last)


@cocotb.test()
@cocotb.parametrize(("form", list(PixelFormat)))
async def one_core_late(dut, form):
    """Three cores run ahead as far as they may, the fourth comes seldom."""
    test = Writer(dut)
    await test.bench.reset()
    for late in test.rng.sample(range(CORES), min(rounds(1, CORES), CORES)):
        await test.frame(24, 2, form, ["heavy" if k == late else "never" for k in range(CORES)], "half")


@cocotb.test()
@cocotb.parametrize(("form", list(PixelFormat)))
async def rate(dut, form):
    """A pair every 132 cycles; the last one is out 141 cycles after its last pixel."""
    test = Writer(dut)
    await test.bench.reset()
    one = await test.frame(4, 2, form, ["never"] * CORES, "never", order="pairs")
    many = await test.frame(40, 2, form, ["never"] * CORES, "never", order="pairs")
    assert many - one == 9 * 132, (one, many)
    assert one == 127 + 141, one


@cocotb.test()
async def abort(dut):
    """clear_i at any time; the next frame is right."""
    test = Writer(dut)
    await test.bench.reset()
    for _ in range(rounds(6, 12)):
        form = test.rng.choice(list(PixelFormat))
        await test.frame(24, 2, form, ["half"] * CORES, "half", stop=test.rng.randrange(1, 700))
        await test.frame(4, 2, form, ["never"] * CORES, "half")


@cocotb.test()
async def late(dut):
    """stop_i at any time: pairs that are on their way are whole, no other is touched; a picture that is whole ends. The next frame is right."""
    test = Writer(dut)
    await test.bench.reset()
    lefts = set()
    for _ in range(rounds(12, 30)):
        form, stall = test.rng.choice(list(PixelFormat)), test.rng.choice(("never", "half"))
        lefts.add(await test.frame(24, 2, form, ["never"] * CORES, stall, late=test.rng.randrange(1, 1200), walk="any"))
        await test.frame(4, 2, form, ["never"] * CORES, "half")
    assert 0 in lefts and 6 in lefts and len(lefts) > 3, lefts
    # In each cycle of the four between a pair that is there and its first row, before that and behind.
    ends = [await test.frame(8, 2, PixelFormat.RGB8, ["never"] * CORES, "never", late=cycle, order="pairs") for cycle in range(120, 140)]
    assert ends == sorted(ends, reverse=True) and set(ends) == {1, 2}, ends
