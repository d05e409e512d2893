"""An IP folder of the chip for Vivado: component.xml (IP-XACT 1685-2009) with the registers of the SystemRDL, and the sources.

    python soc/xilinx/package_ip.py --chip tiny --out build/ip/flicker

Add the folder to `ip_repo_paths`; design.tcl puts it beside a processor. Ports and their widths are read from flk_top_axi by slang, with the chip's
parameters, which the IP fixes; bus interfaces are AXI4-Lite (s_axil), AXI4 (m_axi), clock, reset and interrupt. Not opened in Vivado: no vendor tool is part
of this repository.
"""

import argparse
import re
import shutil
import sys
import tempfile
import xml.etree.ElementTree as Xml
from collections.abc import Mapping
from pathlib import Path

import pyslang
from peakrdl_ipxact import IPXACTExporter, Standard

from flicker.chips import chip_of, chips
from flicker.toolchain import ROOT, filelist

sys.path.append(str(ROOT / "scripts"))

from gen_registers import compiled  # noqa: E402

TOP = "flk_top_axi"
SPIRIT, XILINX = "http://www.spiritconsortium.org/XMLSchema/SPIRIT/1685-2009", "http://www.xilinx.com"
S, X = f"{{{SPIRIT}}}", f"{{{XILINX}}}"
VENDOR, LIBRARY, VERSION = "flicker", "ip", "1.0"
# Bus definitions: vendor, library, name, version.
AXI = ("xilinx.com", "interface", "aximm", "1.0")
SIGNALS = {"clock": "CLK", "reset": "RST", "interrupt": "INTERRUPT"}
MEMORY_BYTES, REGISTER_BYTES = 1 << 40, 1024


def child(parent: Xml.Element, name: str, text: str | None = None, /, **attributes: str) -> Xml.Element:
    element = Xml.SubElement(parent, S + name, {S + key: value for key, value in attributes.items()})
    element.text = text
    return element


def top_body(parameters: Mapping[str, int]):
    """flk_top_axi with parameters of a chip."""
    options = pyslang.ast.CompilationOptions()
    options.topModules = {TOP}
    options.paramOverrides = [f"{name}={value}" for name, value in parameters.items()]
    compilation = pyslang.ast.Compilation(pyslang.Bag([options]))
    for path in filelist():
        compilation.addSyntaxTree(pyslang.syntax.SyntaxTree.fromFile(str(path)))
    return compilation.getRoot().topInstances[0].body


def bus(buses: Xml.Element, name: str, kind: tuple[str, str, str, str], role: str, pins: dict[str, str], reference: str = "", **parameters: str) -> None:
    """A bus interface. pins: of the bus to those of the chip. reference: memory map of a subordinate, address space of a manager."""
    there = child(buses, "busInterface")
    child(there, "name", name)
    child(there, "busType", **dict(zip(("vendor", "library", "name", "version"), kind)))
    vendor, library, short, version = kind
    child(there, "abstractionType", vendor=vendor, library=library, name=f"{short}_rtl", version=version)
    role_ = child(there, role)
    if reference:
        what = "memoryMapRef" if role == "slave" else "addressSpaceRef"
        child(role_, what, **{what: reference})
    maps = child(there, "portMaps")
    for logical, physical in pins.items():
        one = child(maps, "portMap")
        child(child(one, "logicalPort"), "name", logical)
        child(child(one, "physicalPort"), "name", physical)
    if parameters:
        given = child(there, "parameters")
        for key, value in parameters.items():
            one = child(given, "parameter")
            child(one, "name", key)
            child(one, "value", value, id=f"BUSIFPARAM_VALUE.{name.upper()}.{key}")


def component(parameters: Mapping[str, int]) -> Xml.ElementTree:
    """component.xml of a chip with parameters."""
    Xml.register_namespace("spirit", SPIRIT)
    Xml.register_namespace("xilinx", XILINX)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "registers.xml"
        IPXACTExporter(vendor=VENDOR, library=LIBRARY, version=VERSION, standard=Standard.IEEE_1685_2009).export(compiled()[0], str(path))
        maps = Xml.parse(path).getroot().find(f"{S}memoryMaps")
    assert maps is not None
    maps.find(f".//{S}memoryMap/{S}name").text = "s_axil"
    maps.find(f".//{S}addressBlock/{S}range").text = str(REGISTER_BYTES)
    body = top_body(parameters)
    ports = [member for member in body if isinstance(member, pyslang.ast.PortSymbol)]
    names = [port.name for port in ports]
    root = Xml.Element(S + "component")
    for key, value in (("vendor", VENDOR), ("library", LIBRARY), ("name", TOP), ("version", VERSION)):
        child(root, key, value)
    buses = child(root, "busInterfaces")
    for prefix, role, reference in (("s_axil", "slave", "s_axil"), ("m_axi", "master", "m_axi")):
        bus(buses, prefix, AXI, role, {name.removeprefix(f"{prefix}_").upper(): name for name in names if name.startswith(f"{prefix}_")}, reference)
    for name, pin, role, about in (
        ("clock", "aclk", "slave", {"ASSOCIATED_BUSIF": "s_axil:m_axi", "ASSOCIATED_RESET": "aresetn"}),
        ("reset", "aresetn", "slave", {"POLARITY": "ACTIVE_LOW"}), ("interrupt", "irq", "master", {"SENSITIVITY": "LEVEL_HIGH"}),
    ):
        bus(buses, pin, ("xilinx.com", "signal", name, "1.0"), role, {SIGNALS[name]: pin}, **about)
    space = child(child(root, "addressSpaces"), "addressSpace")
    child(space, "name", "m_axi")
    child(space, "range", str(MEMORY_BYTES))
    child(space, "width", str(next(port for port in ports if port.name == "m_axi_rdata").type.bitWidth))
    root.append(maps)
    model = child(root, "model")
    views = child(model, "views")
    for name, tool in (("xilinx_anylanguagesynthesis", "synthesis"), ("xilinx_anylanguagebehavioralsimulation", "simulation")):
        view = child(views, "view")
        child(view, "name", name)
        child(view, "envIdentifier", f":vivado.xilinx.com:{tool}")
        child(view, "language", "SystemVerilog")
        child(view, "modelName", TOP)
        child(child(view, "fileSetRef"), "localName", "sources")
    listed = child(model, "ports")
    for port in ports:
        one = child(listed, "port")
        child(one, "name", port.name)
        wire = child(one, "wire")
        child(wire, "direction", "in" if port.direction == pyslang.ast.ArgumentDirection.In else "out")
        if port.type.bitWidth > 1:
            vector = child(wire, "vector")
            child(vector, "left", str(port.type.bitWidth - 1))
            child(vector, "right", "0")
    fixed = child(model, "modelParameters") if parameters else None
    for name, value in parameters.items():
        one = child(fixed, "modelParameter")
        child(one, "name", name)
        child(one, "value", str(value), format="long", resolve="immediate", id=f"MODELPARAM_VALUE.{name}")
    files = child(child(root, "fileSets"), "fileSet")
    child(files, "name", "sources")
    for path in filelist():
        one = child(files, "file")
        child(one, "name", f"src/{path.name}")
        child(one, "fileType", "systemVerilogSource")
    child(root, "description", "FLICKER: an accelerator for 3D Gaussian Splatting")
    one = child(child(root, "parameters"), "parameter")
    child(one, "name", "Component_Name")
    child(one, "value", TOP, resolve="user", id="PARAM_VALUE.Component_Name", order="1")
    extensions = Xml.SubElement(Xml.SubElement(root, S + "vendorExtensions"), X + "coreExtensions")
    families = Xml.SubElement(extensions, X + "supportedFamilies")
    for family in ("zynquplus", "virtexuplus", "virtexuplusHBM", "kintexuplus", "kintexu", "virtexu"):
        Xml.SubElement(families, X + "family", {X + "lifeCycle": "Pre-Production"}).text = family
    Xml.indent(root)
    return Xml.ElementTree(root)


def package(folder: Path, chip: str) -> None:
    """component.xml of a chip and src/ into a folder, which is made."""
    (folder / "src").mkdir(parents=True, exist_ok=True)
    for path in filelist():
        shutil.copy(path, folder / "src" / path.name)
    component(chip_of(chip).parameters).write(folder / "component.xml", encoding="UTF-8", xml_declaration=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=re.split(r"\n\n", __doc__)[0])
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "ip" / "flicker")
    parser.add_argument("--chip", choices=chips(), default="tiny")
    options = parser.parse_args()
    out = options.out
    package(out, options.chip)
    print(out / "component.xml")


if __name__ == "__main__":
    main()
