"""Pixel-rectangle test unit against the golden model, every register of every stage.

State space: random records as in real scenes, thin slanted splats (terms that cancel), covering splats, and records with special
numbers (zeros, subnormals, largest, infinities, NaN, any bits); all leader rectangles of both sampling modes and any other
corners; thresholds of the record's opacity and any bits; random bubbles with garbage on the inputs.
Parameter space: the default's form and precision and the faithful configuration's, with SLOW=1 every pair of them; two columns and two rows (single pixels:
`make sim UNIT=weight`). Not covered: the space is 2^100, so arithmetic corners are the business of the arithmetic units' tests.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.params import FAITHFUL, Form, Precision, RenderConfig

USUAL = [(config.form, config.precision) for config in (RenderConfig(), FAITHFUL)]


@pytest.mark.parametrize(("form", "precision"), [
    pytest.param(form, precision, id=f"{form.name}-{precision.name}".lower(), marks=[pytest.mark.slow] * ((form, precision) not in USUAL))
    for form in Form for precision in Precision
])
def test_prtu(form: Form, precision: Precision) -> None:
    parameters = {"Form": int(form), "Precision": int(precision)}
    build_and_test("flk_prtu", "cocotb_prtu", parameters=parameters, config=parameters, inner=True)
