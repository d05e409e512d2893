"""`make docs PART=quality`: PSNR and mini-tiles sent for every mode, precision and form of the RTL, in docs/results/quality.md.

Golden model against the float64 reference, one view of each scene.
"""

from __future__ import annotations

from flicker import markdown
from flicker.front.view import View
from flicker.params import CatMode, Coords, Form, Precision, RenderConfig
from flicker.pipeline import Engine, render_view

from .common import Say, titled_views

TESTS = [(CatMode.OFF, Precision.FP16), *((cat, precision) for precision in Precision for cat in CatMode if cat != CatMode.OFF)]


def cell(view: View, config: RenderConfig) -> str:
    """PSNR and thousands of mini-tiles sent."""
    stats = render_view(view, engine=Engine.GOLDEN, config=config, compare=True).stats
    return f"{'equal' if stats['psnr_db'] is None else format(stats['psnr_db'], '.1f')} / {stats['minitiles_sent'] / 1000:,.0f}"


def tables(say: Say) -> dict[str, str]:
    titles: list[str] = []
    cells: dict[tuple, list[str]] = {(form, *test): [] for form in Form for test in TESTS}
    absolute: list[str] = []
    for title, view in titled_views(say):
        titles.append(title)
        for form, cat, precision in cells:
            say(f"{title}: {form.name.lower()}, {precision.name.lower()}, {cat.name.lower()}")
            cells[form, cat, precision].append(cell(view, RenderConfig(form=form, precision=precision, cat=cat)))
        absolute.append(cell(view, RenderConfig(cat=CatMode.OFF, coords=Coords.ABSOLUTE)))
    found = {}
    for form in Form:
        rows = [
            [cat.name.lower(), "-" if cat == CatMode.OFF else precision.name.lower(), *cells[form, cat, precision]] for cat, precision in TESTS
        ]
        found[form.name.lower()] = markdown.table(["test", "formats", *titles], rows)
    return found | {"coordinates": markdown.table(["", *titles], [["absolute", *absolute]])}
