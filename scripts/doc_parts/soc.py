"""`make docs PART=soc`: a processor boots and renders with the chip (soc/run.py), in docs/results/soc.md."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys

from flicker.errors import FlickerError
from flicker.markdown import table
from flicker.toolchain import BUILD, ROOT

from .common import Say


def missing() -> str | None:
    """Why the SoC cannot be simulated; None where it can."""
    if importlib.util.find_spec("litex") is None:
        return "LiteX is not installed: make soc sets it up"
    return None if shutil.which("riscv64-unknown-elf-gcc") else "riscv64-unknown-elf-gcc is not installed (Debian: gcc-riscv64-unknown-elf)"


def tables(say: Say) -> dict[str, str]:
    say("simulating the SoC")
    done = subprocess.run([sys.executable, ROOT / "soc" / "run.py"], capture_output=True, text=True)
    if done.returncode:
        raise FlickerError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "soc/run.py failed")
    numbers = json.loads((BUILD / "soc" / "numbers.json").read_text())
    costs = numbers["table"]
    rows = [
        ("firmware with driver, bytes", f"{numbers['firmware_bytes']:,}"),
        ("reset to prompt, cycles", f"{numbers['boot_cycles']:,}"),
        ("reset to the first picture with its sum, cycles", f"{numbers['to_first_frame_cycles']:,}"),
        ("the same in simulation, seconds", f"{numbers['to_first_frame_seconds']:.0f}"),
        ("cycles a second simulated", f"{numbers['cycles_per_second']:,}"),
        ("camera and descriptor, cycles of the CPU (doubles in software)", f"{costs['camera and descriptor, cycles']:,}"),
        ("frame, cycles of the chip", f"{costs['frame, cycles']:,}"),
        ("start to interrupt, cycles", f"{costs['start to interrupt, cycles']:,}"),
        ("of these the CPU asleep", f"{costs['of these CPU asleep, permille'] / 10:.1f} %"),
    ]
    head = f"{numbers['scene']} scene, {numbers['size']}, chip `{numbers['chip']}`; all pictures equal the golden model's, bit for bit.\n\n"
    return {"": head + table(("what", "number"), rows)}
