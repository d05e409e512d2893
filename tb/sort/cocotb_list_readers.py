"""cocotb test of four list readers at one memory: cycles for the lists of a frame, row by row; setting: lists (a file), limit."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench, config

from flicker.chip.dram import DramConfig, port_config
from flicker.golden.lists import writer_columns
from flicker.sim.memory import Memory

READERS = 4
LIST_BASE, POINTER_BASE = 0x4000_0000, 0x2000_0000


@cocotb.test()
async def frame(dut):
    """Nothing else uses the memory; tiles and lines never wait."""
    bench = Bench(dut)
    given = np.load(config()["lists"])
    cols, rows = int(given["cols"]), int(given["rows"])
    memory = Memory(DramConfig().timing)
    for base, data in ((LIST_BASE, given["memory"]), (POINTER_BASE, given["pointers"])):
        memory.allocate(base, data.nbytes)
        memory.write(base, data.tobytes())
    ports = [
        MemoryPort(dut, memory, port_config(max_reads=64, max_beats=8), prefix=f"p{n}_", writes=False, tick=n == 0) for n in range(READERS)
    ]
    for name, value in (("list_base", LIST_BASE // 64), ("pointer_base", POINTER_BASE // 64), ("columns", writer_columns(cols)),
                        ("chunks", int(given["chunks"])), ("start", 0), ("tile_valid", 0), ("tile_x", 0), ("tile_y", 0)):
        getattr(dut, f"{name}_i").value = value
    walk = [(x, y) for y in range(rows) for x in range(cols)]
    mine = [walk[n::READERS] for n in range(READERS)]
    sent = [0] * READERS
    await bench.reset()
    dut.start_i.value = 1
    edge = RisingEdge(dut.clk_i)
    await edge
    dut.start_i.value = 0
    lists = lines = cycles = 0
    driven = 0
    while lists < len(walk):
        offer = tuple(mine[n][sent[n]] if sent[n] < len(mine[n]) else None for n in range(READERS))
        if driven != (key := tuple(sent)):
            driven = key
            dut.tile_valid_i.value = sum((o is not None) << n for n, o in enumerate(offer))
            dut.tile_x_i.value = sum(o[0] << 8 * n for n, o in enumerate(offer) if o)
            dut.tile_y_i.value = sum(o[1] << 8 * n for n, o in enumerate(offer) if o)
        await edge
        cycles += 1
        ready, valid = int(dut.tile_ready_o.value), int(dut.out_valid_o.value)
        for n in range(READERS):
            sent[n] += offer[n] is not None and ready >> n & 1
        lists += (valid & int(dut.out_last_o.value)).bit_count()
        lines += valid.bit_count()
        assert cycles < config()["limit"]
    assert dut.error_o.value == 0
    beats = sum(port.port.channels()["R"][0] for port in ports)
    dut._log.info("%d lists, %d lines, %d beats: %d cycles", lists, lines, beats, cycles)
    assert cycles < config()["limit"]
