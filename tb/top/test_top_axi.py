"""The chip with the pins of AMBA: what of it is wrapper, with nothing but a header in the chip's place, and, with SLOW=1, frames.

State space: every pin of both sides with random values, one edge of a reset with and without the synchroniser, test enable; what is refused. With SLOW=1
the whole chip behind cocotbext-axi's AXI4-Lite manager, with its AXI4 memory, which knows narrow reads: registers, accesses of bytes, a refused descriptor, a
frame byte for byte as the golden model has it, and every access of that frame against the table of docs/integration.md.
Parameter space: identifiers as wide as the chip's and wider; with SLOW=1 a chip of 32 lanes with small memories. Frames of flk_top: tb/frames/test_chip_frames.py.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from flicker_tb.bench import netlist
from flicker_tb.runner import build, build_and_test, refused

from flicker.toolchain import BUILD, ROOT, sources_of

TOP = ROOT / "rtl" / "flk_top.sv"
WRAPPER = ROOT / "rtl" / "flk_top_axi.sv"
pytestmark = pytest.mark.skipif(netlist(), reason="has no netlist of its own: flk_top has one")


def header(path: Path) -> str:
    """Imports, parameters and ports of a module."""
    found = re.search(rf"^module {path.stem}\b.*?^\);", path.read_text(), re.M | re.S)
    assert found
    return found[0]


def sources() -> list[Path]:
    """The wrapper's, with a module that has the chip's header and nothing inside."""
    empty = BUILD / "top_axi" / "flk_top.sv"
    empty.parent.mkdir(parents=True, exist_ok=True)
    empty.write_text(f"{header(TOP)}\nendmodule\n")
    needed = [path for path in sources_of("flk_top_axi") if path.stem.endswith("_pkg") or path.stem in ("flk_reset_sync", "flk_top_axi")]
    return [*needed[:-1], empty, needed[-1]]


def pins() -> list[tuple[str, str, bool]]:
    """Every port of the chip: its name, the wrapper's pin, whether it is an input."""
    found = []
    for direction, name in re.findall(r"^\s*(input|output)\s+logic\b.*?(\w+),?\s*(?://.*)?$", header(TOP), re.M):
        plain = re.sub(r"_n?[io]$", "", name)
        pin = {"clk": "aclk", "rst": "aresetn", "test_en": "test_en", "irq": "irq"}.get(plain)
        if pin is None:
            interface, rest = ("s_axil", plain.removeprefix("reg_")) if plain.startswith("reg_") else ("m_axi", plain)
            pin = f"{interface}_{rest.replace('_', '')}"
        found.append((name, pin, direction == "input"))
    return found


@pytest.mark.parametrize("id_width,stages", [(7, 0), (11, 3)])
def test_wiring(id_width: int, stages: int) -> None:
    build_and_test(
        "flk_top_axi", "cocotb_top_axi_wiring", sources=sources(), inner=True,
        parameters={"IdWidth": id_width, "UserWidth": 3, "ResetStages": stages, "Cache": 11, "Prot": 2},
        config={"pins": pins(), "stages": stages, "cache": 11, "prot": 2},
    )


@pytest.mark.parametrize("parameter,value,text", [
    ("IdWidth", 6, "IdWidth must be at least 7"), ("UserWidth", 0, "UserWidth must be at least 1"), ("Cache", 16, "Cache must be 0 to 15"),
    ("Prot", 8, "Prot 0 to 7"), ("ResetStages", 1, "ResetStages must be 0 or at least 2"),
])
def test_refused(parameter: str, value: int, text: str) -> None:
    with refused(f"flk_top_axi: {text}" if not text.startswith("Prot") else text):
        build("flk_top_axi", sources=sources(), parameters={parameter: value})


def test_parameters_are_those_of_the_chip() -> None:
    """Each has the chip's default and is handed on."""
    def parameters(path: Path) -> dict[str, str]:
        return dict(re.findall(r"^\s*parameter\s+int unsigned (\w+)\s*= ([\w:]+)", header(path), re.M))

    chip, wrapper = parameters(TOP), parameters(WRAPPER)
    assert len(chip) > 15 and chip.items() <= wrapper.items()
    instance = re.search(r"flk_top #\((.*?)\) i_top", WRAPPER.read_text(), re.S)
    assert instance and dict(re.findall(r"\.(\w+)\s*\((\w+)\)", instance[1])) == {name: name for name in chip}
