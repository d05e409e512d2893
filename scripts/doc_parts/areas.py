"""`make docs PART=areas`: model/flicker/cost/areas.csv from the results of `make synth`, and the tables that follow from it in docs/results/energy.md and
docs/reference/energy.md.

areas.csv has area and switched load of every synthesised unit, for `flicker.cost.area` and `flicker.cost.energy`. Units come from the cached results of
`make synth` (build/synth) of the RTL as it is; the operators of mask generators that have no RTL (integer products, tables, shifters;
`flicker.cost.operations`) are synthesised here by the same flow, a second or two each, and cached in build/synth/operators.
Columns: unit, config; ge, ge_seq, ge_comb (gate equivalents); mem_bits, ff; load: capacitance of all input pins but clock pins, in inputs of
the unit inverter; clock_free, clock_gated: capacitance of the clock pins that always toggle and of those behind clock gates; key: the cached
result. The first line says of which RTL these are (`flicker.cost.stamp`).
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from flicker import markdown
from flicker.cost.area import TABLE, ctu_area, format_bits, generator_area, operator_name, part, parts
from flicker.cost.energy import clock_pj, constant_table, ctu_pj, dram_pj, fifo_pj, generator_pj, sram_pj, switching_pj, vru_pj
from flicker.cost.operations import Op, Operation
from flicker.cost.stamp import LIBERTY, rtl_stamp, stamp_of
from flicker.cost.synth.liberty import CLOCK_GATE, Library
from flicker.cost.synth.run import FOLDER, UNITS, Runner
from flicker.cost.synth.units import all_units
from flicker.errors import FlickerError
from flicker.explore.configurations import CONFIGURATIONS, get_configuration
from flicker.explore.generators.rows import RowFormat, root_table
from flicker.golden.masked import ACCUMULATOR_INT_BITS
from flicker.params import Form, Precision
from flicker.toolchain import ROOT

from .common import Say, significant

OPERATORS = FOLDER / "operators"
COLUMNS = ("unit", "config", "ge", "ge_seq", "ge_comb", "mem_bits", "sram_bits", "ff", "load", "clock_free", "clock_gated", "key")
INSTANCE = re.compile(r"^\s*(\w+) (?:\\\S+ |\w+) \(\n(.*?)\n\s*\);", re.M | re.S)
PIN = re.compile(r"\.(\w+)\((.*?)\)(?:,|$)", re.M)


# ---- synthesised units --------------------------------------------------------------------------


class Synthesised:
    """Results in build/synth/units by key, with their loads."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.results: dict[str, dict] = {}

    def total(self, key: str) -> dict[str, float]:
        """Sums of a unit over itself and its parts. Raises KeyError for one that is not synthesised."""
        if key not in self.results:
            path = UNITS / key / "result.json"
            if not path.exists():
                raise KeyError(key)
            self.results[key] = json.loads(path.read_text()) | loads(UNITS / key / "netlist.v", self.library)
        own = self.results[key]
        names = ("ge_seq", "ge_comb", "mem_bits", "sram_bits", "ff", "load", "clock_free", "clock_gated")
        total = {name: own[name] for name in names}
        for child, count in own["children"].items():
            inside = self.total(child)
            for name in names:
                total[name] += count * inside[name]
        total["ge"] = total["ge_seq"] + total["ge_comb"]
        return total


def loads(netlist: Path, library: Library) -> dict[str, float]:
    """Capacitance of input pins in a mapped netlist: logic, clock pins on free-running nets, clock pins behind clock gates."""
    text = netlist.read_text()
    cells = []
    gated = set()
    for kind, body in INSTANCE.findall(text):
        if kind not in library.cells:
            continue  # a part, counted by itself
        pins = dict(PIN.findall(body))
        cells.append((library.cells[kind], pins))
        if kind == CLOCK_GATE:
            gated.add(pins["gclk"].strip())
    found = {"load": 0.0, "clock_free": 0.0, "clock_gated": 0.0}
    for cell, pins in cells:
        for pin, load in cell.loads.items():
            if pin != cell.clock:
                found["load"] += load
            else:
                found["clock_gated" if pins[pin].strip() in gated else "clock_free"] += load
    return found


# ---- operators ----------------------------------------------------------------------------------


def operations() -> Iterator[Operation]:
    """Every different operation that a configuration has."""
    seen = set()
    for configuration in CONFIGURATIONS.values():
        vru = []
        if configuration.stage.accumulator:
            integer, fraction = ACCUMULATOR_INT_BITS, configuration.stage.accumulator
            vru = [Operation(Op.SHIFT, f"FP16 -> q{integer}.{fraction}", 3), Operation(Op.ADD, f"fixed {integer + fraction}", 3)]
        for o in (*configuration.generator.operations.per_element, *configuration.generator.operations.preprocessing, *vru):
            name = operator_name(o)
            if name not in seen:
                seen.add(name)
                yield o


def _table(format: str) -> str | None:
    """Case items of a table of the row-interval generator."""
    address, data = (int(x) for x in format.split("->"))
    note = next(o.note for o in operations() if o.op == Op.TABLE and o.format == format)
    if note == "k":
        # Octaves of the threshold from 1/2 to 8, 64 steps each; k of the threshold that an address stands for (rows.inverse_radius).
        steps = 1 << (address - 2)
        highs = [2.0 ** (octave - 1) * (1 + (step + 1) / steps) for octave in range(4) for step in range(steps)]
        values = [math.floor(2 ** (data - 1) / (math.sqrt(high) * (1 + 3.1 * 2.0**-11) + 2.0**-11)) for high in highs]
    else:
        values = root_table(RowFormat(data - 1, address))
        values = [min(int(v), (1 << data) - 1) for v in values][: 1 << address]
        values += [0] * ((1 << address) - len(values))
    rows = "\n".join(f"      {address}'d{i}: y_o = {data}'d{int(v)};" for i, v in enumerate(values))
    return f"  input logic [{address - 1}:0] a_i,\n  output logic [{data - 1}:0] y_o\n);\n  always_comb begin\n    unique case (a_i)\n{rows}\n" \
           f"      default: y_o = '0;\n    endcase\n  end\nendmodule\n"


def source(o: Operation) -> str | None:
    """SystemVerilog of an operator `flk_op`, None where a unit of the RTL is the operator itself."""
    head = "module flk_op (\n"
    two = "  input logic [{0}:0] a_i,\n  input logic [{1}:0] b_i,\n  output logic [{2}:0] y_o\n);\n"
    fmt = o.format.lower()
    if o.op == Op.TABLE:
        return None if "exp" in fmt else head + _table(o.format)
    if o.op == Op.LOG:
        return None
    if o.op == Op.SHIFT and "->" in fmt:
        src, dst = (x.strip() for x in fmt.split("->"))
        if src == "fp16":
            if (e_m := format_bits(dst)) is None:  # to fixed point, sign and magnitude
                width = int(dst.split(".")[0][1:]) + int(dst.split(".")[1])
                return (head + f"  input logic [15:0] a_i,\n  output logic [{width}:0] y_o\n);\n  logic [{width + 11}:0] wide;\n"
                        f"  assign wide = {{{width + 1}'b0, |a_i[14:10], a_i[9:0]}} << a_i[14:10];\n"
                        f"  assign y_o = {{a_i[15], wide[{width + 10}:11] + {width}'(wide[10])}};\nendmodule\n")
            e, m, fn, sat = e_m
            return (head + f"  input logic [15:0] a_i,\n  output logic [{e + m}:0] y_o\n);\n"
                    f"  flk_fp_convert #(.SrcExpBits(5), .SrcManBits(10), .SrcFn(0), .DstExpBits({e}), .DstManBits({m}), .DstFn({fn}), "
                    f".DstSaturate({sat})) i_op (.src_i(a_i), .dst_o(y_o));\nendmodule\n")
        wide, width = int(src), int(dst)
        top = max(wide, width)
        return (head + f"  input logic [{wide - 1}:0] a_i,\n  input logic [4:0] b_i,\n  output logic [{width - 1}:0] y_o\n);\n"
                f"  logic signed [{top}:0] moved;\n  assign moved = $signed({{{{{top + 1 - wide}{{a_i[{wide - 1}]}}}}, a_i}}) >>> b_i;\n"
                f"  assign y_o = moved[{width}:1] + {width}'(moved[0]);\nendmodule\n")
    if o.op == Op.SHIFT:  # an exponent added
        return head + two.format(4, 4, 4) + "  assign y_o = a_i + b_i;\nendmodule\n"
    bits = format_bits(fmt)
    if bits is not None:
        e, m, fn, sat = bits
        w = e + m
        p = f".ExpBits({e}), .ManBits({m}), .Fn({fn})"
        if o.op == Op.MUL:
            if o.sqr:
                return (head + f"  input logic [{w}:0] a_i,\n  output logic [{w - 1}:0] y_o\n);\n  logic [{w}:0] prod;\n"
                        f"  flk_fp_mul #({p}, .Saturate({sat})) i_op (.a_i(a_i), .b_i(a_i), .prod_o(prod));\n"
                        f"  assign y_o = prod[{w - 1}:0];\nendmodule\n")
            return head + two.format(w, w, w) + f"  flk_fp_mul #({p}, .Saturate({sat})) i_op (.a_i, .b_i, .prod_o(y_o));\nendmodule\n"
        if o.op == Op.ADD:
            return head + two.format(w, w, w) + f"  flk_fp_add #({p}, .Saturate({sat})) i_op (.a_i, .b_i, .sum_o(y_o));\nendmodule\n"
        return head + two.format(w, w, 0) + f"  flk_fp_cmp #({p}) i_op (.a_i, .b_i, .lt_o(y_o[0]));\nendmodule\n"
    if fmt.startswith("int "):
        left, right = (int(x) for x in fmt.removeprefix("int ").split("x"))
    else:  # qI.F: sign and magnitude; fixed N
        left = right = sum(int(x) for x in fmt[1:].split(".")) + 1 if fmt.startswith("q") else int(fmt.removeprefix("fixed "))
    if o.op == Op.MUL:
        if o.sqr:
            return (head + f"  input logic [{left - 1}:0] a_i,\n  output logic [{2 * left - 1}:0] y_o\n);\n"
                    f"  assign y_o = {2 * left}'(a_i) * {2 * left}'(a_i);\nendmodule\n")
        return head + two.format(left - 1, right - 1, left + right - 1) + f"  assign y_o = {left + right}'(a_i) * {left + right}'(b_i);\nendmodule\n"
    if o.op == Op.ADD:
        return head + two.format(left - 1, left - 1, left - 1) + "  assign y_o = a_i + b_i;\nendmodule\n"
    return head + two.format(left - 1, left - 1, 0) + "  assign y_o[0] = $signed(a_i) < $signed(b_i);\nendmodule\n"


# Choice of the next of eight pixels, one a cycle, for VRUs that visit single pixels.
SELECT = """module flk_op (
  input logic [7:0] a_i,
  output logic [7:0] left_o,
  output logic [2:0] y_o
);
  assign left_o = a_i & (a_i - 8'd1);
  always_comb begin
    y_o = '0;
    for (int unsigned i = 0; i < 8; i++) begin
      if (a_i[7-i]) y_o = 3'(7 - i);
    end
  end
endmodule
"""


def synthesise(name: str, text: str, library: Library) -> dict:
    """Row of an operator."""
    rtl = "".join(path.read_text() for path in sorted((ROOT / "rtl" / "common").glob("flk_fp_*.sv"))) if "flk_fp" in text else ""
    key = "op-" + hashlib.sha256("\0".join((text, rtl, LIBERTY.read_text())).encode()).hexdigest()[:12]
    folder = OPERATORS / key
    if not (folder / "result.json").exists():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "flk_op.sv").write_text(text)
        job = {
            "action": "synthesise", "top": "flk_op", "parameters": {}, "extra": [str(folder / "flk_op.sv")], "boxes": [], "children": {},
            "child_parameters": {}, "liberty": str(LIBERTY), "results": str(UNITS), "open": _open(text),
        }
        (folder / "job.json").write_text(json.dumps(job))
        with (folder / "log").open("w") as log:
            subprocess.run([sys.executable, "-m", "flicker.cost.synth.flow", str(folder / "job.json")], stdout=log, stderr=subprocess.STDOUT)
        if not (folder / "result.json").exists():
            error = folder / "error"
            raise FlickerError(f"operator {name}: {error.read_text() if error.exists() else 'synthesis failed'} (see {folder / 'log'})")
    result = json.loads((folder / "result.json").read_text())
    row = {n: result[n] for n in ("ge_seq", "ge_comb", "mem_bits", "sram_bits", "ff")} | loads(folder / "netlist.v", library)
    return {"unit": "op", "config": name, "ge": row["ge_seq"] + row["ge_comb"], **row, "key": key}


def _open(text: str) -> list[str]:
    """All port bits may be without use: a square has no sign and bit 1 of an integer's is 0, tables have constant bits."""
    widths = {name: int(high) for high, name in re.findall(r"logic \[(\d+):0\] (\w+)", text)}
    return [f"{name}[{bit}]" for name, high in widths.items() for bit in range(high + 1)]


# ---- areas.csv ----------------------------------------------------------------------------------


def unsynthesised() -> list[str]:
    """Units of which build/synth has no result of the RTL as it is."""
    runner = Runner(LIBERTY)
    return [f"{u.name} {u.config}" for u in all_units() if not (UNITS / runner.add(u.top, dict(u.parameters)) / "result.json").exists()]


def lacking() -> str | None:
    """What build/synth has not of the RTL as it is, in few words; None when it has all."""
    if not UNITS.exists():
        return "make synth has not run"
    found = unsynthesised()
    return f"build/synth lacks {found[0]}" + f" and {len(found) - 1} more" * (len(found) > 1) if found else None


def missing() -> str | None:
    """Why areas.csv cannot be of the RTL beside it."""
    what = lacking()
    if what is None or stamp_of(TABLE.read_text()) == rtl_stamp():
        return None
    return f"{TABLE.relative_to(ROOT)} is not of the RTL beside it, and {what}: run make synth first"


def save(say: Say) -> str:
    """Write areas.csv from what is synthesised of the RTL as it is; without that it stays. Says what was done."""
    if what := lacking():
        return f"{TABLE.name} is of this RTL and stays ({what})"
    library = Library(LIBERTY)
    synthesised, runner = Synthesised(library), Runner(LIBERTY)
    rows = []
    for u in all_units():
        key = runner.add(u.top, dict(u.parameters))
        try:
            rows.append({"unit": u.name, "config": u.config, **synthesised.total(key), "key": key})
        except KeyError as error:
            raise FlickerError(f"build/synth lacks {error}, a part of {u.name} {u.config}: run make synth first") from None
    for o in operations():
        if (text := source(o)) is not None:
            say(operator_name(o))
            rows.append(synthesise(operator_name(o), text, library))
    rows.append(synthesise("select 8", SELECT, library))
    with TABLE.open("w", newline="") as file:
        file.write(f"# written by make docs PART=areas; RTL {rtl_stamp()}\n")
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.1f}" if isinstance(v, float) else v for k, v in row.items()})
    parts.cache_clear()
    return f"{len(rows)} rows in {TABLE.name}"


# ---- tables -------------------------------------------------------------------------------------

# Of the RTL, of stages without a test, and of what is estimated.
STAGES = (
    "flicker", "flicker-smooth-mixed-factored", "flicker-smooth-fp16-factored", "faithful", "no-ctu-32", "no-ctu-64", "exact", "exact-e4m3", "rows", "lanes",
    "lanes-deep", "lanes-64",
)


def stage_table() -> str:
    """Millions of GE of rendering stages by part, to two figures behind the point."""
    rows, heads = [], []
    for name in STAGES:
        configuration = get_configuration(name)
        areas = configuration.area_parts()
        heads = list(areas)
        kind = "estimate" if configuration.model_only else "synthesised"
        rows.append([f"`{name}`", configuration.title, kind, f"{sum(areas.values()) / 1e6:.2f}", *(f"{ge / 1e6:.2f}" for ge in areas.values())])
    return markdown.table(["configuration", "what", "from", "MGE", *heads], rows)


def event_table() -> str:
    """pJ of what a frame is made of."""
    rows = [
        (f"{fmt.upper()} {what}", "", switching_pj(part(unit, fmt).load))
        for fmt in ("fp16", "e4m3") for unit, what in (("fp_mul", "multiplication"), ("fp_add", "addition"))
    ]
    for form in Form:
        word = form.name.lower()
        rows.append(("pixel-Gaussian pair in a VRU", word, vru_pj(form)))
        rows.append(("cycle of a VRU's ungated clock", word, clock_pj(part("vru", word).clock_free)))
        rows += [("test cycle of a CTU", f"{word} {precision.name.lower()}", ctu_pj(form, precision)) for precision in Precision]
    rows += [("element in a mask generator", f"`{name}`", generator_pj(get_configuration(name).generator.operations)) for name in ("exact", "rows", "pixels")]
    rows += [("record through a feature FIFO", f"depth {depth}", fifo_pj(depth)) for depth in (4, 16, 64)]
    rows += [("64 bits of SRAM", "288 KiB", sram_pj(64, 288 * 1024)), ("64 bits of LPDDR4", "", dram_pj(8))]
    return markdown.table(["event", "configuration", "pJ"], [[event, which, significant(value, 2)] for event, which, value in rows])


def tables(say: Say) -> dict[str, str]:
    return {
        "stages": stage_table(),
        "generators": generator_error_table(),
        "events": event_table(),
        "constants": markdown.table(["name", "value", "source"], [[f"`{name}`", f"{value:.6g}", source] for name, value, source in constant_table()]),
    }


def generator_errors() -> dict[str, float]:
    """Relative error of the estimate by operators, on the CTUs that are synthesised, by form and precision."""
    errors = {}
    for form in Form:
        for precision in Precision:
            words = form.name.lower(), precision.name.lower()
            generator = get_configuration("-".join(("flicker-smooth", words[1], words[0]))).generator
            errors[" ".join(words)] = generator_area(generator.operations) / ctu_area(form, precision) - 1
    return errors


def generator_error_table() -> str:
    """The rule for generators without RTL, tried on those with RTL."""
    rows = []
    for name, error in generator_errors().items():
        form, precision = name.split()
        synthesised = ctu_area(form, precision)
        rows.append([f"CTU, {form}, {precision}", f"{synthesised / 1e3:.1f}", f"{(1 + error) * synthesised / 1e3:.1f}", f"{error:+.1%}"])
    return markdown.table(["generator", "synthesised, kGE", "by the rule, kGE", "error"], rows)
