"""SoCs with the chip for boards of litex-boards. None has been run on a board, nor been through a vendor's tools.

    python soc/boards.py zcu104 --chip tiny --out build/soc/zcu104

writes Verilog, the list of sources with the chip's, constraints and the script of the board's tool chain. With a vendor's tools installed, LiteX's own
steps follow in that folder (docs/guide/soc.md). The CPU has no second cache: what the chip writes to memory is seen once its data cache is emptied.
"""

import argparse
import contextlib
import importlib
import io
import logging
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from litex_flicker import CHIP, ROOT, add_flicker  # noqa: E402
from soc import write_headers  # noqa: E402

from flicker.chips import chips  # noqa: E402  (litex_flicker makes it known)

# Name: target of litex-boards. All have a DDR4 memory on a LiteDRAM controller.
BOARDS = {
    "zcu104": "xilinx_zcu104",  # Zynq UltraScale+ XCZU7EV
    "vcu118": "xilinx_vcu118",  # Virtex UltraScale+ XCVU9P
    "vcu128": "xilinx_vcu128",  # Virtex UltraScale+ XCVU37P
}


def board_soc(board: str, chip: str):
    """The target's SoC with VexRiscv and the chip at its memory."""
    target = importlib.import_module(f"litex_boards.targets.{BOARDS[board]}")
    soc = target.BaseSoC(cpu_type="vexriscv", cpu_variant="imac", l2_size=0, integrated_rom_size=0x20000)
    add_flicker(soc, chip)
    return soc


def emit_board(board: str, chip: str, folder: Path) -> None:
    """Verilog, constraints, script and headers of a board's SoC, into a folder."""
    soc = board_soc(board, chip)
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.redirect_stdout(io.StringIO()):
        soc.finalize()
        soc.build(build_dir=str(folder), run=False)
    write_headers(soc, folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("board", choices=BOARDS)
    parser.add_argument("--chip", choices=chips(), default=CHIP)
    parser.add_argument("--out", type=Path, default=None)
    options = parser.parse_args()
    out = options.out or ROOT / "build" / "soc" / options.board
    logging.disable(logging.CRITICAL)
    emit_board(options.board, options.chip, out)
    print(out)


if __name__ == "__main__":
    main()
