#!/usr/bin/env python3
"""Time every engine on one frame in one run: writes docs/speed.md.

    scripts/benchmark.py [SCENE [--cameras FILE] [--view N]] [--size WxH] [--out FILE]

Without SCENE: view 0 of flowers if FLICKER_SCENES names the folder of real scenes, else the demo scene. The RTL frame is compared with the
golden frame, pixel for pixel. Kernels are compiled before the clock starts; each figure is the best of three runs (RTL: one run).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from flicker.explore.methods import View, method_name, run

from flicker.cli.options import parse_size
from flicker.errors import FlickerError
from flicker.front.projection import project
from flicker.front.records import build_lists
from flicker.front.reference import render_reference
from flicker.golden.render import render_golden
from flicker.params import CHANNELS, CORES, NAMED_CONFIGS, CatMode
from flicker.perf.render_stage import simulate
from flicker.scene.camera import find_cameras, select_view
from flicker.scene.demo import write_demo
from flicker.scene.files import load_scene
from flicker.scene.metrics import psnr
from flicker.sim.render_stage import build, render_rtl

ROOT = Path(__file__).resolve().parents[1]


def best(function, runs: int = 3):
    """(seconds of the best run, result)."""
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - begin)
    return min(times), result


def default_scene() -> Path:
    """Flowers if it is there, else the demo scene."""
    folder = os.environ.get("FLICKER_SCENES")
    if folder:
        return Path(folder) / "flowers" / "flowers.compressed.ply"
    return write_demo(ROOT / "build" / "demo")[0]


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", type=Path)
    parser.add_argument("--cameras", type=Path)
    parser.add_argument("--view", type=int, default=0)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--out", default=str(ROOT / "docs" / "speed.md"))
    args = parser.parse_args()
    path = args.scene or default_scene()
    load_s, scene = best(lambda: load_scene(path), 1)
    camera = select_view(find_cameras(scene, args.cameras), args.view).resized(*parse_size(args.size))
    project(scene, camera)
    project_s, projected = best(lambda: project(scene, camera))
    render_reference(projected, camera)
    reference_s, reference = best(lambda: render_reference(projected, camera))
    lines = [
        "# Speed of the engines\n",
        "Written by `scripts/benchmark.py`; one run on one machine, so compare lines with each other rather than with other machines.\n",
        f"{path.name}, view {args.view}, {args.size}: {len(scene):,} Gaussians, {projected.n_visible:,} visible. "
        f"Processor cores used: {os.cpu_count()}.\n",
        "| step | seconds | relative to the reference |",
        "|---|---|---|",
        f"| load | {load_s:.2f} | |",
        f"| project | {project_s:.2f} | |",
        f"| float64 reference, with projection | {project_s + reference_s:.2f} | 1 |",
    ]
    rtl_lines = ["", "| RTL frame | cycles | VRUs busy | cycles/s simulated | pixels that differ from golden | PSNR, dB |", "|---|---|---|---|---|---|"]
    model_lines = ["", "| cycle model | cycles, and counters that differ from the RTL's | million cycles/s | times the RTL | masks, VRUs and cycles, s |",
                   "|---|---|---|---|---|"]
    for name, config in {"default": NAMED_CONFIGS["default"], "faithful": NAMED_CONFIGS["faithful"],
                         "default, test off": NAMED_CONFIGS["default"].with_(cat=CatMode.OFF)}.items():
        lists_s, lists = best(lambda: build_lists(projected, camera, config))
        render_golden(lists, config)
        golden_s, golden = best(lambda: render_golden(lists, config))
        total = project_s + lists_s + golden_s
        lines.append(f"| golden, {name}, with projection and lists | {total:.2f} | {total / (project_s + reference_s):.1f} |")
        if config.cat == CatMode.OFF:
            continue
        build(config)
        print(f"simulating the RTL, {name} ...", file=sys.stderr, flush=True)
        rtl = render_rtl(lists, config)
        wrong = int((golden.pixels != rtl.pixels).any(axis=2).sum())
        busy = rtl.channel_counter("vru_busy").sum() / (rtl.cycles * CORES * CHANNELS)
        rtl_lines.append(f"| {name} | {rtl.cycles:,} | {busy:.1%} | {rtl.cycles / rtl.seconds:,.0f} | {wrong} of {lists.cols * lists.rows * 64:,} "
                         f"| {psnr(rtl.image(), reference):.2f} |")
        method = method_name(config)
        run(method, View(projected, camera))
        run_s, result = best(lambda: run(method, View(projected, camera)))
        simulate(result.work, config)
        model_s, model = best(lambda: simulate(result.work, config), 5)
        differ = int((model.counters != rtl.counters).sum())
        model_lines.append(f"| {name} | {model.cycles:,}; {differ} of {rtl.counters.size} | {model.cycles / model_s / 1e6:.1f} "
                           f"| {model.cycles / model_s * rtl.seconds / rtl.cycles:,.0f} | {run_s + model_s:.2f} |")
    text = "\n".join(lines + rtl_lines + model_lines) + "\n"
    if args.out == "-":
        print(text)
    else:
        Path(args.out).write_text(text)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        print(f"benchmark: {error}", file=sys.stderr)
        sys.exit(2)
