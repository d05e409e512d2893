"""What docs/guide/integration.md and docs/reference/chip_ports.md say of the sources: clocks, resets, cells to replace, figures; the wrapper's parameters.

Not covered: its templates and tables, which tb/test_docs.py and tb/test_tooling.py hold; frames and pins: tb/top/test_top_axi.py.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from doc_parts.instance import OWN_ID_BITS, managers

from flicker.toolchain import ROOT, filelist, sources_of

TOP = ROOT / "rtl" / "flk_top.sv"
WRAPPER = ROOT / "rtl" / "flk_top_axi.sv"


def header(path: Path) -> str:
    """Imports, parameters and ports of a module."""
    found = re.search(rf"^module {path.stem}\b.*?^\);", path.read_text(), re.M | re.S)
    assert found
    return found[0]


def code(path: Path) -> str:
    """A source without its comments."""
    return re.sub(r"//.*", "", path.read_text())


def test_clocks_and_resets() -> None:
    """One clock and its rising edge; resets that in a scan test are the pin; gates in flk_top alone, each with its test enable."""
    gates = 0
    for path in filelist():
        text, wrapper = code(path), path.stem == "flk_top_axi"
        events = {re.sub(r"\s+", " ", event) for event in re.findall(r"\balways\w*\s*@\s*\((.*?)\)", text)}
        clock, reset = ("aclk", "rst_n") if wrapper else ("clk_i", "rst_ni")
        assert events <= {f"posedge {clock}", f"posedge {clock} or negedge {reset}"}, path.name
        assert ("always_latch" in text) == (path.stem == "flk_clock_gate"), path.name
        connected = set(re.findall(r"\.rst_ni\s*\(\s*(.*?)\s*\)", text)) - {"rst_ni"}
        assert connected <= {"flk_top": {"front_rst_n", "rendering_rst_n"}, "flk_top_axi": {"rst_n", "aresetn"}}.get(path.stem, set()), path.name
        clocks = set(re.findall(r"\.clk_i\s*\(\s*(.*?)\s*\)", text)) - {"clk_i", "1'b0"}
        assert clocks <= {"flk_top": {"front_clk", "rendering_clk"}, "flk_top_axi": {"aclk"}}.get(path.stem, set()), path.name
        inside = re.findall(r"flk_clock_gate (\w+) \((.*?)\);", text, re.S)
        assert not inside or path.stem == "flk_top"
        assert all(re.search(r"\.test_en_i,", pins) for _, pins in inside)
        gates += len(inside)
    assert gates == 2
    for half in ("front", "rendering"):
        assert re.search(rf"assign {half}_rst_n\s*= rst_ni && \(test_en_i \|\| {half}_rst_nq\);", code(TOP))
    assert re.search(r"assign rst_no\s*= test_en_i \? rst_ni : ", code(ROOT / "rtl" / "common" / "flk_reset_sync.sv"))


def test_cells_to_replace() -> None:
    """Those of the page are all that hold memories, gate a clock or synchronise; the stages alone have none of them."""
    page = (ROOT / "docs" / "guide" / "integration.md").read_text()
    listed = re.findall(r"^\| `(\w+)` \| `(rtl/[\w/]+\.sv)` \|", page, re.M)
    assert len(listed) == 4 and all((ROOT / file).stem == name for name, file in listed)
    cells = {name for name, _ in listed}
    arrays = {path.stem for path in filelist() if re.search(r"\blogic\b[^;=]*\]\s*\w+_q\s*\[\w+\]\s*;", code(path))}
    assert arrays == {"flk_sram", "flk_sram_single", "flk_fifo", "flk_lane", "flk_lane_core"}, arrays  # the latter of shared cores alone
    for stage in ("flk_render_stage", "flk_lane_stage"):
        assert not cells & {path.stem for path in sources_of(stage)}


def test_figures_of_the_page() -> None:
    """Widths, sizes and constants in the prose."""
    page = " ".join((ROOT / "docs" / "reference" / "chip_ports.md").read_text().split())
    said = {"narrow": 5, "whole": 6}
    table = managers()
    assert all(m.size == (said["narrow"] if m.note.startswith("always") else said["whole"]) for m in table)
    assert all(m.beats == 1 and not m.note for m in table if m.write) and "Writes are single beats of the whole width" in page
    assert f"(AxSIZE {said['narrow']})" in page and f"(AxSIZE {said['whole']})" in page and "single beats of 32 bytes" in page
    ports = header(WRAPPER)
    for text, bits in (
        ("512 bits of data, byte addresses of 40 bits", r"\[39:0\]\s+m_axi_araddr"), ("32 bits of data and 10 of address, 1 KB", r"\[9:0\]\s+s_axil_araddr"),
    ):
        assert text in page and re.search(bits, ports)
    assert re.search(r"\[PortBits-1:0\]\s+m_axi_rdata", ports) and re.search(r"PortBits\s+= 512\b", ports) and re.search(r"\[31:0\]\s+s_axil_rdata", ports)
    for name, value, text in (
        ("Cache", 3, "CACHE is 3 ("), ("ResetStages", 2, "with `ResetStages` of 2 (default)"), ("IdWidth", 7, "fewer than 7 bits of identifiers are refused"),
    ):
        assert re.search(rf"{name}\s+= {value}\b", ports) and text in page
    assert OWN_ID_BITS == 4 and "above its own four bits" in page and all(m.ids[0] >> OWN_ID_BITS == m.index for m in table)


@pytest.mark.parametrize("file", ["rtl/flk_top_axi.sv", "soc/pulp/flk_top_pulp.sv", "soc/flk_top_axi_shim.sv"])
def test_parameters_are_those_of_the_chip(file: str) -> None:
    """Each has the chip's default and is handed on; the shim has no chip inside."""
    def parameters(text: str) -> dict[str, str]:
        return dict(re.findall(r"^\s*parameter\s+(?:int unsigned|bit)\s+(\w+)\s*= ([\w:']+)", text, re.M))

    text = (ROOT / file).read_text()
    chip = parameters(header(TOP))
    assert len(chip) > 15 and chip.items() <= parameters(text).items()
    if "shim" not in file:
        instance = re.search(r"flk_top #\((.*?)\) i_top", text, re.S)
        assert instance and {name: name for name in chip}.items() == dict(re.findall(r"\.(\w+)\s*\((\w+)\)", instance[1])).items()
