"""Generator of FuseSoC for flicker_soc.core: the SoC of soc.py, without the chip's sources, as a core of its own."""

import sys
from pathlib import Path

import yaml

sys.path.insert(0, str(Path(__file__).resolve().parent))

import pythondata_cpu_vexriscv  # noqa: E402
from litex_flicker import CHIP  # noqa: E402
from soc import SimSoC, emit  # noqa: E402


def main() -> None:
    given = yaml.safe_load(Path(sys.argv[1]).read_text())
    emit(SimSoC(given.get("parameters", {}).get("chip", CHIP)), Path.cwd())
    cpu = Path(pythondata_cpu_vexriscv.data_location) / "VexRiscv_IMAC.v"
    Path(cpu.name).write_text(cpu.read_text())
    memories = "".join(f"      - {path.name}: {{file_type: user, copyto: {path.name}}}\n" for path in sorted(Path.cwd().glob("*.init")))
    Path(f"{given['vlnv'].split(':')[2]}.core").write_text(f"""CAPI=2:
name: "{given['vlnv']}"
filesets:
  soc:
    files:
      - {cpu.name}: {{file_type: verilogSource}}
      - flk_soc.v: {{file_type: verilogSource}}
{memories}targets:
  default:
    filesets: [soc]
""")


if __name__ == "__main__":
    main()
