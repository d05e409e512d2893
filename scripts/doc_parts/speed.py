"""`make docs PART=speed`: engines timed on one frame (scripts/benchmark.py), in docs/results/speed.md."""

from __future__ import annotations

import benchmark

from .common import SIZE, Say


def tables(say: Say) -> dict[str, str]:
    return benchmark.tables(benchmark.default_scene(), 0, SIZE, None, say)
