"""`make docs PART=families`: the families of the stability suite, in docs/reference/stability.md."""

from __future__ import annotations

from flicker import markdown
from flicker.explore.stability.families import FAMILIES
from flicker.explore.stability.moving import MOVING

from .common import Say


def tables(say: Say) -> dict[str, str]:
    return {
        "still": markdown.table(["family", "what", "swept", "from", "to"], [
            [f"`{family.name}`", family.title, family.parameter, f"{family.values[0]:g}", f"{family.values[-1]:g}"] for family in FAMILIES.values()
        ]),
        "moving": markdown.table(["family", "what moves"], [[f"`{family.name}`", family.title] for family in MOVING.values()]),
    }
