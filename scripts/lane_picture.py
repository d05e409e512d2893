#!/usr/bin/env python3
"""Draws docs/images/lanes.png: a splat in the log domain, step by step, with the numbers of the golden model (docs/reference/lanes.md).

    scripts/lane_picture.py [FILE]

`make docs PART=lanes` draws it too.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from flicker.front.view import View
from flicker.golden.lanes import mask, setup
from flicker.golden.lanes.formats import FORMATS, h_of
from flicker.golden.lanes.formats import tables as lane_tables
from flicker.golden.lanes.lane import BLENDED, log_alpha, pair
from flicker.golden.lanes.lists import float_lists
from flicker.params import ALPHA_MIN, SUBTILE, Form
from flicker.perf.lanes import pixels_of_lanes
from flicker.report.figures import COLOURS, STYLE
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.toolchain import ROOT

PICTURE = ROOT / "docs" / "images" / "lanes.png"
T = lane_tables(FORMATS)
LANES = 8  # of a core


def splat() -> setup.SplatSetup:
    """One slanted splat, seen from the sub-tile that the picture consists of."""
    camera = Camera(SUBTILE, SUBTILE, 8.0, 8.0, np.zeros(3), np.eye(3))
    turn = np.pi / 6
    scene = Scene(
        means=np.array([[-0.05, 0.08, 1.0]]), scales=np.array([[0.34, 0.09, 0.09]]), quats=np.array([[np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)]]),
        opacities=np.array([0.8]), sh=np.zeros((1, 1, 3)),
    )
    view = View(camera, scene)
    lists = float_lists(view.projected, view.lists(Form.FACTORED, "ellipse"))
    return setup.splat_setup(*map(int, lists.records[0]), 0, 0, T)


def la_of(s: setup.SplatSetup) -> np.ndarray:
    """int64 (rows, columns): La of every pixel, in the mask or not."""
    return np.array([[log_alpha(setup.u_of(s, i, j, T), setup.v_of(s, j, T), s.lo, T) for i in range(SUBTILE)] for j in range(SUBTILE)])


def mask_of(s: setup.SplatSetup) -> np.ndarray:
    """bool (rows, columns): the row mask."""
    bits, out = mask.row_mask(s, T), np.zeros((SUBTILE, SUBTILE), bool)
    for bit in range(SUBTILE * SUBTILE):
        column, row = mask.place_of(bit)
        out[row, column] = bits >> bit & 1
    return out


def _grid(axes, title: str) -> None:
    axes.set(title=title, xticks=range(SUBTILE), yticks=range(SUBTILE), xlim=(-0.5, SUBTILE - 0.5), ylim=(SUBTILE - 0.5, -0.5))
    axes.tick_params(length=0)


def draw_splat(axes) -> None:
    s = splat()
    la, visited = la_of(s) / 2.0**FORMATS.log, mask_of(s)
    axes.imshow(np.where(visited, 2.0**-la, np.nan), cmap="Blues", vmin=0, vmax=1)
    for j in range(SUBTILE):
        for i in range(SUBTILE):
            if visited[j, i]:
                axes.text(i, j, f"{la[j, i]:.1f}", ha="center", va="center", fontsize=6, color="white" if la[j, i] < 1.2 else "black")
        row = np.flatnonzero(visited[j])
        if len(row):
            left, right = row[0] - 0.5, row[-1] + 0.5
            axes.plot([left, right, right, left, left], [j - 0.5, j - 0.5, j + 0.5, j + 0.5, j - 0.5], color="black", linewidth=0.6)
    _grid(axes, "1. One sum: La = u² + v² - log o.\nRow intervals say which pixels are visited")


def draw_curves(axes) -> None:
    x = np.linspace(0.02, 8.3, 400)
    axes.plot(x, 2.0**-x, color=COLOURS[0], label="alpha = 2^-La")
    axes.plot(x, h_of(x), color=COLOURS[1], label="h(La) = -log(1 - alpha)")
    limit, clamp = T.limit / 2.0**FORMATS.log, T.x_max / 2.0**FORMATS.sum
    axes.axvspan(limit, x[-1], color=COLOURS[7], alpha=0.2)
    axes.axvline(clamp, color=COLOURS[7], linewidth=0.8)
    axes.annotate("alpha = 0.99", (clamp, 1.5), fontsize=6, xytext=(4, 0), textcoords="offset points")
    axes.annotate("alpha < 1/255: skipped", (limit, 1e-2), fontsize=6, xytext=(-62, 46), textcoords="offset points")
    axes.set(title="2. One function of it: what a layer\ntakes from the light, as a logarithm", xlabel="La", yscale="log", ylim=(ALPHA_MIN / 1.5, 8))
    axes.legend(fontsize=6, loc="lower left")


def draw_sums(axes) -> None:
    """S of a pixel under layers of several opacities, until it is finished."""
    layers = [0.30, 0.55, 0.12, 0.80, 0.35, 0.65, 0.90, 0.75, 0.60, 0.95, 0.97, 0.98]
    total, sums, ends = 0, [0.0], None
    for alpha in layers:
        done = pair(round(-np.log2(alpha) * 2**FORMATS.log), total, T)
        if done.outcome != BLENDED:
            ends = len(sums) - 1
            break
        total = done.s_next
        sums.append(total / 2.0**FORMATS.sum)
    axes.step(range(len(sums)), sums, where="post", color=COLOURS[2])
    axes.axhline(T.s_max / 2.0**FORMATS.sum, color=COLOURS[3], linewidth=0.8)
    axes.text(0, T.s_max / 2.0**FORMATS.sum + 0.2, "T = 1e-4: the pixel is finished", fontsize=6, color=COLOURS[3])
    for n, value in enumerate(sums[:7]):
        axes.annotate(f"T = {2.0**-value:.2f}", (n, value), fontsize=6, xytext=(-2, 3), textcoords="offset points", ha="right")
    axes.set(title="3. One addition per layer: S = -log T.\nWeight of a layer: 2^-(La + S)", xlabel="layers, near to far", ylabel="S",
             xlim=(-1.2, len(sums)), ylim=(-0.5, 15))
    if ends is not None:
        axes.plot([ends], [sums[ends]], "x", color=COLOURS[3])


def draw_lanes(axes) -> None:
    owner, bits = np.zeros((SUBTILE, SUBTILE), int), pixels_of_lanes(LANES)
    for lane, pixels in enumerate(bits):
        for bit in pixels:
            column, row = mask.place_of(int(bit))
            owner[row, column] = lane
    visited = mask_of(splat())
    axes.imshow(owner, cmap="tab10", vmin=0, vmax=9, alpha=np.where(visited, 0.75, 0.12))
    for j in range(SUBTILE):
        for i in range(SUBTILE):
            axes.text(i, j, str(owner[j, i]), ha="center", va="center", fontsize=6)
    counts = np.bincount(owner[visited], minlength=LANES)
    _grid(axes, f"4. Eight lanes share the pixels: this splat\ntakes them {', '.join(map(str, counts))} cycles")


def draw(path: Path = PICTURE) -> str:
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(2, 2, figsize=(7.4, 7.2), layout="constrained")
        for axes, panel in zip(grid.flat, (draw_splat, draw_curves, draw_sums, draw_lanes), strict=True):
            panel(axes)
        figure.savefig(path, dpi=110, metadata={"Software": None})
        plt.close(figure)
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


if __name__ == "__main__":
    print(draw(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else PICTURE))
