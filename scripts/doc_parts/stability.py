"""`make docs PART=stability`: where chosen configurations break, in docs/results/stability.md; `PART=stability_front`: where front ends do, there and in
docs/results/front_end.md; `PART=stability_moving`: what flickers at which speed."""

from __future__ import annotations

from flicker.explore.stability.front_ends import FRONT_ENDS
from flicker.explore.stability.moving import moving_table, run_moving
from flicker.explore.stability.run import run_stability
from flicker.explore.stability.write import FRONT_TABLES, LINES, markdown_table

from .common import Say

SEED = 1


def tables(say: Say) -> dict[str, str]:
    result = run_stability(names=LINES, seed=SEED, progress=lambda done, total: say(f"case {done} of {total}"))
    return {"": markdown_table(result)}


def front_tables(say: Say) -> dict[str, str]:
    result = run_stability(names=list(FRONT_ENDS), seed=SEED, progress=lambda done, total: say(f"case {done} of {total}"))
    return {place: made(result) for place, made in FRONT_TABLES.items()}


def moving_tables(say: Say) -> dict[str, str]:
    return {"": moving_table(run_moving(seed=SEED, progress=lambda done, total: say(f"sequence {done} of {total}")))}
