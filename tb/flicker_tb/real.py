"""Real scenes as parameters of tests: those of half a million Gaussians and more with SLOW=1."""

from __future__ import annotations

import pytest

from flicker.scene.real import REAL_VIEWS

LARGE = ("flowers", "playbot")


def real_views() -> list:
    """A parameter for each of `REAL_VIEWS`, by its folder."""
    return [pytest.param(view, id=view.folder, marks=[pytest.mark.slow] * (view.folder in LARGE)) for view in REAL_VIEWS]
