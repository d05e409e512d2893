"""The table of configurations, and the groups that reports, tables and suites are made of.

Every module of `GENERATORS` says which configurations its mask generator has part in. A new generator or stage is a module and one entry here
(docs/guide/extending.md).
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from fnmatch import fnmatchcase

from ..errors import FlickerError
from ..front.view import View
from ..params import RenderConfig
from . import machine
from .generators import all_pixels, contribution, exact, log_lanes, oracle, rows, seele
from .machine import Configuration, Result

GENERATORS = (contribution, seele, exact, rows, log_lanes, all_pixels, oracle)

CONFIGURATIONS: dict[str, Configuration] = {c.name: c for module in GENERATORS for c in module.configurations()}

# Names and patterns; order is that of tables. What one is for stands behind it.
GROUPS: dict[str, tuple[str, ...]] = {
    # flicker report and `all` of a sweep
    "report": (
        "vanilla", "no-ctu-32", "no-ctu-64", "gscore", "seele", "faithful", "faithful-barrier", "flicker", "flicker-barrier",
        "flicker-*-*-factored", "flicker-*-*-conic", "flicker-stop", "flicker-16", "flicker-64", "flicker-fifo-64",
        "exact", "exact-e4m3", "exact-e5m2", "exact-e5m3", "exact-e4m4", "exact-q8.8", "rows-minitile", "rows", "rows-ellipse", "rows-ellipse-64",
        "lanes", "lanes-deep", "lanes-64", "lanes-fp16", "lanes-acc10", "lanes-acc12", "lanes-acc16", "lanes-acc20", "log-lanes", "log-lanes-64",
        "log-lanes-128", "oracle", "oracle-lanes",
        "no-ctu-32-conic", "no-ctu-64-conic", "gscore-conic",
    ),
    # docs/results/frames.md, in few rows
    "summary": ("gscore", "faithful", "flicker", "log-lanes", "log-lanes-64", "log-lanes-128"),
    # docs/results/exploration.md, by theme
    "rivals and the RTL": ("gscore", "seele", "no-ctu-32", "faithful", "flicker"),
    "barriers, finished sub-tiles, FIFOs, VRUs": ("flicker-barrier", "flicker-stop", "flicker-fifo-64", "flicker-16", "flicker-64"),
    "exact rectangle, by format": ("exact", "exact-e4m4", "exact-e5m3", "exact-e4m3", "exact-e5m2", "exact-q8.8"),
    "only pixels that contribute": ("rows-minitile", "rows", "rows-ellipse", "rows-ellipse-64", "oracle"),
    "lanes": ("lanes", "lanes-deep", "lanes-64", "oracle-lanes"),
    "lanes in the log domain, RTL": ("log-lanes", "log-lanes-64", "log-lanes-128"),
    "accumulators": ("lanes-fp16", "lanes-acc10", "lanes-acc12", "lanes-acc16", "lanes-acc20"),
    # from the default to lanes in the log domain; each step changes one thing (tb/test_docs.py)
    "ablation": (
        "flicker", "exact", "rows-minitile", "rows", "rows-ellipse", "rows-ellipse-stop", "lanes-fp16-window-1", "lanes-fp16", "lanes", "log-lanes-one",
        "log-lanes", "log-lanes-64",
    ),
    # from lanes with FIFOs of whole records to lanes-deep, likewise
    "deeper FIFOs": ("lanes", "lanes-fifo-40", "lanes-fifo-40-window-3", "lanes-deep"),
    # whole-frame estimates, figure 10: stages that the chip's RTL has, and GSCore's
    "chip": ("no-ctu-32-conic", "no-ctu-64-conic", "gscore-conic", "faithful", "flicker", "log-lanes", "log-lanes-64", "log-lanes-128"),
    # docs/results/energy.md
    "energy": (
        "gscore", "vanilla", "no-ctu-32", "no-ctu-64", "faithful", "flicker", "exact", "rows", "lanes", "lanes-deep", "lanes-64", "log-lanes", "log-lanes-64",
        "log-lanes-128",
    ),
    # docs/results/mask_generators.md
    "pictures": (
        "vanilla", "no-ctu-32", "gscore", "seele", "faithful", "flicker", "flicker-dense-fp16-factored", "exact-fp16", "exact-fp16-bound", "exact-e5m6",
        "exact-e5m6-bound", "exact-e4m4", "exact-e5m3", "exact-e4m3", "exact-e4m3-scaled", "exact-e4m3-bound", "exact-e5m2", "exact-q8.8", "exact-fp16-conic",
        "exact-fp16-conic-bound", "exact-e4m3-conic", "rows-minitile", "rows-f6a6", "rows-f7a5", "rows-f8a6", "rows", "rows-ellipse", "rows-ellipse-acc14",
        "rows-f10a10", "pixels", "oracle",
    ),
    # flicker stability: every picture once (row intervals draw what no test draws, so one of them is enough), and the two machines that have names
    "stability": (
        "vanilla*", "no-ctu-32*", "gscore*", "seele*", "faithful", "flicker", "flicker-*-*-factored", "flicker-*-*-conic", "exact-*",
        "rows", "rows-f*", "rows-ellipse-acc*", "log-lanes", "pixels*", "oracle-minitile*", "oracle", "oracle-conic",
    ),
    # docs/results/motion.md, flicker report over time: every mode of FLICKER, GSCore's test, none, lanes
    "stability in time": (
        "gscore", "no-ctu-32", "faithful", "flicker", "flicker-dense-fixed-factored", "flicker-sparse-fixed-factored", "flicker-spiky-fixed-factored",
        "flicker-auto-fixed-factored", "flicker-dense-fp16-factored", "log-lanes", "log-lanes-128", "log-lanes-squares",
    ),
    "stability, quick": (
        "vanilla", "no-ctu-32", "no-ctu-32-conic", "gscore", "seele", "faithful", "flicker", "flicker-dense-fp16-factored", "exact-e4m3", "exact",
        "exact-fp16-conic-bound", "rows", "rows-f6a6", "oracle",
    ),
}
EXPLORED = (
    "rivals and the RTL", "barriers, finished sub-tiles, FIFOs, VRUs", "exact rectangle, by format", "only pixels that contribute", "lanes",
    "lanes in the log domain, RTL", "accumulators",
)


def matching(patterns: Sequence[str]) -> list[str]:
    """Names of configurations by names and patterns, each once, in the order of the patterns. FlickerError for one that nothing matches."""
    found: list[str] = []
    for pattern in patterns:
        if any(sign in pattern for sign in "*?["):
            names = [name for name in CONFIGURATIONS if fnmatchcase(name, pattern)]
            if not names:
                raise FlickerError(f"no configuration matches '{pattern}'")
            found += names
        else:
            found.append(get_configuration(pattern).name)
    return list(dict.fromkeys(found))


def group(name: str) -> list[str]:
    """Names of a group's configurations."""
    return matching(GROUPS[name])


def get_configuration(name: str) -> Configuration:
    """A configuration by name; FlickerError, naming close ones, if there is none."""
    if name not in CONFIGURATIONS:
        close = difflib.get_close_matches(name, CONFIGURATIONS, 3, 0.3)
        raise FlickerError(f"configuration '{name}' is unknown; close names: {', '.join(close) or 'none'}")
    return CONFIGURATIONS[name]


def run(configuration: Configuration | str, view: View) -> Result:
    """`machine.run` of a configuration or of its name."""
    return machine.run(get_configuration(configuration) if isinstance(configuration, str) else configuration, view)


def rtl_configuration(config: RenderConfig, name: str = "rtl") -> Configuration:
    """The configuration that a build of the RTL is, whatever its depths and numbers of VRUs or lanes."""
    if config.by_lanes:
        lanes = log_lanes.LogLanes(config.lanes, config.in_width, config.slots, config.fifo_depth)
        return Configuration(name, "RTL, lanes", "lanes", log_lanes.LogRows(), lanes)
    if config.mask_generator == "all":
        return Configuration(
            name, "RTL, no test", "baseline", contribution.Untested(config.form),
            contribution.Channels(config.form, config.fifo_depth, config.vrus_per_channel),
        )
    return contribution.flicker(config, name, "RTL", fifo_depth=config.fifo_depth, vrus_per_channel=config.vrus_per_channel)
