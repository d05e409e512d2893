"""What commands print: tables whose figures are never cut, on a terminal of any width and in a pipe."""

from __future__ import annotations

import math
import re
from typing import Any

from rich.console import Console, ConsoleDimensions
from rich.table import Column, Table
from rich.text import Text

BAR = 12  # columns of a bar
PIPE = 1_000_000  # columns of what is no terminal: nothing is wrapped there
_FIGURE = re.compile(r"[-+(]*\d[\d.,:x%)^-]*$")
_FOLDED = 20  # characters of a word, such as a path, that a narrow column may break; figures are never broken


def decibels(value: float | None, digits: int = 2, unit: str = " dB") -> str:
    """A PSNR; None and infinity are those of equal pictures."""
    return "equal" if value is None or value == math.inf else f"{value:.{digits}f}{unit}"


def bytes_text(count: int) -> str:
    """A number of bytes in the unit that leaves three figures or more."""
    return f"{count / 1e6:,.2f} MB" if count >= 1e6 else f"{count / 1e3:,.1f} KB" if count >= 1e4 else f"{count:,} bytes"


def bar(share: float, columns: int = BAR) -> str:
    """A share as a bar with its percentage; shares of sums may lie above 1."""
    eighths = min(max(round(8 * columns * share), 0), 8 * columns)
    full, rest = divmod(eighths, 8)
    return ("█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else "")).ljust(columns) + f" {share:6.1%}"


class Terminal(Console):
    """The console of all commands. Text is printed as it is: names of files may hold brackets and colons."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    @property  # type: ignore[misc]  # never set
    def size(self) -> ConsoleDimensions:
        """Columns and lines; a pipe has no width that would wrap or cut a line."""
        if not self.file.isatty():
            return ConsoleDimensions(PIPE, 25)
        return super().size

    def print(self, *objects: Any, **options: Any) -> None:
        """As rich's, but tables are laid out by `fitted`, with title and caption as lines of their own."""
        if len(objects) != 1 or not isinstance(objects[0], Table):
            super().print(*objects, **options)
            return
        table: Table = objects[0]
        if table.title:
            super().print(table.title, style="table.title", highlight=False)
        for part in fitted(table, self):
            super().print(part, crop=False, **options)
        if table.caption:
            super().print(table.caption, style="table.caption", highlight=False)


def _text(cell: Any, console: Console) -> Text:
    return cell.copy() if isinstance(cell, Text) else console.render_str(str(cell))


def _natural(texts: list[Text]) -> int:
    return max((line.cell_len for text in texts for line in text.split(allow_blank=True)), default=0)


def _least(texts: list[Text]) -> int:
    """Columns that the longest word needs, behind the indentation of its line; of a text that is not to be wrapped all."""
    found = 1
    for text in texts:
        if text.no_wrap:
            found = max(found, text.cell_len)
            continue
        for line in text.plain.splitlines():
            indent = len(line) - len(line.lstrip())
            words = (len(word) if _FIGURE.match(word) else min(len(word), _FOLDED) for word in line.split())
            found = max(found, indent + max(words, default=0))
    return found


def _wrapped(text: Text, width: int, console: Console) -> Text:
    """The text in lines of `width` columns at most; a line that begins with spaces goes on behind as many."""
    lines = []
    for line in text.split(allow_blank=True):
        if line.cell_len <= width:
            lines.append(line)
            continue
        indent = len(line.plain) - len(line.plain.lstrip())
        for part in line[indent:].wrap(console, width - indent, overflow="fold"):
            part.rstrip()
            lines.append(Text(" " * indent) + part)
    return Text("\n").join(lines)


def _widths(table: Table, cells: list[list[Text]], room: int) -> list[int] | None:
    """Columns that each column of the table gets, `room` in all; None: the figures need more."""
    least = [_least(column) for column in cells]
    widths = [max(_natural(column), low) for column, low in zip(cells, least)]
    while sum(widths) > room:
        slack = [(width, k) for k, (width, low) in enumerate(zip(widths, least)) if width > low]
        if not slack:
            return None
        widths[max(slack)[1]] -= 1
    return widths


def fitted(table: Table, console: Console) -> list[Table]:
    """The table in the width of the console: words are wrapped; where that is not enough it is cut between columns into several, each with the columns
    that name a row. No figure is shortened: what cannot fit stays wider than the console."""
    heads = [_text(column.header, console) for column in table.columns]
    cells = [[_text(cell, console) for cell in column.cells] for column in table.columns]
    shown = [[head, *column] if table.show_header else column for head, column in zip(heads, cells)]

    def room(count: int) -> int:
        return console.width - 3 * count - 1

    def made(chosen: list[int], widths: list[int]) -> Table:
        part = Table(show_header=table.show_header, box=table.box, width=sum(widths) + 3 * len(widths) + 1)  # whatever the console has
        for k, width in zip(chosen, widths):
            column: Column = table.columns[k]
            part.add_column(_wrapped(heads[k], width, console), style=column.style, justify=column.justify, width=width, no_wrap=True)
        for number, row in enumerate(table.rows):
            part.add_row(*(_wrapped(cells[k][number], width, console) for k, width in zip(chosen, widths)), style=row.style, end_section=row.end_section)
        return part

    every = list(range(len(cells)))
    widths = _widths(table, shown, room(len(every)))
    if widths is None:  # what is better not wrapped is, rather than too wide
        for text in (text for column in shown for text in column):
            text.no_wrap = False
        widths = _widths(table, shown, room(len(every)))
    if widths is not None:
        return [made(every, widths)]
    first = next((k for k, column in enumerate(table.columns) if k and column.justify == "right" and all(
        later.justify == "right" for later in table.columns[k:])), len(every))
    names = every[:first]
    parts, begin = [], first
    while begin < len(every):
        end = begin + 1
        while end < len(every) and _widths(table, [shown[k] for k in (*names, *every[begin : end + 1])], room(len(names) + end + 1 - begin)) is not None:
            end += 1
        chosen = [*names, *every[begin:end]]
        given = [shown[k] for k in chosen]
        parts.append(made(chosen, _widths(table, given, room(len(chosen))) or [_least(column) for column in given]))
        begin = end
    return parts or [made(every, [_least(column) for column in shown])]
