"""SystemVerilog of a schedule: units with the results that take turns in them, expressions, registers."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .graph import BOOL, Ff, Graph, Int, Value
from .schedule import QUICK, Schedule, Unit, needed, schedule


class _Writer:
    def __init__(self, plan: Schedule) -> None:
        self.plan, self.graph = plan, plan.graph
        self.names: dict[Value, str] = {}
        self._name()
        self.rows = _rows(plan)
        self.memories = any(row.memory for row in self.rows.values())

    def _name(self) -> None:
        taken = set()
        for i, v in enumerate(self.graph.values):
            name = v.name or f"v{i}"
            if v.operator is None:
                name += "_i"
            elif name in taken:
                name += f"_{i}"
            taken.add(name)
            self.names[v] = name

    def type_of(self, v: Value) -> str:
        return _type(v.kind)

    def operand(self, v: Value, cycle: int) -> str:
        """A value as it stands in a cycle of its element."""
        if v.constant is not None:
            if isinstance(v.kind, Ff):
                return f"{v.kind.bits}'h{v.constant:x}"
            return _integer(v.constant, v.kind.bits, v.kind.signed)
        k = self.plan.registers(v, cycle)
        assert k >= 0, (self.names[v], cycle)
        if k == 0:
            return self.names[v]
        text = f"{self.names[v]}_q[{k - 1}]" if k <= self.rows[v].front else f"{self.names[v]}_end{'_q' if self.rows[v].last else ''}"
        return f"$signed({text})" if isinstance(v.kind, Int) and v.kind.signed else text

    def begin(self, v: Value) -> int:
        return self.plan.begin.get(v, 0)


def _type(kind: Ff | Int) -> str:
    if kind == BOOL:
        return "logic"
    sign = "signed " if isinstance(kind, Int) and kind.signed else ""
    return f"logic {sign}[{kind.bits - 1}:0]"


def _integer(value: int, bits: int, signed: bool) -> str:
    return f"{'-' if value < 0 else ''}{bits}'{'s' if signed else ''}d{abs(value)}"


def _expression(w: _Writer, v: Value) -> str:
    """Operands of integer arithmetic are widened to the result, or to the widest operand where a comparison is made."""
    assert v.operator is not None
    cycle = w.begin(v)
    operands = [w.operand(o, cycle) for o in v.operands]
    text = v.operator.text
    integers = all(isinstance(o.kind, Int) for o in v.operands) and isinstance(v.kind, Int)
    if v.operator.wide:
        operands = [_widened(o, value, v.operator.wide, True) for o, value in zip(operands, v.operands)]
        return f"{v.kind.bits}'({text.format(*operands)})"
    arithmetic = integers and re.search(r"[-+*<>=]", text) and "[" not in text
    if arithmetic:
        kinds = [o.kind for o in v.operands]
        signed = any(k.signed for k in [*kinds, v.kind] if isinstance(k, Int))
        wide = max(k.bits + (signed and not k.signed) for k in [*kinds, v.kind] if isinstance(k, Int))
        operands = [_widened(o, value, wide, signed) for o, value in zip(operands, v.operands)]
        whole = text.format(*operands)
        if v.kind == BOOL:
            return whole
        return f"{v.kind.bits}'({whole})"
    if v.kind != BOOL and isinstance(v.kind, Int) and "?" in text:
        signed = v.kind.signed
        operands[1:] = [_widened(o, value, v.kind.bits, signed) for o, value in zip(operands[1:], v.operands[1:])]
    return text.format(*operands)


def _widened(text: str, value: Value, wide: int, signed: bool) -> str:
    assert isinstance(value.kind, Int)
    if value.constant is not None:
        return _integer(value.constant, wide, signed)
    if signed:
        if not value.kind.signed:
            return f"$signed({wide}'({text}))"
        return f"{wide}'({text})" if value.kind.bits != wide else text
    return f"{wide}'({text})" if value.kind.bits != wide else text


def module(name: str, head: str, build: Callable[[], Graph], intervals: Sequence[int]) -> tuple[str, dict[int, Schedule]]:
    """Text of the module, and its schedules by interval. Of several intervals, the parameter Interval chooses, the first where nobody does. `head` is the
    comment above it; how it works is added to it."""
    writers = {interval: _Writer(schedule(build(), interval)) for interval in intervals}
    first = writers[intervals[0]]
    memories = any(w.memories for w in writers.values())
    bodies = {interval: _body(w, memories, len(intervals) > 1) for interval, w in writers.items()}
    if len(intervals) == 1:
        parameters, check, inside = [" ("], [], bodies[intervals[0]]
    else:
        several = f"{', '.join(map(str, intervals[:-1]))} or {intervals[-1]}"
        parameters = [
            " #(", f"  parameter  int unsigned Interval = {intervals[0]},  // {several}",
            "  localparam int unsigned PhaseBits = (Interval > 2) ? $clog2(Interval) : 1", ") (",
        ]
        check = [
            f"  if ({' && '.join(f'Interval != {n}' for n in intervals)}) begin : gen_check", f'    $error("{name}: Interval must be {several}");', "  end", "",
        ]
        inside = []
        for interval, body in bodies.items():
            inside += [f"  {'end else ' if inside else ''}if (Interval == {interval}) begin : gen_{interval}", *(f"  {line}".rstrip() for line in body)]
        inside.append("  end")
    text = "\n".join([
        *_comment(_head(head, name, {interval: w.plan for interval, w in writers.items()}, memories)), f"module {name}{parameters[0]}", *parameters[1:],
        *_ports(first, memories, intervals), ");", "", *check, *_tables(first.graph), *inside, "", "endmodule", "",
    ])
    return text, {interval: w.plan for interval, w in writers.items()}


def _body(w: _Writer, reset: bool, chosen: bool) -> list[str]:
    """What stands between ports and end. reset: the module has one; chosen: it has a phase, whatever the interval."""
    plan, graph = w.plan, w.graph
    wires: list[str] = []
    body: list[str] = []
    turns = {v: unit for unit in plan.units for v in unit.turns.values()}
    made: set[int] = set()
    live = needed(graph)
    for v in graph.values:
        if v.operator is None or v not in live:
            continue
        note = f"  // cycle {plan.ready(v)}" if v in plan.begin else ""
        wires.append(f"  {w.type_of(v)} {w.names[v]};{note}")
        if v.operator.module and v in turns:
            unit = turns[v]
            if id(unit) not in made:
                made.add(id(unit))
                declared, lines = _unit(w, plan, unit)
                bits = dict(v.operator.parameters).get("OutBits", 0)
                wires += [f"  logic signed [{bits - 1}:0] {_unit_name(w, unit)};" if bits else f"  {w.type_of(v)} {_unit_name(w, unit)};", *declared]
                body += lines
        elif v.operator.module:
            body += _instance(w, v, w.names[v])
        else:
            body.append(f"  assign {w.names[v]} = {_expression(w, v)};")
    unused = {
        "wrapped": [w.names[v] for v in _wrapped(graph, live)], "reset": ["rst_ni"] if reset and not w.memories else [],
        "phase": ["phase_i"] if chosen and plan.interval == 1 else [],
    }
    for what, names in unused.items():
        if names:
            wires.append(f"  logic unused_{what};")
            body.append(f"  assign unused_{what} = ^{{{', '.join(names)}}};")
    if any("next_odd" in line for line in body):
        wires.insert(0, "  logic next_odd;  // the phase of the next cycle")
        body.insert(0, "  assign next_odd = phase_i ^ en_i;")
    outputs = [f"  assign {n}_o = {w.operand(v, plan.latency)};" for n, v in graph.outputs.items()]
    return [*wires, *_registers(w, plan), *body, "", *outputs]


def _wrapped(graph: Graph, live: set[Value]) -> list[Value]:
    """Values of which only low bits are used."""
    users: dict[Value, list[Value]] = {}
    for v in graph.values:
        if v in live:
            for o in v.operands:
                users.setdefault(o, []).append(v)
    narrow = lambda v, o: v.operator.wiring and re.fullmatch(r"\d+'\(\{0\}\)", v.operator.text) and v.kind.bits < o.kind.bits  # noqa: E731
    return [o for o, found in users.items() if o not in graph.outputs.values() and all(narrow(v, o) for v in found)]


def _head(head: str, name: str, plans: dict[int, Schedule], memories: bool) -> str:
    modulo = "Interval" if len(plans) > 1 else next(iter(plans))
    taken = "in each cycle with en_i" if modulo == 1 else f"in cycles with en_i and phase_i 0; phase_i counts cycles with en_i modulo {modulo}"
    units = " ".join(f"Units{f' with Interval {n}' if len(plans) > 1 else ''}: {_census(plan) or 'none'}." for n, plan in plans.items())
    return (
        f"{head}\n\nGenerated by `make generate` from flicker.datapath.units.{_builder(name)}: edit that, not this (docs/reference/datapath.md).\n"
        f"An element is taken {taken}. Its outputs stand {' or '.join(str(plan.latency) for plan in plans.values())} cycles with en_i later, for one of them"
        f"{'; Interval is ' + ' or '.join(map(str, plans)) if len(plans) > 1 else ''}. "
        f"Registers load with en_i and are not reset{', but for places in memories' if memories else ''}.\n{units}"
    )


def _builder(name: str) -> str:
    return name.removeprefix("flk_").removeprefix("splat_")


def _comment(head: str) -> list[str]:
    return [f"// {line}".rstrip() for paragraph in head.splitlines() for line in (textwrap.wrap(paragraph, 117) or [""])]


def _census(plan: Schedule) -> str:
    counts: dict[str, list[int]] = {}
    for unit in plan.units:
        size = dict(unit.operator.parameters).get("ManBits", 0)
        entry = counts.setdefault(f"{unit.operator.module.removeprefix('flk_ff_')} of {size} bits", [0, 0])
        entry[0] += len(unit.turns)
        entry[1] += 1
    return ", ".join(f"{operations} {name} in {units}" for name, (operations, units) in sorted(counts.items()))


def _ports(w: _Writer, memories: bool, intervals: Sequence[int]) -> list[str]:
    ports = [("input", "logic", "clk_i"), *([("input", "logic", "rst_ni")] if memories else []), ("input", "logic", "en_i")]
    if max(intervals) > 1:
        width = "PhaseBits-1" if len(intervals) > 1 else str(_phase_bits(w.plan) - 1)
        ports.append(("input", f"logic [{width}:0]", "phase_i"))
    ports += [("input", w.type_of(v), w.names[v]) for v in w.graph.values if v.operator is None]
    ports += [("output", _type(v.kind), f"{name}_o") for name, v in w.graph.outputs.items()]
    wide = max(len(p[1]) for p in ports)
    return [f"  {d:6} {t:{wide}} {n}{',' if i + 1 < len(ports) else ''}" for i, (d, t, n) in enumerate(ports)]


def _tables(graph: Graph) -> list[str]:
    out = []
    for name, table in graph.tables.items():
        codes = [f"{9 + table.M}'h{code:x}" for code in table.codes()]
        rows = [f"    {', '.join(codes[i:i + 8])}" for i in range(0, len(codes), 8)]
        out += [f"  localparam logic [{8 + table.M}:0] {name.upper()} [{len(codes)}] = '{{", ",\n".join(rows), "  };", ""]
    return out


def _instance(w: _Writer, v: Value, result: str) -> list[str]:
    """An unclocked module."""
    assert v.operator is not None
    cycle = w.begin(v)
    operands = [w.operand(o, cycle) for o in v.operands]
    if v.operator.module == "flk_ff_ldexp":
        operands[1] = _widened(operands[1], v.operands[1], 10, True)
    return _text(v, [*operands, result], result)


def _text(v: Value, wires: list[str], name: str, clocked: bool = False) -> list[str]:
    assert v.operator is not None
    parameters = ", ".join(f".{n}({x})" for n, x in v.operator.parameters)
    ports = ", ".join([*([".clk_i", ".en_i"] if clocked else []), *(f".{p}({x})" for p, x in zip(v.operator.ports, wires))])
    return [f"  {v.operator.module} #({parameters}) i_{name} ({ports});"]


def _unit_name(w: _Writer, unit: Unit) -> str:
    return f"u_{w.names[unit.turns[min(unit.turns)]]}"


SLICE = 10  # bits of an operand that share the register of their multiplexer


def _unit(w: _Writer, plan: Schedule, unit: Unit) -> tuple[list[str], list[str]]:
    """Wires; a unit, its operands by phase, and the results by name."""
    turns = dict(sorted(unit.turns.items()))
    first = next(iter(turns.values()))
    assert first.operator is not None
    name = _unit_name(w, unit)
    declared, body, ports, held = [], [], [], []
    parameters = dict(first.operator.parameters)
    for k in range(len(first.operands)):
        texts = [_turn(w, plan, v, k) for v in turns.values()]
        bits = first.operands[k].kind.bits
        if first.operator.module == "flk_fixed_mul":
            bits = (parameters["ABits"], parameters["BBits"])[k]
        port = first.operator.ports[k].removesuffix("_i")
        if len(set(texts)) == 1:
            text = texts[0]
        elif plan.interval == 2 and not first.operator.held and first.operator.module not in QUICK:
            text = f"{name}_{port}"
            declared += [f"  logic [{bits - 1}:0] {text}, {text}_even, {text}_odd;"]
            body += [f"  assign {text}_even = {texts[0]};", f"  assign {text}_odd = {texts[1]};"]
            slices = -(-bits // SLICE)
            for i in range(slices):
                low, high = bits * i // slices, bits * (i + 1) // slices - 1
                part = f"[{high}:{low}]"
                body += [
                    f"  flk_phase_mux #(.Width({high - low + 1})) i_{text}_{i} (.clk_i, .odd_i(next_odd), .a_i({text}_even{part}), .b_i({text}_odd{part}), "
                    f".y_o({text}{part}));"
                ]
        else:
            text = texts[-1]
            for p, other in list(zip(turns, texts))[-2::-1]:
                text = f"phase_i == {_phase_bits(plan)}'d{p} ? {other} : {text}"
        if first.operator.held:
            held.append((f"{name}_{port}_q", bits, text))
            text = held[-1][0]
        if first.operator.module == "flk_ff_exp2":
            text = f"{parameters['IntBits'] + parameters['FracBits']}'({text})"
        ports.append(text)
    if held:
        declared += [f"  logic [{bits - 1}:0] {register};" for register, bits, _ in held]
        loads = [f"      {register} <= {text};" for register, _, text in held]
        body += ["  always_ff @(posedge clk_i) begin", "    if (en_i) begin", *loads, "    end", "  end"]
    body += _text(first, [*ports, name], name, True)
    result = parameters.get("OutBits", 0)
    for v in turns.values():
        body.append(f"  assign {w.names[v]} = {f'{v.kind.bits}({name})'.replace('(', chr(39) + '(') if result > v.kind.bits else name};")
    return declared, body


def _turn(w: _Writer, plan: Schedule, v: Value, k: int) -> str:
    """An operand of a turn."""
    text = w.operand(v.operands[k], plan.begin[v])
    if v.operator is not None and v.operator.module == "flk_fixed_mul":
        parameters = dict(v.operator.parameters)
        return _widened(text, v.operands[k], (parameters["ABits"], parameters["BBits"])[k], True)
    if not v.negated[k]:
        return text
    top = v.operands[k].kind.bits - 1
    return f"{{!{text}[{top}], {text}[{top - 1}:0]}}" if "'" not in text else f"({text} ^ {{1'b1, {top}'b0}})"


LONG = 8  # registers in a row that become a memory


@dataclass(frozen=True)
class _Row:
    """Registers behind a value: front of flip-flops, then a memory of so many places, then a last flip-flop if logic uses what comes out."""

    front: int
    memory: int = 0
    last: int = 0


def _rows(plan: Schedule) -> dict[Value, _Row]:
    """Registers behind each value: where the last user alone is far away, a memory takes what lies between."""
    taps: dict[Value, set[int]] = {}
    logic: dict[Value, int] = {}
    for v in plan.begin:
        for o in v.operands:
            if o.constant is None and (k := plan.registers(o, plan.begin[v])) > 0:
                taps.setdefault(o, set()).add(k)
                logic[o] = max(logic.get(o, 0), k)
    for v in plan.graph.outputs.values():
        if v.constant is None and (k := plan.registers(v, plan.latency)) > 0:
            taps.setdefault(v, set()).add(k)
    rows = {}
    for v, found in taps.items():
        *inner, deepest = sorted(found)
        front, last = max(inner, default=0), int(logic.get(v, 0) == deepest)
        memory = deepest - front - last
        rows[v] = _Row(front, memory, last) if memory >= LONG else _Row(deepest)
    return rows


def _registers(w: _Writer, plan: Schedule) -> list[str]:
    """Registers of all values, by the phase in which they load, and the memories, one for rows of equal length."""
    out: list[str] = []
    loads: dict[int, list[str]] = {}
    rings: dict[tuple[int, int], list[Value]] = {}
    for v in w.graph.values:
        if v not in w.rows:
            continue
        bits, name, phase = v.kind.bits, w.names[v], plan.ready(v) % plan.interval
        row = w.rows[v]
        if row.memory:
            rings.setdefault((phase, row.memory), []).append(v)
            out.append(f"  logic [{bits - 1}:0] {name}_end;")
        if row.last:
            out.append(f"  logic [{bits - 1}:0] {name}_end_q;")
            loads.setdefault(phase, []).append(f"      {name}_end_q <= {name}_end;")
        if row.front:
            out.append(f"  logic [{row.front - 1}:0][{bits - 1}:0] {name}_q;")
            shift = f"{{{name}_q[{row.front - 2}:0], {name}}}" if row.front > 1 else name
            loads.setdefault(phase, []).append(f"      {name}_q <= {shift};")
    out.append("")
    for phase, lines in sorted(loads.items()):
        out += ["  always_ff @(posedge clk_i) begin", f"    if ({_enable(plan, phase)}) begin", *lines, "    end", "  end", ""]
    for (phase, depth), values in sorted(rings.items()):
        begins = ", ".join(f"{w.names[v]}_q[{w.rows[v].front - 1}]" if w.rows[v].front else w.names[v] for v in values)
        ends = ", ".join(f"{w.names[v]}_end" for v in values)
        out += [f"  flk_delay_ram #(.Width({sum(v.kind.bits for v in values)}), .Depth({depth})) i_ring_{phase}_{depth} (",
                f"    .clk_i, .rst_ni, .en_i({_enable(plan, phase)}), .d_i({{{begins}}}), .q_o({{{ends}}})", "  );", ""]
    return out


def _phase_bits(plan: Schedule) -> int:
    return max((plan.interval - 1).bit_length(), 1)


def _enable(plan: Schedule, phase: int) -> str:
    return "en_i" if plan.interval == 1 else f"en_i && phase_i == {_phase_bits(plan)}'d{phase}"
