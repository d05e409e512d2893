"""Static timing of a mapped netlist with the linear delays of ``liberty``.

The delay of an arc is intrinsic + the delay of the net that it drives. A net whose load is up to ``EFFORT_LIMIT`` unit
inverters' is driven directly; a larger one through the chain of inverters that makes it fastest. Wires have no load, gates
have one size, clocks and resets are ideal.

Modules inside a module (black boxes of a composed unit) appear with their interface: arrival at their outputs, delay beyond
their inputs, bit by bit, and delays between ports, each as the worst over their bits.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass

from ...errors import FlickerError
from .liberty import Library

# Load of a net, in unit-inverter inputs seen by a driver of unit resistance, above which it gets a chain of inverters.
EFFORT_LIMIT = 8.0
MAX_CHAIN = 6


class Nets:
    """Delay and cost of driving a net."""

    def __init__(self, library: Library) -> None:
        arc = library.inverter_arc
        self.tau = arc.resistance * library.inverter_load
        self.parasitic = arc.intrinsic
        self.area = library.inverter.area

    def chain(self, effort: float) -> tuple[float, int]:
        """Fastest way to drive an effort (in tau): delay in library units, number of inverters."""
        if effort <= EFFORT_LIMIT:
            return effort * self.tau, 0
        return min(
            ((n + 1) * effort ** (1 / (n + 1)) * self.tau + n * self.parasitic, n) for n in range(1, MAX_CHAIN)
        )

    def delay(self, resistance: float, load: float) -> float:
        return self.chain(resistance * load / self.tau)[0]

    def driver_area(self, resistance: float, load: float) -> float:
        """Area of the inverters of a net: half an inverter and half of one per unit of drive."""
        effort = resistance * load / self.tau
        _, count = self.chain(effort)
        step = effort ** (1 / (count + 1))
        return sum(self.area * (1 + step**k) / 2 for k in range(1, count + 1))


@dataclass
class Path:
    """A longest path: its ends (register, port or instance) and its delay in library units."""

    delay: float
    source: str
    target: str
    port: bool = False  # begins or ends at a port


class Timing:
    """Timing of one module of a ``write_json`` netlist.

    Args:
        module: the module's object in the JSON.
        library: cells.
        blocks: interface of each black box by cell type (``interface()`` of its own Timing).
    """

    def __init__(self, module: dict, library: Library, blocks: dict[str, dict]) -> None:
        self.library = library
        self.nets = Nets(library)
        self.ports = module["ports"]
        self.load: dict[object, float] = defaultdict(float)
        self._name_nets(module["netnames"])
        self._collect(module["cells"], blocks)
        self._order()

    # Structure

    def _name_nets(self, netnames: dict) -> None:
        self.name: dict[object, str] = {}
        for name, net in sorted(netnames.items(), key=lambda item: (item[1]["hide_name"], len(item[0]))):
            for bit in net["bits"]:
                self.name.setdefault(bit, name)

    def register(self, net: object) -> str:
        """Name of the register or signal that a net belongs to, without bit index."""
        name = self.name.get(net, str(net))
        return re.sub(r"^\$.*\$.*$", "(unnamed)", name)

    def _collect(self, cells: dict, blocks: dict[str, dict]) -> None:
        pending: list[tuple[object, object, float, float]] = []  # source, target, intrinsic, resistance
        self.launch: list[tuple[object, float, float, str]] = []  # net, intrinsic, resistance, name
        self.capture: list[tuple[object, float, str]] = []  # net, set-up, name
        driver = self.nets
        unit = self.library.inverter_arc.resistance
        for name, cell in cells.items():
            pins, kind = cell["connections"], cell["type"]
            if kind in blocks:
                block = blocks[kind]
                for port, face in block["inputs"].items():
                    for bit, load, capture in zip(pins[port], face["loads"], face["captures"]):
                        self.load[bit] += load
                        pending.append((bit, (name, port), 0.0, 0.0))
                        if capture:
                            delay, end = capture
                            self.capture.append((bit, delay, f"{name}.{end}"))
                for port, face in block["outputs"].items():
                    for bit, launch in zip(pins[port], face["launches"]):
                        if launch:
                            delay, start = launch
                            self.launch.append((bit, delay, unit, f"{name}.{start}"))
                        for source, delay in face["through"].items():
                            pending.append(((name, source), bit, delay, unit))
                continue
            gate = self.library.cells.get(kind)
            if gate is None:
                raise FlickerError(f"netlist: cell {name} has type {kind}, which {self.library.path.name} lacks")
            for pin, load in gate.loads.items():
                self.load[pins[pin][0]] += load
            for pin, arcs in gate.arcs.items():
                if pin not in pins:
                    continue
                target = pins[pin][0]
                for arc in arcs:
                    if gate.sequential:
                        if arc.source == gate.clock:
                            self.launch.append((target, arc.intrinsic, arc.resistance, self.register(target)))
                    else:
                        pending.append((pins[arc.source][0], target, arc.intrinsic, arc.resistance))
            if gate.sequential:
                output = next(pins[pin][0] for pin in gate.functions if pin in pins)
                data = re.sub(r"\W", "", gate.sequential["next_state"])
                self.capture.append((pins[data][0], gate.setup, self.register(output)))
        self.driver_area = 0.0
        driven: dict[object, float] = {}
        self.fanin: dict[object, list[tuple[object, float]]] = defaultdict(list)
        for source, target, intrinsic, resistance in pending:
            delay = intrinsic + (driver.delay(resistance, self.load[target]) if resistance else 0.0)
            self.fanin[target].append((source, delay))
            driven[target] = resistance
        self.starts: dict[object, tuple[float, str]] = {}
        for net, intrinsic, resistance, name in self.launch:
            time = intrinsic + driver.delay(resistance, self.load[net])
            if net not in self.starts or time > self.starts[net][0]:
                self.starts[net] = (time, name)
            driven[net] = resistance
        self.driver_area = sum(
            driver.driver_area(resistance, self.load[net]) for net, resistance in driven.items() if resistance
        )

    def _order(self) -> None:
        """Topological order of the nets that have a fan-in."""
        waiting = {
            target: sum(source in self.fanin for source, _ in sources) for target, sources in self.fanin.items()
        }
        fanout = defaultdict(list)
        for target, sources in self.fanin.items():
            for source, _ in sources:
                if source in self.fanin:
                    fanout[source].append(target)
        ready = [net for net, count in waiting.items() if count == 0]
        order = []
        while ready:
            net = ready.pop()
            order.append(net)
            for target in fanout[net]:
                waiting[target] -= 1
                if waiting[target] == 0:
                    ready.append(target)
        if len(order) != len(waiting):
            loop = [self.register(net) for net, count in waiting.items() if count][:4]
            raise FlickerError(f"netlist: combinational loop through {', '.join(map(str, loop))}")
        self.order = [(net, self.fanin[net]) for net in order]

    # Arrival

    def arrive(self, starts: dict[object, tuple[float, str]]) -> dict[object, tuple[float, str]]:
        """Latest arrival at every reached net: time and name of the start."""
        at = dict(starts)
        for net, sources in self.order:
            best = at.get(net)
            for source, delay in sources:
                before = at.get(source)
                if before is not None and (best is None or before[0] + delay > best[0]):
                    best = (before[0] + delay, before[1])
            if best is not None:
                at[net] = best
        return at

    def remaining(self) -> dict[object, tuple[float, str]]:
        """Longest delay from every net to a register: time and name of the end."""
        left: dict[object, tuple[float, str]] = {}
        for net, setup, name in self.capture:
            if net not in left or setup > left[net][0]:
                left[net] = (setup, name)
        for net, sources in reversed(self.order):
            after = left.get(net)
            if after is None:
                continue
            for source, delay in sources:
                if source not in left or after[0] + delay > left[source][0]:
                    left[source] = (after[0] + delay, after[1])
        return left

    def _captured(self, at: dict[object, tuple[float, str]]) -> list[Path]:
        paths = []
        for net, setup, name in self.capture:
            if net in at:
                paths.append(Path(at[net][0] + setup, at[net][1], name))
        return paths

    def _directed(self, direction: str) -> list[tuple[str, list]]:
        return [(name, port["bits"]) for name, port in self.ports.items() if port["direction"] == direction]

    def paths(self) -> list[Path]:
        """Longest path to each register and output port, longest first, with a register outside every port."""
        flop = self.library.flip_flop
        (arc, *_) = (a for arcs in flop.arcs.values() for a in arcs if a.source == flop.clock)
        starts = dict(self.starts)
        for name, bits in self._directed("input"):
            for bit in bits:
                time = arc.intrinsic + self.nets.delay(arc.resistance, self.load[bit])
                starts.setdefault(bit, (time, name))
        at = self.arrive(starts)
        paths = self._captured(at)
        data = re.sub(r"\W", "", flop.sequential["next_state"])
        for name, bits in self._directed("output"):
            for bit in bits:
                if bit in at:
                    delay = at[bit][0] + arc.resistance * flop.loads[data] + flop.setup
                    paths.append(Path(delay, at[bit][1], name, True))
        # Paths between registers may hide behind a longer one from a port to the same register.
        paths += self._captured(self.arrive(self.starts))
        worst: dict[tuple[str, bool], Path] = {}
        inputs = {name for name, _ in self._directed("input")}
        for path in paths:
            path.port = path.port or path.source in inputs
            key = (path.target, path.port)
            if key not in worst or path.delay > worst[key].delay:
                worst[key] = path
        return sorted(worst.values(), key=lambda path: -path.delay)

    def interface(self) -> dict:
        """What a module that contains this one needs to know of it (see the module's docstring)."""
        inputs, outputs = {}, {}
        at, left = self.arrive(self.starts), self.remaining()
        for name, bits in self._directed("output"):
            outputs[name] = {"launches": [at.get(bit) for bit in bits], "through": {}}
        for name, bits in self._directed("input"):
            inputs[name] = {"loads": [self.load[bit] for bit in bits], "captures": [left.get(bit) for bit in bits]}
            at = self.arrive({bit: (0.0, name) for bit in bits})
            for target, target_bits in self._directed("output"):
                reached = [at[bit][0] for bit in target_bits if bit in at]
                if reached:
                    outputs[target]["through"][name] = max(reached)
        return {"inputs": inputs, "outputs": outputs}
