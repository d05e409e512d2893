"""AXI4 ports of the memory for simulations (`flicker.sim.memory`): contents, order, answers, errors, what is counted, rules that are checked.

A manager written here drives ports cycle by cycle; a Python dictionary of bytes is the golden memory. Random bursts under random pauses on all
channels, every order of answers and of addresses and data, widths of 32 to 512 bits, perfect memory and LPDDR4. The DRAM's own times: tb/model/test_chip.py.
Not covered here: connection to the pins of a verilated design (tb/memory).
"""

from __future__ import annotations

import random
import re
from collections import defaultdict, deque
from dataclasses import dataclass, field, replace

import pytest
from flicker_tb.runner import seed

from flicker import layout
from flicker.chip.constants import DRAM_LATENCY_CYCLES
from flicker.chip.dram import DramConfig, Refresh, port_config
from flicker.errors import FlickerError
from flicker.sim.memory import FOLDER, Memory, Order, Port, PortConfig, Resp, WriteOrder

TIMING = DramConfig().timing
BASE, SIZE = 0x10000, 0x8000
INCR = 1


@dataclass
class Burst:
    """A transaction. data: a (bytes, strobes) pair a beat of a write; got: (bytes, resp) a beat of a read; cycles of its first and last transfer."""

    addr: int
    beats: int
    id: int = 0
    qos: int = 0
    data: list[tuple[bytes, int]] = field(default_factory=list)
    got: list[tuple[bytes, int]] = field(default_factory=list)
    resp: int | None = None
    begun: int = -1
    first: int = -1
    ended: int = -1


class Manager:
    """Drives a port: takes writes and reads from queues, valid and ready in a share `busy` of the cycles."""

    def __init__(self, port: Port, busy: float = 1.0, number: int = 0) -> None:
        self.port, self.busy = port, busy
        self.rng = random.Random(seed() * 1000 + number)
        self.width = port.config.data_bits // 8
        self.size = self.width.bit_length() - 1
        self.aw, self.w, self.ar = deque[Burst](), deque[tuple[bytes, int, bool]](), deque[Burst]()
        self.writes, self.reads = defaultdict(deque), defaultdict(deque)
        self.under_way = 0
        self.order: list[Burst] = []  # reads by their last beat

    def write(self, burst: Burst) -> Burst:
        self.aw.append(burst)
        self.w.extend((*beat, k + 1 == burst.beats) for k, beat in enumerate(burst.data))
        self.under_way += 1
        return burst

    def read(self, burst: Burst) -> Burst:
        self.ar.append(burst)
        self.under_way += 1
        return burst

    def step(self) -> None:
        """One cycle; valid stays until the transfer."""
        q, p, yes = self.port.request, self.port.reply, lambda: self.rng.random() < self.busy
        for channel, queue in ((q.aw, self.aw), (q.ar, self.ar)):
            if not channel.valid and queue and yes():
                b = queue[0]
                channel.valid, channel.addr, channel.len, channel.id, channel.size, channel.burst = 1, b.addr, b.beats - 1, b.id, self.size, INCR
                channel.qos = b.qos
        if not q.w_valid and self.w and yes():
            data, q.w_strb, q.w_last = self.w[0]
            for k in range(self.width // 4):
                q.w_data[k] = int.from_bytes(data[4 * k : 4 * k + 4], "little")
            q.w_valid = 1
        q.b_ready, q.r_ready = yes(), yes()
        now = self.port.memory.cycle + 1
        taken = []
        if q.aw.valid and p.aw_ready:
            taken.append((q.aw, "valid"))
            b = self.aw.popleft()
            b.begun = now
            self.writes[b.id].append(b)
        if q.ar.valid and p.ar_ready:
            taken.append((q.ar, "valid"))
            b = self.ar.popleft()
            b.begun = now
            self.reads[b.id].append(b)
        if q.w_valid and p.w_ready:
            taken.append((q, "w_valid"))
            self.w.popleft()
        if p.b_valid and q.b_ready:
            b = self.writes[p.b_id].popleft()
            b.resp, b.ended = p.b_resp, now
            self.under_way -= 1
        if p.r_valid and q.r_ready:
            b = self.reads[p.r_id][0]
            b.first = now if b.first < 0 else b.first
            b.got.append((b"".join(p.r_data[k].to_bytes(4, "little") for k in range(self.width // 4)), p.r_resp))
            assert p.r_last == (len(b.got) == b.beats)
            if p.r_last:
                self.reads[p.r_id].popleft()
                b.ended = now
                self.order.append(b)
                self.under_way -= 1
        self.port.memory.tick()
        self.port.step()
        for where, name in taken:
            setattr(where, name, 0)

    def run(self, limit: int = 20_000) -> None:
        """Until every answer has come."""
        for _ in range(limit):
            if not self.under_way:
                return
            self.step()
        raise AssertionError(f"{self.under_way} transactions without an answer in {limit} cycles")


def memory(perfect: bool = True, **options) -> tuple[Memory, Port]:
    m = Memory(TIMING, perfect)
    m.allocate(BASE, SIZE, noise=7)
    return m, Port(m, PortConfig(**options))


# ---- contents and order ------------------------------------------------------------------------

CASES = [
    (512, True, Order.BY_ID, WriteOrder.ANY, {}),
    (512, False, Order.IN_ORDER, WriteOrder.ADDRESS_FIRST, {}),
    (512, False, Order.WHOLE, WriteOrder.ANY, {}),
    (64, True, Order.WHOLE, WriteOrder.ADDRESS_FIRST, {"R": 0.5, "B": 0.3}),
    (512, False, Order.BY_ID, WriteOrder.DATA_FIRST, {"AW": 0.5, "W": 0.5, "B": 0.5, "AR": 0.5, "R": 0.5}),
    (256, False, Order.INTERLEAVED, WriteOrder.ANY, {"R": 0.3, "W": 0.2}),
    (128, True, Order.INTERLEAVED, WriteOrder.DATA_FIRST, {"AW": 0.9, "W": 0.3}),
    (32, False, Order.INTERLEAVED, WriteOrder.ADDRESS_FIRST, {"B": 0.9, "AR": 0.2}),
]


@pytest.mark.parametrize(("bits", "perfect", "order", "write_order", "stall"), CASES)
def test_random_bursts(bits, perfect, order, write_order, stall):
    """Against a dictionary of bytes; no burst overlaps another that is under way."""
    m, port = memory(
        perfect, data_bits=bits, id_bits=3, order=order, write_order=write_order, stall=stall, run={"R": 5}, latency=3, seed=seed(), max_reads=8, max_writes=5,
        urgent=15,
    )
    manager = Manager(port, busy=0.7, number=bits)
    rng, width = manager.rng, bits // 8
    golden = dict(enumerate(m.read(BASE, SIZE), BASE))
    active: list[tuple[Burst, bool]] = []
    done = 0
    reads = []

    def settle():
        nonlocal done
        for item in list(active):
            burst, is_write = item
            if burst.ended < 0:
                continue
            active.remove(item)
            done += 1
            if is_write:
                assert burst.resp == Resp.OKAY
                for k, (data, strb) in enumerate(burst.data):
                    golden.update({burst.addr + k * width + j: data[j] for j in range(width) if strb >> j & 1})
            else:
                reads.append(burst)
                for k, (data, resp) in enumerate(burst.got):
                    at = burst.addr + k * width
                    assert resp == Resp.OKAY and data == bytes(golden[at + j] for j in range(width)), hex(at)

    while done < 300:
        if manager.under_way < 12:
            beats = rng.randint(1, rng.choice([1, 4, 16]))
            page = BASE + 4096 * rng.randrange(SIZE // 4096)
            first = page + width * rng.randint(0, 4096 // width - beats)
            last = first + beats * width
            if all(last <= b.addr or b.addr + b.beats * width <= first for b, _ in active):
                burst = Burst(first, beats, rng.randrange(8), rng.choice([0, 15]))
                is_write = rng.random() < 0.5
                if is_write:
                    strobes = [(1 << width) - 1, 0, rng.getrandbits(width)]
                    burst.data = [(rng.randbytes(width), rng.choice(strobes)) for _ in range(beats)]
                    manager.write(burst)
                else:
                    manager.read(burst)
                active.append((burst, is_write))
        manager.step()
        assert m.cycle < 60_000
        settle()
    manager.run()
    settle()
    assert port.errors == [] and port.idle
    assert m.read(BASE, SIZE) == bytes(golden[BASE + k] for k in range(SIZE))
    turned = sum(a.begun > b.begun for a, b in zip(manager.order, manager.order[1:]))
    mixed = sum(a.first > b.first and a.ended < b.ended for a in reads for b in reads)
    assert (turned > 0) == (order != Order.IN_ORDER)
    assert mixed == 0 or order == Order.INTERLEAVED
    assert port.channels()["R"][0] == sum(b.beats for b in reads)
    counts = m.counts()
    assert (counts.bursts == 0) == perfect


def test_answers_of_one_id_keep_their_order():
    for order in Order:
        _, port = memory(False, order=order, stall={"R": 0.5, "B": 0.5}, seed=seed())
        manager = Manager(port)
        reads = [manager.read(Burst(BASE + 4096 * (k % 8) + 64 * k, 1 + k % 3, id=k % 2)) for k in range(30)]
        manager.run()
        for number in (0, 1):
            ends = [b.ended for b in reads if b.id == number]
            assert ends == sorted(ends)
        if order == Order.IN_ORDER:
            assert manager.order == reads


# ---- time --------------------------------------------------------------------------------------


def test_perfect_memory_has_the_full_rate():
    m, port = memory(latency=20)
    manager = Manager(port)
    reads = [manager.read(Burst(BASE + 1024 * k, 16)) for k in range(20)]
    manager.run()
    assert reads[0].first - reads[0].begun == 20
    assert reads[-1].ended - reads[0].first == 20 * 16 - 1
    write = manager.write(Burst(BASE, 4, data=[(bytes(64), 1)] * 4))
    begun = m.cycle
    manager.run()
    assert write.ended - begun == 4 + 20


def test_dram_behind_a_port():
    """A lone read takes what the constants say; many in a row reach the DRAM's rate, two runs are alike, refresh stops them."""
    results = []
    for _ in range(2):
        m = Memory(TIMING)
        m.allocate(0, 1 << 20)
        port = Port(m, port_config(max_reads=32))
        manager = Manager(port)
        lone = manager.read(Burst(0, 1))
        manager.run()
        assert 0 <= lone.first - lone.begun - DRAM_LATENCY_CYCLES <= 1
        reads = [manager.read(Burst(1024 * k, 16)) for k in range(1024)]
        start = m.cycle
        manager.run(100_000)
        results.append([b.ended for b in reads])
        rate = (1 << 20) / (m.cycle - start)
        assert 0.9 * 51.2 < rate <= 51.2
        counts = m.counts()
        assert counts.bursts == (1 << 15) + 2 and counts.row_hits > 29 / 30 * counts.bursts and counts.refreshes > 0
        assert m.efficiency == pytest.approx(counts.bursts * 32 / (m.cycle * 51.2), rel=1e-3)
    assert results[0] == results[1]
    fewer = Manager(Port(m, port_config(max_reads=1)))
    start = m.cycle
    for k in range(100):
        fewer.read(Burst(1024 * k, 1))
    fewer.run()
    assert m.cycle - start > 70 * 100  # one after the other: latency, not rate


def test_whole_bursts():
    """WHOLE: no burst waits for the DRAM between its beats; BY_ID: some do."""
    gaps = {}
    for order in (Order.BY_ID, Order.WHOLE):
        m = Memory(TIMING)
        m.allocate(0, 1 << 20)
        manager = Manager(Port(m, port_config(order=order, max_reads=32)))
        reads = [manager.read(Burst(32 * 1024 * k % (1 << 20) + 1024 * (k // 32), 16, id=k % 16)) for k in range(256)]
        manager.run(100_000)
        gaps[order] = [b.ended - b.first - 15 for b in reads]
    assert not any(gaps[Order.WHOLE]) and sum(g > 0 for g in gaps[Order.BY_ID]) > 20


@pytest.mark.parametrize("order", [Order.BY_ID, Order.WHOLE])
def test_urgent_answers(order):
    """What is urgent is answered before the rest, in any order among itself; a burst that has begun goes on."""
    for urgent in (8, 16):
        _, port = memory(order=order, urgent=urgent)
        manager = Manager(port)
        reads = [manager.read(Burst(BASE + 1024 * k, 16, id=k, qos=8 + k if k % 2 else 7)) for k in range(8)]
        manager.run()
        assert manager.order[0] is reads[0]
        first = {id(b) for b in manager.order[1:5]}
        assert (first == {id(b) for b in reads[1::2]}) == (urgent == 8)


def test_urgent_bursts_pass_what_waits_for_the_dram():
    """A read of each kind behind a crowd of others: the urgent one waits for a channel's queue, not for all that wait to get there."""
    waits = {}
    for kind, urgent, qos in (("alone", 8, 7), ("not urgent", 8, 7), ("urgent", 8, 8), ("urgency off", 16, 15)):
        m = Memory(TIMING)
        m.allocate(0, 1 << 22)
        manager = Manager(Port(m, port_config(max_reads=256, urgent=urgent)))
        crowd = [] if kind == "alone" else [manager.read(Burst(4096 * (7 * k % 1024), 16, id=0)) for k in range(200)]
        manager.read(last := Burst((1 << 22) - 64, 1, id=1, qos=qos))
        manager.run(100_000)
        waits[kind] = last.ended - last.begun
        assert m.counts().bursts == 32 * len(crowd) + 2
    assert waits["urgent"] < waits["alone"] + TIMING.window * TIMING.half + 16 < waits["not urgent"] / 3
    assert waits["urgency off"] == waits["not urgent"]


@pytest.mark.parametrize("places", [0, 64])
def test_urgent_bursts_are_like_all_in_the_queue(places):
    """An urgent read of another row among row hits that came before it and wait in the same queue: it is the last, so that no row is opened twice."""
    m = Memory(DramConfig(refresh=Refresh.NONE, write_places=places).timing)
    m.allocate(0, 1 << 22)
    manager = Manager(Port(m, port_config(max_reads=256, urgent=8)))
    one_channel = DramConfig().channels * DramConfig().interleave_bytes
    crowd = [manager.read(Burst(one_channel * k, 1, id=0)) for k in range(15)]
    manager.read(urgent := Burst(DramConfig().channels * DramConfig().page_bytes, 1, id=1, qos=8))
    manager.run(100_000)
    assert max(c.ended for c in crowd) < urgent.ended and m.counts().activates == 2


def test_gathered_writes_are_answered_before_they_move():
    """As soon as a channel has places for their bursts; those beyond wait for one. Without places of their own they are answered once they are written."""
    ended = {}
    for places in (0, 8, 64):
        m = Memory(DramConfig(refresh=Refresh.NONE, write_places=places).timing)
        m.allocate(0, 1 << 20)
        manager = Manager(Port(m, port_config(max_writes=64)))
        one_channel = DramConfig().channels * DramConfig().interleave_bytes  # two bursts each
        writes = [manager.write(Burst(one_channel * k, 1, data=[(bytes([k] * 64), (1 << 64) - 1)])) for k in range(8)]
        manager.run()
        ended[places] = [w.ended - w.begun for w in writes]
        assert m.read(one_channel * 7, 64) == bytes([7] * 64)
        for _ in range(200):
            manager.step()
        assert m.counts().bursts == 16
    latency = port_config().latency
    assert max(ended[64]) <= latency + 2
    assert max(ended[8][:4]) <= latency + 2 < ended[8][4]
    assert min(ended[0]) >= latency + DramConfig().idle_cycles() - 10
    assert all(a >= b >= c for a, b, c in zip(ended[0], ended[8], ended[64]))


# ---- answers with errors -----------------------------------------------------------------------


def test_outside_of_what_is_allocated():
    """DECERR, no wrap-around, nothing changed; a read gives the beats that exist."""
    m, port = memory(False)
    before = m.read(BASE, SIZE)
    manager = Manager(port)
    ones = [(b"\xff" * 64, (1 << 64) - 1)]
    end = manager.read(Burst(BASE + SIZE - 128, 4))
    far = [manager.read(Burst(address, 2)) for address in (0, BASE - 128, BASE + SIZE, (1 << 64) - 4096, BASE + (1 << 32))]
    writes = [manager.write(Burst(address, 4, 1, data=ones * 4)) for address in (BASE + SIZE - 128, BASE - 128, BASE + SIZE + 4096, (1 << 64) - 4096)]
    manager.run()
    assert [resp for _, resp in end.got] == [Resp.OKAY, Resp.OKAY, Resp.DECERR, Resp.DECERR]
    assert end.got[0][0] + end.got[1][0] == before[-128:]
    assert all(resp == Resp.DECERR for b in far for _, resp in b.got)
    assert all(b.resp == Resp.DECERR for b in writes)
    assert m.read(BASE, SIZE) == before
    assert port.counts(0).errors == 6 and port.counts(1).errors == 4
    with pytest.raises(FlickerError, match="not allocated"):
        m.read(BASE + SIZE - 1, 2)
    with pytest.raises(FlickerError, match="overlap"):
        m.allocate(BASE + SIZE - 1, 2)
    with pytest.raises(FlickerError, match="wrap"):
        m.allocate((1 << 64) - 1, 2)
    m.allocate(BASE + SIZE, 64)
    assert manager.read(again := Burst(BASE + SIZE - 64, 2)) is again
    manager.run()
    assert [resp for _, resp in again.got] == [Resp.OKAY, Resp.OKAY]


def test_faults():
    """By range and by number; SLVERR changes nothing, the others go on."""
    m, port = memory(False)
    before = m.read(BASE, SIZE)
    port.fail_range(BASE + 1024, 64, writes=False)
    port.fail_range(BASE + 2048, 1, reads=False, resp=Resp.DECERR)
    port.fail_read(2)
    port.fail_write(1)
    manager = Manager(port)
    data = [(b"\x55" * 64, (1 << 64) - 1)] * 2
    reads = [manager.read(Burst(BASE + a, 2)) for a in (896, 960, 0, 2048, 1088)]
    manager.run()
    writes = [manager.write(Burst(BASE + a, 2, data=data)) for a in (1024, 3072, 1984, 2112)]
    manager.run()
    assert [[resp for _, resp in b.got] for b in reads] == [[0, 0], [2, 2], [2, 2], [0, 0], [0, 0]]
    assert [b.resp for b in writes] == [0, 2, 3, 0]
    after = m.read(BASE, SIZE)
    changed = {k // 64 for k in range(SIZE) if after[k] != before[k]}
    assert changed == {1024 // 64, 1088 // 64, 2112 // 64, 2176 // 64}
    assert port.errors == []


@pytest.mark.parametrize("channel", ["AW", "W", "B", "AR", "R"])
def test_never_answers(channel):
    """A channel that stops after three transfers stands still for good; the other direction goes on."""
    _, port = memory(False, stop_after={channel: 3})
    manager = Manager(port)
    reads = [manager.read(Burst(BASE + 128 * k, 2)) for k in range(4)]
    writes = [manager.write(Burst(BASE + 4096 + 128 * k, 2, data=[(bytes(64), 1)] * 2)) for k in range(4)]
    with pytest.raises(AssertionError, match="without an answer"):
        manager.run(2000)
    assert port.channels()[channel][0] == 3 and port.idle == (channel == "AR")  # what AR does not take is not under way
    ended = {"AW": (4, 3), "W": (4, 1), "B": (4, 3), "AR": (3, 4), "R": (1, 4)}[channel]
    assert (sum(b.ended > 0 for b in reads), sum(b.ended > 0 for b in writes)) == ended
    assert port.errors == []


def test_pauses():
    """Share and mean length are those asked for."""
    for share, length in ((0.25, 1), (0.5, 10), (0.9, 20)):
        m, port = memory(stall={"R": share, "AR": share}, run={"R": length, "AR": length}, seed=seed())
        ready = []
        for _ in range(20_000):
            m.tick()
            port.step()
            ready.append(port.reply.ar_ready)
        assert abs(1 - sum(ready) / len(ready) - share) < 0.08
        runs = sum(a and not b for a, b in zip(ready, ready[1:]))
        mean = (len(ready) - sum(ready)) / runs
        assert length == 1 or 0.7 * length < mean < 1.4 * length


# ---- rules -------------------------------------------------------------------------------------


def violations(**request) -> list[str]:
    """What a port says of a request that is offered once and taken."""
    _, port = memory(max_beats=16)
    port.request.r_ready = port.request.b_ready = 1
    for _ in range(2):
        port.memory.tick()
        port.step()
    for name, value in request.items():
        where, _, part = name.partition("_") if name.startswith(("aw_", "ar_")) else (None, None, name)
        setattr(getattr(port.request, where) if where else port.request, part, value)
    port.memory.tick()
    port.step()
    return port.errors


GOOD = {"ar_valid": 1, "ar_addr": BASE + 4096 - 128, "ar_len": 1, "ar_size": 6, "ar_burst": INCR}


@pytest.mark.parametrize(("change", "message"), [
    ({}, None),
    ({"ar_len": 2}, "crosses a 4 KB boundary"),
    ({"ar_addr": BASE, "ar_len": 16}, "more than 16 beats"),
    ({"ar_size": 7}, "size 7, "),
    ({"ar_burst": 2}, "only INCR"),
    ({"ar_addr": BASE + 32}, "not a multiple of 64"),
    ({"ar_id": 16}, "more than 4 bits"),
])
def test_rules_of_addresses(change, message):
    for channel in ("ar", "aw"):
        found = violations(**{name.replace("ar", channel, 1): value for name, value in (GOOD | change).items()})
        if message is None:
            assert found == []
        else:
            assert len(found) == 1 and message in found[0] and f"{channel.upper()} 0x" in found[0]


def test_narrow():
    """Reads may be narrower than the port, at multiples of their size; writes may not."""
    narrow = {"valid": 1, "addr": BASE + 4096 - 64, "len": 1, "size": 5, "burst": INCR}
    for addr, length, message in ((BASE + 4096 - 64, 1, None), (BASE + 4096 - 64, 2, "crosses a 4 KB boundary"), (BASE + 16, 0, "not a multiple of 32")):
        found = violations(**{f"ar_{name}": value for name, value in (narrow | {"addr": addr, "len": length}).items()})
        assert [message in e for e in found] == ([True] if message else [])
    found = violations(**{f"aw_{name}": value for name, value in narrow.items()})
    assert len(found) == 1 and "only whole beats" in found[0]


@pytest.mark.parametrize(("bits", "perfect", "order"), [(512, True, Order.BY_ID), (512, False, Order.INTERLEAVED), (128, False, Order.IN_ORDER)])
def test_narrow_reads(bits, perfect, order):
    """Each beat in its lanes, noise in the others; the DRAM moves whole bursts, each once for beats beside each other, the counts are of what is asked for."""
    m, port = memory(perfect, data_bits=bits, id_bits=3, order=order, stall={"R": 0.3, "AR": 0.3}, seed=seed())
    manager = Manager(port)
    rng, whole = manager.rng, manager.size
    reads, elsewhere, moved = [], 0, 0
    for _ in range(60):
        size = manager.size = rng.randint(0, whole)
        beats = rng.randint(1, 16)
        first = BASE + 4096 * rng.randrange(SIZE // 4096) + (rng.randrange(4096 // (1 << size) - beats + 1) << size)
        b = manager.read(Burst(first, beats, rng.randrange(8)))
        reads.append((b, 1 << size))
        while manager.ar:  # `size` is that of the address that waits
            manager.step()
    manager.run()
    for b, step in reads:
        assert len(b.got) == b.beats
        for k, (data, resp) in enumerate(b.got):
            at = b.addr + k * step
            lane = at % manager.width
            assert resp == Resp.OKAY and data[lane : lane + step] == m.read(at, step), hex(at)
            around = m.read(at - lane, manager.width)
            elsewhere += step < manager.width and data != around
        moved += b.beats * step
    assert port.errors == [] and port.idle
    assert elsewhere > 100
    assert sum(port.counts(k).read_bytes for k in range(8)) == moved
    in_dram = sum(port.counts(k).dram_read_bytes for k in range(8))
    assert in_dram == (0 if perfect else sum(32 * len({at // 32 for at in range(b.addr, b.addr + b.beats * step)}) for b, step in reads))


def test_last_is_checked():
    for marks, beat in (([0, 1, 0], 2), ([0, 0, 0], 3), ([1, 0, 1], 1)):
        _, port = memory()
        manager = Manager(port)
        b = manager.write(Burst(BASE, 3, data=[(bytes(64), 1)] * 3))
        manager.w = deque((data, strb, last) for (data, strb, _), last in zip(manager.w, marks))
        manager.run()
        assert any(f"W: beat {beat} of the write at {b.addr:#x}" in e and ("not marked" in e) == (marks[beat - 1] == 0) for e in port.errors)
    early = Manager(memory()[1])
    early.write(Burst(BASE, 1, data=[(bytes(64), 1)] * 1))
    early.run()
    assert early.port.errors == []


def test_waiting_channels_must_hold():
    for name in ("ar", "aw", "w"):
        for field_name, value in (("valid", 0), ("addr", BASE + 64), ("qos", 1)) if name != "w" else (("valid", 0), ("last", 1), ("strb", 1), ("data", 5)):
            _, port = memory(stop_after={name.upper(): 0})
            q = port.request
            where = q if name == "w" else getattr(q, name)
            prefix = "w_" if name == "w" else ""
            setattr(where, f"{prefix}valid", 1)
            if name != "w":
                where.addr, where.size, where.burst = BASE, 6, INCR
            for _ in range(3):
                port.memory.tick()
                port.step()
            assert port.errors == []
            if field_name == "data":
                q.w_data[15] = value
            else:
                setattr(where, f"{prefix}{field_name}", value)
            port.memory.tick()
            port.step()
            word = "valid fell" if field_name == "valid" else "payload changed"
            assert len(port.errors) == 1 and port.errors[0] == f"cycle 4: AXI: {name.upper()}: {word} before the transfer"


def test_hazards_and_leftovers():
    for first_write, second_write, same_id, wrong in ((0, 0, 1, 0), (0, 1, 1, 1), (1, 0, 1, 1), (1, 1, 1, 0), (1, 1, 0, 1)):
        for hazards in (True, False):
            _, port = memory(hazards=hazards, latency=30)
            manager = Manager(port)
            for is_write, number in ((first_write, 0), (second_write, 0 if same_id else 1)):
                data = [(bytes(64), 1)] * 2
                (manager.write if is_write else manager.read)(Burst(BASE + 64 * number, 2, number, data=data))
                for _ in range(5):
                    manager.step()
            manager.run()
            assert len(port.errors) == (wrong and hazards), (first_write, second_write, same_id)
            assert not port.errors or "has no answer yet" in port.errors[0]
    two = memory()
    other = Port(two[0], PortConfig())
    a, b = Manager(two[1]), Manager(other)
    a.read(Burst(BASE, 16))
    b.write(Burst(BASE + 64, 1, data=[(bytes(64), 1)]))
    for _ in range(4):  # the memory ticks for both managers: of no matter here
        a.step()
        b.step()
    assert "overlaps a read" in (two[1].errors + other.errors)[0]
    m, port = memory()
    port.request.w_valid = port.request.w_last = 1
    for _ in range(2):
        m.tick()
        port.step()
    assert not port.idle  # data without an address


def test_reset_forgets():
    m, port = memory(False)
    manager = Manager(port)
    for k in range(4):
        manager.read(Burst(BASE + 1024 * k, 16))
        manager.write(Burst(BASE + 4096 + 1024 * k, 2, data=[(bytes(64), 1)] * 2))
    for _ in range(70):
        manager.step()
    assert not port.idle
    for name in ("aw", "ar"):
        getattr(port.request, name).valid = 0
    port.request.w_valid = 0
    for _ in range(3):
        m.tick()
        port.reset()
    assert port.idle and port.errors == []
    again = Manager(port, number=1)
    b = again.read(Burst(BASE, 16))
    again.run()
    assert len(b.got) == 16 and port.errors == []
    port.request.ar.valid = 1
    port.reset()
    assert "valid in reset" in port.errors[0]


# ---- counts ------------------------------------------------------------------------------------


def test_bytes_by_purpose():
    """By id, by range before it; whole bursts of the DRAM, masked ones where strobes leave bytes out."""
    m, port = memory(False)
    port.purpose(BASE + 4096, 4096, 100)
    manager = Manager(port)
    every = (1 << 64) - 1
    manager.read(Burst(BASE, 3, id=1))
    manager.read(Burst(BASE + 256, 1, id=2))
    manager.read(Burst(BASE + 4096, 5, id=1))
    manager.write(Burst(BASE + 8192, 4, 3, data=[(bytes(64), s) for s in (every, 0, 1, (1 << 33) - 1)]))
    manager.write(Burst(BASE + 4096 + 1024, 1, 3, data=[(bytes(64), every)]))
    manager.run()
    for _ in range(200):  # gathered writes move
        manager.step()
    one, two, three, region = (port.counts(k) for k in (1, 2, 3, 100))
    assert (one.read_bursts, one.read_beats, one.read_bytes, one.dram_read_bytes) == (1, 3, 192, 192)
    assert two.read_bytes == 64
    assert (three.write_bursts, three.write_beats, three.write_bytes) == (1, 4, 64 + 1 + 33)
    assert (three.dram_write_bytes, three.dram_masked_bytes) == (2 * 32 + 32 + 2 * 32, 2 * 32)
    assert (region.read_bytes, region.write_bytes) == (320, 64)
    assert m.counts().bursts == 6 + 2 + 10 + 5 + 2
    assert port.counts(55).read_bursts == 0
    each = [port.counts(k) for k in (1, 2, 3, 100)]
    assert sum(c.rows_opened for c in each) == m.counts().activates > 0 and sum(c.row_clocks for c in each) == m.counts().rows > 0
    assert one.rows_opened == 3 and one.row_clocks > 0  # begins in three channels
    transfers = {name: k for name, (k, _) in port.channels().items()}
    assert transfers == {"AW": 2, "W": 5, "B": 2, "AR": 3, "R": 9}


@pytest.mark.parametrize(("options", "message"), [
    ({"data_bits": 48}, "data_bits"), ({"id_bits": 20}, "id_bits"), ({"latency": 0}, "latency"), ({"max_reads": 0}, "max_reads"),
    ({"stall": {"R": 2.0}}, "stall"), ({"stall": {"X": 0.5}}, "no channel X"),
])
def test_bad_options(options, message):
    with pytest.raises(FlickerError, match=message):
        memory(**options)
    assert replace(PortConfig(), seed=2).seed == 2


def test_channels_are_those_of_the_packages():
    """`flk::channels` takes structs of flk_axi_pkg apart as `flicker.layout` makes them: widths, and fields in its order."""
    found = re.search(r"constexpr int ID = (\d+), ADDR = (\d+), DATA = (\d+), STRB = DATA / 8;", (FOLDER / "memory.hpp").read_text())
    assert found is not None and tuple(map(int, found.groups())) == (layout.AXI_ID_BITS, layout.AXI_ADDR_BITS, layout.AXI_DATA_BITS)
    orders = {"axi_ax": "burst size len addr id", "axi_r": "data resp last id", "axi_w": "data strb last", "axi_b": "resp id"}
    assert {record: " ".join(reversed(layout.fields(record))) for record in orders} == orders
