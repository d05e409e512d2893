"""FLICKER: golden model, float64 reference renderer and tools of a contribution-aware 3DGS accelerator."""

import hashlib
import os
from pathlib import Path


def _compiled_code_folder() -> Path:
    """Where numba keeps compiled kernels: one folder per state of the modules that have or feed kernels.

    Numba itself only looks at the file a kernel stands in, not at the functions it calls.
    """
    here = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    folders = ("arithmetic", "front", "golden", "golden/front", "golden/lanes", "perf", "explore/generators", "chip")
    for source in sorted([here / "params.py", *(path for folder in folders for path in here.glob(f"{folder}/*.py"))]):
        digest.update(source.read_bytes())
    return here.parents[1] / "build" / "numba" / digest.hexdigest()[:16]


os.environ.setdefault("NUMBA_CACHE_DIR", str(_compiled_code_folder()))
