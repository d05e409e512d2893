"""Sweeps: scenes x views x configurations on a Dask cluster, results in Parquet (docs/reference/sweep.md)."""

from .config import Sweep, load_sweep
from .results import load_results
from .run import SweepResult, run_sweep

__all__ = ["Sweep", "SweepResult", "load_results", "load_sweep", "run_sweep"]
