"""`make docs PART=subnormals`: what flushing subnormal numbers to zero would cost in PSNR, per format (docs/results/subnormals.md).

The model's rounding constants are replaced before anything is compiled: results below the smallest normal number become 0, and so do operands in
the splat records. So this file runs itself, one process per variant, each with a cache of its own. The chip's numbers keep subnormals.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable

VARIANTS = ((), ("fp16",), ("e4m3",), ("fp16", "e4m3"))
CONFIGURATIONS = ("no-ctu-32", "no-ctu-32-conic", "flicker", "flicker-dense-fp8-factored", "faithful")


def measure(variant: tuple[str, ...]) -> None:
    """Print a line of PSNR per view and configuration, tab-separated."""
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

    from flicker.explore.configurations import run
    from flicker.front.view import load_view
    from flicker.scene.metrics import psnr
    from flicker.scene.real import REAL_VIEWS, real_scenes

    folder = real_scenes()
    assert folder is not None
    for real in REAL_VIEWS:
        view = load_view(real.path(folder), real.number, (1280, 720))
        for name in CONFIGURATIONS:
            result = run(name, view)
            sent = result.work.totals()["minitiles_sent"]
            print(f"{real.title}\t{name}\t{psnr(result.image, view.reference):.3f}\t{sent}", flush=True)


def tables(say: Callable[[str], None]) -> dict[str, str]:
    """PSNR in dB and thousands of mini-tiles sent."""
    from flicker import markdown

    found: dict[tuple[str, str], list[str]] = {}
    for variant in VARIANTS:
        say(" and ".join(variant) or "kept")
        with tempfile.TemporaryDirectory() as cache:
            done = subprocess.run(
                [sys.executable, __file__, "+".join(variant)], env=os.environ | {"NUMBA_CACHE_DIR": cache}, stdout=subprocess.PIPE, text=True, check=True,
            )
        for line in done.stdout.splitlines():
            view, name, db, sent = line.split("\t")
            found.setdefault((name, view), []).append(f"{float(db):.1f} / {int(sent) / 1000:,.0f}")
    heads = ["configuration", "view", *("kept" if not v else " and ".join(v).upper() + " flushed" for v in VARIANTS)]
    return {"": markdown.table(heads, [[f"`{name}`", view, *cells] for (name, view), cells in sorted(found.items())])}


if __name__ == "__main__":
    measure(tuple(word for word in sys.argv[1].split("+") if word))
