"""Channel: pixels against the golden model, splats accounted for, under stalls.

State space: random lists (as in real scenes, thin, special numbers, covering), empty and one-splat sub-tiles, lists whose pixels finish early, one of 5,000
splats; idle input, blocked output; clear in mid-traffic; finished_o and idle_o in every cycle. Parameter space: FIFO depth 1, the factored form, two VRUs;
with SLOW=1 also depths 2, 3, 5, 16 and 128 (the list of 5,000), both forms, all mini-tile positions (spread over the depths), 1 and 4 VRUs. Not covered: more
than a few dozen sub-tiles in one run.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test

from flicker.params import Form

SHORT = [0, 1, 30, 0, 0, 2, 60, 5, 40, 0, 17, 25]
CASES = {
    "depth1": (Form.FACTORED, 1, 2, 0, SHORT, "never", "half"),
    "depth2": (Form.FACTORED, 2, 2, 1, SHORT, "half", "never"),
    "depth3": (Form.CONIC, 3, 2, 2, SHORT, "bursts", "heavy"),
    "depth16": (Form.CONIC, 16, 2, 3, [*SHORT, *SHORT], "rare", "rare"),
    "depth128": (Form.FACTORED, 128, 2, 3, [*SHORT, 5000, 3], "never", "never"),
    "vrus1": (Form.FACTORED, 3, 1, 2, SHORT, "half", "rare"),
    "vrus4": (Form.CONIC, 5, 4, 3, [*SHORT, *SHORT], "never", "half"),
}


@pytest.mark.parametrize("case", [pytest.param(case, marks=[pytest.mark.slow] * (case != "depth1")) for case in CASES])
def test_channel(case: str) -> None:
    form, depth, vrus, m, lengths, idle, stall = CASES[case]
    build_and_test(
        "flk_channel", "cocotb_channel",
        parameters={"Form": int(form), "FifoDepth": depth, "VrusPerChannel": vrus, "MiniTile": m},
        config={"Form": int(form), "FifoDepth": depth, "MiniTile": m, "VrusPerChannel": vrus, "lengths": lengths, "idle": idle, "stall": stall},
    )
