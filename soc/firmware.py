"""Builds the firmware (docs/reference/soc.md): the driver of sw/ as it is, the C of firmware/, and of picolibc what they call.

    python soc/firmware.py build/soc/tiny                              # a folder of soc.py, with the SoC's headers
    python soc/firmware.py build/soc/zcu104 --ram build/firmware.bin    # for a board, whose boot loader puts it into RAM
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from flicker.errors import FlickerError
from flicker.toolchain import ROOT

HERE = Path(__file__).resolve().parent / "firmware"
PREFIX = "riscv64-unknown-elf-"
ROM_BYTES = 32768
# -ffp-contract=off: the driver's arithmetic is the golden model's bit for bit.
ARCHITECTURE = ("-march=rv32imac_zicsr", "-mabi=ilp32")
FLAGS = (
    *ARCHITECTURE, "-Os", "-std=c99", "-ffreestanding", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra",
    "-Wno-missing-braces",
)
OWN = ("start.S", "port.c", "main.c", "provoke.c")
LIBRARY = (
    "libc/string/memcpy.c", "libc/string/memset.c", "libc/string/memcmp.c", "libm/math/s_sqrt.c", "libm/common/math_err_invalid.c", "libm/math/s_fabs.c",
    "libm/math/s_floor.c",
)


def compiler() -> str:
    """The cross compiler's path. FlickerError says how to get it."""
    found = shutil.which(f"{PREFIX}gcc")
    if not found:
        raise FlickerError(f"firmware: {PREFIX}gcc is not installed (Debian: gcc-riscv64-unknown-elf)")
    return found


def build(folder: Path, ram: bool = False) -> bytes:
    """The firmware for a SoC that was emitted to a folder: the ROM's contents, or with `ram` an image for the beginning of RAM, where a boot loader puts it.

    FlickerError with the first error of the compiler, or where it is too large.
    """
    import pythondata_software_picolibc

    library = Path(pythondata_software_picolibc.data_location) / "newlib"
    sources = [HERE / name for name in OWN] + [ROOT / "sw" / "flk.c"]
    taken = [library / name for name in LIBRARY]
    headers = [*HERE.glob("*.h"), HERE / "link.ld", *(ROOT / "sw").glob("*.h"), *(folder / name for name in ("csr.h", "mem.h", "soc.h"))]
    texts = (compiler(), str(ram), *FLAGS, *(_text(path) for path in (*sources, *taken, *headers, Path(__file__))))
    out = folder / f"firmware-{hashlib.sha256(chr(0).join(texts).encode()).hexdigest()[:16]}"
    image = out / "firmware.bin"
    if image.exists():
        return image.read_bytes()
    out.mkdir(exist_ok=True)
    include = [word for path in (folder, HERE / "picolibc", library / "libm/common") for word in ("-I", path)]
    include += [word for path in ("libc/include", "libc/tinystdio") for word in ("-isystem", library / path)]
    objects = []
    for path in (*sources, *taken):
        extra = ["-w", "-D_LIBC", "-D_IEEE_LIBM"] if path in taken else ["-Werror"]
        objects.append(out / f"{path.stem}.o")
        _run([compiler(), *FLAGS, *extra, *include, "-c", path, "-o", objects[-1]])
    elf, script = out / "firmware.elf", out / "link.ld"
    text = (HERE / "link.ld").read_text()
    script.write_text(text.replace("ORIGIN = 0x00000000", "ORIGIN = 0x40000000") if ram else text)
    # libgcc's folder is chosen by the architecture's name without the CSRs.
    _run([compiler(), "-march=rv32imac", "-mabi=ilp32", "-nostdlib", "-T", script, "-Wl,--gc-sections", f"-Wl,-Map={out / 'firmware.map'}", *objects, "-lgcc",
          "-o", elf])
    _run([f"{PREFIX}objcopy", "-O", "binary", elf, image.with_suffix(".new")])
    os.replace(image.with_suffix(".new"), image)
    data = image.read_bytes()
    if len(data) > ROM_BYTES:
        raise FlickerError(f"firmware: {len(data)} bytes, the ROM has {ROM_BYTES}")
    return data


def _text(path: Path) -> str:
    """Without the date that LiteX writes."""
    return "\n".join(line for line in path.read_text(errors="replace").splitlines() if "Auto-generated" not in line)


def _run(command: list) -> None:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.splitlines() or [str(command[0])]
        raise FlickerError(f"firmware: {next((line for line in lines if re.search('error:|undefined|overflowed|too little', line)), lines[0])}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where soc.py or boards.py wrote csr.h, mem.h and soc.h")
    parser.add_argument("--ram", type=Path, help="write it to this file for the beginning of RAM, as a boot loader loads it")
    options = parser.parse_args()
    try:
        data = build(options.folder, options.ram is not None)
        if options.ram is not None:
            options.ram.write_bytes(data)
        print(f"{len(data)} bytes")
    except (FlickerError, OSError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
