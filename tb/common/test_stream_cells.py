import pytest
from flicker_tb.runner import build_and_test

@pytest.mark.parametrize("top", ["flk_pipe_reg", "flk_skid_buffer", "flk_fifo"])
def test_order(top):
    build_and_test(top, "cocotb_stream_cells")
