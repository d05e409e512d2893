"""FLICKER: golden model, float64 reference renderer and tools of a contribution-aware 3DGS accelerator."""

import os
from pathlib import Path

os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).resolve().parents[2] / "build" / "numba"))
os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", "flicker.kernels.Locator,UserProvidedCacheLocator,UserWideCacheLocator")
