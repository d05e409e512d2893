#!/usr/bin/env python3
"""Writes scripts/cells/flicker.lib: the default cell library of `make synth`, in Liberty form.

It describes no process. Units: area in gate equivalents (NAND2 = 1), capacitance in inputs of the unit inverter, time in
tenths of tau of the method of logical effort (Sutherland, Sproull, Harris: Logical Effort, 1999), so that an inverter with
fan-out 4 takes FO4 = 50.

Area: a row of transistor pairs. A cell with n pairs is n + 1 columns wide (one for its edge) and NAND2, with 2 pairs, is
one gate equivalent: area = (n + 1) / 3.
Delay: a cell of size s has s times the drive of the unit inverter: delay = parasitic + load / s, and it has s times the pairs
and the input loads of size 1. An input's load is its logical effort; an input that is also inverted inside loads one unit
more, and its delay is the mean of the direct way and the way through that inverter. Flip-flops are not covered by logical
effort: clock to output 6 and set-up 5 are assumptions (2 and 1 FO4 at fan-out 4).
The clock gate is a latch (7 pairs) and an AND2; its enable has the set-up of a flip-flop.
"""

from __future__ import annotations

import sys
from pathlib import Path

PATH = Path(__file__).with_name("flicker.lib")

# name: (transistor pairs, function of Y, {inputs: (load, parasitic delay)}); inputs as a string of one-letter names.
GATES: dict[str, tuple[int, str, dict[str, tuple[float, float]]]] = {
    "INV": (1, "!A", {"A": (1, 1)}),
    "BUF": (2, "A", {"A": (0.5, 4)}),  # half an inverter before one
    "NAND2": (2, "!(A*B)", {"AB": (4 / 3, 2)}),
    "NAND3": (3, "!(A*B*C)", {"ABC": (5 / 3, 3)}),
    "NAND4": (4, "!(A*B*C*D)", {"ABCD": (2, 4)}),
    "NOR2": (2, "!(A+B)", {"AB": (5 / 3, 2)}),
    "NOR3": (3, "!(A+B+C)", {"ABC": (7 / 3, 3)}),
    "AND2": (3, "A*B", {"AB": (4 / 3, 4)}),  # NAND2 and inverter
    "OR2": (3, "A+B", {"AB": (5 / 3, 4)}),
    "AOI21": (3, "!((A*B)+C)", {"AB": (2, 7 / 3), "C": (5 / 3, 5 / 3)}),
    "OAI21": (3, "!((A+B)*C)", {"AB": (2, 7 / 3), "C": (4 / 3, 5 / 3)}),
    "AOI22": (4, "!((A*B)+(C*D))", {"ABCD": (2, 4)}),
    "OAI22": (4, "!((A+B)*(C+D))", {"ABCD": (2, 4)}),
    "XOR2": (5, "A^B", {"AB": (3, 5.5)}),  # inverters of A and B inside
    "XNOR2": (5, "!(A^B)", {"AB": (3, 5.5)}),
    "MUX2": (6, "(S*B)+(!S*A)", {"AB": (2, 6), "S": (3, 7.5)}),  # inverting multiplexer and inverter
}

SIZES = {
    "INV": (1, 2, 4, 8), "BUF": (1, 2, 4, 8), "NAND2": (1, 2, 4), "NOR2": (1, 2, 4), "NAND3": (1, 2), "NOR3": (1, 2),
    "AOI21": (1, 2), "OAI21": (1, 2), "XOR2": (1, 2), "XNOR2": (1, 2), "MUX2": (1, 2), "AND2": (1, 2), "OR2": (1, 2),
}

# name: (transistor pairs, asynchronous pin of the ff group)
FLIP_FLOPS = {"DFF": (12, ""), "DFFR": (14, "clear"), "DFFS": (14, "preset")}
CLOCK_TO_Q, SETUP, D_LOAD, CLOCK_LOAD, RESET_LOAD = 6.0, 5.0, 1.0, 2.0, 4 / 3

# Integrated clock gate: transistor pairs.
CLOCK_GATE_PAIRS = 10

TAU = 10.0
LOADS = (0.0, 16.0)  # of size 1; two points are enough for a straight line
SLEWS = (0.0, 500.0)  # no influence


def area(pairs: int) -> str:
    return f"{(pairs + 1) / 3:.4g}"


def rows(values: list[float]) -> str:
    """Values over the loads, the same for both slews."""
    return ", ".join(f'"{value:.4g}, {value:.4g}"' for value in values)


def delay_tables(parasitic: float, size: int = 1) -> str:
    index = ", ".join(f"{size * load:g}" for load in LOADS)
    delay = rows([TAU * (parasitic + load) for load in LOADS])
    slew = rows([TAU * (2 + 2 * load) for load in LOADS])
    return "".join(
        f'        {table}(line) {{ index_1("{index}"); values({values}); }}\n'
        for table, values in (
            ("cell_rise", delay), ("cell_fall", delay), ("rise_transition", slew), ("fall_transition", slew)
        )
    )


def input_pin(name: str, load: float, extra: str = "") -> str:
    return f"    pin({name}) {{ direction : input; capacitance : {load:.4g};{extra} }}\n"


def gate(name: str, size: int) -> str:
    pairs, function, groups = GATES[name]
    inputs = {pin: numbers for pins, numbers in groups.items() for pin in pins}
    text = f"  cell({name}_X{size}) {{\n    area : {area(size * pairs)};\n    cell_footprint : {name};\n"
    text += "".join(input_pin(pin, size * load) for pin, (load, _) in inputs.items())
    text += f'    pin(Y) {{ direction : output; capacitance : 0; max_capacitance : {size * LOADS[1]:g};\n'
    text += f'      function : "{function}";\n'
    for pin, (_, parasitic) in inputs.items():
        text += f'      timing() {{ related_pin : "{pin}";\n{delay_tables(parasitic, size)}      }}\n'
    return text + "    }\n  }\n"


def flip_flop(name: str) -> str:
    pairs, asynchronous = FLIP_FLOPS[name]
    text = f'  cell({name}) {{\n    area : {area(pairs)};\n    ff(IQ, IQN) {{ next_state : "D"; clocked_on : "CK";'
    if asynchronous:
        text += f' {asynchronous} : "!RN";'
    text += " }\n" + input_pin("CK", CLOCK_LOAD, " clock : true;")
    if asynchronous:
        text += input_pin("RN", RESET_LOAD)
    constraint = rows([TAU * SETUP] * 2)
    text += (
        f"    pin(D) {{ direction : input; capacitance : {D_LOAD:.4g};\n"
        f'      timing() {{ related_pin : "CK"; timing_type : setup_rising;\n'
        f"        rise_constraint(setup) {{ values({constraint}); }}\n"
        f"        fall_constraint(setup) {{ values({constraint}); }}\n      }}\n    }}\n"
        f'    pin(Q) {{ direction : output; capacitance : 0; function : "IQ";\n'
        f'      timing() {{ related_pin : "CK"; timing_type : rising_edge;\n{delay_tables(CLOCK_TO_Q)}      }}\n'
    )
    if asynchronous:
        sense = "positive_unate" if asynchronous == "clear" else "negative_unate"
        text += (
            f'      timing() {{ related_pin : "RN"; timing_type : {asynchronous}; timing_sense : {sense};\n'
            f"{delay_tables(CLOCK_TO_Q)}      }}\n"
        )
    return text + "    }\n  }\n"


def clock_gate() -> str:
    return (
        f"  cell(ICG) {{\n    area : {area(CLOCK_GATE_PAIRS)};\n    clock_gating_integrated_cell : latch_posedge;\n    dont_use : true;\n"
        + input_pin("CK", CLOCK_LOAD, " clock : true; clock_gate_clock_pin : true;")
        + input_pin("E", D_LOAD, " clock_gate_enable_pin : true;")
        + "    pin(GCK) { direction : output; capacitance : 0; clock_gate_out_pin : true; }\n  }\n"
    )


def library() -> str:
    loads, slews = (", ".join(f"{x:g}" for x in axis) for axis in (LOADS, SLEWS))
    return (
        "/* Generated by scripts/cells/gen_cells.py: edit that, not this. */\n"
        "library(flicker) {\n"
        '  delay_model : table_lookup;\n  time_unit : "1ps";\n  voltage_unit : "1V";\n  current_unit : "1uA";\n'
        '  pulling_resistance_unit : "1kohm";\n  leakage_power_unit : "1nW";\n  capacitive_load_unit (1, ff);\n'
        "  lu_table_template(line) {\n"
        "    variable_1 : total_output_net_capacitance;\n    variable_2 : input_net_transition;\n"
        f'    index_1("{loads}");\n    index_2("{slews}");\n  }}\n'
        "  lu_table_template(setup) {\n"
        "    variable_1 : constrained_pin_transition;\n    variable_2 : related_pin_transition;\n"
        f'    index_1("{slews}");\n    index_2("{slews}");\n  }}\n'
        + "".join(gate(name, size) for name in GATES for size in SIZES.get(name, (1,)))
        + "".join(map(flip_flop, FLIP_FLOPS))
        + clock_gate()
        + "}\n"
    )


def main() -> int:
    check = "--check" in sys.argv[1:]
    text = library()
    if check:
        stale = not PATH.exists() or PATH.read_text() != text
        if stale:
            print(f"{PATH.name}: not what gen_cells.py writes")
        return int(stale)
    PATH.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
