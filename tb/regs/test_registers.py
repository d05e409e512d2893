"""Registers of the chip against their description: rtl/regs/flk_registers.rdl is compiled and walked, nothing is repeated here.

State space: every register written and read in random order with random data and bytes, reads and writes at once, pauses on all five channels; every word
of the address space that has no register; lock; commands; interrupts that come with and without clears and enables; what hardware drives; reset under way.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import gen_counters
import gen_registers
import pytest
from flicker_tb.runner import build_and_test

from flicker import chip_counters
from flicker.chip_registers import REGISTERS, ChipCounter, ResultError
from flicker.toolchain import ROOT

PACKAGE = ROOT / "rtl" / "generated" / "flk_registers_pkg.sv"


def described() -> list[dict[str, Any]]:
    """Registers in the order of their addresses, and what each field is."""
    top, _ = gen_registers.compiled()
    return [
        {
            "name": reg.inst_name, "offset": reg.raw_address_offset, "count": gen_registers.count(reg),
            "fields": [
                {
                    "name": field.inst_name, "low": field.low, "width": field.width,
                    "reset": reset if isinstance(reset := field.get_property("reset"), int) else None,
                    "written": field.is_sw_writable, "read": field.is_sw_readable, "to_hardware": field.is_hw_readable,
                    "from_hardware": field.is_hw_writable, "locked": bool(field.get_property("swwel")),
                    "pulse": field.get_property("singlepulse"), "interrupt": bool(field.get_property("intr")),
                    "clear": field.get_property("onwrite") is not None,
                }
                for field in reg.fields()
            ],
        }
        for reg in top.registers(unroll=False)
    ]


def places(struct: str) -> dict[str, tuple[int, int]]:
    """Lowest bit and bits of every leaf of a packed struct of the package, by path, as `position[0].value.value`."""
    found = {name: body for body, name in re.findall(r"typedef struct packed \{(.*?)\} (\w+);", PACKAGE.read_text(), re.S)}

    def walk(struct: str, path: str, at: int) -> int:
        """The bit above."""
        for kind, high, name in reversed(re.findall(r"^\s*(\w+)\s*(?:\[(\d+):0\])?\s*(\w+);", found[struct], re.M)):
            size = int(high or 0) + 1
            if kind == "logic":
                out[f"{path}{name}"] = at, size
                at += size
            else:
                for i in range(size):
                    at = walk(kind, f"{path}{name}{f'[{i}]' if high else ''}.", at)
        return at

    out: dict[str, tuple[int, int]] = {}
    walk(struct, "", 0)
    return out


def test_registers() -> None:
    config = {"registers": described(), "in": places("flk_registers__in_t"), "out": places("flk_registers__out_t")}
    build_and_test("flk_registers", "cocotb_registers", config=config)


def test_python_module_is_the_description() -> None:
    assert {reg["name"]: (reg["offset"], reg["count"], {f["name"]: (f["low"], f["width"]) for f in reg["fields"]}) for reg in described()} == {
        name: (register.offset, register.count, register.fields) for name, register in REGISTERS.items()
    }
    assert len({int(error) for error in ResultError}) == len(ResultError) and all(0 <= error < REGISTERS["result"].fields["error"][1] for error in ResultError)


def test_registers_do_not_overlap() -> None:
    words = [register.offset + 4 * i for register in REGISTERS.values() for i in range(register.count)]
    assert len(set(words)) == len(words) and all(word % 4 == 0 for word in words)


def test_counters_are_in_both() -> None:
    """rtl/counters.toml, by way of the register map and of Python."""
    counters = {kind: [(c.name, c.number, c.words) for c in each] for kind, each in gen_counters.load().items() if kind != "stage"}
    assert counters == {kind: [(c.name, c.number, c.words) for c in getattr(chip_counters, kind.upper())] for kind in counters}
    numbers = {c.member.upper(): c.number for each in gen_counters.load().values() for c in each}
    assert numbers == {member.name: int(member) for member in ChipCounter}


@pytest.mark.parametrize("old,new,message", [
    ("number = 2,", "number = 1,", "culled_gaussians: number 1 belongs to culled_clusters"),
    ("number = 98,", "number = 110,", "front: not in the order of numbers"),
    ('number = 106, name = "beat_waits"', 'number = 107, name = "beat_waits"', "front_beat_waits: number 107 is not the one behind front_line_waits"),
    ("number = 83,", "number = 84,", "live_data_waits: number 84 is not the one behind live_front_address_waits"),
    ('name = "clipped"', 'name = "faint"', "faint: two counters have this symbol"), ("bits = 25", "bytes = 25", "taken: .*unexpected keyword argument 'bytes'"),
    ("stamps = [", "stamp = [", "kinds are front, rendering, stamps, live, stage"),
    ('number = 0, name = "cycles"', 'number = 110, name = "cycles"', "front: not in the order of numbers"),
])
def test_counters_that_cannot_be(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = gen_counters.SOURCE.read_text()
    assert text.count(old) == 1
    path = tmp_path / "counters.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(SystemExit, match=message):
        gen_counters.load(path)
