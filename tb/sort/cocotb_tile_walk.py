"""cocotb tests of flk_tile_walk."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge
from flicker_tb.bench import Bench

from flicker.golden.walk import borders, tile_walk


class Walk:
    """The design; its inputs change in the middle of a cycle."""

    def __init__(self, dut) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.bits = len(dut.pairs_i)
        dut.start_i.value = dut.next_i.value = dut.pairs_i.value = dut.rows_i.value = 0

    async def reset(self) -> None:
        await self.bench.reset()
        await FallingEdge(self.dut.clk_i)
        assert self.dut.done_o.value == 1

    async def start(self, pairs: int, rows: int) -> None:
        dut = self.dut
        dut.pairs_i.value, dut.rows_i.value, dut.start_i.value = pairs, rows, 1
        # A step that comes together with a start is forgotten.
        dut.next_i.value = self.bench.rng.getrandbits(1) if dut.done_o.value == 0 else 0
        await FallingEdge(dut.clk_i)
        dut.start_i.value = dut.next_i.value = 0

    async def go(self, pairs: int, rows: int, pause: str = "never", steps: int | None = None) -> None:
        """From the first tile on; to the end, or `steps` steps."""
        dut, idle = self.dut, self.bench.stall(pause)
        tiles = list(zip(*(v.tolist() for v in tile_walk(pairs, rows)), strict=True))
        border = [int(a) | int(b) << 4 for a, b in borders(pairs, rows)]
        for k, tile in enumerate(tiles[:steps]):
            while True:
                stay = next(idle)
                dut.next_i.value = int(not stay)
                assert dut.done_o.value == 0, f"{pairs} x {rows}: done before tile {k}"
                seen = int(dut.tile_x_o.value), int(dut.tile_y_o.value)
                assert seen == tile, f"{pairs} x {rows}: tile {k} is {seen}, due {tile}"
                assert int(dut.second_o.value) == k % 2
                assert int(dut.border_o.value) == border[k], f"{pairs} x {rows}: tile {k}: borders {int(dut.border_o.value):#x}, due {border[k]:#x}"
                await FallingEdge(dut.clk_i)
                if not stay:
                    break
        dut.next_i.value = 0
        for _ in range(3 if steps is None else 0):
            assert dut.done_o.value == 1, f"{pairs} x {rows}: not done"
            await FallingEdge(dut.clk_i)


@cocotb.test()
async def small(dut):
    """All sizes up to four pairs and two bands."""
    walk = Walk(dut)
    await walk.reset()
    for pairs in range(1, 5):
        for rows in (*range(1, 11), 16):
            await walk.start(pairs, rows)
            await walk.go(pairs, rows)


@cocotb.test()
async def largest(dut):
    """As many columns and rows as the coordinates can name."""
    walk = Walk(dut)
    most = 1 << walk.bits
    await walk.reset()
    for pairs, rows in ((most // 2, 3), (1, most), (most // 2 - 1, 2), (2, most - 1)):
        await walk.start(pairs, rows)
        await walk.go(pairs, rows, "rare")


@cocotb.test()
@cocotb.parametrize(pause=["half", "heavy", "bursts"])
async def pauses_and_starts(dut, pause):
    """Steps with pauses; the next start comes before the end of the walk, with the last step, or after it."""
    walk = Walk(dut)
    rng = walk.bench.rng
    await walk.reset()
    for _ in range(25):
        pairs, rows = rng.randint(1, 4), rng.choice((1, 2, 5, 8, 9, 13))
        await walk.start(pairs, rows)
        await walk.go(pairs, rows, pause, rng.choice([None, rng.randrange(2 * pairs * rows + 1)]))
