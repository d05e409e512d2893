"""Progress of long work."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext


class Steps:
    """Hooks a front end gives to show progress; this one shows nothing."""

    def step(self, text: str) -> AbstractContextManager[None]:
        """Around a step of unknown length."""
        return nullcontext()

    def bar(self, text: str) -> AbstractContextManager[Callable[[float, int], None]]:
        """Around a step that reports (done, total)."""
        return nullcontext(lambda done, total: None)


@contextmanager
def undivided() -> Iterator[None]:
    """Ctrl-C within takes effect at the end of the block, whose state is then whole; a second one takes effect at once."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    came = False

    def wait(*_: object) -> None:
        nonlocal came
        if came:
            raise KeyboardInterrupt
        came = True

    signal.signal(signal.SIGINT, wait)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if came:
        raise KeyboardInterrupt
