"""A pipeline of the front end as a function: numbers in, numbers out, through the compiled RTL."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from flicker_tb.runner import seed

from flicker.arithmetic.ff import ff_bits, ff_value
from flicker.datapath.emit import module
from flicker.datapath.graph import Ff, Kind
from flicker.datapath.units import PIPELINES
from flicker.golden.front.setup import FORMATS
from flicker.toolchain import BUILD, verilate

HERE = Path(__file__).parent


class Bench:
    """name: of the pipeline's module. interval: one of those that it can be built for; 0: the usual one."""

    def __init__(self, name: str, interval: int = 0) -> None:
        self.pipeline = next(p for p in PIPELINES if p.module == name)
        self.interval = interval or self.pipeline.intervals[0]
        text, plans = module(name, self.pipeline.head, partial(self.pipeline.build, FORMATS), self.pipeline.intervals)
        plan = plans[self.interval]
        self.graph = plan.graph
        self.reset = ".rst_ni, " if "rst_ni" in text else ""
        self.latency = plan.latency
        ends = [v for v in self.graph.values if v.operator is None]
        self.registers = {v.name: v.kind for v in ends if v.register}
        self.inputs = {v.name: v.kind for v in ends if not v.register}
        self.outputs = {n: v.kind for n, v in self.graph.outputs.items()}

    @cached_property
    def _library(self) -> ctypes.CDLL:
        names = [*self.registers, *self.inputs]
        kinds = {**self.registers, **self.inputs}
        lines = ["module datapath_bench (", "  input logic clk_i, rst_ni, en_i,", "  input logic [3:0] phase_i,"]
        # Two outputs at least: an array of words in C++.
        lines += [f"  input logic [{64 * len(names) - 1}:0] in_i,", f"  output logic [{max(64 * len(self.outputs), 128) - 1}:0] out_o", ");"]
        several = len(self.pipeline.intervals) > 1
        phase = f".phase_i(phase_i[{max((self.interval - 1).bit_length(), 1) - 1}:0]), " if several or self.interval > 1 else ""
        chosen = f"#(.Interval({self.interval})) " if several else ""
        ports = [f".{n}_i(in_i[{64 * i + kinds[n].bits - 1}:{64 * i}])" for i, n in enumerate(names)]
        for i, (n, k) in enumerate(self.outputs.items()):
            lines.append(f"  logic {'signed ' if getattr(k, 'signed', False) else ''}[{k.bits - 1}:0] o{i};")
            lines.append(f"  assign out_o[{64 * i + 63}:{64 * i}] = 64'(o{i});")
            ports.append(f".{n}_o(o{i})")
        if len(self.outputs) == 1:
            lines.append("  assign out_o[127:64] = '0;")
        lines += [f"  {self.pipeline.module} {chosen}i_dut (.clk_i, {self.reset}.en_i, {phase}{', '.join(ports)});", "endmodule", ""]
        name = f"{self.pipeline.module}_{self.interval}" if several else self.pipeline.module
        folder = BUILD / "datapath" / name
        folder.mkdir(parents=True, exist_ok=True)
        wrapper = folder / "datapath_bench.sv"
        if not wrapper.exists() or wrapper.read_text() != "\n".join(lines):
            wrapper.write_text("\n".join(lines))
        words = f"-DIN_WORDS={2 * len(names)} -DOUT_WORDS={2 * len(self.outputs)}"
        path = verilate("datapath_bench", extra=[wrapper], args=["-Wno-WIDTH", "-Wno-UNUSED"], cpp=[HERE / "datapath_harness.cpp"],
                        cflags=words, shared=True, name=f"bench_{name}")
        return ctypes.CDLL(str(path))

    def __call__(self, registers: Mapping[str, float], stall: float = 0.3, **inputs: np.ndarray) -> dict[str, np.ndarray]:
        """Outputs (n,) of inputs (n,): ff numbers as float64, integers as int64. stall: share of the cycles without enable."""
        assert set(registers) == set(self.registers) and set(inputs) == set(self.inputs), (
            set(registers) ^ set(self.registers), set(inputs) ^ set(self.inputs))
        fixed = np.array([_code(registers[n], k) for n, k in self.registers.items()], np.uint64)
        columns = np.stack([_codes(np.asarray(inputs[n]), k) for n, k in self.inputs.items()], axis=1)
        n = len(columns)
        out = np.zeros((n, len(self.outputs)), np.uint64)
        rng = np.random.default_rng(seed())
        enable = (rng.random(4093) >= stall).astype(np.uint8)
        enable[0] = 1
        p = lambda a: ctypes.c_void_p(a.ctypes.data)  # noqa: E731
        columns, fixed = np.ascontiguousarray(columns), np.ascontiguousarray(fixed)
        self._library.run(ctypes.c_int64(n), self.interval, self.latency, 2 * len(fixed), p(fixed), p(columns), p(out), p(enable),
                          ctypes.c_int64(len(enable)), ctypes.c_uint64(seed()))
        return {name: _values(out[:, i], kind) for i, (name, kind) in enumerate(self.outputs.items())}


def _code(value: float, kind: Kind) -> int:
    return int(ff_bits(float(value), kind.M)) if isinstance(kind, Ff) else int(value) & (1 << 64) - 1


def _codes(values: np.ndarray, kind: Kind) -> np.ndarray:
    if isinstance(kind, Ff):
        return np.array([ff_bits(v, kind.M) for v in values.astype(np.float64).tolist()], np.uint64)
    return values.astype(np.int64).view(np.uint64)


def _values(codes: np.ndarray, kind: Kind) -> np.ndarray:
    if isinstance(kind, Ff):
        return np.array([ff_value(c, kind.M) for c in codes.tolist()])
    return codes.view(np.int64)
