#!/usr/bin/env python3
"""Writes model/flicker/cost/areas.csv: area and switched load of every synthesised unit, for `flicker.cost.area` and `flicker.cost.energy`.

    make synth && python scripts/save_areas.py

Units come from the cached results of `make synth` (build/synth); the operators of mask generators that have no RTL (integer products,
tables, shifters; `flicker.cost.operations`) are synthesised here by the same flow, a second or two each, and cached in build/synth/operators.
Columns: unit, config; ge, ge_seq, ge_comb (gate equivalents); mem_bits, ff; load: capacitance of all input pins but clock pins, in inputs of
the unit inverter; clock_free, clock_gated: capacitance of the clock pins that always toggle and of those behind clock gates; key: the cached
result, whose hash covers the unit's sources. The first line says whether these are of the RTL beside it.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from flicker.explore.generators.disc import DiscFormat, root_table
from flicker.explore.methods import methods

from flicker.cost.area import TABLE, format_bits, operator_name
from flicker.cost.operations import Op, Operation
from flicker.cost.synth.liberty import CLOCK_GATE, Library
from flicker.cost.synth.run import FOLDER, UNITS, Runner
from flicker.cost.synth.units import PRECISIONS, Unit, all_units, ctu_parameters, unit
from flicker.errors import FlickerError
from flicker.golden.masked import ACCUMULATOR_INT_BITS
from flicker.params import Form, Precision
from flicker.toolchain import FILELIST, ROOT

LIBERTY = ROOT / "scripts" / "cells" / "flicker.lib"
OPERATORS = FOLDER / "operators"
COLUMNS = ("unit", "config", "ge", "ge_seq", "ge_comb", "mem_bits", "ff", "load", "clock_free", "clock_gated", "key")
INSTANCE = re.compile(r"^\s*(\w+) (?:\\\S+ |\w+) \(\n(.*?)\n\s*\);", re.M | re.S)
PIN = re.compile(r"\.(\w+)\((.*?)\)(?:,|$)", re.M)


def units() -> list[Unit]:
    """All units of `make synth`, and those of the precisions that its tables leave out."""
    found = all_units()
    have = {(u.name, u.config) for u in found}
    for form in Form:
        for precision in Precision:
            if precision.name.lower() in PRECISIONS:
                continue
            config = f"{form.name.lower()} {precision.name.lower()}"
            values = {"Form": int(form), "Precision": int(precision)}
            found += [u for u in (unit("flk_prtu", config, **values, Cols=2, Rows=2), unit("flk_ctu", config, **ctu_parameters(form, precision)))
                      if (u.name, u.config) not in have]
    return found


# ---- synthesised units --------------------------------------------------------------------------


class Cached:
    """Results in build/synth/units by key, with their loads."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.results: dict[str, dict] = {}
        self.by_unit: dict[tuple, list[str]] = defaultdict(list)
        for path in sorted(UNITS.glob("*/result.json"), key=lambda path: path.stat().st_mtime):
            result = json.loads(path.read_text())
            if "cells" not in result:
                continue
            key = path.parent.name
            self.results[key] = result
            self.by_unit[result["top"], tuple(sorted(result["parameters"].items()))].append(key)

    def total(self, key: str) -> dict[str, float]:
        """Sums of a unit over itself and its parts."""
        own = self.results[key]
        if "load" not in own:
            own |= loads(UNITS / key / "netlist.v", self.library)
        names = ("ge_seq", "ge_comb", "mem_bits", "ff", "load", "clock_free", "clock_gated")
        total = {name: own[name] for name in names}
        for child, count in own["children"].items():
            inside = self.total(child)
            for name in names:
                total[name] += count * inside[name]
        total["ge"] = total["ge_seq"] + total["ge_comb"]
        return total

    def find(self, u: Unit, ge: float | None, present: set[str]) -> str | None:
        """A unit's result of the RTL as it is (its key is in `present`), else the newest, of the area that area.csv gives where it has the unit."""
        for key in sorted(reversed(self.by_unit.get((u.top, u.parameters), [])), key=lambda key: key not in present):
            try:
                if ge is None or abs(self.total(key)["ge"] - ge) < 0.06:
                    return key
            except (KeyError, OSError):
                continue
        return None


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
    """Every different operation that a method has."""
    seen = set()
    for method in methods().values():
        vru = []
        if method.accumulator:
            integer, fraction = ACCUMULATOR_INT_BITS, method.accumulator
            vru = [Operation(Op.SHIFT, f"FP16 -> q{integer}.{fraction}", 3), Operation(Op.ADD, f"fixed {integer + fraction}", 3)]
        for o in (*method.operations.per_element, *method.operations.preprocessing, *vru):
            name = operator_name(o)
            if name not in seen:
                seen.add(name)
                yield o


def _table(format: str) -> str | None:
    """Case items of a table of the row-interval generator."""
    address, data = (int(x) for x in format.split("->"))
    found = [m for m in methods().values() if any(o.op == Op.TABLE and o.format == format for o in m.operations.per_element)]
    note = next(o.note for o in found[0].operations.per_element if o.op == Op.TABLE and o.format == format)
    if note == "k":
        # Octaves of the threshold from 1/2 to 8, 64 steps each; k of the threshold that an address stands for (disc.inverse_radius).
        steps = 1 << (address - 2)
        highs = [2.0 ** (octave - 1) * (1 + (step + 1) / steps) for octave in range(4) for step in range(steps)]
        values = [math.floor(2 ** (data - 1) / (math.sqrt(high) * (1 + 3.1 * 2.0**-11) + 2.0**-11)) for high in highs]
    else:
        values = root_table(DiscFormat(data - 1, address))
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
    row = {n: result[n] for n in ("ge_seq", "ge_comb", "mem_bits", "ff")} | loads(folder / "netlist.v", library)
    return {"unit": "op", "config": name, "ge": row["ge_seq"] + row["ge_comb"], **row, "key": key}


def _open(text: str) -> list[str]:
    """All port bits may be without use: a square has no sign and bit 1 of an integer's is 0, tables have constant bits."""
    widths = {name: int(high) for high, name in re.findall(r"logic \[(\d+):0\] (\w+)", text)}
    return [f"{name}[{bit}]" for name, high in widths.items() for bit in range(high + 1)]


# ---- the table ----------------------------------------------------------------------------------


def main() -> int:
    library = Library(LIBERTY)
    cached = Cached(library)
    areas = {}
    if (FOLDER / "area.csv").exists():
        with (FOLDER / "area.csv").open() as file:
            areas = {(row["unit"], row["config"]): float(row["ge"]) for row in csv.DictReader(file)}
    rows, missing = [], []
    wanted = units()
    present = None
    try:
        runner = Runner(LIBERTY)
        present = {runner.add(u.top, dict(u.parameters)) for u in wanted}
    except FlickerError as error:
        print(f"save_areas: the RTL cannot be planned: {error}", file=sys.stderr)
    for u in wanted:
        key = cached.find(u, areas.get((u.name, u.config)), present or set())
        if key is None:
            missing.append(f"{u.name} {u.config}")
            continue
        rows.append({"unit": u.name, "config": u.config, **cached.total(key), "key": key})
    if missing:
        print(f"save_areas: no synthesis result of {', '.join(missing)}; run make synth", file=sys.stderr)
    if not any(row["unit"] == "vru" for row in rows):
        raise FlickerError("no synthesis results; run make synth first")
    for o in operations():
        if (text := source(o)) is not None:
            rows.append(synthesise(operator_name(o), text, library))
    rows.append(synthesise("select 8", SELECT, library))

    stale = ["all"] if present is None else [row["unit"] for row in rows if row["unit"] != "op" and row["key"] not in present]
    rtl = hashlib.sha256("".join(path.read_text() for path in sorted((FILELIST.parent).rglob("*.sv"))).encode()).hexdigest()[:12]
    note = f"RTL {rtl}" if not stale else f"not of the RTL beside it ({rtl}): {', '.join(sorted(set(stale)))}"
    with TABLE.open("w", newline="") as file:
        file.write(f"# written by scripts/save_areas.py; {note}\n")
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.1f}" if isinstance(v, float) else v for k, v in row.items()})
    print(f"save_areas: {len(rows)} rows in {TABLE.relative_to(ROOT)}; {note}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"save_areas: {error}")
