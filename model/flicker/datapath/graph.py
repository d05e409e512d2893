"""What a golden function computes, as a graph: the function is called with symbols instead of numbers.

    graph = Graph()
    a, b = graph.input("a", Ff(13)), graph.input("b", Ff(13))
    graph.output("hypot", retrace(hypot)(a, b, 13))

`retrace` gives the Python function behind a numba kernel, with the ff operations, `min`, `max` and `pick` replaced by symbolic ones; everything else
in it runs as it stands. Integers carry their range, from which widths follow, so that nothing can overflow.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arithmetic import ff
from ..arithmetic.ff_stages import stages
from ..errors import FlickerError


@dataclass(frozen=True)
class Ff:
    """An ff number of M mantissa bits."""

    M: int

    @property
    def bits(self) -> int:
        return 9 + self.M


@dataclass(frozen=True)
class Int:
    """An integer from low to high; in two's complement where low is negative."""

    low: int
    high: int

    @property
    def bits(self) -> int:
        if self.low < 0:
            return max((-self.low - 1).bit_length(), self.high.bit_length() if self.high >= 0 else 0) + 1
        return max(self.high.bit_length(), 1)

    @property
    def signed(self) -> bool:
        return self.low < 0


BOOL = Int(0, 1)
LARGE = 170  # bits by bits of a product of whole numbers that is too slow for one cycle
Kind = Ff | Int


@dataclass(frozen=True)
class Operator:
    """A module, or an expression.

    module: name; parameters, ports: of it, results last. latency: of the module. shared: worth a multiplexer. commutes: the two operands may be
    exchanged. Without a module, `text` is an expression with {0}, {1} for operands and {bits} for its width; its result is registered by its users,
    unless it is only wiring.
    """

    module: str = ""
    parameters: tuple[tuple[str, int], ...] = ()
    ports: tuple[str, ...] = ()
    latency: int = 0
    shared: bool = False
    commutes: bool = False
    clocked: bool = True
    text: str = ""
    wiring: bool = False
    wide: int = 0  # bits in which an expression of whole numbers is computed, if more than its operands and result have
    held: bool = False  # registers behind the multiplexers of its operands; they are in the latency


@dataclass(eq=False)
class Value:
    """A number of the graph: what an operator makes of operands, an input, a register (the same for all elements of a frame) or a constant."""

    graph: Graph
    kind: Kind
    operator: Operator | None = None
    operands: tuple[Value, ...] = ()
    negated: tuple[bool, ...] = ()  # operands whose sign is inverted on the way
    name: str = ""
    constant: int | None = None  # bits
    register: bool = False
    late: bool = False  # stands late in its cycle: registered before it is used

    @property
    def range(self) -> Int:
        """Of an integer."""
        if not isinstance(self.kind, Int):
            raise FlickerError(f"datapath: {self.name} is no integer")
        return self.kind

    @property
    def M(self) -> int:
        """Mantissa bits of an ff number."""
        if not isinstance(self.kind, Ff):
            raise FlickerError(f"datapath: {self.name} is no ff number")
        return self.kind.M

    # Integers and comparisons as Python writes them.

    def _int(self, other: Any, text: str, bounds: Callable[[Int, Int], tuple[int, int]]) -> Value:
        b = self.graph.integer(other)
        return self.graph.expression(text, Int(*bounds(self.range, b.range)), (self, b))

    def __add__(self, other: Any) -> Value:
        return self._int(other, "{0} + {1}", lambda a, b: (a.low + b.low, a.high + b.high))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Value:
        return self._int(other, "{0} - {1}", lambda a, b: (a.low - b.high, a.high - b.low))

    def __rsub__(self, other: Any) -> Value:
        return self.graph.integer(other) - self

    def __mul__(self, other: Any) -> Value:
        if isinstance(self.kind, Ff):
            return self.graph.scaled(self, other)
        b = self.graph.integer(other)
        if b.constant is not None and b.range.low > 0 and b.range.low & (b.range.low - 1) == 0:
            return self << (b.range.low.bit_length() - 1)
        if b.constant is None and self.kind.bits * b.kind.bits > LARGE and not b.range.signed:
            low = b.kind.bits - b.kind.bits // 2  # in two parts, each with a register behind it
            return self * self.graph.slice(b, 0, low) + (self * self.graph.slice(b, low, b.kind.bits - low) << low)
        ends = lambda p, q: [x * y for x in (p.low, p.high) for y in (q.low, q.high)]  # noqa: E731
        return self._int(b, "{0} * {1}", lambda p, q: (min(ends(p, q)), max(ends(p, q))))

    __rmul__ = __mul__

    def __neg__(self) -> Value:
        return self.graph.integer(0) - self

    def __invert__(self) -> Value:
        return self.graph.wire("~{0}", Int(-self.range.high - 1, -self.range.low - 1), (self,))

    def __lshift__(self, places: int) -> Value:
        if not places:
            return self
        return self.graph.wire(f"{{0}} <<< {places}", Int(self.range.low << places, self.range.high << places), (self,))

    def __rshift__(self, places: int) -> Value:
        return self.graph.wire(f"{{0}} >>> {places}", Int(self.range.low >> places, self.range.high >> places), (self,))

    def __le__(self, other: Any) -> Value:
        return self.graph.compare(self, other, "{0} <= {1}")

    def __lt__(self, other: Any) -> Value:
        return self.graph.compare(self, other, "{0} < {1}")

    def __ge__(self, other: Any) -> Value:
        return self.graph.compare(self, other, "{0} >= {1}")

    def __gt__(self, other: Any) -> Value:
        return self.graph.compare(self, other, "{0} > {1}")

    def __or__(self, other: Any) -> Value:
        """Of truth values."""
        return self if isinstance(other, int) and other == 0 else self.graph.expression("{0} | {1}", BOOL, (self, other))

    __ror__ = __or__

    def __and__(self, other: Any) -> Value:
        """Of truth values."""
        return self.graph.expression("{0} & {1}", BOOL, (self, other))

    def __floordiv__(self, divisor: int) -> Value:
        if divisor & (divisor - 1):
            raise FlickerError(f"datapath: {divisor} is no power of two")
        return self >> (divisor.bit_length() - 1)

    def __bool__(self) -> bool:
        raise FlickerError(f"datapath: the golden function decides by a value ({self.name or self.operator}); use pick")


@dataclass(frozen=True)
class Table:
    """Numbers in a ROM, indexed by an integer value."""

    graph: Graph
    name: str
    numbers: tuple[float, ...]
    M: int

    def __getitem__(self, index: Value) -> Value:
        kind = Ff(self.M)
        text = f"{self.name.upper()}[{{0}}]"
        self.graph.tables[self.name] = self
        return self.graph.expression(text, kind, (index,))

    def codes(self) -> list[int]:
        return [int(ff.ff_bits(v, self.M)) for v in self.numbers]


@dataclass(eq=False)
class Graph:
    """Values in the order in which they were made, and the named outputs."""

    values: list[Value] = field(default_factory=list)
    outputs: dict[str, Value] = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)
    _known: dict[Any, Value] = field(default_factory=dict)

    # ---- ends --------------------------------------------------------------------------------------

    def input(self, name: str, kind: Kind, register: bool = False, late: bool = False) -> Value:
        value = Value(self, kind, name=name, register=register, late=late)
        self.values.append(value)
        return value

    def inputs(self, name: str, kind: Kind, shape: Sequence[int], register: bool = False, late: bool = False) -> Any:
        """Nested lists of inputs: name_0, name_1 or name_00, name_01."""
        if not shape:
            return self.input(name, kind, register, late)
        join = name if name[-1:].isdigit() else f"{name}_"
        return [self.inputs(f"{join}{i}", kind, shape[1:], register, late) for i in range(shape[0])]

    def output(self, name: str, value: Value) -> None:
        if value.constant is None and not value.name:
            value.name = name
        self.outputs[name] = value

    def table(self, name: str, numbers: np.ndarray, M: int) -> Table:
        return Table(self, name, tuple(np.asarray(numbers).tolist()), M)

    # ---- operands ----------------------------------------------------------------------------------

    def integer(self, value: Any) -> Value:
        if isinstance(value, Value):
            return value
        value = int(value)
        return Value(self, Int(value, value), constant=value)

    def number(self, value: Any, M: int) -> Value:
        if isinstance(value, Value):
            if value.kind != Ff(M):
                raise FlickerError(f"datapath: {value.name} is {value.kind}, wanted {M} mantissa bits")
            return value
        if ff.ff_round(float(value), M) != float(value):
            raise FlickerError(f"datapath: {value} is no ff number of {M} bits")
        return Value(self, Ff(M), constant=int(ff.ff_bits(float(value), M)))

    def make(self, kind: Kind, operator: Operator, operands: tuple[Value, ...], negated: tuple[bool, ...] = ()) -> Value:
        """The value of an operator; equal ones are made once."""
        key = (kind, operator, tuple((id(o) if o.constant is None else (o.kind, o.constant)) for o in operands), negated)
        if key not in self._known:
            value = Value(self, kind, operator, operands, negated or (False,) * len(operands))
            self.values.append(value)
            self._known[key] = value
        return self._known[key]

    def expression(self, text: str, kind: Kind, operands: tuple[Value, ...]) -> Value:
        return self.make(kind, Operator(text=text), operands)

    def wire(self, text: str, kind: Kind, operands: tuple[Value, ...]) -> Value:
        return self.make(kind, Operator(text=text, wiring=True), operands)

    # ---- ff ----------------------------------------------------------------------------------------

    def ff_pair(self, module: str, out: str, a: Any, b: Any, M: int, negate: bool = False) -> Value:
        count = stages(module, M)
        operator = Operator(module, (("ManBits", M), ("Stages", count)), ("a_i", "b_i", out), count, True, True)
        return self.make(Ff(M), operator, (self.number(a, M), self.number(b, M)), (False, negate))

    def ff_function(self, module: str, x: Any, M: int) -> Value:
        count = stages(module, M)
        return self.make(Ff(M), Operator(module, (("ManBits", M), ("Stages", count)), ("x_i", "y_o"), count, True), (self.number(x, M),))

    def ff_neg(self, x: Value) -> Value:
        top = x.kind.bits - 1
        return self.wire(f"{{{{{{0}}[{top}] ^ (|{{0}}[{top - 1}:{x.M}]), {{0}}[{top - 1}:0]}}}}", x.kind, (x,))

    def ff_bits(self, x: Value) -> Value:
        """The code of a number."""
        return self.wire("{0}", Int(0, (1 << x.kind.bits) - 1), (x,))

    def ff_round(self, x: Value, M: int) -> Value:
        if x.M == M:
            return x
        if x.M < M:
            return self.wire(f"{{{{{{0}}, {M - x.M}'b0}}}}", Ff(M), (x,))
        return self.make(Ff(M), Operator("flk_ff_narrow", (("FromBits", x.M), ("ManBits", M)), ("x_i", "y_o"), clocked=False), (x,))

    def scaled(self, x: Value, factor: float) -> Value:
        """x times a power of two, saturated."""
        mantissa, exponent = math.frexp(factor)
        if mantissa != 0.5:
            raise FlickerError(f"datapath: {factor} is no power of two")
        return self.ldexp(x, exponent - 1)

    def ldexp(self, x: Value, shift: Any) -> Value:
        shift = self.integer(shift)
        return self.make(x.kind, Operator("flk_ff_ldexp", (("ManBits", x.M), ("ShiftBits", 10)), ("x_i", "shift_i", "y_o"), clocked=False), (x, shift))

    def to_fixed(self, x: Value, frac_bits: int, bits: int, nearest: bool) -> Value:
        parameters = (("Bits", bits), ("FracBits", frac_bits), ("Round", int(nearest)), ("ManBits", x.M), ("Stages", 2))
        return self.make(Int(-(1 << (bits - 1)), (1 << (bits - 1)) - 1), Operator("flk_ff_to_fixed", parameters, ("x_i", "y_o"), 2, True), (x,))

    def from_fp16(self, bits: Value, M: int) -> Value:
        return self.make(Ff(M), Operator("flk_ff_from_fp16", (("ManBits", M),), ("x_i", "y_o"), clocked=False), (bits,))

    def slice(self, x: Value, low: int, bits: int) -> Value:
        """Bits of an unsigned integer."""
        return self.wire(f"{{0}}[{low + bits - 1}:{low}]", Int(0, (1 << bits) - 1), (x,))

    def from_fixed(self, i: Any, frac_bits: int, M: int) -> Value:
        i = self.integer(i)
        if not i.range.signed:  # a sign bit
            kind = Int(-1 - i.range.high, i.range.high)
            i = self.wire(f"{kind.bits}'({{0}})", kind, (i,))
        parameters = (("Bits", i.kind.bits), ("FracBits", frac_bits), ("ManBits", M), ("Stages", 2))
        return self.make(Ff(M), Operator("flk_ff_from_fixed", parameters, ("x_i", "y_o"), 2, True), (i,))

    def fixed_mul(self, a: Value, b: Value, drop: int) -> Value:
        """The wider operand last, and wider than the first, so that products of numbers of nearly the same width share units."""
        if a.kind.bits > b.kind.bits:
            a, b = b, a
        wide = max(b.kind.bits, a.kind.bits + 1)
        ends = [x * y for x in (a.range.low, a.range.high) for y in (b.range.low, b.range.high)]
        half = 1 << (drop - 1)
        kind = Int(min((min(ends) + half) >> drop, -1), (max(ends) + half) >> drop)
        out = max(a.kind.bits + wide - drop - 1, kind.bits)
        parameters = (("ABits", a.kind.bits), ("BBits", wide), ("Drop", drop), ("OutBits", out), ("Stages", 1))
        return self.make(kind, Operator("flk_fixed_mul", parameters, ("a_i", "b_i", "y_o"), 1, True), (a, b))

    def fixed_mix(self, a: Any, factor_a: int, b: Any, factor_b: int, offset: int, drop: int) -> Value:
        operands = [(v, f) for v, f in ((a, factor_a), (b, factor_b)) if f]
        rest = offset + ((1 << drop) >> 1)
        low = sum(min(v.range.low * f, v.range.high * f) for v, f in operands) + rest
        high = sum(max(v.range.low * f, v.range.high * f) for v, f in operands) + rest
        kind, wide = Int(min(low >> drop, -1), high >> drop), Int(min(low, -1), high).bits + 1
        text = " ".join(f"{'-' if digit < 0 else '+'} ({{{k}}} <<< {place})" for k, (_, f) in enumerate(operands) for digit, place in signed_digits(f))
        if rest:
            text += f" {'-' if rest < 0 else '+'} {wide}'sd{abs(rest)}"
        return self.make(kind, Operator(text=f"({text.removeprefix('+ ')}) >>> {drop}", wide=wide), tuple(v for v, _ in operands))

    def fixed_wrap(self, x: Value, bits: int) -> Value:
        return self.wire(f"{bits}'({{0}})", Int(-(1 << (bits - 1)), (1 << (bits - 1)) - 1), (x,))

    def exp2_fixed(self, L: Value, frac_bits: int, M: int) -> Value:
        count = stages("flk_ff_exp2", M)
        parameters = (("ManBits", M), ("IntBits", max(L.kind.bits - frac_bits, 2)), ("FracBits", frac_bits), ("Stages", count))
        return self.make(Ff(M), Operator("flk_ff_exp2", parameters, ("l_i", "y_o"), count, True), (L,))

    def less(self, a: Value, b: Value) -> Value:
        return self.make(BOOL, Operator("flk_ff_cmp", (("ManBits", a.M),), ("a_i", "b_i", "lt_o"), clocked=False), (a, b))

    # ---- choice ------------------------------------------------------------------------------------

    def compare(self, a: Value, other: Any, text: str) -> Value:
        if isinstance(a.kind, Int):
            return self.expression(text, BOOL, (a, self.integer(other)))
        b = self.number(other, a.M)
        operation = text[4:-4]
        less = self.less(b, a) if operation in ("<=", ">") else self.less(a, b)
        return less if operation in ("<", ">") else self.wire("!{0}", BOOL, (less,))

    def pick(self, condition: Value, a: Any, b: Any) -> Value:
        if isinstance(a, Value) and isinstance(a.kind, Ff) or isinstance(b, Value) and isinstance(b.kind, Ff):
            M = next(v.M for v in (a, b) if isinstance(v, Value))
            a, b = self.number(a, M), self.number(b, M)
            kind: Kind = a.kind
        else:
            a, b = self.integer(a), self.integer(b)
            kind = Int(min(a.range.low, b.range.low), max(a.range.high, b.range.high))
        return self.expression("{0} ? {1} : {2}", kind, (condition, a, b))

    def extreme(self, a: Any, b: Any, largest: bool) -> Value:
        """min or max as Python has them: the first where both are equal."""
        kind = a.kind if isinstance(a, Value) else b.kind
        if isinstance(kind, Ff):
            a, b = self.number(a, kind.M), self.number(b, kind.M)
            if largest and b.constant == 0:
                return self.wire(f"{{0}}[{kind.bits - 1}] ? '0 : {{0}}", kind, (a,))
            return self.pick(self.less(a, b) if largest else self.less(b, a), b, a)
        a, b = self.integer(a), self.integer(b)
        f = max if largest else min
        bounds = Int(f(a.range.low, b.range.low), f(a.range.high, b.range.high))
        return self.expression("{0} < {1} ? {1} : {0}" if largest else "{1} < {0} ? {1} : {0}", bounds, (a, b))


def _sum_kind(*values: Value) -> Int:
    return Int(sum(v.range.low for v in values), sum(v.range.high for v in values))


def signed_digits(value: int) -> list[tuple[int, int]]:
    """Digits 1 and -1 and their places, as few as there can be, the largest first: canonical signed digits."""
    digits, place = [], 0
    while value:
        if value & 1:
            digit = 2 - (value & 3)
            digits.append((digit, place))
            value -= digit
        value >>= 1
        place += 1
    return digits[::-1]


def _symbolic() -> dict[str, Any]:
    """What stands in for the ff operations and Python's own."""

    def graph_of(*values: Any) -> Graph:
        graphs = [v.graph for v in values if isinstance(v, Value)]
        if not graphs:
            raise FlickerError(f"datapath: no value of a graph among {values}; equality of values is not traced")
        return graphs[0]

    def extreme(largest: bool) -> Callable:
        def of(a: Any, b: Any) -> Any:
            if not isinstance(a, Value) and not isinstance(b, Value):
                return max(a, b) if largest else min(a, b)
            return graph_of(a, b).extreme(a, b, largest)

        return of

    return {
        "ff_add": lambda a, b, M: graph_of(a, b).ff_pair("flk_ff_add", "sum_o", a, b, M),
        "ff_sub": lambda a, b, M: graph_of(a, b).ff_pair("flk_ff_add", "sum_o", a, b, M, negate=True),
        "ff_mul": lambda a, b, M: graph_of(a, b).ff_pair("flk_ff_mul", "prod_o", a, b, M),
        "ff_recip": lambda x, M: x.graph.ff_function("flk_ff_recip", x, M),
        "ff_rsqrt": lambda x, M: x.graph.ff_function("flk_ff_rsqrt", x, M),
        "ff_sqrt": lambda x, M: x.graph.ff_function("flk_ff_sqrt", x, M),
        "ff_neg": lambda x: x.graph.ff_neg(x),
        "ff_round": lambda x, M: x.graph.ff_round(x, M),
        "ff_bits": lambda x, M: x.graph.ff_bits(x),
        "ff_ldexp": lambda x, shift, M: x.graph.ldexp(x, shift),
        "ff_to_fixed_round": lambda x, frac_bits, bits: x.graph.to_fixed(x, frac_bits, bits, True),
        "ff_to_fixed_floor": lambda x, frac_bits, bits: x.graph.to_fixed(x, frac_bits, bits, False),
        "ff_from_fixed": lambda i, frac_bits, M: i.graph.from_fixed(i, frac_bits, M),
        "ff_from_int": lambda i, M: i.graph.from_fixed(i, 0, M),
        "ff_exp2_fixed": lambda L, frac_bits, M: L.graph.exp2_fixed(L, frac_bits, M),
        "fixed_mul": lambda a, b, drop: graph_of(a, b).fixed_mul(a, b, drop),
        "fixed_mix": lambda a, factor_a, b, factor_b, offset, drop: graph_of(a, b).fixed_mix(a, factor_a, b, factor_b, offset, drop),
        "fixed_sum": lambda a, b, c: graph_of(a).expression("{0} + {1} + {2}", _sum_kind(a, b, c), (a, b, c)),
        "fixed_wrap": lambda x, bits: x.graph.fixed_wrap(x, bits),
        "pick": lambda condition, a, b: graph_of(condition).pick(condition, a, b),
        "min": extreme(False),
        "max": extreme(True),
    }


def retrace(kernel: Any) -> Callable:
    """The Python function of a numba kernel, in which ff operations make values of a graph."""
    function = kernel.py_func
    own = dict(function.__globals__)
    own |= {name: retrace(own[name]) for name in function.__code__.co_names if hasattr(own.get(name), "py_func") and name not in _symbolic()}
    return types.FunctionType(function.__code__, own | _symbolic(), function.__name__, function.__defaults__, function.__closure__)
