"""Progress of long work."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext


class Steps:
    """Hooks a front end gives to show progress; this one shows nothing."""

    def step(self, text: str) -> AbstractContextManager[None]:
        """Around a step of unknown length."""
        return nullcontext()

    def bar(self, text: str) -> AbstractContextManager[Callable[[int, int], None]]:
        """Around a step that reports (done, total)."""
        return nullcontext(lambda done, total: None)
