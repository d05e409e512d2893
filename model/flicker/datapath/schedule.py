"""When each operation begins, and which of them share a unit.

An element enters every `interval` cycles. An operation that begins t cycles after its element entered has the phase t mod interval; operations of one
kind with different phases share a unit. A result that is ready in cycle r is at its unit's output in that cycle alone; later users take it from registers
that load once an interval: the k-th holds it in the cycles r + (k - 1) interval + 1 to r + k interval.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from .graph import Graph, Operator, Value

REACH = 12  # cycles by which a move may go
SWEEPS = 20
WIDE = 28  # bits of a whole number that several sums take out of a register of its own


@dataclass(eq=False)
class Unit:
    """A module of the pipeline and the operations that take turns in it, by phase."""

    operator: Operator
    turns: dict[int, Value] = field(default_factory=dict)


@dataclass(eq=False)
class Schedule:
    """begin: cycle in which an operation takes its operands. latency: cycle of the outputs, a multiple of the interval. units: of clocked modules."""

    graph: Graph
    interval: int
    begin: dict[Value, int]
    latency: int
    units: list[Unit]

    def ready(self, value: Value) -> int:
        return _ready(value, self.begin)

    def registers(self, value: Value, cycle: int) -> int:
        """Registers between a value and its user in a cycle."""
        if _fixed(value):
            return 0
        return -(-(cycle - self.ready(value)) // self.interval)


def _fixed(value: Value) -> bool:
    """The same for all elements of a frame."""
    return value.register or value.constant is not None or (value.operator is not None and all(map(_fixed, value.operands)))


def _ready(value: Value, begin: dict[Value, int]) -> int:
    if value.operator is None:
        return 0
    return begin[value] + value.operator.latency


def _settle(value: Value) -> int:
    """Cycles between a value and its first use: expressions end in a register, and late inputs, and wide numbers."""
    operator = value.operator
    if value.late:
        return 1
    return 1 if operator is not None and operator.latency == 0 and not operator.wiring else 0


def _shared(value: Value) -> bool:
    return value.operator is not None and value.operator.shared and not _fixed(value)


class _Scheduler:
    def __init__(self, graph: Graph, interval: int) -> None:
        self.graph, self.interval = graph, interval
        live = needed(graph)
        self.order = [v for v in graph.values if v in live and v.operator is not None and not _fixed(v)]
        self.users: dict[Value, list[Value]] = defaultdict(list)
        for v in self.order:
            for o in set(v.operands):
                if not _fixed(o):
                    self.users[o].append(v)
        self.ends = {v for v in graph.outputs.values() if not _fixed(v)}
        counts: dict[tuple, int] = defaultdict(int)
        for v in self.order:
            if _shared(v):
                counts[self.class_of(v)] += 1
        self.limit = {key: -(-n // interval) for key, n in counts.items()}
        self.used: dict[tuple, int] = defaultdict(int)
        self.begin: dict[Value, int] = {}

    def class_of(self, v: Value) -> tuple:
        assert v.operator is not None
        return v.operator.module, v.operator.parameters

    def slot(self, v: Value, cycle: int) -> tuple:
        return self.class_of(v), cycle % self.interval

    def free(self, v: Value, cycle: int) -> bool:
        return not _shared(v) or self.used[self.slot(v, cycle)] < self.limit[self.class_of(v)]

    def earliest(self, v: Value) -> int:
        return max((_ready(o, self.begin) + _settle(o) for o in v.operands if not _fixed(o)), default=0)

    def place(self, v: Value, cycle: int) -> None:
        if v in self.begin and _shared(v):
            self.used[self.slot(v, self.begin[v])] -= 1
        self.begin[v] = cycle
        if _shared(v):
            self.used[self.slot(v, cycle)] += 1

    def first(self) -> None:
        """Each operation as early as its operands and a free unit allow, those far from the end first."""
        distance: dict[Value, int] = {}
        for v in reversed(self.order):
            assert v.operator is not None
            distance[v] = v.operator.latency + _settle(v) + max((distance[u] for u in self.users[v]), default=0)
        waiting = list(self.order)
        while waiting:
            ready = [v for v in waiting if all(_fixed(o) or o.operator is None or o in self.begin for o in v.operands)]
            v = min(ready, key=lambda v: (self.earliest(v), -distance[v]))
            cycle = self.earliest(v)
            while not self.free(v, cycle):
                cycle += 1
            self.place(v, cycle)
            waiting.remove(v)

    def bits(self, value: Value, latency: int) -> int:
        """Register bits behind a value."""
        last = max([self.begin[u] for u in self.users[value]] + ([latency] if value in self.ends else []), default=0)
        return value.kind.bits * max(-(-(last - _ready(value, self.begin)) // self.interval), 0)

    def improve(self, latency: int) -> None:
        """Move operations while that saves registers."""
        for _ in range(SWEEPS):
            moved = False
            for v in [*reversed(self.order), *self.order]:
                assert v.operator is not None
                around = [v, *{o for o in v.operands if not _fixed(o)}]
                now = self.begin[v]
                low = max(self.earliest(v), now - REACH)
                last = [self.begin[u] for u in self.users[v]] + ([latency] if v in self.ends else [])
                high = min([c - v.operator.latency - _settle(v) for c in last] + [now + REACH])
                best, least = now, sum(self.bits(a, latency) for a in around)
                for cycle in range(low, high + 1):
                    if cycle == now or (cycle - now) % self.interval and not self.free(v, cycle):
                        continue
                    self.place(v, cycle)
                    bits = sum(self.bits(a, latency) for a in around)
                    if bits < least:
                        best, least = cycle, bits
                self.place(v, best)
                moved |= best != now
            if not moved:
                return


def needed(graph: Graph) -> set[Value]:
    """Values that an output depends on."""
    reached: set[Value] = set()
    pending = list(graph.outputs.values())
    while pending:
        v = pending.pop()
        if v not in reached:
            reached.add(v)
            pending += v.operands
    return reached


# Operators whose first stage leaves no time for a multiplexer in front: their operands are held in registers behind it. Name, least mantissa bits.
SLOW = {"flk_ff_add": 15, "flk_ff_mul": 15}
QUICK = ("flk_ff_to_fixed",)  # have time for a multiplexer and its choice in front of them


def _held(operator: Operator, interval: int) -> bool:
    """Whether operands are registered behind the multiplexers of an operator that takes turns: of more than two, all but QUICK."""
    if operator.module in QUICK:
        return False
    return interval > 2 or dict(operator.parameters).get("ManBits", 0) >= SLOW.get(operator.module, 99)


def _hold(graph: Graph, interval: int) -> None:
    """Mark what is slow where units take turns: operations with registers in front, wide whole numbers with one behind."""
    counts: dict[Operator, int] = defaultdict(int)
    live = needed(graph)
    for v in graph.values:
        if v in live and v.operator is not None and _shared(v):
            counts[v.operator] += 1
    for v in graph.values:
        operator = v.operator
        if operator is None or interval == 1 or counts[operator] < 2:
            continue
        v.late = operator.module == "flk_ff_to_fixed" and v.kind.bits >= WIDE
        if _held(operator, interval):
            v.operator = replace(operator, latency=operator.latency + 1, held=True)


def schedule(graph: Graph, interval: int) -> Schedule:
    """Begin of each operation that an output needs, and the units."""
    _hold(graph, interval)
    s = _Scheduler(graph, interval)
    s.first()
    end = max((_ready(v, s.begin) + _settle(v) for v in s.ends), default=0)
    latency = -(-end // interval) * interval
    s.improve(latency)
    result = Schedule(graph, interval, s.begin, latency, [])
    result.units = _bind(s, result)
    return result


def _source(result: Schedule, v: Value, k: int) -> tuple:
    """What tells an operand's wire from others."""
    o = v.operands[k]
    return (o.kind, o.constant) if o.constant is not None else (id(o), result.registers(o, result.begin[v])), v.negated[k]


def _bind(s: _Scheduler, result: Schedule) -> list[Unit]:
    """Operations of a class to units, so that few operands need a multiplexer."""
    classes: dict[tuple, list[Value]] = defaultdict(list)
    for v in s.order:
        assert v.operator is not None
        if v.operator.module and v.operator.clocked:
            classes[(v.operator, id(v) if not _shared(v) else 0)].append(v)
    units = []
    for (operator, _), values in classes.items():
        by_phase = [[v for v in values if result.begin[v] % result.interval == p] for p in range(result.interval)]
        most = max(by_phase, key=len)
        made = [Unit(operator, {result.begin[v] % result.interval: v}) for v in most]
        for phase, turns in enumerate(by_phase):
            if turns is most:
                continue
            cost = np.array([[sum(_different(result, v, next(iter(u.turns.values())))) for u in made] for v in turns]).reshape(len(turns), len(made))
            for i, j in zip(*linear_sum_assignment(cost)):
                other, v = next(iter(made[j].turns.values())), turns[i]
                if operator.commutes and sum(_exchanged(result, v, other)) < sum(_kept(result, v, other)):
                    v.operands, v.negated = v.operands[::-1], v.negated[::-1]
                made[j].turns[phase] = v
        units += made
    return units


def _kept(result: Schedule, v: Value, w: Value) -> list[int]:
    return [v.operands[k].kind.bits * (_source(result, v, k) != _source(result, w, k)) for k in range(len(v.operands))]


def _exchanged(result: Schedule, v: Value, w: Value) -> list[int]:
    return [v.operands[k].kind.bits * (_source(result, v, 1 - k) != _source(result, w, k)) for k in range(2)]


def _different(result: Schedule, v: Value, w: Value) -> list[int]:
    assert v.operator is not None
    return min(_kept(result, v, w), _exchanged(result, v, w), key=sum) if v.operator.commutes else _kept(result, v, w)
