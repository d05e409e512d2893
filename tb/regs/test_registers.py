"""Registers of the chip against their description: rtl/regs/flk_registers.rdl is compiled and walked, nothing is repeated here.

State space: every register written and read in random order with random data and bytes, reads and writes at once, pauses on all five channels; every word
of the address space that has no register; lock; commands; interrupts that come with and without clears and enables; what hardware drives; reset under way.
"""

from __future__ import annotations

import re
from typing import Any

import gen_registers
from flicker_tb.runner import build_and_test

from flicker.chip_registers import REGISTERS, ChipCounter, ResultError
from flicker.sim import preprocessing, rendering
from flicker.toolchain import ROOT

PACKAGE = ROOT / "rtl" / "regs" / "flk_registers_pkg.sv"


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


def test_counters_are_the_description() -> None:
    """Where the words of flk_top_pkg begin, and how many there are, is what the numbers of the counters say."""
    text = (ROOT / "rtl" / "top" / "flk_top_pkg.sv").read_text()
    numbers = {name: int(value) for name, value in re.findall(r"localparam int unsigned (\w+) = (\d+);", text)}
    bases = {
        "COUNTER_FRONT": ChipCounter.FRONT_CYCLES, "COUNTER_RENDERING": ChipCounter.RENDERING_CYCLES, "COUNTER_LIVE": ChipCounter.LIVE_CYCLES,
        "COUNTER_FRONT_WAITS": ChipCounter.FRONT_CLUSTER_WAITS, "COUNTER_STAGE": ChipCounter.STAGE,
    }
    assert {name: numbers[name] for name in bases} == {name: int(base) for name, base in bases.items()}
    ends = {
        "COUNTER_RENDERING": ChipCounter.POINTERS_FETCHED - ChipCounter.FRONT_CYCLES,  # the front end's words but waits
        "FRONT_WAITS": ChipCounter.FRONT_BEAT_WAITS - ChipCounter.FRONT_CLUSTER_WAITS,
        "RENDERING_WORDS": ChipCounter.FRAME_WAITS - ChipCounter.RENDERING_CYCLES,
        "LIVE_WORDS": ChipCounter.LIVE_DATA_WAITS - ChipCounter.LIVE_CYCLES,
    }
    assert {name: numbers[name] for name in ends} == {name: last + 1 for name, last in ends.items()}


def test_waits_are_where_they_are_said_to_be() -> None:
    """Counters of waits come in one order: fields of the halves' structures, words that the top makes of them, numbers, names that the harness reads."""
    top = (ROOT / "rtl" / "flk_top.sv").read_text()
    for half, package, waits, first, prefix in (
        ("front", "preproc/flk_preproc_pkg", preprocessing.WAITS, ChipCounter.FRONT_CLUSTER_WAITS, "FRONT_"),
        ("rendering", "common/flk_rendering_pkg", rendering.WAITS, ChipCounter.LIST_LINE_WAITS, ""),
    ):
        names = [name for name, *_ in waits]
        struct = (ROOT / "rtl" / f"{package}.sv").read_text().split(f"}} {half}_counters_t;")[0].rsplit("typedef struct packed {", 1)[1]
        assert re.findall(r"logic \[31:0\] +(\w+);", struct)[-len(names) :] == names
        words = top.split(f"assign {half}_words = {{")[1].split("};")[0]
        assert re.findall(rf"{half}_counters\.(\w+)", words)[: len(names)] == names[::-1]
        numbers = [ChipCounter(first + k).name.removeprefix(prefix).lower() for k in range(len(names))]
        assert [name.replace("list_line_waits", "list_waits") for name in numbers] == names
