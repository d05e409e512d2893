"""A memory port on the pins of a verilated design: a traffic generator writes and reads back, in the loop that docs/reference/memory_model.md shows to
harnesses.

Covered: wide and, with SLOW=1, narrow data buses (arrays of words, integers), pauses, every order, LPDDR4 and perfect memory, an answer with an error, a broken
rule (three with SLOW=1), a memory that does not answer. The port itself: tb/model/test_memory.py.
"""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path

import pytest
from flicker_tb.bench import rounds
from flicker_tb.runner import seed

from flicker.chip.dram import DramConfig, port_config
from flicker.sim.memory import FOLDER, HEADERS, Order, PortConfig, Timing, WriteOrder
from flicker.toolchain import verilate

HERE = Path(__file__).parent
BURSTS, MAX_BEATS = 64, 8
BEATS = BURSTS * (MAX_BEATS + 1) // 2
BASE = 0x40_0000


class Result(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint64) for name in ("cycles", "bad_beats", "bad_answers", "read_beats", "write_beats", "bursts")]


def simulate(
    config: PortConfig, perfect: bool = False, *, source: Path = HERE / "axi_traffic.sv", fail_write: int = -1, limit: int = 50_000,
) -> tuple[int, Result, str]:
    """State (1: done, 0: not in time, -1: a rule is broken), result, first error."""
    library = ctypes.CDLL(str(verilate(
        "axi_traffic", [source], parameters={"Width": config.data_bits, "IdBits": config.id_bits, "Bursts": BURSTS, "MaxBeats": MAX_BEATS},
        cpp=[HERE / "axi_traffic_harness.cpp"], depends=HEADERS, cflags=f"-I{FOLDER}", shared=True, kind="sim",
    )))
    library.traffic_run.argtypes = [
        ctypes.POINTER(Timing), ctypes.c_int, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_int, ctypes.c_int64, ctypes.c_uint64, ctypes.c_void_p,
    ]
    library.traffic_error.restype = ctypes.c_char_p
    result = Result()
    size = BURSTS * MAX_BEATS * config.data_bits // 8
    state = library.traffic_run(
        ctypes.byref(DramConfig().timing), perfect, ctypes.byref(config.structure()), BASE, size, 0xA5, fail_write, limit, ctypes.byref(result),
    )
    return state, result, library.traffic_error().decode()


@pytest.mark.parametrize("bits", [512, *(pytest.param(bits, marks=pytest.mark.slow) for bits in (64, 32))])
@pytest.mark.parametrize("perfect", [False, True])
def test_traffic(bits, perfect):
    stall = {"AW": 0.3, "W": 0.3, "B": 0.3, "AR": 0.3, "R": 0.3}
    base = port_config(data_bits=bits, id_bits=2, max_beats=16, seed=seed())
    cases = [base] + [replace(base, order=order, write_order=write_order, stall=stall) for order in Order for write_order in WriteOrder]
    cycles = []
    for config in cases:
        state, result, error = simulate(config, perfect)
        assert (state, error) == (1, "")
        assert (result.bad_beats, result.bad_answers, result.read_beats, result.write_beats) == (0, 0, BEATS, BEATS)
        assert (result.bursts > 0) == (not perfect)
        cycles.append(result.cycles)
    assert cycles[0] < min(cycles[1:])


def test_errors_reach_the_design():
    config = PortConfig(id_bits=2)
    state, result, _ = simulate(config, fail_write=2)
    assert (state, result.bad_answers, result.bad_beats) == (1, 1, 3)  # the three beats of burst 2 were not written
    assert simulate(replace(config, stop_after={"R": 5}), limit=5000)[0] == 0
    state, _, error = simulate(replace(config, max_beats=4))
    assert state == -1 and "AW" in error and "more than 4 beats" in error


def test_a_broken_manager_is_seen(tmp_path):
    text = (HERE / "axi_traffic.sv").read_text()
    faults = (
        ("assign mem_w_last_o   = w_beat_q == len(w_q);", "assign mem_w_last_o   = w_beat_q == 8'd0;", "is marked last"),
        ("mem_ar_valid_o = b_q == 16'(Bursts)", "mem_ar_valid_o = b_q > 16'd1", "that has no answer yet"),
        ("base_i + 40'(n) * 40'(Stride)", "base_i + 40'd64 + 40'(n) * 40'(Stride)", "crosses a 4 KB boundary"),
    )
    for good, bad, message in faults[:: rounds(3, 1)]:
        assert text.count(good) == 1
        source = tmp_path / "axi_traffic.sv"
        source.write_text(text.replace(good, bad))
        state, _, error = simulate(PortConfig(id_bits=2, seed=seed()), source=source)
        assert state == -1 and message in error
