#!/usr/bin/env python3
"""Draws the block diagrams of the pages: docs/figures/*.fig to docs/images/*.svg (`make generate`); `--check` only compares.

    scripts/gen_figures.py [--check]

A figure is text, a line for each thing; `#` begins a comment:

    title: What the picture shows
    grid:
      host  regs  .                 places of boxes: a name over several columns or rows is a larger box, `.` is empty
      .     core  core
    box regs = flk_registers | what it does             the first line is its name; | begins another line
    box core *4 = flk_lane_core | ...                   four of them, drawn as a stack
    plain host = host                                   text without a frame: what lies outside
    group half = Rendering half: regs core              a frame around boxes and groups
    host -> regs: AXI4-Lite                             a stream; <-> both ways, -- a line without a head
    regs -> core @0.3 via v: label                      @: place along the common side; via: h, v or z, the first leg of a bent line

Boxes that share rows or columns are joined by a straight line, others by a bent one. Wrong text is one line that names file and line, exit status 1.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import escape

from flicker.errors import FlickerError
from flicker.output import write_text
from flicker.toolchain import ROOT

SOURCES, PICTURES = ROOT / "docs" / "figures", ROOT / "docs" / "images"
SIZE, LEADING, PAD, STACK = 12, 16, 9, 4  # pixels: letters, line, margin of text in a box, offset of a stack
GAP, ROW_GAP, FRAME, TITLE, EDGE = 30, 24, 12, 20, 14  # between columns, rows; a group's margin and title; of the picture
COLOURS = {"page": "#ffffff", "box": "#eaf0fb", "line": "#3b5b92", "text": "#1b2433", "quiet": "#4a5568", "group": "#f6f7f9", "frame": "#a3adbd"}
NAME = r"[a-z]\w*"


@dataclass
class Rect:
    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def middle(self) -> tuple[float, float]:
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2


@dataclass
class Box:
    """kind: box, plain or group. line: of the source. cells: first column, first row, behind the last of each."""

    kind: str
    line: int
    text: list[str]
    stack: int = 1
    members: list[str] = field(default_factory=list)
    cells: tuple[int, int, int, int] = (0, 0, 0, 0)


@dataclass
class Stream:
    line: int
    begin: str
    head: str
    end: str
    at: float
    via: str
    label: str


@dataclass
class Figure:
    title: str
    boxes: dict[str, Box]
    streams: list[Stream]
    columns: int
    rows: int


def width_of(text: str) -> float:
    """Of letters of a common sans-serif face, rather more than less; names of modules are monospaced."""
    if text.startswith("flk_"):
        return 0.62 * SIZE * len(text)
    return SIZE * sum(0.36 if c in "iljtfr.,:;'|!() " else 0.88 if c in "mwMW" or c.isupper() else 0.62 for c in text)


def read(text: str, name: str) -> Figure:
    """The figure that a text describes. Raises FlickerError."""
    title, boxes, streams, grid = "", {}, [], []
    inside = False

    def wrong(number: int, what: str) -> FlickerError:
        return FlickerError(f"{name}:{number}: {what}")

    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.partition("#")[0].rstrip()
        if not line:
            continue
        if inside and line[0] == " ":
            grid.append((number, line.split()))
            continue
        inside = line == "grid:"
        if inside:
            continue
        if found := re.fullmatch(r"title: (.+)", line):
            title = found[1]
        elif found := re.fullmatch(rf"(box|plain) ({NAME})(?: \*(\d+))? = (.+)", line):
            kind, key, stack, words = found.groups()
            if key in boxes:
                raise wrong(number, f"{key} is there twice")
            boxes[key] = Box(kind, number, [part.strip() for part in words.split("|")], int(stack or 1))
        elif found := re.fullmatch(rf"group ({NAME}) = ([^:]+): ([\w ]+)", line):
            boxes[found[1]] = Box("group", number, [found[2]], members=found[3].split())
        elif found := re.fullmatch(rf"({NAME}) (->|<->|--) ({NAME})(?: @([\d.]+))?(?: via ([hvz]))?(?:: (.+))?", line):
            begin, head, end, at, via, label = found.groups()
            streams.append(Stream(number, begin, head, end, float(at or 0.5), via or "z", label or ""))
        else:
            raise wrong(number, f"not understood: {line}")
    if not title or not grid:
        raise wrong(1, "a figure has a title and a grid")
    columns = len(grid[0][1])
    places: dict[str, list[tuple[int, int]]] = {}
    for row, (number, cells) in enumerate(grid):
        if len(cells) != columns:
            raise wrong(number, f"{len(cells)} columns, not {columns}")
        for column, key in enumerate(cells):
            if key != ".":
                if key not in boxes or boxes[key].kind == "group":
                    raise wrong(number, f"no box {key}")
                places.setdefault(key, []).append((column, row))
    for key, box in boxes.items():
        if box.kind != "group":
            if key not in places:
                raise wrong(box.line, f"{key} is not in the grid")
            xs, ys = zip(*places[key], strict=True)
            box.cells = (min(xs), min(ys), max(xs) + 1, max(ys) + 1)
            if len(places[key]) != (box.cells[2] - box.cells[0]) * (box.cells[3] - box.cells[1]):
                raise wrong(box.line, f"{key} is no rectangle of the grid")
        elif unknown := [member for member in box.members if member not in boxes or boxes[member].line > box.line]:
            raise wrong(box.line, f"no {unknown[0]} before this line")
        else:
            inner = [boxes[member].cells for member in box.members]
            box.cells = (min(c[0] for c in inner), min(c[1] for c in inner), max(c[2] for c in inner), max(c[3] for c in inner))
    for stream in streams:
        if unknown := [key for key in (stream.begin, stream.end) if key not in boxes]:
            raise wrong(stream.line, f"no box {unknown[0]}")
    return Figure(title, boxes, streams, columns, len(grid))


def _sizes(figure: Figure, axis: int) -> tuple[list[float], list[float]]:
    """Lengths of the columns (axis 0) or rows (1), and of the gaps before each and behind the last."""
    n = (figure.columns, figure.rows)[axis]
    lengths, gaps = [0.0] * n, [float((GAP, ROW_GAP)[axis])] * (n + 1)
    gaps[0] = gaps[-1] = 0.0
    need = {}
    for key, box in figure.boxes.items():
        first, last = box.cells[axis], box.cells[axis + 2]
        if box.kind == "group":
            continue
        text = max(width_of(box.text[0]) * (1.08 if box.kind == "box" else 1), *map(width_of, box.text)) if axis == 0 else LEADING * len(box.text)
        need[key] = text + 2 * PAD + (STACK * 2 if box.stack > 1 else 0)
        if last - first == 1:
            lengths[first] = max(lengths[first], need[key])
    # Frames that begin or end at a gap stand side by side in it.
    before, behind = [0] * (n + 1), [0] * (n + 1)
    for key, box in figure.boxes.items():
        if box.kind == "group":
            depth = 1 + _depth(figure, key)
            before[box.cells[axis]] = max(before[box.cells[axis]], depth)
            behind[box.cells[axis + 2]] = max(behind[box.cells[axis + 2]], depth)
    for k in range(n + 1):
        gaps[k] += before[k] * (FRAME + (TITLE if axis else 0)) + behind[k] * FRAME
    for stream in figure.streams:
        a, b = figure.boxes[stream.begin], figure.boxes[stream.end]
        if axis == 0 and stream.label and _shared(a, b, 1):
            left, right = sorted((a, b), key=lambda box: box.cells[0])
            between = range(left.cells[2], right.cells[0])
            room = sum(lengths[k] for k in between) + sum(gaps[k] for k in range(left.cells[2], right.cells[0] + 1))
            gaps[left.cells[2]] += max(0.0, width_of(stream.label) + 22 - room + FRAME * (before[left.cells[2]] + behind[left.cells[2]]))
    for key, box in figure.boxes.items():
        first, last = box.cells[axis], box.cells[axis + 2]
        if last - first > 1 and box.kind != "group":
            there = sum(lengths[first:last]) + sum(gaps[first + 1 : last])
            for k in range(first, last):
                lengths[k] += max(0.0, need[key] - there) / (last - first)
    return lengths, gaps


def _depth(figure: Figure, key: str) -> int:
    """Groups inside a group, one in the other."""
    inner = [member for member in figure.boxes[key].members if figure.boxes[member].kind == "group"]
    return max((1 + _depth(figure, member) for member in inner), default=0)


def _shared(a: Box, b: Box, axis: int) -> bool:
    return a.cells[axis] < b.cells[axis + 2] and b.cells[axis] < a.cells[axis + 2]


def rectangles(figure: Figure) -> tuple[dict[str, Rect], float, float]:
    """Where everything lies, and the size of the picture."""
    starts, ends = [], []
    totals = []
    for axis in (0, 1):
        lengths, gaps = _sizes(figure, axis)
        at, begin, end = float(EDGE), [], []
        for k, length in enumerate(lengths):
            at += gaps[k]
            begin.append(at)
            at += length
            end.append(at)
        totals.append(at + gaps[-1] + EDGE)
        starts.append(begin)
        ends.append(end)
    found: dict[str, Rect] = {}
    for key, box in figure.boxes.items():  # groups follow what they have inside
        c0, r0, c1, r1 = box.cells
        if box.kind != "group":
            found[key] = Rect(starts[0][c0], starts[1][r0], ends[0][c1 - 1], ends[1][r1 - 1])
        else:
            inner = [found[member] for member in box.members]
            found[key] = Rect(min(r.x0 for r in inner) - FRAME, min(r.y0 for r in inner) - FRAME - TITLE,
                              max(r.x1 for r in inner) + FRAME, max(r.y1 for r in inner) + FRAME)
    title_room = max((width_of(box.text[0]) + 20 + found[key].x0 for key, box in figure.boxes.items() if box.kind == "group"), default=0)
    return found, max(totals[0], title_room), totals[1]


Point = tuple[float, float]


def path_of(stream: Stream, a: Rect, b: Rect) -> list[Point]:
    """Corners of a stream's line."""
    low, high = max(a.y0, b.y0), min(a.y1, b.y1)
    if high - low >= 8:
        y = low + (high - low) * stream.at
        return [(a.x1, y), (b.x0, y)] if a.middle[0] < b.middle[0] else [(a.x0, y), (b.x1, y)]
    low, high = max(a.x0, b.x0), min(a.x1, b.x1)
    if high - low >= 8:
        x = low + (high - low) * stream.at
        return [(x, a.y1), (x, b.y0)] if a.middle[1] < b.middle[1] else [(x, a.y0), (x, b.y1)]
    right, down = a.middle[0] < b.middle[0], a.middle[1] < b.middle[1]
    if stream.via == "h":
        x, y = b.x0 + (b.x1 - b.x0) * stream.at, a.middle[1]
        return [(a.x1 if right else a.x0, y), (x, y), (x, b.y0 if down else b.y1)]
    if stream.via == "v":
        x, y = a.x0 + (a.x1 - a.x0) * stream.at, b.middle[1]
        return [(x, a.y1 if down else a.y0), (x, y), (b.x0 if right else b.x1, y)]
    y0, y1 = a.middle[1], b.y0 + (b.y1 - b.y0) * stream.at
    x = b.x0 - GAP / 2 if right else b.x1 + GAP / 2
    return [(a.x1 if right else a.x0, y0), (x, y0), (x, y1), (b.x0 if right else b.x1, y1)]


def crossed(figure: Figure, rects: dict[str, Rect], stream: Stream, points: list[Point]) -> str | None:
    """A box that a stream's line runs through."""
    for key, box in figure.boxes.items():
        if box.kind == "group" or key in (stream.begin, stream.end):
            continue
        r = rects[key]
        for (x0, y0), (x1, y1) in zip(points, points[1:], strict=False):
            if min(x0, x1) < r.x1 and max(x0, x1) > r.x0 and min(y0, y1) < r.y1 and max(y0, y1) > r.y0:
                return key
    return None


def _text(x: float, y: float, words: str, colour: str, anchor: str = "middle", bold: bool = False) -> str:
    face = ' font-family="DejaVu Sans Mono, Menlo, Consolas, monospace"' if words.startswith("flk_") else ""
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" fill="{COLOURS[colour]}"{face}{weight}>{escape(words)}</text>'


def _block(box: Box, r: Rect) -> list[str]:
    """A box or an outside thing with its lines of text."""
    out = []
    x1, y1 = (r.x1 - 2 * STACK, r.y1 - 2 * STACK) if box.stack > 1 else (r.x1, r.y1)
    if box.kind == "box":
        for k in reversed(range(min(box.stack, 3))):
            out.append(f'<rect x="{r.x0 + STACK * k:.0f}" y="{r.y0 + STACK * k:.0f}" width="{x1 - r.x0:.0f}" height="{y1 - r.y0:.0f}" rx="4" '
                       f'fill="{COLOURS["box"]}" stroke="{COLOURS["line"]}"/>')
    top = (r.y0 + y1) / 2 - LEADING * len(box.text) / 2 + SIZE
    for k, words in enumerate(box.text):
        out.append(_text((r.x0 + x1) / 2, top + LEADING * k, words, "text" if k == 0 else "quiet", bold=k == 0 and box.kind == "box"))
    return out


def draw(figure: Figure, name: str) -> str:
    """The picture as SVG, legible on light and dark pages: it has a ground of its own. Raises FlickerError where a line crosses a box."""
    rects, width, height = rectangles(figure)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}" '
        f'font-family="DejaVu Sans, Verdana, Arial, sans-serif" font-size="{SIZE}" role="img">',
        f"<title>{escape(figure.title)}</title>",
        f'<!-- Generated by `make generate` from docs/figures/{name}: edit that, not this. -->',
        f'<rect width="{width:.0f}" height="{height:.0f}" rx="8" fill="{COLOURS["page"]}"/>',
    ]
    for key in sorted((k for k, box in figure.boxes.items() if box.kind == "group"), key=lambda k: -_depth(figure, k)):
        r = rects[key]
        out.append(f'<rect x="{r.x0:.0f}" y="{r.y0:.0f}" width="{r.x1 - r.x0:.0f}" height="{r.y1 - r.y0:.0f}" rx="6" fill="{COLOURS["group"]}" '
                   f'stroke="{COLOURS["frame"]}"/>')
        out.append(_text(r.x0 + 10, r.y0 + 16, figure.boxes[key].text[0], "quiet", "start", bold=True))
    heads, labels = [], []
    for stream in figure.streams:
        points = path_of(stream, rects[stream.begin], rects[stream.end])
        if key := crossed(figure, rects, stream, points):
            raise FlickerError(f"docs/figures/{name}:{stream.line}: the line runs through {key}")
        out.append(f'<polyline points="{" ".join(f"{x:.0f},{y:.0f}" for x, y in points)}" fill="none" stroke="{COLOURS["line"]}" stroke-width="1.4"/>')
        for (x, y), (u, v) in ([(points[-1], points[-2])] if ">" in stream.head else []) + ([(points[0], points[1])] if "<" in stream.head else []):
            dx, dy = (x > u) - (x < u), (y > v) - (y < v)
            heads.append(f'<path d="M{x:.0f} {y:.0f}l{-8 * dx - 4 * dy} {-8 * dy - 4 * dx}l{8 * dy} {8 * dx}z" fill="{COLOURS["line"]}"/>')
        if stream.label:
            legs = list(zip(points, points[1:], strict=False))
            (x0, y0), (x1, y1) = max(legs, key=lambda leg: (abs(leg[0][0] - leg[1][0]) > width_of(stream.label) - 8,
                                                            abs(leg[0][0] - leg[1][0]) + abs(leg[0][1] - leg[1][1])))
            if y0 == y1:
                labels.append(_text((x0 + x1) / 2, y0 - 5, stream.label, "quiet"))
            else:
                labels.append(_text(x0 + 6, (y0 + y1) / 2 + 4, stream.label, "quiet", "start"))
    out += heads
    for key, box in figure.boxes.items():
        if box.kind != "group":
            out += _block(box, rects[key])
    return "\n".join([*out, *labels, "</svg>", ""])


def pictures() -> dict[Path, str]:
    """Text of every picture by its file."""
    return {PICTURES / f"{path.stem}.svg": draw(read(path.read_text(), f"docs/figures/{path.name}"), path.name) for path in sorted(SOURCES.glob("*.fig"))}


def stale(there: dict[Path, str]) -> list[str]:
    """Pictures that are not those of the figures, and pictures without a figure."""
    found = [path.name for path, text in there.items() if not path.exists() or path.read_text() != text]
    return found + [path.name for path in sorted(PICTURES.glob("*.svg")) if path not in there]


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--check"]):
        raise FlickerError("usage: scripts/gen_figures.py [--check]")
    made = pictures()
    if arguments:
        for name in stale(made):
            print(f"docs/images/{name}: stale, run make generate")
        return 1 if stale(made) else 0
    for path, text in made.items():
        if not path.exists() or path.read_text() != text:
            write_text(path, text)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except FlickerError as error:
        sys.exit(f"figures: {error}")
