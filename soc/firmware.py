"""Builds the firmware (docs/reference/soc.md): the driver of sw/ as it is, the C of firmware/, and of picolibc what they call.

    python soc/firmware.py build/soc/small        # a folder of soc.py, with the SoC's headers
"""

from __future__ import annotations

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
# -ffp-contract=off: the driver's arithmetic is the golden model's bit for bit. -fno-builtin is not given: the compiler may call memcpy and memset, which are there.
FLAGS = (
    "-march=rv32imac_zicsr", "-mabi=ilp32", "-Os", "-std=c99", "-ffreestanding", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra",
    "-Wno-missing-braces",
)
OWN = ("start.S", "port.c", "main.c", "provoke.c")
LIBRARY = ("libc/string/memcpy.c", "libc/string/memset.c", "libc/string/memcmp.c", "libm/math/s_sqrt.c", "libm/common/math_err_invalid.c", "libm/math/s_fabs.c", "libm/math/s_floor.c")


def compiler() -> str:
    """The cross compiler's path. FlickerError says how to get it."""
    found = shutil.which(f"{PREFIX}gcc")
    if not found:
        raise FlickerError(f"firmware: {PREFIX}gcc is not installed (Debian: gcc-riscv64-unknown-elf)")
    return found


def build(folder: Path) -> bytes:
    """The ROM's contents for a SoC that was emitted to a folder. FlickerError with the first error of the compiler."""
    import pythondata_software_picolibc

    library = Path(pythondata_software_picolibc.data_location) / "newlib"
    sources = [HERE / name for name in OWN] + [ROOT / "sw" / "flk.c"]
    taken = [library / name for name in LIBRARY]
    headers = [*HERE.glob("*.h"), HERE / "link.ld", *(ROOT / "sw").glob("*.h"), *(folder / name for name in ("csr.h", "mem.h", "soc.h"))]
    digest = hashlib.sha256("\0".join((compiler(), *FLAGS, *(_text(path) for path in (*sources, *taken, *headers)))).encode()).hexdigest()[:16]
    out = folder / f"firmware-{digest}"
    image = out / "firmware.bin"
    if image.exists():
        return image.read_bytes()
    out.mkdir(exist_ok=True)
    include = ["-I", folder, "-I", HERE / "picolibc", "-isystem", library / "libc/include", "-isystem", library / "libc/tinystdio", "-I", library / "libm/common"]
    objects = []
    for path in (*sources, *taken):
        extra = ["-w", "-D_LIBC", "-D_IEEE_LIBM"] if path in taken else ["-Werror"]
        objects.append(out / f"{path.stem}.o")
        _run([compiler(), *FLAGS, *extra, *include, "-c", path, "-o", objects[-1]])
    elf = out / "firmware.elf"
    _run([compiler(), "-march=rv32imac", "-mabi=ilp32", "-nostdlib", "-T", HERE / "link.ld", "-Wl,--gc-sections", f"-Wl,-Map={out / 'firmware.map'}", *objects, "-lgcc", "-o", elf])
    _run([shutil.which(f"{PREFIX}objcopy") or f"{PREFIX}objcopy", "-O", "binary", elf, image.with_suffix(".new")])
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
        lines = done.stderr.splitlines()
        raise FlickerError(f"firmware: {next((line for line in lines if re.search('error:|undefined|overflowed|too little', line)), lines[0] if lines else command[0])}")


if __name__ == "__main__":
    try:
        print(f"{len(build(Path(sys.argv[1])))} bytes")
    except FlickerError as error:
        sys.exit(str(error))
