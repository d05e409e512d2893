"""cocotb tests of flk_bitonic_sorter; its parameters are read back from the design.

An item is (keys, payloads), each the lanes packed with lane 0 lowest.
"""

import cocotb
from cocotb.triggers import FallingEdge, Timer
from flicker_tb.bench import StreamTest
from flicker_tb.streams import Stream

FIELDS = ("key", "payload")
VECTORS = 200


def pack(values, width):
    word = 0
    for value in reversed(values):
        word = word << width | value
    return word


def unpack(word, width, lanes):
    mask = (1 << width) - 1
    return [word >> lane * width & mask for lane in range(lanes)]


class SorterTest(StreamTest):
    """Bench whose model is Python's stable sort by key."""

    def __init__(self, dut, model=None, **patterns):
        self.lanes = int(dut.Lanes.value)
        self.key_width = int(dut.KeyWidth.value)
        self.payload_width = int(dut.PayloadWidth.value)
        stages = (self.lanes.bit_length() - 1) * self.lanes.bit_length() // 2
        self.latency = -(-stages // int(dut.StagesPerReg.value))
        assert len(dut.in_key_i) == self.lanes * self.key_width
        assert len(dut.in_payload_i) == self.lanes * self.payload_width
        super().__init__(
            dut,
            model or self.sort,
            source=Stream(dut, "in", FIELDS),
            sink=Stream(dut, "out", FIELDS),
            **patterns,
        )

    def sort(self, item):
        keys = unpack(item[0], self.key_width, self.lanes)
        payloads = unpack(item[1], self.payload_width, self.lanes)
        order = sorted(range(self.lanes), key=keys.__getitem__)
        yield (
            pack([keys[lane] for lane in order], self.key_width),
            pack([payloads[lane] for lane in order], self.payload_width),
        )

    def vector(self):
        """A random vector of one of several kinds, with random payloads."""
        rng, lanes, top = self.bench.rng, self.lanes, (1 << self.key_width) - 1
        keys = [rng.randint(0, top) for _ in range(lanes)]
        match rng.randrange(8):
            case 0:  # all equal
                keys = keys[:1] * lanes
            case 1:  # few different keys
                keys = [rng.choice(keys[:2]) for _ in range(lanes)]
            case 2:
                keys.sort()
            case 3:
                keys.sort(reverse=True)
            case 4:  # extremes and their neighbours
                keys = [rng.choice((0, min(1, top), top - 1, top)) for _ in range(lanes)]
            case 5:  # neighbours: a carry-chain comparator must look at every bit
                keys = [keys[0] ^ (1 << rng.randrange(self.key_width)) for _ in range(lanes)]
        return pack(keys, self.key_width), rng.getrandbits(lanes * self.payload_width)


@cocotb.test()
@cocotb.parametrize(
    (
        ("idle", "stall"),
        [("never", "never"), ("never", "half"), ("half", "never"), ("half", "half"),
         ("bursts", "bursts"), ("heavy", "rare"), ("rare", "heavy"), ("alternate", "alternate")],
    )
)
async def sorts(dut, idle, stall):
    """All kinds of vectors come out sorted, stable, with their payloads, under stalls."""
    test = SorterTest(dut, idle=idle, stall=stall)
    await test.run([test.vector() for _ in range(VECTORS)], at_least=VECTORS)


@cocotb.test()
async def rate(dut):
    """Latency is the number of registers, one vector per cycle."""
    test = SorterTest(dut)
    await test.run([test.vector() for _ in range(VECTORS)], at_least=VECTORS)
    assert test.output.first - test.input.first == test.latency
    assert test.input.last - test.input.first == VECTORS - 1
    assert test.output.last - test.output.first == VECTORS - 1


@cocotb.test()
async def fills_bubbles(dut):
    """A blocked output: one vector per register is taken, even with gaps between them, and
    ready comes back combinationally when the output moves."""
    gate = [True]
    test = SorterTest(dut, idle="half")
    test.sink.stall = iter(lambda: gate[0], None)
    await test.bench.reset()
    test.source.send([test.vector() for _ in range(VECTORS)])
    await test.bench.cycles(10 * test.latency + 50)
    assert test.input.count == test.latency, f"{test.input.count} vectors taken"
    await FallingEdge(dut.clk_i)
    for ready in (1, 0):
        dut.out_ready_i.value = ready
        await Timer(100, unit="ps")
        assert dut.in_ready_o.value == ready
    gate[0] = False
    await test.bench.until(lambda: test.checker.checked == VECTORS, 10 * VECTORS, "last vector")
    test.checker.finish(VECTORS)


@cocotb.test()
async def zero_one(dut):
    """The 0-1 principle: a network that sorts every vector of zeros and ones sorts everything.

    The payload is the lane number where it fits, so stability is checked on every pattern too.
    """
    lanes, payload_width = int(dut.Lanes.value), int(dut.PayloadWidth.value)
    key_width = int(dut.KeyWidth.value)
    one = (1 << key_width) - 1
    numbers = [lane & ((1 << payload_width) - 1) for lane in range(lanes)]
    payload = pack(numbers, payload_width)
    spread = [one << lane * key_width for lane in range(lanes)]

    def split(pattern):
        return [n for n in range(lanes) if not pattern >> n & 1], [
            n for n in range(lanes) if pattern >> n & 1
        ]

    patterns = {}  # input keys to output, computed only from the pattern
    for pattern in range(1 << lanes):
        zeros, ones = split(pattern)
        keys = sum(spread[lane] for lane in ones)
        sorted_keys = sum(spread[len(zeros) :])
        sorted_numbers = [numbers[lane] for lane in zeros + ones]
        patterns[keys] = (sorted_keys, pack(sorted_numbers, payload_width))
    assert len(patterns) == 1 << lanes
    test = SorterTest(dut, lambda item: [patterns[item[0]]])
    await test.run([(keys, payload) for keys in patterns], at_least=1 << lanes)
