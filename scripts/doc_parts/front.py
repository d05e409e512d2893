"""`make docs PART=front`: what the bit-true front end does to pictures of the demo scene and the real ones, and its number formats, in
docs/results/front_end.md."""

from __future__ import annotations

from flicker.cost.area import parts
from flicker.golden.front.frame import run_front
from flicker.golden.front.setup import FORMATS, FrontFormats
from flicker.golden.render import render_golden
from flicker.markdown import table
from flicker.params import CatMode, RenderConfig
from flicker.pipeline import packed_scene
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat

from .common import Say, titled_views
from .front_widths import Widths, blended, decibel, opacity_table

# The default, one number of mantissa bits changed at a time, and all of them wider.
TRIED = [FORMATS, *(FrontFormats(position=b) for b in (15, 17, 21, 23)), *(FrontFormats(shape=b) for b in (10, 13, 15, 19)),
         *(FrontFormats(colour=b) for b in (10, 13, 15)), FrontFormats(21, 13, 13)]


def _cells() -> str:
    """GE of the operators on ff numbers, as synthesised."""
    names = ("add", "mul", "recip", "rsqrt", "sqrt", "exp2")
    found: dict[tuple[str, str], float] = {(unit, config.split(",")[0]): part.ge for (unit, config), part in parts().items()}
    rows = [(bits, *(f"{found[f'ff_{name}', bits]:,.0f}" for name in names)) for bits in ("11 bit", "15 bit", "19 bit", "23 bit")]
    return table(["mantissa", *names], rows)


def tables(say: Say) -> dict[str, str]:
    pictures: list[tuple[str, ...]] = []
    outcomes: list[tuple[str, ...]] = []
    formats: dict[FrontFormats, list[str]] = {tried: [] for tried in TRIED}
    widths = Widths()
    titles: list[str] = []
    kinds: list[str] = []
    for title, view in titled_views(say):
        titles.append(title)
        for form in PackedFormat:
            say(f"{title}: {form.value}")
            packed = packed_scene(view, form)
            frame = run_front(packed, view.camera)
            golden = render_golden(frame.subtile_lists(), RenderConfig(cat=CatMode.OFF)).image(view.background)
            default = render_golden(frame.subtile_lists(), RenderConfig()).image(view.background)
            pictures.append((title, form.value, *(decibel(psnr(image, view.reference)) for image in (blended(frame, frame.splats()), golden, default))))
            if form is PackedFormat.CHUNK:
                outcomes.append((title, f"{len(packed):,}", *(f"{n:,}" for n in frame.outcomes.values()), f"{len(frame.entry_tile):,}",
                                 f"{frame.adjusted.get('colour above 2 clipped', 0):,}"))
                kinds = list(frame.outcomes)
            if form is PackedFormat.FP16_LOCAL:
                for tried in TRIED:
                    say(f"{title}: {tried}")
                    other = run_front(packed, view.camera, formats=tried)
                    formats[tried].append(decibel(psnr(blended(other, other.splats()), view.reference)))
            widths.add(title, view, packed, say)
    rows = [(str(f.position), str(f.shape), str(f.colour), *db) for f, db in formats.items()]
    return {
        "pictures": table(["view", "format", "records in float64", "golden stage, test off", "golden stage, default"], pictures),
        "outcomes": table(["view", "Gaussians", *kinds, "list entries", "colours clipped"], outcomes),
        "formats": table(["position", "shape", "colour", *titles], rows),
        "cells": _cells(),
        "fixed": widths.table(say),
        "opacity": opacity_table(say),
    }
