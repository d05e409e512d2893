"""`make docs PART=system`: rendering stages in whole chips on the real views, by the models held to the RTL, in docs/results/chip.md."""

from __future__ import annotations

from collections.abc import Iterator

from flicker.chip.compare import chip_estimates
from flicker.explore.configurations import get_configuration, group
from flicker.front.view import View
from flicker.markdown import table
from flicker.scene.grow import grown
from flicker.scene.real import REAL_VIEWS

from .common import Say, load

GSCORE = "gscore-conic"  # whose frames a second are 1
SMALL_PICTURE = (320, 178)

SMALL = ("faithful", "flicker", "log-lanes", "log-lanes-64")  # shown with small memories too


def _views() -> Iterator[tuple[str, View]]:
    """The real views; the first of them as a small picture, whose lists are long, and with twice the Gaussians."""
    for real in REAL_VIEWS:
        yield real.title, load(real)
    view = load(REAL_VIEWS[0])
    yield f"{REAL_VIEWS[0].title}, {SMALL_PICTURE[0]}x{SMALL_PICTURE[1]}", View(view.camera.resized(*SMALL_PICTURE), view.scene, name=view.name)
    yield f"{REAL_VIEWS[0].title}, twice the Gaussians", View(view.camera, grown(view.scene, 2), name=view.name)


def tables(say: Say) -> dict[str, str]:
    names = group("chip")
    rows: dict[tuple[str, str], list[str]] = {(name, "default"): [f"`{name}`", get_configuration(name).title] for name in names}
    rows |= {(name, "small"): [f"`{name}`", f"{get_configuration(name).title}; `small` memories"] for name in SMALL}
    titles = []
    for title, loaded in _views():
        say(title)
        titles.append(title)
        facts = {"default": chip_estimates(loaded, names), "small": chip_estimates(loaded, SMALL, "small")}
        for (name, memories), row in rows.items():
            fact = facts[memories][name]
            interval = fact["interval_cycles"]
            row.append(
                f"{interval / 1e6:.2f} M, {facts['default'][GSCORE]['interval_cycles'] / interval:.2f}x, {fact['bottleneck']}: "
                f"{fact['front_cycles'] / 1e6:.2f} / {fact['render_cycles'] / 1e6:.2f} / {fact['dram_cycles'] / 1e6:.2f}, {fact['dram_bytes'] / 1e6:.1f} MB"
            )
    return {"": table(["configuration", "what", *titles], [tuple(row) for row in rows.values()])}
