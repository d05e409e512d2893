#!/usr/bin/env python3
"""What flushing subnormal numbers to zero would cost in PSNR, per format (docs/arithmetic.md).

    FLICKER_SCENES=folder scripts/flush_subnormals.py

The model's rounding constants are replaced before anything is compiled: results below the smallest normal number become 0, and so do operands in
the splat records. One process per variant, each with a cache of its own. The chip's numbers keep subnormals.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

VARIANTS = ((), ("fp16",), ("e4m3",), ("fp16", "e4m3"))
METHODS = ("no-ctu-32", "no-ctu-32-conic", "flicker-smooth-fixed-factored", "flicker-dense-fp8-factored", "flicker-smooth-mixed-conic")
SCENES = (("flowers/flowers.compressed.ply", 0), ("playbot/playbot.sog", 1), ("guitar/guitar.ply", 1), ("stpeter/st-peter.sog", 0))


def measure(variant: tuple[str, ...], folder: Path) -> None:
    """Print a line of PSNR per scene and method, tab-separated."""
    import numba
    import numpy as np

    from flicker.arithmetic import fp

    def flushed(r: tuple, smallest: float) -> tuple:
        # Adding it leaves units of four smallest normal numbers, so that whatever is below one is rounded to 0.
        return (*r[:4], np.float32(smallest * 4 * 2.0**23), *r[5:])

    if "fp16" in variant:
        fp.FP16_R = flushed(fp.FP16_R, 2.0**-14)
        exact = fp.fp16_value

        @numba.njit
        def fp16_value(h):
            v = exact(h)
            return v if abs(v) >= np.float32(2.0**-14) else np.float32(0.0)

        fp.fp16_value = fp16_value
    if "e4m3" in variant:
        fp.E4M3_R = flushed(fp.E4M3_R, 2.0**-6)

    from flicker.explore.methods import run

    from flicker.explore.evaluate import load_view
    from flicker.scene.metrics import psnr

    for file, view in SCENES:
        data = load_view(folder / file, view)
        for method in METHODS:
            result = run(method, data.methods_view)
            sent = result.work.totals()["minitiles_sent"]
            print(f"{data.scene} {view}\t{method}\t{psnr(result.image, data.reference):.3f}\t{sent}", flush=True)


def main() -> int:
    if len(sys.argv) > 1:
        measure(tuple(w for w in sys.argv[1].split("+") if w), Path(sys.argv[2]))
        return 0
    folder = os.environ.get("FLICKER_SCENES")
    if not folder:
        sys.exit("flush_subnormals: FLICKER_SCENES must name the folder of real scenes")
    found: dict[tuple[str, str], list[str]] = {}
    for variant in VARIANTS:
        with tempfile.TemporaryDirectory() as cache:
            run = subprocess.run(
                [sys.executable, __file__, "+".join(variant), str(Path(folder).resolve())], env=os.environ | {"NUMBA_CACHE_DIR": cache},
                stdout=subprocess.PIPE, text=True, check=True,
            )
        for line in run.stdout.splitlines():
            view, method, db, sent = line.split("\t")
            found.setdefault((method, view), []).append(f"{float(db):.2f} / {int(sent) / 1000:,.0f}")
    print("| method | view | " + " | ".join("kept" if not v else " and ".join(v).upper() + " flushed" for v in VARIANTS) + " |\n" + "|---" * 6 + "|")
    for (method, view), cells in sorted(found.items()):
        print(f"| `{method}` | {view} | {' | '.join(cells)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
