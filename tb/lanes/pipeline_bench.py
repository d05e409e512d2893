"""A pipeline with clock and enable as a function: inputs in, outputs out, through the compiled RTL under a random pattern of enables."""

from __future__ import annotations

import ctypes
from functools import cached_property
from pathlib import Path

import numpy as np
from flicker_tb.runner import seed

from flicker.toolchain import BUILD, verilate

HERE = Path(__file__).parent

# lane_splat_t, highest first: bits, signed.
SPLAT = {
    "w": (20, True), "z": (20, True), "s0": (15, False), "s1": (16, True), "s2": (15, False), "lo": (12, False), "red": (10, False), "green": (10, False),
    "blue": (10, False),
}
SPLAT_BITS = sum(bits for bits, _ in SPLAT.values())


class Bench:
    """module: with ports `inputs`, lowest first, and the port `output`, of so many bits; it has `latency` registers."""

    def __init__(self, module: str, inputs: dict[str, int], output: str, bits: int, latency: int) -> None:
        self.module, self.inputs, self.output, self.bits, self.latency = module, inputs, output, bits, latency
        # Three words at least: arrays of words in C++.
        self.in_words, self.out_words = (max(-(-n // 32), 3) for n in (sum(inputs.values()), bits))

    @cached_property
    def _library(self) -> ctypes.CDLL:
        ports, low = [], 0
        for name, bits in self.inputs.items():
            ports.append(f".{name}(in_i[{low + bits - 1}:{low}])")
            low += bits
        text = "\n".join([
            "module pipeline_bench (", "  input logic clk_i, en_i,", f"  input logic [{32 * self.in_words - 1}:0] in_i,",
            f"  output logic [{32 * self.out_words - 1}:0] out_o", ");", f"  logic [{self.bits - 1}:0] out;",
            f"  assign out_o = {32 * self.out_words}'(out);", f"  {self.module} i_dut (.clk_i, .en_i, {', '.join(ports)}, .{self.output}(out));",
            "endmodule", "",
        ])
        folder = BUILD / "lanes" / self.module
        folder.mkdir(parents=True, exist_ok=True)
        wrapper = folder / "pipeline_bench.sv"
        if not wrapper.exists() or wrapper.read_text() != text:
            wrapper.write_text(text)
        path = verilate(
            "pipeline_bench", extra=[wrapper], args=["-Wno-WIDTH", "-Wno-UNUSED"], cpp=[HERE / "pipeline_harness.cpp"],
            cflags=f"-DIN_WORDS={self.in_words} -DOUT_WORDS={self.out_words}", shared=True, name=f"bench_{self.module}",
        )
        return ctypes.CDLL(str(path))

    def __call__(self, elements: np.ndarray, stall: float = 0.3) -> np.ndarray:
        """uint64 (n, words) of elements, uint64 (n, words), lowest first. stall: share of the cycles without enable."""
        n = len(elements)
        words = np.ascontiguousarray(elements).view(np.uint32)
        padded = np.zeros((n, self.in_words), np.uint32)
        padded[:, : min(words.shape[1], self.in_words)] = words[:, : self.in_words]
        out = np.zeros((n, self.out_words), np.uint32)
        enable = (np.random.default_rng(seed()).random(4093) >= stall).astype(np.uint8)
        enable[0] = 1
        p = lambda a: ctypes.c_void_p(a.ctypes.data)  # noqa: E731
        self._library.run(ctypes.c_int64(n), self.latency, p(padded), p(out), p(enable), ctypes.c_int64(len(enable)), ctypes.c_uint64(seed()))
        full = np.zeros((n, 2 * -(-self.out_words // 2)), np.uint32)
        full[:, : self.out_words] = out
        return full.view(np.uint64)


def pack_splat(fields: dict[str, np.ndarray]) -> np.ndarray:
    """uint64 (n, 2): lane_splat_t of integers (n,)."""
    words = np.zeros((len(fields["w"]), 2), np.uint64)
    low = 0
    for name, (bits, _) in reversed(SPLAT.items()):
        value = fields[name].astype(np.int64).view(np.uint64) & np.uint64((1 << bits) - 1)
        word, shift = divmod(low, 64)
        words[:, word] |= value << np.uint64(shift)
        if shift + bits > 64:
            words[:, word + 1] |= value >> np.uint64(64 - shift)
        low += bits
    return words


def unpack_splat(words: np.ndarray) -> dict[str, np.ndarray]:
    """The fields of lane_splat_t, int64 (n,)."""
    fields, low = {}, 0
    for name, (bits, signed) in reversed(SPLAT.items()):
        word, shift = divmod(low, 64)
        value = words[:, word] >> np.uint64(shift)
        if shift + bits > 64:
            value = value | words[:, word + 1] << np.uint64(64 - shift)
        number = (value & np.uint64((1 << bits) - 1)).view(np.int64)
        fields[name] = number - ((number >> (bits - 1)) << bits) if signed else number
        low += bits
    return fields
