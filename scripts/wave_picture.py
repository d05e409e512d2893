#!/usr/bin/env python3
"""Draws traces of real simulations: docs/images/waveform.png, docs/images/stream.png.

waveform.png is a FIFO as ``make waves UNIT=stream_cells`` opens it in GTKWave: the signals of tb/waves/fifo.gtkw. stream.png shows the
stream contract on both sides of a skid buffer. Both are from the unit tests of the stream cells with seed 1, which this script runs; the
part of a trace that is drawn is the first that shows what it should (``Window``).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib

from flicker.errors import FlickerError
from flicker.toolchain import BUILD, ROOT

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

PERIOD = 10_000  # ps, of the testbench's clock
TRACES = BUILD / "waves" / "stream_cells"


class Trace:
    """A VCD file: ``trace[name]`` with the full name without range, as (times, values); ``widths[name]`` in bits."""

    def __init__(self, path: Path) -> None:
        self.widths: dict[str, int] = {}
        codes: dict[str, str] = {}
        changes: dict[str, tuple[list[int], list[int]]] = {}
        scopes: list[str] = []
        time = 0
        with path.open() as lines:
            for line in lines:
                words = line.split()
                if line[0] == "#":
                    time = int(line[1:])
                elif line[0] in "01":
                    self._change(changes, line[1:].strip(), time, int(line[0]))
                elif line[0] == "b":
                    self._change(changes, words[1], time, int(words[0][1:], 2))
                elif words[:1] == ["$scope"]:
                    scopes.append(words[2])
                elif words[:1] == ["$upscope"]:
                    scopes.pop()
                elif words[:1] == ["$var"]:
                    name = ".".join([*scopes, words[4]])
                    codes[name], self.widths[name] = words[3], int(words[2])
                    changes.setdefault(words[3], ([], []))
        self.end = time
        self._signals = {name: changes[code] for name, code in codes.items()}

    @staticmethod
    def _change(changes: dict[str, tuple[list[int], list[int]]], code: str, time: int, value: int) -> None:
        times, values = changes[code]
        times.append(time)
        values.append(value)

    def __contains__(self, name: str) -> bool:
        return name in self._signals

    def __getitem__(self, name: str) -> tuple[list[int], list[int]]:
        return self._signals[name]

    def at(self, name: str, time: int) -> int:
        """Value after the changes of a time."""
        times, values = self._signals[name]
        return values[bisect_right(times, time) - 1]


@dataclass
class Window:
    """``cycles`` clock cycles, the first for which ``good(trace, edges)`` holds; edges are the times of the rising edges that end them."""

    cycles: int
    good: Callable[[Trace, list[int]], bool]

    def edges(self, trace: Trace) -> list[int]:
        first = 20 * PERIOD  # after reset
        for start in range(first, trace.end - self.cycles * PERIOD, PERIOD):
            edges = [start + (k + 1) * PERIOD for k in range(self.cycles)]
            if self.good(trace, edges):
                return edges
        raise FlickerError("wave_picture: no part of the trace shows what it should")


def sampled(trace: Trace, name: str, edges: list[int]) -> list[int]:
    """What registers see at rising edges: values just before them."""
    return [trace.at(name, edge - 1) for edge in edges]


def states(trace: Trace, top: str, side: str, edges: list[int]) -> list[str]:
    """Per cycle of a stream: transfer, stall, idle."""
    valid, ready = (("in_valid_i", "in_ready_o") if side == "in" else ("out_valid_o", "out_ready_i"))
    pairs = zip(sampled(trace, f"{top}.{valid}", edges), sampled(trace, f"{top}.{ready}", edges), strict=True)
    return ["transfer" if v and r else "stall" if v else "idle" for v, r in pairs]


def draw(trace: Trace, rows: list[str], edges: list[int], path: Path, *, dark: bool, top: str, marks: dict[str, str] | None = None) -> None:
    """A picture of signals. ``marks``: rows under which the transfers (green) and stalls (red) of a stream are shaded, with its side."""
    ground, ink, line, faint = ("black", "white", "#00ff00", "#303060") if dark else ("white", "black", "#1f3f7f", "#d0d0d0")
    begin, end = edges[0] - PERIOD, edges[-1]
    plt.rcParams["font.family"] = "DejaVu Sans Mono"
    figure, axes = plt.subplots(figsize=(11, 0.3 * len(rows) + 0.55), facecolor="#e8e8e8" if dark else "white")
    axes.set_facecolor(ground)
    for edge in [begin, *edges]:
        axes.axvline(edge, color=faint, linewidth=0.7, zorder=0)
    for number, name in enumerate(rows):
        low, high = -number - 0.38, -number + 0.3
        full = f"{top}.{name}"
        if marks and name in marks:
            for edge, state in zip(edges, states(trace, top, marks[name], edges), strict=True):
                if state != "idle":
                    colour = "#c8ebc8" if state == "transfer" else "#f6cccc"
                    bottom, above = ((y + len(rows) - 0.4) / len(rows) for y in (low, high + 2.2))
                    axes.axvspan(edge - PERIOD, edge, bottom, above, color=colour, zorder=0, lw=0)
        times = [begin, *(t for t in trace[full][0] if begin < t < end)]
        values = [trace.at(full, t) for t in times]
        ends = [*times[1:], end]
        if trace.widths[full] == 1:
            level = [high if value else low for value in values]
            axes.step([*times, end], [*level, level[-1]], where="post", color=line, linewidth=1.3)
            continue
        slope = PERIOD / 14
        for start, stop, value in zip(times, ends, values, strict=True):
            left, right = (start if start == begin else start + slope), (stop if stop == end else stop - slope)
            middle = (low + high) / 2
            axes.plot([start, left, right, stop], [middle if start > begin else high, high, high, middle if stop < end else high], color=line, linewidth=1.1)
            axes.plot([start, left, right, stop], [middle if start > begin else low, low, low, middle if stop < end else low], color=line, linewidth=1.1)
            digits = f"{value:0{(trace.widths[full] + 3) // 4}x}"
            if stop - start > PERIOD * 0.11 * len(digits) + 2 * slope:
                axes.text((start + stop) / 2, middle, digits, ha="center", va="center", fontsize=7.5, color=ink)
    axes.set_xlim(begin, end)
    axes.set_ylim(-len(rows) + 0.4, 0.5)
    labels = [f"{name}[{trace.widths[f'{top}.{name}'] - 1}:0]" if trace.widths[f"{top}.{name}"] > 1 else name for name in rows]
    axes.set_yticks([-n for n in range(len(rows))], labels, fontsize=8)
    axes.tick_params(length=0)
    axes.xaxis.tick_top()
    axes.set_xticks(edges[::2], [f"{edge // 1000} ns" for edge in edges[::2]], fontsize=7)
    for spine in axes.spines.values():
        spine.set_visible(False)
    figure.tight_layout(pad=0.5)
    figure.savefig(path, dpi=100, metadata={"Software": None})
    plt.close(figure)
    print(f"{path.relative_to(ROOT)}: {top}, {begin // 1000} to {end // 1000} ns")


def view_rows(view: Path, trace: Trace, top: str) -> list[str]:
    """Signals of a GTKWave view that the trace has, without the top's name and ranges."""
    names = (line.split("[")[0] if line.endswith(":0]") and line.count("[") == 1 else line for line in view.read_text().splitlines())
    rows = [name.removeprefix(f"{top}.").removesuffix("[7:0]") for name in names if name.startswith(f"{top}.")]
    return [row for row in rows if f"{top}.{row}" in trace]


def waveform() -> None:
    trace_path = TRACES / "fifo" / "test_fifo_8-3-seed1.vcd"
    trace, top = Trace(trace_path), "flk_fifo"

    def good(trace: Trace, edges: list[int]) -> bool:
        usage = sampled(trace, f"{top}.usage_o", edges)
        quiet = 0 not in sampled(trace, f"{top}.rst_ni", edges)
        return quiet and {0, 1, 2, 3} <= set(usage) and all(set(states(trace, top, side, edges)) >= {"stall", "idle"} for side in ("in", "out"))

    draw(trace, view_rows(trace_path.with_suffix(".gtkw"), trace, top), Window(24, good).edges(trace), ROOT / "docs/images/waveform.png", dark=True, top=top)


def stream() -> None:
    trace, top = Trace(TRACES / "skid_buffer" / "test_skid_buffer_8-seed1.vcd"), "flk_skid_buffer"

    def good(trace: Trace, edges: list[int]) -> bool:
        sides = [states(trace, top, side, edges) for side in ("in", "out")]
        held = any(states(trace, top, "out", edges)[k : k + 3] == ["stall", "stall", "transfer"] for k in range(len(edges)))
        return held and all(side.count("transfer") >= 5 and "stall" in side and "idle" in side[2:-2] for side in sides)

    rows = ["clk_i", "in_valid_i", "in_ready_o", "in_data_i", "out_valid_o", "out_ready_i", "out_data_o"]
    draw(trace, rows, Window(14, good).edges(trace), ROOT / "docs/images/stream.png", dark=False, top=top, marks={"in_data_i": "in", "out_data_o": "out"})


def main() -> int:
    argparse.ArgumentParser(description=__doc__).parse_args()
    environment = {**os.environ, "WAVES": "1", "WAVES_FORMAT": "vcd", "FLICKER_SEED": "1"}
    chosen = "test_fifo[8-3] or test_skid_buffer[8]"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--unit", "stream_cells", "-k", chosen, "tb"], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True
    )
    if done.returncode:
        raise FlickerError(f"the simulation failed:\n{done.stdout}")
    waveform()
    stream()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"wave_picture: {error}")
