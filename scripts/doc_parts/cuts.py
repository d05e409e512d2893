"""`make docs PART=cuts`: where the lists of lanes end, and the pixels that jump for it, in docs/results/motion.md.

A splat's Gaussian goes on beyond 3 standard deviations, where its alpha is up to 2.8/255. The float64 reference, as the INRIA code, cuts it off at squares of
whole tiles; lists of sub-tiles at boxes of 3 standard deviations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flicker.front.lists import ellipse_lists, square_lists, tile_lists
from flicker.front.paths import Asked, path_of
from flicker.front.records import SubtileLists
from flicker.front.view import View
from flicker.golden.front.blend import blend_records
from flicker.golden.lanes.lists import float_lists
from flicker.golden.lanes.render import render_lanes
from flicker.markdown import table
from flicker.params import RECOMMENDED, Form
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.report.moving import FPS
from flicker.scene.real import REAL_VIEWS
from flicker.scene.sources import Source, open_scene
from flicker.scene.temporal import Change, TemporalError, summarise

from .common import SIZE, Say, folder_of_scenes
from .lanes import unrounded
from .motion import FRAMES, figures
from .motion import SIZE as SMALL

FIRST, SQUARES, ALL = "boxes of 3 sigma on 8x8, as they are", "the reference's squares on 16x16", "all of alpha 1/255 and more"
SAME, OWN = "the last, against float64 of the same lists", "the reference, against float64 of the last"
BEYOND = 1.15  # of 3 sigma: alpha of an opaque splat is 1/255 at 3.33


def kinds(view: View) -> dict[str, SubtileLists]:
    """Lists that end in different places, each without the sub-tiles where alpha is below 1/255."""
    projected, lists = view.projected, view.lists(Form.FACTORED)
    wide = replace(projected, circle=np.ceil(BEYOND * projected.circle + 1.0))
    return {
        FIRST: ellipse_lists(lists, projected, view.camera), SQUARES: square_lists(lists, projected, view.camera),
        ALL: ellipse_lists(tile_lists(lists, wide, view.camera), projected, view.camera),
    }


def _costs(view: View) -> dict[str, tuple[int, int]]:
    """Entries of sub-tiles and cycles of the lanes' stage."""
    found = {}
    for name, lists in kinds(view).items():
        cycles = simulate_lanes(lane_work(float_lists(view.projected, lists)), RECOMMENDED, leave=True).cycles
        found[name] = len(lists.entry), cycles
    return found


def _shaken(source: Source, number: int, say: Say, title: str) -> dict[str, str]:
    """Temporal figures of a head's shake, by what is compared."""
    errors: dict[str, TemporalError] = {}
    changes: dict[str, list[Change]] = {}
    for n, camera in enumerate(path_of(source, Asked("shake", view=number, size=SMALL, frames=FRAMES, fps=FPS))[0]):
        say(f"{title}: frame {n + 1} of {FRAMES}")
        view = View(camera, source.scene)
        lists = kinds(view)
        pairs = {name: (render_lanes(float_lists(view.projected, each)).image(), view.reference) for name, each in lists.items()}
        last = lists[ALL]
        exact = blend_records(unrounded(view.projected), Form.FACTORED, last.start, last.entry, last.width, last.height)
        for name, pair in (pairs | {SAME: (pairs[ALL][0], exact), OWN: (view.reference, exact)}).items():
            changes.setdefault(name, []).append(errors.setdefault(name, TemporalError()).add(*pair))
    return {name: figures(summarise(each, FPS)) for name, each in changes.items()}


def tables(say: Say) -> dict[str, str]:
    columns: dict[str, list[str]] = {}
    more: dict[str, list[tuple[float, float]]] = {}
    for real in REAL_VIEWS:
        source = open_scene(real.path(folder_of_scenes()))
        for name, cell in _shaken(source, real.number, say, real.title).items():
            columns.setdefault(name, []).append(cell)
        say(f"{real.title}: entries and cycles")
        costs = _costs(View(source.cameras[real.number].resized(*SIZE), source.scene))
        for name, both in costs.items():
            entries, cycles = (ours / first - 1.0 for ours, first in zip(both, costs[FIRST]))
            more.setdefault(name, []).append((entries, cycles))

    def span(values: list[float]) -> str:
        return f"{min(values):+.1%} to {max(values):+.1%}" if max(values) else ""

    rows = [
        (name, *cells, *(span([pair[k] for pair in more[name]]) if name in more else "" for k in range(2))) for name, cells in columns.items()
    ]
    return {"": table(["lists of lanes", *(real.title for real in REAL_VIEWS), "entries", "cycles of the stage"], rows)}
