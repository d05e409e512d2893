"""`make docs PART=shared`: what RTL and model share beside constants: sizes of memories, modes, packed structs, operations on ff numbers."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re

from flicker.errors import FlickerError
from flicker.layout import RECORDS, bits, leaves
from flicker.markdown import table
from flicker.params import CHIP_MEMORIES, CatMode, ChipMemories
from flicker.toolchain import ROOT

from .common import Say

# Parameter of flk_top that a size is, and the page of the unit.
MEMORIES = {
    "sorted_entries": ("`SortStages`: 16 << this", "sorting_unit.md"), "list_chunks": ("`Chunks`", "list_reader.md"),
    "sorted_ahead": ("`Entries`", "delivery.md"),
    "pairs": ("`Pairs`", "frame_writer.md"), "survivors": ("`Waiting`", "front_end.md"), "sort_ways": ("`SortWays`", "sorting_unit.md"),
    "gathered_lines": ("`Gather`", "front_end.md"), "merge_lines": ("`MergeLines`", "list_sorter.md"),
    "record_lines": ("`RecordLines`", "delivery.md"), "queued_records": ("`Queue`", "delivery.md"),
}
# Units that do an operation of flicker.arithmetic.ff; the others are of the model alone.
FF_UNITS = {
    "ff_add": "flk_ff_add", "ff_sub": "flk_ff_add, the sign bit of `b_i` inverted, of a zero too", "ff_mul": "flk_ff_mul", "ff_lt": "flk_ff_cmp",
    "ff_recip": "flk_ff_recip", "ff_rsqrt": "flk_ff_rsqrt", "ff_sqrt": "flk_ff_sqrt", "ff_exp2_fixed": "flk_ff_exp2", "ff_from_fixed": "flk_ff_from_fixed",
    "ff_from_int": "flk_ff_from_fixed", "ff_to_fixed_floor": "flk_ff_to_fixed, `Round` 0", "ff_to_fixed_round": "flk_ff_to_fixed, `Round` 1",
    "ff_round": "flk_ff_narrow, of a longer number", "ff_ldexp": "flk_ff_ldexp",
}


def named(text: str, names: tuple[str, ...]) -> dict[str, str]:
    """Meanings from a docstring of the form `name: meaning. name: meaning.`; raises FlickerError for a name without one."""
    text = re.sub(r"\s*\(docs/[^)]*\)", "", " ".join(text.split()))
    either = "|".join(names)
    found = {name: meaning.rstrip(". ") for name, meaning in re.findall(rf"(?:^|[.:] )({either}): (.*?)(?=\. (?:{either}): |$)", text)}
    if missing := [name for name in names if name not in found]:
        raise FlickerError(f"docs: no meaning of {missing[0]} in a docstring")
    return found


def memories() -> str:
    names = tuple(field.name for field in dataclasses.fields(ChipMemories))
    meanings = named(inspect.getdoc(ChipMemories) or "", names)
    rows = []
    for name in names:
        parameter, page = MEMORIES[name]
        values = (f"{getattr(sizes, name):,}" for sizes in CHIP_MEMORIES.values())
        rows.append((name.replace("_", " "), parameter, *values, f"{meanings[name]} ([{page}]({page}))"))
    return table(["size", "parameter", *CHIP_MEMORIES, ""], rows)


def modes() -> str:
    names = tuple(CatMode.__members__)
    meanings = named(inspect.getdoc(CatMode) or "", names)
    return table(["`CAT_*`", "number", "leader pixels"], [(f"`{name}`", str(int(CatMode[name])), meanings[name]) for name in names])


def structs() -> str:
    """One row a packed struct; fields from the most significant one, records inside by their own fields."""
    rows = []
    for name, record in RECORDS.items():
        own = ", ".join(f"`{path}` " + (f"{p.at + p.bits - 1}:" if p.bits > 1 else "") + f"{p.at}" for path, p in leaves(name).items())
        rows.append((f"`{record.package}::{name}_t`", str(bits(name)), record.note.rstrip("."), own))
    return table(["struct", "bits", "what", "fields"], rows)


def operations() -> str:
    """Functions of flicker.arithmetic.ff in the order of the source."""
    rows, left = [], set(FF_UNITS)
    for node in ast.parse((ROOT / "model" / "flicker" / "arithmetic" / "ff.py").read_text()).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            unit, _, note = FF_UNITS.get(node.name, "").partition(", ")
            left.discard(node.name)
            arguments = ", ".join(a.arg for a in node.args.args)
            said = " ".join((ast.get_docstring(node) or "").partition("\n\n")[0].split()).rstrip(".")
            own = (f"`{unit}`" + (f", {note}" if note else "")) if unit else ""
            rows.append((f"`{node.name}({arguments})`", own, said.replace("|", "\\|").replace("<", "&lt;")))
    if left:
        raise FlickerError(f"scripts/doc_parts/shared.py: FF_UNITS: no function {min(left)}")
    return table(["model", "unit", "result"], rows)


def tables(say: Say) -> dict[str, str]:
    return {"memories": memories(), "modes": modes(), "structs": structs(), "ff": operations()}
