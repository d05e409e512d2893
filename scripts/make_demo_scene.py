#!/usr/bin/env python3
"""Generate the demo scene: demo.ply and cameras.json in the folder given by --out."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from flicker.errors import FlickerError
from flicker.scene.demo import write_demo


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/demo"), help="folder (default: build/demo)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the texture and the petals (default: 1)")
    arguments = parser.parse_args()
    try:
        for path in write_demo(arguments.out, arguments.seed):
            print(path)
    except FlickerError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
