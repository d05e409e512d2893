"""`make docs PART=configurations`: the list of configurations and the groups that tables take, in docs/configurations.md."""

from __future__ import annotations

from collections import defaultdict
from fnmatch import fnmatchcase

from flicker import markdown
from flicker.explore.configurations import CONFIGURATIONS, GROUPS, group

from .common import Say

# Told apart by names only: one row for all.
FAMILIES = ("flicker-*-*-factored", "flicker-*-*-conic")


def tables(say: Say) -> dict[str, str]:
    return {"list": configuration_table(), "groups": group_table()}


def configuration_table() -> str:
    """A row for every configuration but the modes and formats of the contribution test, which are one row a form."""
    rows = []
    seen: dict[str, int] = defaultdict(int)
    for name, configuration in CONFIGURATIONS.items():
        pattern = next((pattern for pattern in FAMILIES if fnmatchcase(name, pattern)), None)
        if pattern:
            seen[pattern] += 1
            if seen[pattern] > 1:
                continue
            count = sum(fnmatchcase(other, pattern) for other in CONFIGURATIONS)
            title = f"FLICKER: {count} of every mode and format, {configuration.form.name.lower()}"
            shown = pattern.replace("*", "MODE", 1).replace("*", "FORMAT", 1)
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
