"""pytest set-up: this checkout's model and test library on the path, seed in the header, choice of a unit, progress."""

from __future__ import annotations

import copy
import csv
import functools
import inspect
import os
import sys
from pathlib import Path

import pytest

TB = Path(__file__).resolve().parent
# Each worker's numba has a thread for each core: those that wait must sleep. They spin otherwise, and what takes a tenth of a second takes seconds.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
UNKNOWN = 100.0  # processor seconds of a test file that is not in costs.csv, for the order
sys.path.insert(0, str(TB))

from flicker_tb import durations, passed, progress, runner  # noqa: E402

from flicker import toolchain  # noqa: E402
from flicker.errors import FlickerError  # noqa: E402
from flicker.scene import demo  # noqa: E402


def _made_once(generate):
    """`generate`, which takes seconds, with a copy of what it has made in this process before."""
    made = functools.cache(generate)

    @functools.wraps(generate)
    def copied(seed: int = 1):
        return copy.deepcopy(made(seed))

    return copied


demo.generate = _made_once(demo.generate)  # before a test module takes it


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also the tests marked slow (as with SLOW=1)")
    parser.addoption("--cached", action="store_true", help="leave out tests that passed on the same inputs (FRESH=1: none)")
    parser.addoption("--unit", help="only the tests of one unit: NAME of tb/**/test_NAME.py; slow ones too where it has no others that simulate")


def _simulates(path: Path) -> bool:
    """Whether a test file simulates hardware: those in the folders of tb/ but tb/model and tb/sw do."""
    return path.parent != TB and not any(path.is_relative_to(TB / folder) for folder in ("model", "sw"))


def _slow(config: pytest.Config) -> bool:
    return config.getoption("--slow") or os.environ.get("SLOW") == "1"


def _refusal(item: pytest.Item) -> bool:
    """Whether a test expects that parameters are refused, and simulates nothing."""
    return isinstance(item, pytest.Function) and "refused(" in inspect.getsource(item.function)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "sim: simulates hardware (folders of tb/, tb/model and tb/sw excepted)")
    if toolchain.ROOT != TB.parent:
        raise pytest.UsageError(
            f"{TB.parent}: the flicker package comes from another checkout, {toolchain.ROOT}, whose RTL would be tested; run 'make setup' here"
        )
    try:
        runner.seed()
    except FlickerError as error:
        raise pytest.UsageError(str(error)) from None
    if _slow(config):
        os.environ["SLOW"] = "1"  # what cocotb modules look at
    unit = config.getoption("--unit")
    files = sorted(TB.rglob("test_*.py"))
    sim = config.getoption("markexpr") == "sim"
    units = [path.stem.removeprefix("test_") for path in files if not sim or _simulates(path)]
    if unit is not None and unit not in units:
        exists = any(path.stem == f"test_{unit}" for path in files)
        what = f"unit {unit!r} does not simulate" if exists else f"no unit {unit!r}"
        raise pytest.UsageError(f"{what}; {'those that simulate' if sim else 'there are'}: {', '.join(sorted(units))}")
    progress.register(config)
    durations.register(config)
    passed.register(config, _slow(config))


def pytest_report_header() -> str:
    return f"FLICKER_SEED={runner.seed()}"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    unit = config.getoption("--unit")
    other_test = unit is not None and collection_path.suffix == ".py" and (
        collection_path.name != f"test_{unit}.py"
    )
    return True if other_test else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    slow = _slow(config)
    named = config.getoption("--unit") is not None and all(item.get_closest_marker("slow") or _refusal(item) for item in items)
    if not slow and not named:
        left_out = [item for item in items if item.get_closest_marker("slow")]
        items[:] = [item for item in items if not item.get_closest_marker("slow")]
        config.hook.pytest_deselected(items=left_out)
    for item in items:
        if _simulates(item.path):
            item.add_marker("sim")
    # Files in the order of what they cost: the last ones to end are short. One without a line may take long.
    items.sort(key=lambda item: -_costs().get(item.nodeid.split("::")[0], UNKNOWN))


@functools.cache
def _costs() -> dict[str, float]:
    """Processor seconds of test files on a fresh build."""
    with (TB / "costs.csv").open(newline="") as rows:
        return {row["file"]: float(row["cpu"]) for row in csv.DictReader(rows)}
