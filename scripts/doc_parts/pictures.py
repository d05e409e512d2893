"""`make docs PART=pictures`: picture, work and misses of mask generators on the real views, in docs/results/mask_generators.md."""

from __future__ import annotations

import numpy as np

from flicker import markdown
from flicker.explore.configurations import get_configuration, group, run
from flicker.golden.masked import missed_pixels
from flicker.perf.work import SPLITS
from flicker.scene.metrics import psnr
from flicker.scene.real import REAL_VIEWS

from .common import Say, load


def tables(say: Say) -> dict[str, str]:
    """`work`: PSNR, elements, mini-tiles, pixels, misses. `slots`: VRU slots per visited pixel by how pixels are split between a channel's VRUs."""
    names = group("pictures")
    cells: dict[str, list[str]] = {name: [] for name in names}
    slots: dict[str, list[str]] = {name: [] for name in names if get_configuration(name).generator.pixels}
    for real in REAL_VIEWS:
        view = load(real)
        for name in names:
            say(f"{real.title}: {name}")
            configuration = get_configuration(name)
            result = run(configuration, view)
            total = result.work.totals()
            missed = 0
            if configuration.lists == "subtile":
                masks = missed_pixels(result.lists, result.work.mask, result.work.visit, result.work.pixel_finish)
                missed = int(np.bitwise_count(masks).sum())
            cells[name].append(
                f"{psnr(result.image, view.reference):.1f} / {total['elements'] / 1e3:,.0f} / {total['minitiles_sent'] / 1e3:,.0f} / "
                f"{total['pixels_visited'] / 1e6:.1f}" + (f" / **{missed:,}**" if missed else "")
            )
            if name in slots:
                slots[name].append(" / ".join(f"{result.work.vru_slots(split) / total['pixels_visited']:.2f}" for split in SPLITS))
    titles = [view.title for view in REAL_VIEWS]
    heads = ["configuration", *titles]
    split = f"Slots per visited pixel with the pixels of a mini-tile split by {', '.join(SPLITS)}:"
    return {
        "work": markdown.table(heads, [[f"`{name}`", *row] for name, row in cells.items()]),
        "slots": f"{split}\n\n{markdown.table(heads, [[f'`{name}`', *row] for name, row in slots.items()])}",
    }
