"""Gaussian weight against the golden model, bit for bit: the weights, and every register on the way to them.

State space: differences and shapes as in real scenes, thin slanted splats (terms that cancel), special numbers (zeros, subnormals, largest,
infinities, NaN), any bits; random halts and bubbles with garbage on the inputs, the shape taken in its own cycle. Parameter space: the factored
form of one pixel in FP16, the conic form of 2 x 2 in E4M3; with SLOW=1 either form of both, 2 x 2 in FP16, 3 x 1 in E4M3 for the numbering, E5M2 (IEEE-like
with saturation).
Not covered: other formats, which the arithmetic units' test has.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.arithmetic.formats import E4M3, E5M2, FP16, FloatFormat
from flicker.params import Form

DEFAULT = ((Form.FACTORED, FP16, 1, 1), (Form.CONIC, E4M3, 2, 2))  # the rest is the same with other numbers: slow
CASES = ((FP16, 1, 1), (E4M3, 2, 2), (FP16, 2, 2), (E4M3, 3, 1), (E5M2, 1, 1))


def label(value: Form | FloatFormat | int) -> str:
    """Part of a test's identifier."""
    return value.name.lower() if isinstance(value, Form) else value.name if isinstance(value, FloatFormat) else str(value)


@pytest.mark.parametrize(
    ("form", "fmt", "cols", "rows"),
    [pytest.param(form, *case, marks=() if (form, *case) in DEFAULT else pytest.mark.slow) for case in CASES for form in Form], ids=label,
)
def test_weight(form: Form, fmt: FloatFormat, cols: int, rows: int) -> None:
    size = {"Cols": cols, "Rows": rows}
    parameters = {"Form": int(form), **size, "ExpBits": fmt.exp_bits, "ManBits": fmt.man_bits, "Fn": int(fmt.fn), "Saturate": int(fmt.saturate)}
    config = {"form": int(form), "format": fmt.name, **size}
    build_and_test("flk_weight", "cocotb_weight", parameters=parameters, config=config, inner=True)


@pytest.mark.parametrize(
    ("parameters", "message"), [({"Form": 2}, "Form must be"), ({"Cols": 0}, "Cols and Rows must be at least 1"), ({"Fn": 1}, "Saturate must be set")]
)
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_weight", parameters, message)
