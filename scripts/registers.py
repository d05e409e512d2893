"""Registers without reset, from Verilator's tree of the elaborated design: what they feed, and whether each is on the list (lint/registers.toml).

A register without reset holds anything at the start, in a 4-state simulation X. That is harmless for data that are valid with something that is reset. It
is not for a register whose next value depends on itself other than by holding, which may never leave X, nor for one that decides what reset registers do.
Kinds, the worst first: "feeds itself", "drives control", "data".
"""

from __future__ import annotations

import fnmatch
import re
import tomllib
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

KINDS = ("data", "drives control", "feeds itself")
# Output ports that others act on whatever their data are.
CONTROL = re.compile(
    r"(^|_)(valid|ready|idle|done|start|busy|free|full|empty|error|push|pop|take|en|move|last|release|clear|stuck|drained|locked|refused|post)_o$"
)
Node = tuple[str, str]  # variable, and the part of it that is read or written ("": all)


def _below(node: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for value in node.values():
        if isinstance(value, list):
            for child in value:
                if isinstance(child, dict):
                    yield child


def _part(node: dict[str, Any]) -> Node | None:
    """Variable and part of a reference, through selections; None: no reference."""
    part = ""
    while node["type"] in ("SEL", "ARRAYSEL", "STRUCTSEL"):
        if node["type"] == "STRUCTSEL":
            part = f".{node['name']}"
        else:
            index = node["lsbp" if node["type"] == "SEL" else "bitp"][0]
            part = f"[{index['name'].split(chr(39))[-1]}+{node.get('widthConst', '')}]" if index["type"] == "CONST" else ""
        node = node["fromp"][0]
    return (node["name"], part) if node["type"] == "VARREF" else None


def _reads(node: dict[str, Any]) -> Iterator[Node]:
    """All that an expression reads, indices too."""
    if (part := _part(node)) is not None:
        yield part
        while node["type"] != "VARREF":
            if node["type"] != "STRUCTSEL":
                yield from _reads(node["lsbp" if node["type"] == "SEL" else "bitp"][0])
            node = node["fromp"][0]
        return
    for child in _below(node):
        yield from _reads(child)


def _indices(node: dict[str, Any]) -> Iterator[Node]:
    """What the indices of the left side of an assignment read."""
    while node["type"] in ("SEL", "ARRAYSEL", "STRUCTSEL"):
        if node["type"] != "STRUCTSEL":
            yield from _reads(node["lsbp" if node["type"] == "SEL" else "bitp"][0])
        node = node["fromp"][0]


def _targets(node: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Left sides, those in a concatenation one by one."""
    if node["type"] == "CONCAT":
        for child in _below(node):
            yield from _targets(child)
    else:
        yield node


def _overlap(a: str, b: str) -> bool:
    if not a or not b or a[0] != b[0]:
        return True
    if a[0] == "." or a.endswith("+]") or b.endswith("+]"):
        return a == b
    (a_low, a_bits), (b_low, b_bits) = ((int(low, 16), int(bits)) for low, bits in (x[1:-1].lstrip("sh").split("+") for x in (a, b)))
    return a_low < b_low + b_bits and b_low < a_low + a_bits


def _moves(target: Node, right: dict[str, Any]) -> bool:
    """A row of registers in one vector: its own bits move by a place, others come behind."""
    while right["type"] in ("SEL", "EXTEND"):
        right = right["fromp" if right["type"] == "SEL" else "lhsp"][0]
    if right["type"] != "CONCAT":
        return False
    high, low = ([name for name, _ in _reads(right[side][0])] for side in ("lhsp", "rhsp"))
    return (target[0] in high) != (target[0] in low)


@dataclass
class Module:
    """variables written by each kind of assignment, as edges from what is read. Edges carry whether they copy a value unchanged."""

    name: str
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    edges: dict[Node, dict[Node, bool]] = field(default_factory=lambda: defaultdict(dict))  # from, to: copied
    registers: set[str] = field(default_factory=set)  # with a reset
    bare: set[str] = field(default_factory=set)  # without
    control: set[Node] = field(default_factory=set)  # nodes that reset registers, memories' writes and control ports depend on
    cells: list[tuple[str, Module]] = field(default_factory=list)

    def edge(self, source: Node, target: Node, copied: bool = False) -> None:
        self.edges[source][target] = self.edges[source].get(target, True) and copied

    def is_reset(self, node: Node) -> bool:
        return node[0] in self.registers

    @cached_property
    def graph(self) -> dict[Node, dict[Node, bool]]:
        """With the edges from what is written to what is read of the same variable; nothing leads on from registers with a reset."""
        nodes = {*self.edges, *(target for found in self.edges.values() for target in found), *self.control}
        parts: dict[str, set[str]] = defaultdict(set)
        for name, part in nodes:
            parts[name].add(part)
        out: dict[Node, dict[Node, bool]] = {node: dict(self.edges.get(node, {})) for node in nodes}
        for name, found in parts.items():
            if name not in self.registers:
                for a in found:
                    for b in found:
                        if a != b and _overlap(a, b):
                            out[name, a].setdefault((name, b), True)
        for node in nodes:
            if self.is_reset(node):
                out[node] = {}
        return out

    def reached(self, starts: Iterable[Node], through_registers: bool) -> set[Node]:
        """Nodes behind `starts`, through logic, and through registers without reset if wanted."""
        seen = set(starts)
        pending = list(seen)
        while pending:
            for target in self.graph.get(pending.pop(), {}):
                if target not in seen and (through_registers or target[0] not in self.bare):
                    seen.add(target)
                    pending.append(target)
        return seen

    def all_of(self, name: str) -> list[Node]:
        return [node for node in self.graph if node[0] == name]

    def _ways(self, through_registers: bool) -> list[tuple[str, str]]:
        found = []
        for name in self.inputs:
            reached = self.reached(self.all_of(name), through_registers)
            found += [(name, output) for output in self.outputs if any(node in reached for node in self.all_of(output))]
        return found

    @cached_property
    def logic(self) -> list[tuple[str, str]]:
        """Inputs and the outputs that follow them in the same cycle."""
        return self._ways(False)

    @cached_property
    def rows(self) -> list[tuple[str, str]]:
        """Inputs and the outputs that follow them later, through registers without reset alone."""
        ways = set(self.logic)
        return [way for way in self._ways(True) if way not in ways]

    @cached_property
    def control_inputs(self) -> set[str]:
        """Inputs that decide, through logic alone, what a reset register does."""
        return {name for name in self.inputs if self.reached(self.all_of(name), False) & self.control}

    @cached_property
    def kinds(self) -> dict[str, str]:
        """Of each register without reset."""
        loops = self._loops()
        out = {}
        for name in self.bare:
            nodes = self.all_of(name)
            drives = self.reached(nodes, False) & self.control
            out[name] = "feeds itself" if any(node in loops for node in nodes) else "drives control" if drives else "data"
        for cell, child in self.cells:
            for source, target in child.rows:
                if (f"{cell}()", f".{source}") in self.reached([(f"{cell}()", f".{target}")], False):
                    out[f"{cell} ({child.name})"] = "feeds itself"
        return out

    def _loops(self) -> set[Node]:
        """Nodes of cycles that change the value."""
        found: set[Node] = set()
        for group in _components(self.graph):
            inside = set(group)
            changes = any(not copied for node in group for target, copied in self.graph[node].items() if target in inside)
            held = any(node[0] in self.bare for node in group)
            if changes and held and (len(group) > 1 or group[0] in self.graph[group[0]]):
                found |= inside
        return found


def _components(graph: dict[Node, dict[Node, bool]]) -> Iterator[list[Node]]:
    """Strongly connected components (Tarjan, without recursion)."""
    index: dict[Node, int] = {}
    low: dict[Node, int] = {}
    stack: list[Node] = []
    on: set[Node] = set()
    for root in graph:
        if root in index:
            continue
        work = [(root, iter(graph[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        on.add(root)
        while work:
            node, rest = work[-1]
            for target in rest:
                if target not in index:
                    index[target] = low[target] = len(index)
                    stack.append(target)
                    on.add(target)
                    work.append((target, iter(graph.get(target, {}))))
                    break
                if target in on:
                    low[node] = min(low[node], index[target])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    group = []
                    while True:
                        group.append(stack.pop())
                        on.discard(group[-1])
                        if group[-1] == node:
                            break
                    yield group


class Reader:
    """Modules of a tree, each read once."""

    def __init__(self, modules: list[dict[str, Any]]) -> None:
        self.trees = {tree["addr"]: tree for tree in modules if tree["type"] == "MODULE"}
        self.done: dict[str, Module] = {}

    def module(self, address: str) -> Module:
        if address not in self.done:
            tree = self.trees[address]
            module = Module(tree["origName"])
            for statement in tree["stmtsp"]:
                self._statement(module, statement)
            module.control |= {node for name in module.outputs if CONTROL.search(name) for node in [(name, "")]}
            self.done[address] = module
        return self.done[address]

    def _statement(self, module: Module, node: dict[str, Any]) -> None:
        kind = node["type"]
        if kind == "VAR":
            if node.get("direction") == "INPUT":
                module.inputs.append(node["name"])
            elif node.get("direction") == "OUTPUT":
                module.outputs.append(node["name"])
        elif kind == "ALWAYS":
            senses = node["sentreep"][0]["sensesp"] if node["sentreep"] else []
            edges = [sense for sense in senses if sense.get("edgeType") in ("POS", "NEG")]
            if edges:
                reset = {name for sense in edges[1:] for name, _ in _reads(sense["sensp"][0])}
                cleared = set(self._cleared(node, reset)) if reset else set()
                self._block(module, node["stmtsp"], [], True, cleared, reset)
            else:
                self._block(module, node["stmtsp"], [], False, set(), set())
        elif kind == "CELL":
            self._cell(module, node)
        elif kind in ("GENBLOCK", "BEGIN"):
            for child in _below(node):
                self._statement(module, child)
        elif kind == "ASSIGNW":
            self._assign(module, node, [], False, set(), set())

    def _cleared(self, node: dict[str, Any], reset: set[str]) -> Iterator[str]:
        """Variables that the branch of a reset assigns."""
        if node["type"] == "IF" and (names := {name for name, _ in _reads(node["condp"][0])}) and names <= reset:
            inverted = node["condp"][0]["type"] not in ("NOT", "LOGNOT")  # `if (!rst)` is kept as `if (rst)` with its branches changed over
            branch = node["elsesp" if inverted else "thensp"]
            yield from (name for child in branch for name in self._written(child))
        elif node["type"] == "ASSIGNDLY" and reset & {name for name, _ in _reads(node["rhsp"][0])}:  # `if (!rst) x <= 0; else x <= y;` as x <= rst & y
            yield from self._written(node)
        else:
            for child in _below(node):
                yield from self._cleared(child, reset)

    def _written(self, node: dict[str, Any]) -> Iterator[str]:
        if node["type"] in ("ASSIGN", "ASSIGNDLY", "ASSIGNW"):
            yield from (part[0] for target in _targets(node["lhsp"][0]) if (part := _part(target)) is not None)
        for child in _below(node):
            yield from self._written(child)

    def _block(self, module: Module, statements: list[dict[str, Any]], conditions: list[Node], clocked: bool, cleared: set[str], reset: set[str]) -> None:
        for node in statements:
            kind = node["type"]
            if kind in ("ASSIGN", "ASSIGNDLY", "ASSIGNW"):
                self._assign(module, node, conditions, clocked and kind == "ASSIGNDLY", cleared, reset)
            elif kind in ("IF", "CASE", "LOOP", "LOOPTEST"):
                key = {"IF": "condp", "CASE": "exprp", "LOOPTEST": "condp"}.get(kind)
                own = [part for part in _reads(node[key][0]) if part[0] not in reset] if key else []
                inner = [*conditions, *own]
                for child in _below(node):
                    if kind == "CASE" and child["type"] == "CASEITEM":
                        items = [part for condition in child.get("condsp", []) for part in _reads(condition)]
                        self._block(module, child["stmtsp"], [*inner, *items], clocked, cleared, reset)
                    else:
                        self._block(module, [child], inner, clocked, cleared, reset)
            else:
                self._block(module, list(_below(node)), conditions, clocked, cleared, reset)

    def _assign(self, module: Module, node: dict[str, Any], conditions: list[Node], clocked: bool, cleared: set[str], reset: set[str]) -> None:
        right = node["rhsp"][0]
        for left in _targets(node["lhsp"][0]):
            target = _part(left)
            if target is None:
                continue
            if clocked:
                (module.registers if target[0] in cleared else module.bare).add(target[0])
            indices = list(_indices(left))
            if clocked and (target[0] in cleared or left["type"] == "ARRAYSEL" and indices):
                # What reset registers load, and where and when memories are written.
                module.control |= {*conditions, *indices, *(_reads(right) if target[0] in cleared else ())}
            for source in (*conditions, *indices):
                module.edge(source, target)
            self._value(module, target, right)

    def _value(self, module: Module, target: Node, right: dict[str, Any]) -> None:
        """Edges of a value; one that stays as it is is no edge."""
        if (part := _part(right)) is not None:
            for read in _reads(right):
                if read != target:
                    module.edge(read, target, read == part)
        elif right["type"] == "COND":
            for source in _reads(right["condp"][0]):
                module.edge(source, target)
            for side in ("thenp", "elsep"):
                self._value(module, target, right[side][0])
        elif right["type"] in ("CONCAT", "EXTEND", "SEL", "REPLICATE"):
            moves = _moves(target, right)
            for source in _reads(right):
                if not (moves and source[0] == target[0]):
                    module.edge(source, target, source[0] != target[0])
        else:
            for source in _reads(right):
                module.edge(source, target)

    def _cell(self, module: Module, node: dict[str, Any]) -> None:
        child = self.module(node["modp"])
        # Names in generated blocks may repeat.
        name = node["name"]
        module.cells.append((name, child))
        for pin in node["pinsp"]:
            if not pin.get("exprp"):
                continue
            port, expression = pin["name"], pin["exprp"][0]
            inside = (f"{name}()", f".{port}")
            if port in child.inputs:
                copied = _part(expression) is not None or expression["type"] == "CONCAT"
                for source in _reads(expression):
                    module.edge(source, inside, copied)
                if port in child.control_inputs:
                    module.control.add(inside)
            else:
                for left in _targets(expression):
                    if (target := _part(left)) is not None:
                        module.edge(inside, target, True)
        for entry, leave in child.logic:
            module.edge((f"{name}()", f".{entry}"), (f"{name}()", f".{leave}"))


def registers_of(modules: list[dict[str, Any]]) -> dict[str, dict[str, str]]:
    """Kind of each register without reset, by module and name; of all elaborations of a module the worst."""
    reader = Reader(modules)
    out: dict[str, dict[str, str]] = {}
    for address in reader.trees:
        module = reader.module(address)
        own = out.setdefault(module.name, {})
        for name, kind in module.kinds.items():
            own[name] = max(kind, own.get(name, kind), key=KINDS.index)
    return {name: dict(sorted(own.items())) for name, own in sorted(out.items()) if own}


def with_reset(modules: list[dict[str, Any]]) -> list[str]:
    """Names of modules that have a register with a reset."""
    reader = Reader(modules)
    return sorted({module.name for module in map(reader.module, reader.trees) if module.registers})


def check(found: dict[str, dict[str, str]], path: Path, state: Collection[str] = ()) -> list[str]:
    """Findings: registers that the list does not have as what they are, names and modules of the list that nothing needs, and "*" for data of a module in
    `state`, which has registers with a reset: names are listed there, so that a new one is looked at."""
    entries = tomllib.loads(path.read_text())["register"]
    findings = [f"{path.name}: entry {k + 1}: kind must be one of {', '.join(KINDS)}, with a reason" for k, entry in enumerate(entries)
                if entry.get("kind") not in KINDS or not entry.get("reason")]
    findings += [f"{path.name}: entry {k + 1}: {module} has registers with a reset: name those without" for k, entry in enumerate(entries)
                 if "*" in entry["names"] for module in entry["modules"] if module in state]
    used: set[tuple[int, str]] = set()
    for module, registers in found.items():
        for name, kind in registers.items():
            hits = [(k, pattern) for k, entry in enumerate(entries) if module in entry["modules"] and entry["kind"] == kind
                    for pattern in entry["names"] if fnmatch.fnmatchcase(name, pattern.replace("[", "[[]"))]
            used |= {hit for k, pattern in hits for hit in ((k, module), (k, pattern))}
            if not hits:
                what = "holds data" if kind == "data" else kind
                findings.append(f"{module}: {name} has no reset and {what}: reset it, or say in {path.parent.name}/{path.name} why it may start with anything")
    for k, entry in enumerate(entries):
        words = [word for word in (*entry["modules"], *entry["names"]) if (k, word) not in used]
        findings += [f"{path.parent.name}/{path.name}: entry {k + 1}: nothing is like {word}" for word in words]
    return findings
