"""Fields of a record: flk_mean_field and flk_shape_field against the golden model. Not covered: other widths than the front end's."""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("top", ["flk_mean_field", "flk_shape_field"])
def test_field(top: str) -> None:
    build_and_test(top, "cocotb_fields", config={"top": top})
