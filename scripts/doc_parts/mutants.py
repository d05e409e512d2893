"""Who kills the mutants of the hardware: docs/results/mutants.md."""

from __future__ import annotations

import mutants

from flicker.errors import FlickerError

from .common import Say


def missing() -> str | None:
    """What must be run first."""
    try:
        mutants.results()
    except FlickerError as error:
        return str(error)
    return None


def tables(say: Say) -> dict[str, str]:
    """By unit, and every mutant that its own unit's tests let live."""
    return {"": mutants.summary(mutants.results())}
