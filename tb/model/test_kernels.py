"""Where compiled kernels are kept: by the state of their module and of all that it imports."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from flicker_tb.bench import rounds

from flicker import kernels
from flicker.toolchain import ROOT

PACKAGE = ROOT / "model" / "flicker"
MODULES = ("golden.render", "golden.front.frame", "perf.render_stage", "fit.raster", "chip.rendering", "explore.generators.contribution")


def test_closures_hold_what_python_imports() -> None:
    """Modules with the most kernels, each in a process of its own."""
    for module in MODULES[:: rounds(3, 1)]:
        code = f"import sys, flicker.{module}; print(*(m.__file__ for n, m in sys.modules.items() if n.split('.')[0] == 'flicker'))"
        loaded = {Path(name) for name in subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()}
        found = set(kernels.closure(PACKAGE / f"{module.replace('.', '/')}.py"))
        assert loaded - found <= {PACKAGE / "kernels.py"}, module
        assert len(found) < 160


@pytest.mark.parametrize(("edited", "other", "same"), [
    ("golden/vru.py", {"golden.render"}, {"perf.render_stage", "fit.raster", "golden.front.frame"}),
    ("front/projection.py", {"fit.raster", "chip.rendering"}, {"perf.render_stage"}),
    ("params.py", set(MODULES), set()),
    ("cli/main.py", set(), set(MODULES)),
])
def test_an_edit_discards_what_is_above_it(edited: str, other: set[str], same: set[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def digests() -> dict[str, str]:
        kernels.digest.cache_clear()
        return {module: kernels.digest(PACKAGE / f"{module.replace('.', '/')}.py") for module in MODULES}

    before, content = digests(), kernels._content
    monkeypatch.setattr(kernels, "_content", lambda path: b"other" if path == PACKAGE / edited else content(path))
    after = digests()
    kernels.digest.cache_clear()
    changed = {module for module in MODULES if before[module] != after[module]}
    assert other <= changed and not same & changed, changed


def test_no_stale_kernel(tmp_path: Path) -> None:
    """A kernel is loaded while what it calls in another module stays as it is, and compiled when that changes; the old one is still there."""
    (tmp_path / "upper.py").write_text("import numba\nfrom lower import (\n    helper as used,  # of another file\n)\n\n@numba.njit(cache=True)\ndef run(x):\n"
                                       "    return used(x)\n")
    lower = "import numba\n@numba.njit\ndef helper(x):\n    return x + {}\n"
    code = ("import sys\nfrom pathlib import Path\nimport flicker.kernels as k\nk.ROOT = Path(sys.argv[1])\nimport upper\n"
            "print(upper.run(1), sum(upper.run.stats.cache_hits.values()))")

    def run(number: int) -> str:
        (tmp_path / "lower.py").write_text(lower.format(number))
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.run([sys.executable, "-c", code, tmp_path], env=environment, capture_output=True, text=True, check=True).stdout.strip()

    assert [run(1), run(1), run(5), run(1)] == ["2 0", "2 1", "6 0", "2 1"]
