"""`make docs PART=configurations`: the list of configurations and the groups that tables take, in docs/reference/configurations.md."""

from __future__ import annotations

from collections import defaultdict
from fnmatch import fnmatchcase

from flicker import markdown
from flicker.explore.configurations import CONFIGURATIONS, GROUPS, group

from .common import Say

# Told apart by words of their names only: one row for all. Pattern, name in the table, what they are.
FAMILIES = {
    "flicker-*-*-factored": ("flicker-MODE-FORMAT-factored", "FLICKER in every mode and format"),
    "flicker-*-*-conic": ("flicker-MODE-FORMAT-conic", "the same in the conic form"),
    "exact-*-conic*": ("exact-FORMAT-conic[-scaled][-bound]", "exact rectangle per mini-tile in every format, conic"),
    "exact-*": ("exact-FORMAT[-scaled][-bound]", "exact rectangle per mini-tile in every format"),
}


def tables(say: Say) -> dict[str, str]:
    return {"list": configuration_table(), "groups": group_table()}


def configuration_table() -> str:
    """A row for every configuration; those of a family share one."""
    rows = []
    members: dict[str, int] = defaultdict(int)
    of = {name: next((pattern for pattern in FAMILIES if fnmatchcase(name, pattern)), None) for name in CONFIGURATIONS}
    for name, configuration in CONFIGURATIONS.items():
        pattern = of[name]
        if pattern is not None:
            members[pattern] += 1
            if members[pattern] > 1:
                continue
            shown, what = FAMILIES[pattern]
            title = f"{what}: {sum(other == pattern for other in of.values())} configurations"
        else:
            title, shown = configuration.title, name
        rows.append([
            f"`{shown}`", title, type(configuration.generator).__name__, type(configuration.stage).__name__, configuration.lists, str(configuration.vrus),
            "bound" if configuration.generator.free else "model" if configuration.model_only else "RTL",
        ])
    return markdown.table(["configuration", "what", "mask generator", "rendering stage", "lists", "VRUs", ""], rows)


def group_table() -> str:
    rows = [[f"`{name}`", str(len(group(name))), ", ".join(f"`{pattern}`" for pattern in patterns)] for name, patterns in GROUPS.items()]
    return markdown.table(["group", "configurations", "names and patterns"], rows)
