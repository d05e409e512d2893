#!/usr/bin/env python3
"""Tables of docs/methods.md: picture quality and work of methods on real views.

    FLICKER_SCENES=folder scripts/methods_table.py [--size WxH] [--methods NAME ...] [--scenes NAME ...]
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from flicker.explore.methods import View, get_method, run

from flicker.cli.options import parse_size
from flicker.errors import FlickerError
from flicker.front.projection import project
from flicker.front.reference import render_reference
from flicker.golden.masked import missed_pixels
from flicker.perf.work import SPLITS
from flicker.scene.camera import load_cameras
from flicker.scene.files import load_scene
from flicker.scene.metrics import psnr

REAL = {
    "flowers": ("flowers.compressed.ply", 0), "playbot": ("playbot.sog", 1), "guitar": ("guitar.ply", 1), "stpeter": ("st-peter.sog", 0),
}
METHODS = (
    "vanilla", "no-ctu-32", "gscore", "seele", "faithful", "flicker", "flicker-dense-fp16-factored",
    "exact-fp16", "exact-fp16-bound", "exact-e5m6", "exact-e5m6-bound", "exact-e4m4",
    "exact-e5m3", "exact-e4m3", "exact-e4m3-scaled", "exact-e4m3-bound", "exact-e5m2",
    "exact-q8.8", "exact-fp16-conic", "exact-fp16-conic-bound", "exact-e4m3-conic", "rows-minitile", "rows-f6a6",
    "rows-f7a5", "rows-f8a6", "rows", "rows-ellipse", "rows-ellipse-acc14", "rows-f10a10", "pixels", "oracle",
)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--methods", nargs="+", default=METHODS)
    parser.add_argument("--scenes", nargs="+", default=list(REAL), choices=list(REAL))
    args = parser.parse_args()
    size = parse_size(args.size)
    folder = os.environ.get("FLICKER_SCENES")
    if not folder:
        raise FlickerError("FLICKER_SCENES: not set; it names the folder of the scenes")
    picked = [get_method(name) for name in args.methods]
    for name in args.scenes:
        file, number = REAL[name]
        base = Path(folder) / name
        camera = load_cameras(base / "cameras.json")[number].resized(*size)
        view = View(project(load_scene(base / file), camera), camera)
        reference = render_reference(view.projected, camera)
        print(f"\n### {name} {number}, {args.size}\n")
        print("| method | PSNR, dB | elements, k | mini-tiles sent, k | pixels visited, M | contributing, M | visited / contributing | missed |")
        print("|---|---|---|---|---|---|---|---|")
        slots = []
        for method in picked:
            result = run(method, view)
            t = result.work.totals()
            missed = "-"
            if method.lists == "subtile":
                missed = f"{int(np.bitwise_count(missed_pixels(result.lists, result.work.mask, result.work.visit, result.work.pixel_finish)).sum()):,}"
            print(
                f"| `{method.name}` | {psnr(result.image, reference):.2f} | {t['elements'] / 1e3:,.0f} | {t['minitiles_sent'] / 1e3:,.0f} | "
                f"{t['pixels_visited'] / 1e6:.2f} | {t['pixels_contributing'] / 1e6:.2f} | "
                f"{t['pixels_visited'] / max(t['pixels_contributing'], 1):.3f} | {missed} |", flush=True,
            )
            if method.pixels:
                shares = (f"{split} {result.work.vru_slots(split) / t['pixels_visited']:.3f}" for split in SPLITS)
                slots.append(f"`{method.name}` {', '.join(shares)}")
        print("\nVRU slots per visited pixel: " + "; ".join(slots) if slots else "")
        view.drop()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        print(f"methods_table: {error}", file=sys.stderr)
        sys.exit(2)
