#!/usr/bin/env python3
"""PSNR and mini-tiles sent for every mode, precision and form: writes docs/quality.md.

    FLICKER_SCENES=folder scripts/quality_table.py [--size WxH] [--out FILE]

Golden model against the float64 reference, one view of each scene: the demo scene, and the real ones when FLICKER_SCENES
names their folder. `--out -` prints the tables only.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from rich.progress import track

from flicker.cli.options import parse_size
from flicker.front.projection import project
from flicker.front.reference import render_reference
from flicker.params import CatMode, Coords, Form, Precision, RenderConfig
from flicker.pipeline import Engine, render_view
from flicker.scene.camera import Camera, load_cameras
from flicker.scene.demo import demo_cameras, generate
from flicker.scene.files import Scene, load_scene

ROOT = Path(__file__).resolve().parents[1]
REAL = [
    ("flowers", "flowers.compressed.ply", 0),
    ("playbot", "playbot.sog", 1),
    ("guitar", "guitar.ply", 1),
    ("stpeter", "st-peter.sog", 0),
]
TEXT = """# Picture quality of every configuration

Golden model (bit for bit what the RTL renders) against the float64 reference: PSNR of unquantised floats in dB, and mini-tiles sent
(pixel groups of 16 that the VRUs work on, in thousands). Written by `scripts/quality_table.py`; the real scenes are named in
`docs/scenes.md`.

Rows are the contribution test's mode and number formats. *Factored* and *conic* apply to the test and to the VRU alike; the row `off` therefore shows
what the VRU's FP16 alone costs. The paper's configuration (`--faithful`) is conic, mixed, smooth.

"""
NOTES = """
## Coordinates

Mean rounded to FP16 in screen coordinates (`--coords absolute`) instead of relative to the sub-tile, test off, factored form:

"""


def scenes() -> list[tuple[str, Scene, Camera]]:
    """(title, scene, camera) of every view."""
    found = [("demo 0", generate(), demo_cameras()[0])]
    folder = os.environ.get("FLICKER_SCENES")
    for name, file, view in REAL if folder else []:
        base = Path(folder) / name
        found.append((f"{name} {view}", load_scene(base / file), load_cameras(base / "cameras.json")[view]))
    return found


def cell(psnr: float | None, stats: dict) -> str:
    """One table cell: PSNR and mini-tiles sent."""
    return f"{'equal' if psnr is None else f'{psnr:.1f}'} / {stats['minitiles_sent'] / 1000:,.0f}"


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--out", default=str(ROOT / "docs" / "quality.md"))
    args = parser.parse_args()
    size = parse_size(args.size)
    rows = [(cat, p) for p in Precision for cat in CatMode if cat != CatMode.OFF]
    rows = [(CatMode.OFF, Precision.FP16)] + rows
    tables: dict[Form, dict] = {f: {r: [] for r in rows} for f in Form}
    titles, absolute = [], []
    for title, scene, camera in scenes():
        camera = camera.resized(*size)
        projected = project(scene, camera)
        reference = render_reference(projected, camera)
        titles.append(title)

        def run(config: RenderConfig) -> str:
            r = render_view(scene, camera, engine=Engine.GOLDEN, config=config, compare=True, projected=projected, reference=reference)
            return cell(r.stats["psnr_db"], r.stats)

        for form in track(list(Form), description=title, transient=True):
            for cat, precision in rows:
                tables[form][cat, precision].append(run(RenderConfig(form=form, precision=precision, cat=cat)))
        absolute.append(run(RenderConfig(cat=CatMode.OFF, coords=Coords.ABSOLUTE)))
    lines = [TEXT, f"Size {args.size}. Cells: PSNR in dB / thousands of mini-tiles sent.\n"]
    for form in (Form.FACTORED, Form.CONIC):
        lines += [f"\n## {form.name.capitalize()} form\n", "| test | formats | " + " | ".join(titles) + " |", "|---|---|" + "---|" * len(titles)]
        for (cat, precision), cells in tables[form].items():
            formats = "-" if cat == CatMode.OFF else precision.name.lower()
            lines.append(f"| {cat.name.lower()} | {formats} | " + " | ".join(cells) + " |")
    lines += [NOTES + "| | " + " | ".join(titles) + " |", "|---|" + "---|" * len(titles), "| absolute | " + " | ".join(absolute) + " |"]
    text = "\n".join(lines) + "\n"
    if args.out == "-":
        print(text)
    else:
        Path(args.out).write_text(text)
    return 0


if __name__ == "__main__":
    np.seterr(all="ignore")
    sys.exit(main())
