"""Lane: every output in every cycle, every finished pixel against golden.lanes in program order.

State space: visits in every cycle and with bubbles, the same pixel in successive cycles, thousands of layers on one pixel, ends of lists as soon
as the bank is free with visits right behind them, releases with and without a visit, pixels that wait, clear_i at any time, registers beginning
with random values. Splats: random ones about the sub-tile, every La twice on a pixel, both sides of the skip limit and of the clamp, layers
of 0.99, opacities of 1/255 at their centre. Parameter space: 8 lanes of one sub-tile, whose pixels are flip-flops;
with SLOW=1 also 16 and 32, and 8 of four and 16 of two, whose pixels are memories; one lane of each; slots that are no power of two.
Not covered: pixels outside of a splat's mask, which an assertion refuses.
"""

from __future__ import annotations

import numpy as np
import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.golden.lanes.formats import ACCUMULATOR_INT_BITS, FORMATS, tables


@pytest.mark.parametrize(("parameters", "sweep"), [
    pytest.param({"Lanes": 8, "Lane": 5, "Slots": 20}, 1.0, id="8"),
    *(pytest.param(parameters, 0.2, id=name, marks=pytest.mark.slow) for name, parameters in (
        ("16", {"Lanes": 16, "Lane": 14, "Slots": 6}), ("32", {"Lanes": 32, "Lane": 19, "Slots": 33}),
        ("8 of four sub-tiles", {"Lanes": 8, "Lane": 3, "Slots": 20, "Subtiles": 4}), ("16 of two", {"Lanes": 16, "Lane": 9, "Slots": 6, "Subtiles": 2}),
    )),
])
def test_lane(parameters: dict[str, int], sweep: float) -> None:
    build_and_test("flk_lane", "cocotb_lane", parameters=parameters, config={**parameters, "sweep": sweep})


@pytest.mark.parametrize(("parameters", "message"), [({"Lanes": 2}, "Lanes must be 4, 8, 16 or 32"), ({"Lanes": 16, "Lane": 16}, "Lane must be")])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_lane", parameters, message)


def test_colours_stay_below_saturation() -> None:
    """A layer adds its weight's product, half a unit of rounding more at most; weights add up to little more than T loses."""
    t = tables(FORMATS)
    la = np.arange(t.clamp + 1, t.limit + 1)
    alpha = np.exp2(-np.append(la / 2.0**t.log, t.x_max / 2.0**t.sum))
    h = np.append(t.h[t.clamp + 1 :], t.h_max)
    steps = 1 << t.mantissa
    mantissa = (t.exp2 / steps / np.exp2(-(np.arange(steps) + 1) / steps)).max()  # over the least that a step stands for
    weights = mantissa * (alpha / (1 - np.exp2(-h / 2.0**t.sum))).max()
    layers = t.s_max // h.min() + 1
    most = weights * 1023 / 512 + layers / 2 / 2.0**t.accumulator
    assert 2 < most < 2.1 < 1 << ACCUMULATOR_INT_BITS
