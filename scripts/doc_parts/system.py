"""`make docs PART=system`: rendering stages in whole chips on the real views, by the models held to the RTL, in docs/chip.md."""

from __future__ import annotations

from flicker.chip.compare import chip_estimates
from flicker.explore.configurations import get_configuration, group
from flicker.markdown import table
from flicker.scene.real import REAL_VIEWS

from .common import Say, load

GSCORE = "gscore-conic"  # whose frames a second are 1


def tables(say: Say) -> dict[str, str]:
    rows: dict[str, list[str]] = {name: [f"`{name}`", get_configuration(name).title] for name in group("chip")}
    for view in REAL_VIEWS:
        say(view.title)
        facts = chip_estimates(load(view), list(rows))
        for name, fact in facts.items():
            interval = fact["interval_cycles"]
            rows[name].append(
                f"{interval / 1e6:.2f} M, {facts[GSCORE]['interval_cycles'] / interval:.2f}x, {fact['bottleneck']}: {fact['front_cycles'] / 1e6:.2f} / "
                f"{fact['render_cycles'] / 1e6:.2f} / {fact['dram_cycles'] / 1e6:.2f}, {fact['dram_bytes'] / 1e6:.1f} MB"
            )
    return {"": table(["configuration", "what", *(view.title for view in REAL_VIEWS)], [tuple(row) for row in rows.values()])}
