"""AXI4 of 512 bits on a narrower port: flk_axi_downsizer.

State space: reads of whole lines, of 1 to 64 beats up to a page's end, narrow ones of a power of two of bytes, any identifiers in use; writes with any strobes;
memory perfect and LPDDR4, every order of answers, beats of several identifiers interleaved, of addresses and data, pauses on every channel; responses other
than OKAY; clears at random times. The memory checks the port's side (4 KB, lengths, sizes, payload that stays). Parameter space: 128 bits, the same width
(wires); with SLOW=1 also 256 bits, a port of 32 bits under 128.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SLOW = pytest.mark.slow  # the same with other numbers


@pytest.mark.parametrize("parameters", [
    {}, pytest.param({"PortBits": 256}, marks=SLOW), {"PortBits": 512},
    pytest.param({"Width": 128, "PortBits": 32, "IdBits": 4, "OwnBits": 2, "UsedBits": 2}, marks=SLOW),
], ids=str)
def test_axi_downsizer(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_downsizer", "cocotb_axi_downsizer", parameters=parameters)


@pytest.mark.parametrize("parameters, text", [
    ({"PortBits": 16}, "PortBits must be"), ({"PortBits": 1024}, "PortBits must be"), ({"PortBits": 192}, "PortBits must be"),
    ({"UsedBits": 5}, "UsedBits must be"),
], ids=str)
def test_illegal_parameters(parameters: dict[str, int], text: str) -> None:
    refused("flk_axi_downsizer", parameters, text)
