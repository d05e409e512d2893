"""Other ways to take the chip: the structs of PULP's axi, boards of litex-boards, the guide's example.

Read by slang, which elaborates the chip behind the structs with types as PULP's macros make them. Not covered: Bender, which is not installed here, tools of
vendors.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pyslang
import pytest
import yaml

from flicker import toolchain
from flicker.chips import chip_of
from flicker.toolchain import ROOT, filelist

SOC = ROOT / "soc"

# What AXI_TYPEDEF_ALL and AXI_LITE_TYPEDEF_ALL of PULP's axi 0.39 make: names of the members, their order.
TYPES = """
package pulp_types;
  typedef logic [{id}-1:0] id_t; typedef logic [{address}-1:0] addr_t; typedef logic [0:0] user_t;
  typedef struct packed {{ id_t id; addr_t addr; logic [7:0] len; logic [2:0] size; logic [1:0] burst; logic lock; logic [3:0] cache; logic [2:0] prot;
    logic [3:0] qos; logic [3:0] region; logic [5:0] atop; user_t user; }} aw_t;
  typedef struct packed {{ logic [511:0] data; logic [63:0] strb; logic last; user_t user; }} w_t;
  typedef struct packed {{ id_t id; logic [1:0] resp; user_t user; }} b_t;
  typedef struct packed {{ id_t id; addr_t addr; logic [7:0] len; logic [2:0] size; logic [1:0] burst; logic lock; logic [3:0] cache; logic [2:0] prot;
    logic [3:0] qos; logic [3:0] region; user_t user; }} ar_t;
  typedef struct packed {{ id_t id; logic [511:0] data; logic [1:0] resp; logic last; user_t user; }} r_t;
  typedef struct packed {{ aw_t aw; logic aw_valid; w_t w; logic w_valid; logic b_ready; ar_t ar; logic ar_valid; logic r_ready; }} req_t;
  typedef struct packed {{ logic aw_ready; logic ar_ready; logic w_ready; logic b_valid; b_t b; logic r_valid; r_t r; }} resp_t;
  typedef struct packed {{ logic [31:0] addr; logic [2:0] prot; }} lite_ax_t;
  typedef struct packed {{ logic [31:0] data; logic [3:0] strb; }} lite_w_t;
  typedef struct packed {{ logic [1:0] resp; }} lite_b_t;
  typedef struct packed {{ logic [31:0] data; logic [1:0] resp; }} lite_r_t;
  typedef struct packed {{ lite_ax_t aw; logic aw_valid; lite_w_t w; logic w_valid; logic b_ready; lite_ax_t ar; logic ar_valid; logic r_ready; }} lite_req_t;
  typedef struct packed {{ logic aw_ready; logic w_ready; lite_b_t b; logic b_valid; logic ar_ready; lite_r_t r; logic r_valid; }} lite_resp_t;
endpackage
module pulp_top (input logic clk_i, input logic rst_ni, output logic irq_o, input pulp_types::lite_req_t host_i, output pulp_types::lite_resp_t host_o,
                 output pulp_types::req_t memory_o, input pulp_types::resp_t memory_i);
  flk_top_pulp #(.Stage(1), .axi_req_t(pulp_types::req_t), .axi_resp_t(pulp_types::resp_t), .axi_lite_req_t(pulp_types::lite_req_t),
                 .axi_lite_resp_t(pulp_types::lite_resp_t)) i_chip (
    .clk_i(clk_i), .rst_ni(rst_ni), .test_i(1'b0), .irq_o(irq_o), .slv_req_i(host_i), .slv_resp_o(host_o), .mst_req_o(memory_o), .mst_resp_i(memory_i));
endmodule
"""


def findings(texts: list[str], top: str | None) -> list[str]:
    """Errors of slang, and of widths that do not fit, on sources in order."""
    options = pyslang.ast.CompilationOptions()
    options.topModules = {top} if top else set()
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for text in texts:
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromText(text))
    return [str(found.code) for found in compilation.getAllDiagnostics() if found.isError()]


def rtl() -> list[str]:
    return [path.read_text() for path in filelist()]


@pytest.mark.parametrize("id_bits, address_bits", [(7, 40), (10, 48)])
def test_pulp(id_bits: int, address_bits: int) -> None:
    """The chip behind PULP's structs elaborates, with its own identifiers and with wider ones; a member that is not there is found."""
    wrapper = (SOC / "pulp" / "flk_top_pulp.sv").read_text()
    types = TYPES.format(id=id_bits, address=address_bits)
    assert findings([*rtl(), wrapper, types], "pulp_top") == []
    if id_bits == 7:
        assert findings([*rtl(), wrapper.replace("mst_req_o.aw.qos ", "mst_req_o.aw.quality "), types], "pulp_top")


def test_pulp_manifest() -> None:
    """The Bender package names its sources, and the chip's package where it is."""
    manifest = yaml.safe_load((SOC / "pulp" / "Bender.yml").read_text())
    assert all((SOC / "pulp" / name).is_file() for name in manifest["sources"])
    chip = (SOC / "pulp" / manifest["dependencies"]["flicker"]["path"]).resolve()
    assert yaml.safe_load((chip / "Bender.yml").read_text())["package"]["name"] == "flicker"
    ports = re.findall(r"^\s+\.(\w+)\s*\(", (SOC / "pulp" / "flk_top_pulp.sv").read_text(), re.M)
    declared = re.findall(r"^\s+(?:input|output)\s.*?(\w+),?\s*(?://.*)?$", (ROOT / "rtl" / "flk_top.sv").read_text(), re.M)
    assert set(declared) <= set(ports), set(declared) - set(ports)


def litex() -> None:
    pytest.importorskip("litex", reason="LiteX is not installed: make soc sets it up")
    pytest.importorskip("litex_boards", reason="litex-boards is not installed: make soc sets it up")
    if str(SOC) not in sys.path:
        sys.path.insert(0, str(SOC))


def test_boards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A board's SoC has the chip at the memory's whole width, its constraints, and every source of the chip in the tool's script; a firmware for its RAM."""
    litex()
    import boards
    import firmware

    assert set(boards.BOARDS) == {"zcu104", "vcu118", "vcu128"}
    monkeypatch.setattr(sys, "argv", ["boards.py", "zcu104", "--out", str(tmp_path)])
    boards.main()
    script, text = ((tmp_path / f"xilinx_zcu104.{end}").read_text() for end in ("tcl", "v"))
    assert all(f"{{{path}}}" in script for path in filelist()) and "ddram" in (tmp_path / "xilinx_zcu104.xdc").read_text()
    assert re.search(r"flk_top_axi #\(", text) and "#define FLICKER_BASE 0xa0000000" in (tmp_path / "mem.h").read_text()
    assert set(findings([text], None)) <= {"DiagCode(UnknownModule)"}  # the chip, the CPU, the vendor's cells
    if shutil.which("riscv64-unknown-elf-gcc"):
        monkeypatch.setattr(sys, "argv", ["firmware.py", str(tmp_path), "--ram", str(tmp_path / "firmware.bin")])
        firmware.main()
        assert 20_000 < (tmp_path / "firmware.bin").stat().st_size <= 32_768


@pytest.mark.parametrize("script", ["soc.py", "boards.py", "run.py"])
def test_chip_by_default(script: str) -> None:
    """Scripts begin, and refuse a chip that the table lacks by naming it."""
    litex()
    done = subprocess.run([sys.executable, SOC / script, *(["zcu104"] if script == "boards.py" else []), "--chip", "huge"], capture_output=True, text=True)
    assert done.returncode and "huge" in done.stderr.splitlines()[-1] and "tiny" in done.stderr, done.stderr


def test_guide_example() -> None:
    """At most 10 lines of Python add the chip to a SoC of one's own."""
    litex()
    text = (ROOT / "docs" / "guide" / "soc.md").read_text()
    block = re.search(r"<!-- tb/soc/test_other_ways.py runs this -->\n```python\n(.*?)```", text, re.S)
    assert block and len([line for line in block[1].splitlines() if line.strip()]) <= 10
    names: dict = {}
    exec(block[1], names)
    soc = names["MySoC"](cpu_type="vexriscv", integrated_rom_size=0x8000)
    soc.finalize()
    assert soc.flicker.chip == "small" and soc.bus.regions["flicker"].origin == 0xA000_0000 and soc.irq.locs["flicker"] is not None
    assert len(soc.flicker.memory.r.data) == chip_of("small").config.port_bits == 256


@pytest.mark.parametrize("chip", ["tiny", "default"])
def test_ip_folder(chip: str, tmp_path: Path) -> None:
    """component.xml has every port with its width, two AXI interfaces whose pins are those ports, the registers of the map, and the sources beside it."""
    pytest.importorskip("peakrdl_ipxact", reason="peakrdl-ipxact is not installed: make soc sets it up")
    import xml.etree.ElementTree as Xml

    from flicker.chip_registers import REGISTERS

    if str(SOC / "xilinx") not in sys.path:
        sys.path.insert(0, str(SOC / "xilinx"))
    import package_ip

    done = subprocess.run([sys.executable, "soc/xilinx/package_ip.py", "--chip", chip, "--out", tmp_path], cwd=ROOT, text=True, capture_output=True)
    assert done.returncode == 0 and Path(done.stdout.strip()) == tmp_path / "component.xml", done.stderr
    root = Xml.parse(tmp_path / "component.xml").getroot()
    name = {"s": package_ip.SPIRIT}
    ports = {port.findtext("s:name", None, name): port for port in root.iterfind("s:model/s:ports/s:port", name)}
    declared = re.findall(r"^  (input|output)\s+logic (?:\[.*?\])?\s*(\w+)", (ROOT / "rtl" / "flk_top_axi.sv").read_text(), re.M)
    assert {pin: kind[:-3] if kind == "output" else "in" for kind, pin in declared} == {
        pin: port.findtext("s:wire/s:direction", None, name) for pin, port in ports.items()
    }
    assert ports["m_axi_rdata"].findtext("s:wire/s:vector/s:left", None, name) == str(chip_of(chip).config.port_bits - 1)
    fixed = root.iterfind("s:model/s:modelParameters/s:modelParameter", name)
    assert {one.findtext("s:name", "", name): int(one.findtext("s:value", "", name)) for one in fixed} == chip_of(chip).parameters
    mapped = [place.text for place in root.iterfind("s:busInterfaces/s:busInterface/s:portMaps/s:portMap/s:physicalPort/s:name", name)]
    assert sorted(mapped) == sorted(set(ports) - {"test_en"})
    offsets = {
        register.findtext("s:name", None, name): int(register.findtext("s:addressOffset", "", name), 0)
        for register in root.iterfind("s:memoryMaps/s:memoryMap/s:addressBlock/s:register", name)
    }
    assert {key: at for key, at in offsets.items() if key in REGISTERS} == {key: register.offset for key, register in REGISTERS.items() if key in offsets}
    assert len(offsets) >= len(REGISTERS)
    assert all((tmp_path / file.text).is_file() for file in root.iterfind("s:fileSets/s:fileSet/s:file/s:name", name) if file.text)


def block_design(*arguments: str) -> tuple[str, list[list[str]]]:
    """What soc/xilinx/design.tcl says on standard error, and the commands of Vivado that it gives, which do nothing here."""
    tkinter = pytest.importorskip("tkinter", reason="Python comes without Tcl here")
    tcl, given, said = tkinter.Tcl(), [], []

    def unknown(*command: str) -> str:
        given.append(list(command))
        return command[-1]

    def stop(code: str) -> None:
        raise RuntimeError(code)

    tcl.createcommand("unknown", unknown)
    tcl.createcommand("exit", stop)
    tcl.createcommand("puts", lambda *words: said.append(words[-1]))
    tcl.eval(f"set argv [list {' '.join(f'{{{argument}}}' for argument in arguments)}]")
    try:
        tcl.eval(f"source {{{SOC / 'xilinx' / 'design.tcl'}}}")
    except tkinter.TclError:
        assert len(said) == 1 and not given
    return said[-1], given


def test_block_design(tmp_path: Path) -> None:
    """The script runs to its end with commands that do nothing; it ties up every interface and pin of the IP that package_ip makes, once."""
    pytest.importorskip("peakrdl_ipxact", reason="peakrdl-ipxact is not installed: make soc sets it up")
    if str(SOC / "xilinx") not in sys.path:
        sys.path.insert(0, str(SOC / "xilinx"))
    import package_ip

    root = package_ip.component(chip_of("tiny").parameters).getroot()
    name = {"s": package_ip.SPIRIT}
    buses = {bus.findtext("s:name", "", name) for bus in root.iterfind("s:busInterfaces/s:busInterface", name)}
    (tmp_path / "component.xml").write_text("")
    for board in ("kv260", "zcu104", "zcu102"):
        said, given = block_design(board, str(tmp_path))
        assert said.endswith("flicker.xsa")
        pins = [word for command in given if command[0].startswith(("get_bd_pins", "get_bd_intf_pins")) for word in command[1:] if word.startswith("chip/")]
        assert sorted(pins) == sorted(f"chip/{bus}" for bus in [*buses, "test_en"])
        vlnv = next(command for command in given if command[0] == "create_bd_cell" and command[-1] == "chip")[4]
        assert vlnv == f"{package_ip.VENDOR}:{package_ip.LIBRARY}:{package_ip.TOP}"
        constraints = next(command for command in given if command[:3] == ["add_files", "-fileset", "constrs_1"])[-1]
        text = Path(constraints).read_text()
        assert all(name in (ROOT / "rtl" / file).read_text() for name, file in (("i_reset", "flk_top_axi.sv"), ("released_q", "common/flk_reset_sync.sv")))
        assert text.count("i_reset/released_q_reg") == 2
    assert "two arguments: a board (kv260, zcu104, zcu102)" in block_design("nope", str(tmp_path))[0]
    assert "component.xml: no such file" in block_design("kv260", str(tmp_path / "nothing"))[0]


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["set up", "linted"])
def test_fusesoc(whole: bool, tmp_path: Path) -> None:
    """The SoC as a core of FuseSoC: LiteX emits it beside the chip's sources, Verilator reads all of it."""
    litex()
    environment = toolchain.environment()
    environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
    steps = [] if whole else ["--setup"]
    done = subprocess.run(
        [sys.executable, "-m", "fusesoc.main", "--cores-root", ROOT, "run", "--target", "lint", "--work-root", tmp_path / "work", *steps,
         "flicker_soc"],
        cwd=tmp_path, env={**environment, "HOME": str(tmp_path)}, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )
    assert done.returncode == 0 and "%Error" not in done.stdout, done.stdout[-3000:]
    options = next((tmp_path / "work").glob("*.vc")).read_text()
    assert "--top-module flk_soc" in options and all(path.name in options for path in filelist())
    assert all(name in options for name in ("flk_soc.v", "VexRiscv_IMAC.v"))
