#!/usr/bin/env python3
"""Time every engine on one frame in one run, and print tables; `make docs PART=speed` puts them into docs/results/speed.md.

    scripts/benchmark.py [SCENE [--cameras FILE] [--view N]] [--size WxH]

Without SCENE: view 0 of flowers if FLICKER_SCENES names the folder of real scenes, else the demo scene. The RTL frame is compared with the
golden frame, pixel for pixel. Kernels are compiled before the clock starts; each figure is the best of three runs (RTL: one run).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from flicker import markdown
from flicker.cli.options import parse_size
from flicker.errors import FlickerError
from flicker.explore.configurations import rtl_configuration, run
from flicker.front.projection import project
from flicker.front.records import SubtileLists, build_lists
from flicker.front.reference import render_reference
from flicker.front.view import DEMO, View, load_view
from flicker.golden.front.frame import run_front
from flicker.golden.lanes.lists import RecordLists, float_lists
from flicker.golden.lanes.render import LaneFrame, render_lanes
from flicker.golden.render import Frame, render_golden
from flicker.params import CHANNELS, CORES, LANE_COUNTS, NAMED_CONFIGS, CatMode, Form, RenderConfig
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat
from flicker.scene.packing import pack_file
from flicker.scene.real import REAL_VIEWS, real_scenes
from flicker.sim.render_stage import build, render_rtl

T = TypeVar("T")
LISTS = {"channels": "subtile", "lanes": "ellipse"}  # by stage: 3-sigma boxes, or the ellipse as in the front end


def best(function: Callable[[], T], runs: int = 3) -> tuple[float, T]:
    """(seconds of the best run, result)."""
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - begin)
    return min(times), result


def default_scene() -> str:
    """Flowers if it is there, else the demo scene."""
    folder = real_scenes()
    return str(REAL_VIEWS[0].path(folder)) if folder else DEMO


def lists_of(view: View, config: RenderConfig) -> SubtileLists | RecordLists:
    """What a build takes: splats, or raw records for lanes."""
    if config.by_lanes:
        return float_lists(view.projected, View(view.camera, projected=view.projected).lists(Form.FACTORED, LISTS[config.stage]))
    return build_lists(view.projected, view.camera, config)


def golden(lists: SubtileLists | RecordLists, config: RenderConfig) -> Frame | LaneFrame:
    """The golden frame of such lists."""
    return render_lanes(lists) if isinstance(lists, RecordLists) else render_golden(lists, config)


def tables(scene: str, number: int, size: tuple[int, int], cameras: Path | None, say: Callable[[str], None]) -> dict[str, str]:
    """`engines`: steps and golden frames, with a line on the scene. `rtl`: simulated frames. `model`: the cycle model."""
    name = Path(scene).name
    say(f"{name}: load, project, reference")
    load_s, view = best(lambda: load_view(scene, number, size, cameras), 1)
    camera = view.camera
    assert view.scene is not None
    project(view.scene, camera)
    project_s, projected = best(lambda: project(view.scene, camera))
    render_reference(projected, camera)
    reference_s, reference = best(lambda: render_reference(projected, camera))
    base = project_s + reference_s
    steps = [["load", f"{load_s:.2f}", ""], ["project", f"{project_s:.2f}", ""], ["float64 reference, with projection", f"{base:.2f}", "1"]]
    say(f"{name}: packing, bit-true front end")
    for form in (PackedFormat.CHUNK, PackedFormat.FP16_LOCAL) if scene != DEMO else ():
        pack_file(scene, form)
        pack_s, packing = best(lambda: pack_file(scene, form))
        run_front(packing.packed, camera)
        front_s, _ = best(lambda: run_front(packing.packed, camera))
        steps += [[f"pack, {form.value}, with loading", f"{pack_s:.2f}", ""], [f"bit-true front end, {form.value}", f"{front_s:.2f}", ""]]
    rtl_rows, model_rows = [], []
    for title, config in {
        "default": NAMED_CONFIGS["default"], "faithful": NAMED_CONFIGS["faithful"], "default, test off": NAMED_CONFIGS["default"].with_(cat=CatMode.OFF),
        "32 lanes": RenderConfig(stage="lanes"), "64 lanes": RenderConfig(stage="lanes", lanes=64),
    }.items():
        say(f"{name}: golden, {title}")
        lists_s, lists = best(lambda: lists_of(view, config))
        golden(lists, config)
        golden_s, frame = best(lambda: golden(lists, config))
        if config.lanes == LANE_COUNTS[0]:  # the golden frame does not depend on their number
            total = project_s + lists_s + golden_s
            steps.append([f"golden, {title.removeprefix('32 ')}, with projection and lists", f"{total:.2f}", f"{total / base:.1f}"])
        if config.cat == CatMode.OFF:
            continue
        say(f"{name}: building the simulator, {title}")
        build(config)
        say(f"{name}: simulating the RTL, {title}")
        rtl = render_rtl(lists, config, leave=config.by_lanes, empty=not config.by_lanes)
        wrong = int((frame.pixels != rtl.pixels).any(axis=2).sum())
        if config.by_lanes:
            busy = rtl.core_counter("visits").sum() / (rtl.cycles * config.lanes)
        else:
            busy = rtl.channel_counter("vru_busy").sum() / (rtl.cycles * CORES * CHANNELS)
        rtl_rows.append([
            title, f"{rtl.cycles:,}", f"{busy:.1%}", f"{rtl.cycles / rtl.seconds:,.0f}", f"{wrong} of {lists.cols * lists.rows * 64:,}",
            f"{psnr(rtl.image(), reference):.2f}",
        ])
        say(f"{name}: cycle model, {title}")
        configuration = replace(rtl_configuration(config), lists=LISTS[config.stage])
        run(configuration, View(camera, projected=projected))
        run_s, result = best(lambda: run(configuration, View(camera, projected=projected)))
        if isinstance(lists, RecordLists):  # the work of a configuration does not tell `skipped` of finished pixels
            own = lane_work(lists)
            model_s, model = best(lambda: simulate_lanes(own, config, leave=True, empty=False), 5)
        else:
            configuration.simulate(result.work)
            model_s, (_, model) = best(lambda: configuration.simulate(result.work), 5)
        differ = int((model.counters != rtl.counters).sum())
        model_rows.append([
            title, f"{model.cycles:,}; {differ} of {rtl.counters.size}", f"{model.cycles / model_s / 1e6:.1f}",
            f"{model.cycles / model_s * rtl.seconds / rtl.cycles:,.0f}", f"{run_s + model_s:.2f}",
        ])
    about = (
        f"{name}, view {number}, {size[0]}x{size[1]}: {len(view.scene):,} Gaussians, {projected.n_visible:,} visible. Processor cores used: {os.cpu_count()}."
    )
    return {
        "engines": f"{about}\n\n{markdown.table(['step', 'seconds', 'relative to the reference'], steps)}",
        "rtl": markdown.table(["RTL frame", "cycles", "VRUs or lanes busy", "cycles/s simulated", "pixels that differ from golden", "PSNR, dB"], rtl_rows),
        "model": markdown.table(
            ["cycle model", "cycles; counters unlike the RTL's", "million cycles/s", "times the RTL", "masks, pictures and cycles, s"], model_rows,
        ),
    }


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?")
    parser.add_argument("--cameras", type=Path)
    parser.add_argument("--view", type=int, default=0)
    parser.add_argument("--size", default="1280x720")
    args = parser.parse_args()
    found = tables(args.scene or default_scene(), args.view, parse_size(args.size), args.cameras, lambda text: print(text, file=sys.stderr, flush=True))
    print("\n\n".join(found.values()))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        print(f"benchmark: {error}", file=sys.stderr)
        sys.exit(2)
