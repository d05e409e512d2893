"""`make docs PART=instance`: instantiation templates of the tops from their own ports, what their ports want, what the chip asks of its memory."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pyslang

from flicker.errors import FlickerError
from flicker.markdown import table
from flicker.toolchain import ROOT, filelist

from .common import Say

STAGE = "flk_render_stage"
CHIP = "flk_top"
WRAPPER = "flk_top_axi"

# What a port of the chip wants, by its name in flk_top; each port has one line (`duties`).
DUTIES = (
    (r"clk_i", "the one clock, rising edge; all other ports belong to it"),
    (r"rst_ni", "low: reset, at once. `flk_top`, and `flk_top_axi` with `ResetStages` 0: must rise in time with the clock. The memory's side of the port is in "
     "reset as well, or has nothing under way"),
    (r"test_en_i", "0 in use; 1 in a scan test ([below](#test))"),
    (r"irq_o", "a level: 1 while an enabled interrupt waits"),
    (r"reg_aw_(addr|prot)_i", "byte address, of which bits 1 and 0 are not looked at; PROT is not looked at"),
    (r"reg_w_(data|strb)_i", "bytes without a strobe keep their value"),
    (r"reg_(aw|w|ar)_valid_i", "stays until it is taken. Addresses and data of writes come in any order; low in reset"),
    (r"reg_(aw|w|ar)_ready_o", "from registers: one address, one word of data and one read are kept. `flk_top`: high in reset too"),
    (r"reg_ar_(addr|prot)_i", "as of writes; reads change nothing"),
    (r"reg_(b|r)_valid_o", "stays until it is taken. Answers come in the order of the accesses, reads and writes together"),
    (r"reg_(b|r)_ready_i", "must not wait for an answer of the other kind"),
    (r"reg_b_resp_o|reg_r_(data|resp)_o", "OKAY; SLVERR where there is no register"),
    (r"(ar|aw)_valid_o", "stays, with all that belongs to it, until it is taken; does not wait for ready; low in reset"),
    (r"(ar|aw)_(id|addr|len|size|burst|qos)_o", "INCR, in order within an identifier, never across 4 KB ([below](#memory-port))"),
    (r"(ar|aw|w)_ready_i", "may come and go; `w_ready_i` reaches the writers combinationally"),
    (r"r_valid_i", "what was asked for, no more. Beats of several identifiers may be interleaved; low in reset"),
    (r"r_(id|data|resp|last)_i", "the whole width, of narrow reads those that are asked for; SLVERR and DECERR end the frame with an error"),
    (r"(r|b)_ready_o", "always 1"),
    (r"w_valid_o", "may come before its address does; bursts in the order of the addresses, not interleaved"),
    (r"w_(data|strb|last)_o", "whole width; strobes may be any, and none at all after an abort"),
    (r"b_valid_i", "not before address and last data are taken: what is answered, later reads see; low in reset"),
    (r"b_(id|resp)_i", "of several identifiers in any order"),
)

# Managers behind the memory port: purpose, half and name of its port there (`HALVES`), place of the unit of AXI in the half, what it does beside whole beats.
MANAGERS = (
    ("records", "RENDERING", "READ_RECORDS", "i_delivery", "always narrow: one beat of 32 bytes"),
    ("lists", "RENDERING", "READ_LISTS", "gen_unit", "a pointer is a narrow beat of 32 bytes"),
    ("pointers that were written", "FRONT", "READ_POINTERS", "i_pointers", ""),
    ("colours", "FRONT", "READ_COLOURS", "i_colours", ""),
    ("kept colours", "FRONT", "READ_COLOURS", "gen_store.i_store", ""),
    ("cluster headers, geometry", "FRONT", "READ_GEOMETRY", "i_geometry", ""),
    ("cluster table", "FRONT", "READ_TABLE", "i_cull", ""),
    ("frame buffer", "RENDERING", "", "i_lines", ""),
    ("pointers that make room", "FRONT", "WRITE_POINTERS", "i_pointers", ""),
    ("records, lists, pointers, kept colours", "FRONT", "WRITE_LINES", "i_write", ""),
)
HALVES = {  # package, instance in flk_top; the first one's ports go first
    "RENDERING": ("common/flk_rendering_pkg", "i_rendering"), "FRONT": ("preproc/flk_preproc_pkg", "i_front"),
}
AXI_SIZES = ("MaxBeats", "Bursts", "Width", "Id")  # parameters of the units of AXI
OWN_ID_BITS = 4  # of a manager's identifier, below its number
BEAT = 64


def elaborate(extra: str = "", tops: set[str] | None = None) -> tuple[list[str], dict[str, pyslang.ast.InstanceSymbol]]:
    """Errors of slang and top modules by name.

    extra: SystemVerilog text behind the sources of rtl/flk.f. tops: None: modules that no other has inside.
    """
    options = pyslang.ast.CompilationOptions()
    options.topModules = tops or set()
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for path in filelist():
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromFile(str(path)))
    if extra:
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromText(extra))
    errors = [str(found.code) for found in compilation.getAllDiagnostics() if found.isError()]
    return errors, {top.name: top for top in compilation.getRoot().topInstances}


def _padded(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows with their columns aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _body(top: str) -> pyslang.ast.InstanceBodySymbol:
    errors, tops = elaborate(tops={top})
    if errors:
        raise FlickerError(f"rtl/flk.f: slang finds {errors[0]}")
    return tops[top].body


def template(top: str, instance: str) -> str:
    """Declarations of a top's signals and its instance with every parameter at its default."""
    body = _body(top)
    signals, connections = [], []
    for port in body.portList:
        name = re.sub(r"_n?[io]$", lambda end: "_n" if "n" in end[0] else "", port.name)
        signals.append((re.sub(r"(?<=\w)\[", " [", str(port.type)) + " ", f"{name};"))
        connections.append((f"  .{port.name} ", f"({name}),"))
    parameters = []
    for parameter in body.parameters:
        if not parameter.isPortParam or parameter.isLocalParam:
            continue
        text = str(parameter.syntax.initializer.expr if hasattr(parameter.syntax, "initializer") else parameter.syntax.assignment.type).strip()
        text = re.sub(r"//.*", "", text).strip()
        package = "flk_param_pkg::" if re.fullmatch(r"[A-Z][A-Z0-9_]*", text) else "flk_pkg::" if re.fullmatch(r"[a-z_0-9]+_t", text) else ""
        parameters.append((f"  .{parameter.name} ", f"({package}{text}),"))
    parameters[-1] = (parameters[-1][0], parameters[-1][1].rstrip(","))
    connections[-1] = (connections[-1][0], connections[-1][1].rstrip(","))
    return "\n".join([
        *_padded(signals), "", f"{top} #(", *_padded(parameters), f") {instance} (", *_padded(connections), ");",
    ])


def amba(name: str) -> str:
    """Pin of flk_top_axi that a port of flk_top is."""
    plain = re.sub(r"_n?[io]$", "", name)
    if plain in (own := {"clk": "aclk", "rst": "aresetn", "test_en": "test_en", "irq": "irq"}):
        return own[plain]
    return f"s_axil_{plain.removeprefix('reg_').replace('_', '')}" if plain.startswith("reg_") else f"m_axi_{plain.replace('_', '')}"


def duties() -> str:
    """Table of the chip's ports, in both forms, with what each wants."""
    ports = {port.name: str(port.type) for port in _body(CHIP).portList}
    pins = {port.name: str(port.type) for port in _body(WRAPPER).portList}
    rows, left = [], set(ports)
    for pattern, text in DUTIES:
        names = [name for name in ports if re.fullmatch(pattern, name)]
        if not names or not set(names) <= left:
            raise FlickerError(f"scripts/doc_parts/instance.py: DUTIES: {pattern}: no port, or one that another line has")
        left -= set(names)
        for name in names:
            if ports[name] != pins[amba(name)]:
                raise FlickerError(f"flk_top_axi: {amba(name)} is {pins[amba(name)]}, {name} of flk_top {ports[name]}")
        rows.append((", ".join(f"`{name}`" for name in names), ", ".join(f"`{amba(name)}`" for name in names), text))
    if left:
        raise FlickerError(f"scripts/doc_parts/instance.py: DUTIES: nothing about {', '.join(sorted(left))}")
    constant = ", ".join(f"`{name}`" for name in pins if name not in {amba(port) for port in ports})
    rows.append(("", constant, "LOCK, REGION and USER are 0, CACHE and PROT the parameters `Cache` and `Prot`; USER of answers is not looked at"))
    return table(["`flk_top`", "`flk_top_axi`", "duty"], rows)


def _instances(scope: object) -> Iterator[pyslang.ast.InstanceSymbol]:
    """All below a scope, blocks that are generated included."""
    for member in scope:  # type: ignore[attr-defined]
        if isinstance(member, pyslang.ast.InstanceSymbol):
            yield member
            yield from _instances(member.body)
        elif isinstance(member, pyslang.ast.GenerateBlockArraySymbol) or (isinstance(member, pyslang.ast.GenerateBlockSymbol) and not member.isUninstantiated):
            yield from _instances(member)


@dataclass(frozen=True)
class Manager:
    """What the memory port sees of one of its managers. index: its number among readers or writers, which the identifier begins with. ids: of the port.
    size: AxSIZE of its longest beats. beats: of a burst, at most. bursts: under way, at most. qos: at the port."""

    name: str
    write: bool
    index: int
    ids: tuple[int, ...]
    size: int
    beats: int
    bursts: int
    note: str

    @property
    def qos(self) -> int:
        return 15 - self.index


def managers(parameters: Mapping[str, int] | None = None) -> list[Manager]:
    """From the units of AXI as slang elaborates them. parameters: of flk_top beside its defaults; none changes the answer but by the sizes of memories."""
    text = "" if not parameters else (
        f"module flk_sized; {CHIP} #({', '.join(f'.{name}({value})' for name, value in parameters.items())}) i_chip (); endmodule"
    )
    errors, tops = elaborate(text, {"flk_sized"} if text else {CHIP})
    if errors:
        raise FlickerError(f"rtl/flk.f: slang finds {errors[0]}")
    units = [
        (
            instance.hierarchicalPath, instance.definition.name,
            {p.name: int(str(p.value).split("'d")[-1]) for p in instance.body.parameters if p.name in AXI_SIZES},
        )
        for instance in _instances(next(iter(tops.values())).body) if instance.definition.name in ("flk_axi_read", "flk_axi_write")
    ]
    constants = {
        name: int(value) for package, _ in HALVES.values() for name, value in re.findall(r" (\w+) = (\d+);", (ROOT / "rtl" / f"{package}.sv").read_text())
    }
    found, taken = [], 0
    for name, half, port, place, note in MANAGERS:
        write = not port.startswith("READ_")
        first = constants["RENDERING_WRITERS" if write else "RENDERING_READERS"] if half == "FRONT" else 0
        own = [
            values for path, kind, values in units if f".{HALVES[half][1]}.{place}" in path and kind == f"flk_axi_{'write' if write else 'read'}"
        ]
        if not own or len({(v["MaxBeats"], v["Bursts"], v["Width"]) for v in own}) != 1:
            raise FlickerError(f"scripts/doc_parts/instance.py: MANAGERS: {name}: no unit of AXI, or several kinds")
        taken += len(own)
        index, one = first + (constants[f"{half}_{port}"] if port else 0), own[0]
        beats = 1 if one["Width"] < 8 * BEAT else one["MaxBeats"]
        found.append(Manager(
            name, write, index, tuple(index << OWN_ID_BITS | v["Id"] for v in own), (one["Width"] // 8).bit_length() - 1, beats, one["Bursts"] * len(own), note,
        ))
    if taken != len(units):
        raise FlickerError("scripts/doc_parts/instance.py: MANAGERS: a unit of AXI is of no manager")
    return found


def traffic() -> str:
    """Table of what the memory port asks for."""
    found = managers()
    rows = [
        ("write" if m.write else "read", m.name, ", ".join(str(i) for i in m.ids), f"{m.size}" if m.note.startswith("always") or not m.note else f"{m.size}, 5",
         f"{m.beats}", f"{m.bursts}", f"{m.qos}", m.note)
        for m in found
    ]
    for write in (False, True):
        rows.append(("write" if write else "read", "all", "", "", "", f"{sum(m.bursts for m in found if m.write == write)}", "", ""))
    return table(["", "what", "identifiers", "AxSIZE", "beats at most", "bursts under way at most", "QOS", ""], rows)


def tables(say: Say) -> dict[str, str]:
    return {
        "": f"```systemverilog\n{template(STAGE, 'i_stage')}\n```", "chip": f"```systemverilog\n{template(CHIP, 'i_chip')}\n```",
        "axi": f"```systemverilog\n{template(WRAPPER, 'i_chip')}\n```", "duties": duties(), "managers": traffic(),
    }
