"""What a path may be asked for: the same rules for the command line and for the files of sweeps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..errors import FlickerError

MOTIONS = ("pan", "orbit", "dolly", "walk", "shake")
_OF = {"seed": ("shake",), "speed": ("dolly", "walk"), "ahead": ("dolly", "walk", "shake")}
_POSITIVE, _SIGNED = ("fps", "clock", "ahead", "speed"), ("pan", "orbit")


def kind_of(given: Mapping[str, Any], said: Callable[[str], str]) -> str | None:
    """The kind of a path (`paths.Asked`) from its options by name, of which None and False are not given. said: how people call an option.
    FlickerError for options that do not go together and numbers out of their range."""
    made = [name for name in MOTIONS if given[name] not in (None, False)]
    if len(made) > 1:
        raise FlickerError(f"{', '.join(map(said, made))}: one motion makes a path")
    if made and given["keyframes"]:
        raise FlickerError(f"{said('keyframes')}: joins given cameras, so it cannot be combined with {said(made[0])}")
    for option, motions in _OF.items():
        if given[option] is not None and not set(made) & set(motions):
            raise FlickerError(f"{said(option)}: for {', '.join(map(said, motions))} only")
    for option in _POSITIVE:
        if given[option] is not None and not 1e-3 <= given[option] <= 1e5:
            raise FlickerError(f"{said(option)}: {given[option]:g} is not from 0.001 to 100,000")
    for option in _SIGNED:
        if given[option] is not None and not abs(given[option]) <= 1e5:
            raise FlickerError(f"{said(option)}: {given[option]:g} is not from -100,000 to 100,000")
    return "keyframes" if given["keyframes"] else made[0] if made else None
