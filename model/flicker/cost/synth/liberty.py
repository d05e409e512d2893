"""Cell libraries in Liberty form: areas, functions, and a linear delay model in FO4.

A delay is taken from the tables at one input slew, that of an inverter with fan-out 4, as the mean of rise and fall,
and fitted by ``intrinsic + resistance * load``. Everything downstream (``timing``) uses these two numbers per arc.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np

from ...errors import FlickerError


@dataclass
class Group:
    """A Liberty group: ``kind(args) { attributes, groups }``."""

    kind: str
    args: list[str]
    attributes: dict[str, list[str]] = field(default_factory=dict)
    groups: list[Group] = field(default_factory=list)

    def get(self, name: str, default: str = "") -> str:
        """First value of an attribute."""
        return self.attributes.get(name, [default])[0]

    def all(self, kind: str) -> list[Group]:
        return [group for group in self.groups if group.kind == kind]


_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}();:,]|[^\s{}();:,"]+', re.S)


def parse(path: Path) -> Group:
    """The ``library`` group of a Liberty file. FlickerError if there is none."""
    try:
        text = path.read_text(errors="replace")
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
    text = re.sub(r"/\*.*?\*/|//[^\n]*", " ", text, flags=re.S).replace("\\\n", " ")
    tokens = _TOKEN.findall(text)
    root = Group("file", [])
    stack, at = [root], 0
    try:
        while at < len(tokens):
            word = tokens[at]
            if word == "}":
                stack.pop()
                at += 1
            elif word == ";":
                at += 1
            elif tokens[at + 1] == ":":
                end = at + 2
                while tokens[end] not in (";", "}") and tokens[end + 1] != ":":
                    end += 1
                stack[-1].attributes[word] = [" ".join(tokens[at + 2 : end]).strip('"')]
                at = end
            elif tokens[at + 1] == "(":
                end = tokens.index(")", at)
                args = [token.strip('"') for token in tokens[at + 2 : end] if token != ","]
                at = end + 1
                if at < len(tokens) and tokens[at] == "{":
                    stack[-1].groups.append(Group(word, args))
                    stack.append(stack[-1].groups[-1])
                    at += 1
                else:
                    stack[-1].attributes[word] = args
            else:
                raise ValueError
    except (IndexError, ValueError):
        raise FlickerError(f"{path}: not a Liberty file (near {' '.join(tokens[at : at + 6])!r})") from None
    if not root.all("library"):
        raise FlickerError(f"{path}: no library group")
    return root.all("library")[0]


# ---- Functions ----------------------------------------------------------------------------------------------------


def to_verilog(function: str) -> str:
    """A Liberty function as a Verilog expression with every operator in brackets."""
    tokens = re.findall(r"[A-Za-z_]\w*|[01]|[!'()*&+|^]", function)
    at = 0

    def peek() -> str:
        return tokens[at] if at < len(tokens) else ""

    def atom() -> str:
        nonlocal at
        word = peek()
        at += 1
        if word == "!":
            text = f"(~{atom()})"
        elif word == "(":
            text = either()
            at += 1
        elif word in "01":
            text = f"1'b{word}"
        else:
            text = word
        while peek() == "'":
            at += 1
            text = f"(~{text})"
        return text

    def chain(operand, operators: str, symbol: str, juxtaposed: bool = False):
        def rule() -> str:
            nonlocal at
            text = operand()
            while peek() and (peek() in operators or (juxtaposed and peek() not in ")+|^")):
                if peek() in operators:
                    at += 1
                text = f"({text} {symbol} {operand()})"
            return text

        return rule

    exclusive = chain(atom, "^", "^")  # binds tighter than AND
    both = chain(exclusive, "*&", "&", juxtaposed=True)
    either = chain(both, "+|", "|")
    return either()


def truth(function: str, pins: list[str]) -> tuple[int, ...]:
    """Truth table over ``pins``, first pin slowest."""
    code = compile(to_verilog(function).replace("~", "1^").replace("1'b", ""), function, "eval")
    return tuple(eval(code, {}, dict(zip(pins, bits))) for bits in product((0, 1), repeat=len(pins)))


# ---- Cells --------------------------------------------------------------------------------------------------------


# Cell type of a clock gate in a netlist: enable ce, clock clk, gated clock gclk.
CLOCK_GATE = "FLK_CLOCK_GATE"


@dataclass
class Arc:
    """Delay from an input to an output: intrinsic + resistance * load, in library units."""

    source: str
    intrinsic: float
    resistance: float


@dataclass
class Cell:
    name: str
    area: float
    loads: dict[str, float]  # input pin -> capacitance
    functions: dict[str, str]  # output pin -> Liberty function
    arcs: dict[str, list[Arc]]  # output pin -> arcs
    sequential: dict[str, str]  # of a flip-flop: next_state, clocked_on, clear, preset, state, inverse
    setup: float
    clock: str  # clock pin of a flip-flop


class Library:
    """A Liberty library with the scalars of the estimate.

    Attributes: ``cells`` (all with a function, and ``CLOCK_GATE``), ``ge`` (area of the smallest NAND2), ``inverter`` (the
    smallest), ``fo4`` (delay of the inverter with a load of four of its kind), ``slew`` (its output transition), ``ps``
    (picoseconds in a time unit).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        group = parse(path)
        self.templates = {
            template.args[0]: template
            for template in group.groups if template.kind.endswith("_template") and template.args
        }
        raw = {cell.args[0]: cell for cell in group.all("cell")}
        inverter = self._smallest(raw, "!A", 1)
        nand = self._smallest(raw, "!(A*B)", 2)
        self.ge = float(raw[nand].get("area"))
        self._find_slew(raw[inverter])
        self.cells = {
            name: cell for name, group in raw.items() if (cell := self._cell(name, group)) is not None
        }
        number, unit = re.match(r"([\d.]+)\s*(ps|ns)", group.get("time_unit", "1ns")).groups()
        self.ps = float(number) * {"ps": 1.0, "ns": 1000.0}[unit]
        self.inverter = self.cells[inverter]
        arc = next(iter(self.inverter.arcs.values()))[0]
        self.inverter_load = next(iter(self.inverter.loads.values()))
        self.inverter_arc = arc
        self.fo4 = arc.intrinsic + arc.resistance * 4 * self.inverter_load
        self.flip_flop = min(
            (cell for cell in self.cells.values() if cell.sequential and not cell.sequential.get("preset")),
            key=lambda cell: cell.area, default=None,
        )
        if self.flip_flop is None:
            raise FlickerError(f"{path}: no flip-flop")
        self.cells[CLOCK_GATE] = self._clock_gate(raw)

    def _smallest(self, raw: dict[str, Group], function: str, inputs: int) -> str:
        found = []
        for name, cell in raw.items():
            pins = cell.all("pin")
            names = [pin.args[0] for pin in pins if pin.get("direction") == "input"]
            outputs = [pin.get("function") for pin in pins if pin.get("direction") == "output"]
            if cell.all("ff") or cell.all("latch") or len(names) != inputs or len(outputs) != 1 or not outputs[0]:
                continue
            if truth(outputs[0], names) == truth(function, ["A", "B"][:inputs]):
                found.append((float(cell.get("area", "0")), name))
        if not found:
            raise FlickerError(f"{self.path}: no cell with the function {function}")
        return min(found)[1]

    def _clock_gate(self, raw: dict[str, Group]) -> Cell:
        """Clock gate: the library's own, else the area of a latch (or flip-flop), an AND2 and an inverter."""
        own = [cell for cell in raw.values() if cell.get("clock_gating_integrated_cell")]
        if own:
            area = min(float(cell.get("area")) for cell in own)
        else:
            latches = [float(cell.get("area")) for cell in raw.values() if cell.all("latch")]
            both = self.cells[self._smallest(raw, "A*B", 2)]
            area = min([*latches, self.flip_flop.area]) + both.area + self.inverter.area
        flop = self.flip_flop
        data = re.sub(r"\W", "", flop.sequential["next_state"])
        return Cell(
            CLOCK_GATE, area, {"ce": flop.loads[data], "clk": flop.loads[flop.clock]}, {"gclk": "gate"}, {"gclk": []},
            {"state": "gate", "inverse": "", "next_state": "ce", "clocked_on": "clk"}, flop.setup, "clk",
        )

    # Tables

    def _table(self, table: Group) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Axes by variable name, in the order of the table's dimensions, and the values."""
        template = self.templates.get(table.args[0]) if table.args else None

        def numbers(name: str) -> np.ndarray:
            words = table.attributes.get(name) or (template.attributes.get(name) if template else None) or []
            return np.array([float(x) for word in words for x in word.replace(",", " ").split()])

        values = numbers("values")
        if template is None:  # scalar
            return {}, values
        axes = {
            template.get(f"variable_{n}"): numbers(f"index_{n}") for n in (1, 2) if template.get(f"variable_{n}")
        }
        return axes, values.reshape([len(axis) for axis in axes.values()])

    def _line(self, tables: list[Group], slew: float) -> tuple[float, float]:
        """Intrinsic value and slope over the load, mean of the tables, at an input slew."""
        intrinsic = slope = 0.0
        for table in tables:
            axes, values = self._table(table)
            if "input_net_transition" in axes:
                names = list(axes)
                dimension = names.index("input_net_transition")
                axis = axes.pop("input_net_transition")
                values = np.apply_along_axis(lambda column: np.interp(slew, axis, column), dimension, values)
            if axes:
                (load,) = axes.values()
                fit = np.polyfit(load, values, 1)
                slope += fit[0] / len(tables)
                intrinsic += fit[1] / len(tables)
            else:
                intrinsic += float(np.mean(values)) / len(tables)
        return float(intrinsic), float(slope)

    def _find_slew(self, cell: Group) -> None:
        """The slew that reproduces itself along a chain of inverters with fan-out 4."""
        pins = {pin.get("direction"): pin for pin in cell.all("pin")}
        load = 4 * float(pins["input"].get("capacitance"))
        timing = pins["output"].all("timing")[0]
        tables = timing.all("rise_transition") + timing.all("fall_transition")
        self.slew = 0.0
        for _ in range(30):
            intrinsic, slope = self._line(tables, self.slew)
            self.slew = intrinsic + slope * load

    def _cell(self, name: str, group: Group) -> Cell | None:
        """The cell, or None if it is no gate or flip-flop of use here."""
        if group.all("latch") or group.all("statetable") or group.get("dont_use") == "true":
            return None
        loads, functions, arcs = {}, {}, {}
        setup, clock = 0.0, ""
        for pin in group.all("pin"):
            label = pin.args[0]
            if pin.get("direction") == "input":
                loads[label] = float(pin.get("capacitance", "0"))
                if pin.get("clock") == "true":
                    clock = label
                for timing in pin.all("timing"):
                    if timing.get("timing_type").startswith("setup"):
                        tables = timing.all("rise_constraint") + timing.all("fall_constraint")
                        setup = max(setup, self._setup(tables))
            elif pin.get("direction") == "output":
                if not pin.get("function") or pin.get("three_state"):
                    return None
                functions[label] = pin.get("function")
                arcs[label] = []
                for timing in pin.all("timing"):
                    if timing.get("timing_type") in ("clear", "preset") or "three_state" in timing.get("timing_type"):
                        continue
                    intrinsic, slope = self._line(timing.all("cell_rise") + timing.all("cell_fall"), self.slew)
                    for source in timing.get("related_pin").split():
                        arcs[label].append(Arc(source, intrinsic, slope))
        sequential = {}
        for ff in group.all("ff"):
            sequential = {"state": ff.args[0], "inverse": ff.args[1] if len(ff.args) > 1 else ""}
            sequential |= {
                key: ff.get(key) for key in ("next_state", "clocked_on", "clear", "preset") if ff.get(key)
            }
            clock = clock or re.sub(r"\W", "", sequential["clocked_on"])
        if not functions:
            return None
        return Cell(name, float(group.get("area", "0")), loads, functions, arcs, sequential, setup, clock)

    def _setup(self, tables: list[Group]) -> float:
        worst = 0.0
        for table in tables:
            axes, values = self._table(table)
            for axis in reversed(list(axes.values())):
                values = np.apply_along_axis(lambda line, at=axis: np.interp(self.slew, at, line), -1, values)
            worst = max(worst, float(np.max(values)))
        return worst
