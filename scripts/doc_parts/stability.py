"""`make docs PART=stability`: where chosen configurations break, in docs/stability.md."""

from __future__ import annotations

from flicker.explore.stability.run import run_stability
from flicker.explore.stability.write import LINES, markdown_table

from .common import Say

SEED = 1


def tables(say: Say) -> dict[str, str]:
    result = run_stability(names=LINES, seed=SEED, progress=lambda done, total: say(f"case {done} of {total}"))
    return {"": markdown_table(result)}
