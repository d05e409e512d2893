"""`index.html`: one page with everything in it, no network."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..explore.stability.run import BROKEN_ERROR, BROKEN_PSNR, Stability
from .claims import Verdict
from .collect import ViewResult
from .figures import Figure, is_bound, overall
from .moving import MOTIONS, Moving, Picture, decibels_text, jumps_text

_MARKS = {"yes": "holds", "no": "does not hold here", "partly": "holds in part", "open": "open"}
_FOLDER = Path(__file__).resolve().parent


def _e(text: object) -> str:
    return html.escape(str(text))


def _points(views: Sequence[ViewResult]) -> str:
    """The configurations as JSON for the chart: numbers that JSON has, inf as null."""
    keys = ("config", "title", "cycles", "psnr_db", "ssim", "flip", "photo_psnr_db", "photo_ssim", "area_ge", "energy_uj", "model_only")
    groups = {v.target.title: list(v.rows.values()) for v in views}
    if len(views) > 1:
        groups["all views"] = overall(views)

    def plain(value):
        return None if isinstance(value, float) and not math.isfinite(value) else value

    data = {
        title: [{k: plain(p.get(k)) for k in keys} | {"bound": is_bound(p["config"])} for p in points] for title, points in groups.items()
    }
    return json.dumps(data, default=float).replace("</", "<\\/")


def _number(value: object) -> str:
    if value is None or value == "":
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        if value == math.inf:  # a PSNR
            return "equal"
        return f"{value:,.0f}" if abs(value) >= 10000 else f"{value:.4g}"
    return _e(value)


def _table(header: Sequence[str], rows: Sequence[Sequence], classes: str = "") -> str:
    head = "".join(f"<th>{_e(h)}</th>" for h in header)
    body = "".join("<tr>" + "".join(f"<td>{_number(v)}</td>" for v in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table class="{classes}"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _verdicts(verdicts: Sequence[Verdict]) -> str:
    rows = []
    for v in verdicts:
        ours = "<br>".join(f"{_e(title)}: {_e(text)}" for title, text in v.ours.items())
        rows.append(f'<tr class="{v.kind}"><td>{_e(v.figure)}</td><td>{_e(v.claim)}</td><td>{_e(v.paper)}</td><td>{ours}</td><td>{_e(v.verdict)}</td></tr>')
    head = "".join(f"<th>{h}</th>" for h in ("figure", "claim", "paper", "here", "verdict"))
    return f'<div class="wide"><table class="verdicts"><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _figure(figure: Figure, verdicts: Sequence[Verdict] = ()) -> str:
    links = " ".join(f'<a href="figures/{figure.name}.{kind}">{kind.upper()}</a>' for kind in ("csv", *figure.written))
    picture = f'<img alt="{_e(figure.title)}" src="{figure.image}">' if figure.image else ""
    of = f"Figure {figure.of}: " if figure.of and not figure.of.startswith("Table") else ""
    table = _table(figure.header, figure.rows)
    if figure.image:
        table = f"<details><summary>{len(figure.rows)} rows</summary>{table}</details>"
    return f'<section id="{figure.name}"><h3>{_e(of + figure.title)}</h3><p>{_e(figure.note)} {links}</p>{picture}{table}{_verdicts(verdicts) if verdicts else ""}</section>'


def _stability(result: Stability, figure: Figure) -> str:
    header = "".join(f"<th>{_e(m)}</th>" for m in result.configurations)
    rows = []
    for family in result.families:
        cells = []
        for name in result.configurations:
            point = result.breaks(family, name)
            lowest = min(p.psnr_db for p in result.sweep(family, name))
            cells.append(f"<td>- ({_number(lowest) if lowest == math.inf else f'{lowest:.0f}'})</td>" if point is None else
                         f'<td class="broken" title="error {point.max_error:.2f}">{point.value:g} ({point.psnr_db:.0f})</td>')
        rows.append(f"<tr><th>{_e(family)}</th>{''.join(cells)}</tr>")
    return (
        f'<section id="stability"><p>{_e(figure.note)} Broken: PSNR below {BROKEN_PSNR:g} dB or error above {BROKEN_ERROR:g}; seed {result.seed}. '
        f'<a href="figures/stability.csv">CSV</a></p><div class="wide"><table class="slanted"><thead><tr><th></th>{header}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div></section>"
    )


@dataclass(frozen=True)
class InMotion:
    """The section on stability over time. pictures: strips and clips of the views in `moving`. note: what is assumed."""

    moving: Sequence[Moving]
    figure: Figure
    pictures: Sequence[Picture]
    note: str


def _moving_table(moving: Moving) -> str:
    """A row a configuration, three columns a motion."""
    heads = "".join(f'<th colspan="3">{_e(MOTIONS[motion][0])}</th>' for motion in moving.samples)
    columns = "<th>temporal PSNR, dB</th><th>jumps, %</th><th>million cycles</th>" * len(moving.samples)
    rows = []
    for name in next(iter(moving.samples.values())):
        cells = []
        for of in moving.samples.values():
            cells += [decibels_text(of[name].temporal_psnr_db), jumps_text(of[name].jumps), f"{of[name].cycles / 1e6:.3g}"]
        rows.append(f"<tr><th>{_e(name)}</th>{''.join(f'<td>{_e(cell)}</td>' for cell in cells)}</tr>")
    return (f'<div class="wide"><table class="moving"><thead><tr><th rowspan="2">configuration</th>{heads}</tr><tr>{columns}</tr></thead>'
            f"<tbody>{''.join(rows)}</tbody></table></div>")


def _in_motion(section: InMotion) -> str:
    figure = section.figure
    links = " ".join(f'<a href="figures/{figure.name}.{kind}">{kind.upper()}</a>' for kind in ("csv", *figure.written))
    parts = [f"<p>{_e(section.note)}</p>", f'<section id="{figure.name}"><h3>{_e(figure.title)}</h3><p>{_e(figure.note)} {links}</p>'
             f'<img alt="{_e(figure.title)}" src="{figure.image}"></section>']
    parts += [f"<h3>{_e(moving.target.title)} in motion</h3>{_moving_table(moving)}" for moving in section.moving]
    parts += [
        f'<section id="{p.name}"><h3>{_e(p.title)}</h3><p>{_e(p.note)} <a href="figures/{p.name}.{p.suffix}">{p.suffix.upper()}</a></p>'
        f'<img alt="{_e(p.title)}" src="{p.image}"></section>' for p in section.pictures
    ]
    return "".join(parts)


def page(
    views: Sequence[ViewResult], verdicts: Sequence[Verdict], paper: Sequence[Figure], charts: Sequence[Figure], heats: Sequence[Figure],
    budgets: Sequence[Figure], stability: tuple[Stability, Figure], about: dict[str, str], motion: InMotion | None = None,
) -> str:
    """The whole page. charts: of all configurations. about: facts of the run, by name. motion: None: without that section."""
    counts = {kind: sum(v.kind == kind for v in verdicts) for kind in _MARKS}
    tally = ", ".join(f"{count} {_MARKS[kind]}" for kind, count in counts.items())
    facts = "".join(f"<dt>{_e(k)}</dt><dd>{_e(v)}</dd>" for k, v in about.items())
    of_figure = {f.name: [v for v in verdicts if v.figure.rstrip("abc") == f.of.rstrip("abc") and f.of] for f in paper}

    def printed(chart: Figure) -> str:
        links = " ".join(f'<a href="figures/{chart.name}.{kind}">{kind.upper()}</a>' for kind in ("csv", "png", "svg"))
        return (f"<details><summary>{_e(chart.title)}, for every view, printed</summary><p>{_e(chart.note)} {links}</p>"
                f"<img alt='{_e(chart.title)}' src='{chart.image}'></details>")

    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><meta name='viewport' content='width=device-width'><title>FLICKER report</title>",
        f"<style>{(_FOLDER / 'page.css').read_text()}</style></head><body>",
        "<h1>FLICKER: speed, accuracy, area, energy</h1>",
        f"<p>Written by <code>flicker report</code>. Numbers in <a href='summary.csv'>summary.csv</a> and beside every figure.</p><dl>{facts}</dl>",
        "<nav><a href='#chart'>speed against accuracy</a> <a href='#claims'>claims of the paper</a> <a href='#paper'>figures of the paper</a> "
        "<a href='#heat'>heat maps</a> " + ("<a href='#motion'>stability over time</a> " if motion else "") + "<a href='#fail'>where configurations fail</a></nav>",
        "<h2 id='chart'>Speed against accuracy</h2>",
        "<p>Every configuration is a point; the line is the Pareto front of the two axes shown. Point at one to read it, click to keep it. "
        "FPS are those of the rendering stage at 1 GHz; cycles times area lets builds of different size compare.</p>",
        "<div id='controls'></div><div id='plot'><svg id='scatter' viewBox='0 0 900 480' role='img' aria-label='scatter chart'></svg><pre id='read'>no point chosen</pre></div>",
        *map(printed, charts),
        f"<h2 id='claims'>Claims of the paper</h2><p>{len(verdicts)} claims: {tally}. What a verdict asks for stands in it.</p>",
        _verdicts(verdicts),
        "<h2 id='paper'>Figures of the paper</h2><p>Figure 1 (GPU profile) appears with its published numbers only, in the table above.</p>",
        *(_figure(f, of_figure[f.name]) for f in paper),
        "<h2 id='heat'>Heat maps</h2>",
        *(_figure(f) for f in heats),
        *(["<h2 id='motion'>Stability over time</h2>", _in_motion(motion)] if motion else []),
        *(["<h2>Scenes to a budget</h2>", *map(_figure, budgets)] if budgets else []),
        "<h2 id='fail'>Where configurations fail</h2>", _stability(*stability),
        f"<script>const DATA = {_points(views)};\n{(_FOLDER / 'page.js').read_text()}</script></body></html>\n",
    ]
    return "\n".join(parts)
