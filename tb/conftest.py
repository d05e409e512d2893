"""pytest set-up: the shared test library on the path, seed in the header, choice of a unit."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

TB = Path(__file__).resolve().parent
sys.path.insert(0, str(TB))

from flicker.errors import FlickerError  # noqa: E402
from flicker_tb import runner  # noqa: E402


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also the tests marked slow (as with SLOW=1)")
    parser.addoption("--unit", help="only the tests of one unit: NAME of tb/**/test_NAME.py")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "sim: simulates hardware (everything outside tb/model)")
    try:
        runner.seed()
    except FlickerError as error:
        raise pytest.UsageError(str(error)) from None
    unit = config.getoption("--unit")
    units = sorted(path.stem.removeprefix("test_") for path in TB.rglob("test_*.py"))
    if unit is not None and unit not in units:
        raise pytest.UsageError(f"no unit {unit!r}; there are {', '.join(units)}")


def pytest_report_header() -> str:
    return f"FLICKER_SEED={runner.seed()}"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    unit = config.getoption("--unit")
    other_test = unit is not None and collection_path.suffix == ".py" and (
        collection_path.name != f"test_{unit}.py"
    )
    return True if other_test else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    slow = config.getoption("--slow") or os.environ.get("SLOW") == "1"
    if not slow:
        left_out = [item for item in items if item.get_closest_marker("slow")]
        items[:] = [item for item in items if not item.get_closest_marker("slow")]
        config.hook.pytest_deselected(items=left_out)
    for item in items:
        if not item.path.is_relative_to(TB / "model"):
            item.add_marker("sim")
