"""Results on disk by what they depend on: sweeps and reports share one folder, so what one has computed the other need not.

One JSON file a result, and an .npz beside it where it has arrays.
"""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..output import write_atomically, write_text, writing
from ..toolchain import BUILD

DEFAULT = BUILD / "sweep" / "points"


def plain(value: Any) -> Any:
    """numpy numbers and arrays as Python's, other objects as text."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)


class Store:
    """A folder of results. Made, and tried out, before any work starts."""

    def __init__(self, folder: Path = DEFAULT) -> None:
        self.folder = folder
        probe = folder / f".probe.{os.getpid()}"
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            probe.write_bytes(b"")
            probe.unlink()

    def load(self, key: str) -> dict | None:
        """The stored numbers; None when there are none, or damaged ones."""
        try:
            data = json.loads((self.folder / f"{key}.json").read_text())
            return data if isinstance(data, dict) else None
        except (OSError, ValueError):
            return None

    def arrays(self, key: str) -> dict[str, np.ndarray] | None:
        """The stored arrays; None when there are none, or damaged ones."""
        try:
            with np.load(self.folder / f"{key}.npz", allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def put(self, key: str, data: dict, arrays: dict[str, np.ndarray] | None = None) -> None:
        """Write a result: arrays first, numbers last, each put in place whole."""
        if arrays:
            write_atomically(self.folder / f"{key}.npz", lambda path: np.savez_compressed(path, **arrays))  # type: ignore[arg-type]
        write_text(self.folder / f"{key}.json", json.dumps(data, default=plain))
