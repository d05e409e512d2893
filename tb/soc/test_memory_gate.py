"""`MemoryGate` of soc/litex_flicker.py in migen's simulator: a chip is reset while the memory owes it responses.

Random traffic of a manager that writes lines, of a beat or of several, and reads bursts, a memory that takes and responds when it likes, holds at random
times. Checked at the memory: offered addresses and data stay; the beats of a line for each address, with their own data or without strobes. At the chip:
nothing comes in a hold; what was asked behind one is answered, each once. Parameter space: 512 and 128 bits; with SLOW=1
also 256, other seeds. Not covered: more than 20 transactions under way.
"""

from __future__ import annotations

import random
import sys

import pytest
from flicker_tb.runner import seed

from flicker.toolchain import ROOT

pytest.importorskip("litex", reason="LiteX is not installed: make soc sets it up")

if str(ROOT / "soc") not in sys.path:
    sys.path.insert(0, str(ROOT / "soc"))

from litex.soc.interconnect import axi  # noqa: E402
from litex_flicker import MemoryGate  # noqa: E402
from migen import run_simulation  # noqa: E402

LINE = 512
CYCLES, HOLDS = {512: 2500, 256: 4000, 128: 6000}, 12  # by bits of the port


class Bench:
    def __init__(self, number: int, width: int) -> None:
        self.rng = random.Random(f"{seed()} {number} {width}")
        self.parts, self.strobes, self.length = LINE // width, (1 << width // 8) - 1, CYCLES[width]
        self.chip, self.memory = (axi.AXIInterface(data_width=width, address_width=16, id_width=7) for _ in range(2))
        self.gate = MemoryGate(self.chip, self.memory)
        self.dropped = self.answered = self.held = 0

    def run(self) -> None:
        run_simulation(self.gate, self.cycles())

    def cycles(self):
        rng, chip, memory, gate = self.rng, self.chip, self.memory, self.gate
        epoch, tag = 0, 0
        to_send: list[tuple[int, int]] = []  # beats that the chip has not sent: tag of the write, last
        asked = {"b": [], "r": []}  # tags under way, of this life of the chip
        owed: list[list[int]] = []  # at the memory: [address, beats without data]
        written: list[int] = []  # at the memory: writes to answer
        reads: list[list[int]] = []  # at the memory: [address, beats left]
        offered: dict[str, tuple | None] = {"aw": None, "ar": None, "w": None}
        hold_for = -1
        for _ in range(self.length):
            # What there is in this cycle.
            at = {}
            for name in ("aw", "ar", "w", "b", "r"):
                for side, port in (("chip", chip), ("memory", memory)):
                    stream = getattr(port, name)
                    at[side, name] = ((yield stream.valid), (yield stream.ready))
            holding, idle = (yield gate.hold), (yield gate.idle)
            payload = {
                "aw": ((yield memory.aw.addr),), "ar": ((yield memory.ar.addr), (yield memory.ar.len)),
                "w": ((yield memory.w.data), (yield memory.w.strb), (yield memory.w.last)),
            }
            chip_b, chip_r = (yield chip.b.id), ((yield chip.r.data), (yield chip.r.last))
            # The memory's rules.
            for name in ("aw", "ar", "w"):
                valid, ready = at["memory", name]
                if offered[name] is not None:
                    assert valid, f"{name}: valid fell"
                    kept = payload[name][1:] if name == "w" and payload[name][1] == 0 == offered[name][1] else payload[name]
                    assert kept == (offered[name][1:] if len(kept) < len(payload[name]) else offered[name]), f"{name}: changed"
                offered[name] = payload[name] if valid and not ready else None
            # Transfers at the memory.
            moved = {name for name in ("aw", "ar", "w", "b", "r") if all(at["memory", name])}
            if "b" in moved:
                written.pop(0)
            if "r" in moved:
                reads[0][1] -= 1
                if reads[0][1] == 0:
                    reads.pop(0)
            if "w" in moved:
                address, left = owed[0]
                data, strobes, last = payload["w"]
                assert last == (left == 1) and (strobes == 0 or (strobes == self.strobes and data == address)), (data, address, left)
                self.dropped += strobes == 0
                owed[0][1] -= 1
                if left == 1:
                    owed.pop(0)
                    written.append(address)
            if "aw" in moved:
                owed.append([payload["aw"][0], self.parts])
            if "ar" in moved:
                reads.append([payload["ar"][0], payload["ar"][1] + 1])
            # Transfers at the chip.
            if all(at["chip", "b"]):
                assert not holding and asked["b"] and chip_b == asked["b"].pop(0) % 128
                self.answered += 1
            if all(at["chip", "r"]):
                assert not holding and chip_r[0] == asked["r"][0]
                if chip_r[1]:
                    asked["r"].pop(0)
                    self.answered += 1
            if all(at["chip", "aw"]):
                asked["b"].append((yield chip.aw.addr))
            if all(at["chip", "w"]):
                to_send.pop(0)
            if all(at["chip", "ar"]):
                asked["r"].append((yield chip.ar.addr))
            if idle:
                assert holding and not owed and not written and not reads and not any(offered.values()), "idle, and something is under way"
            # The next cycle: the chip.
            if hold_for < 0 and not holding and rng.random() < HOLDS / self.length:
                yield gate.hold.eq(1)
                hold_for = 400
            elif holding and idle:
                # The chip is reset, then the memory comes back.
                epoch, to_send, asked = epoch + 1, [], {"b": [], "r": []}
                for name in ("aw", "ar", "w"):
                    yield getattr(chip, name).valid.eq(0)
                yield gate.hold.eq(0)
                hold_for, self.held = -1, self.held + 1
                yield
                continue
            elif holding:
                hold_for -= 1
                assert hold_for > 0, "a hold that does not end"
            for name in ("aw", "ar"):
                valid, ready = at["chip", name]
                if valid and not ready:
                    continue
                go = rng.random() < 0.4 and len(asked["b"]) + len(asked["r"]) < 20
                yield getattr(chip, name).valid.eq(go)
                if go:
                    tag = (tag + 1) % 30_000
                    yield getattr(chip, name).addr.eq(tag)
                    yield getattr(chip, name).id.eq(tag % 128)
                    yield getattr(chip, name).len.eq(rng.randrange(4) if name == "ar" else self.parts - 1)
                    if name == "aw":
                        to_send += [(tag, part == self.parts - 1) for part in range(self.parts)]
            valid, ready = at["chip", "w"]
            if to_send and not (valid and not ready):
                go = rng.random() < 0.5
                yield chip.w.valid.eq(go)
                yield chip.w.data.eq(to_send[0][0])
                yield chip.w.strb.eq(self.strobes)
                yield chip.w.last.eq(to_send[0][1])
            elif not (valid and not ready):
                yield chip.w.valid.eq(0)
            yield chip.b.ready.eq(1)
            yield chip.r.ready.eq(1)
            # The memory.
            for name in ("aw", "ar", "w"):
                yield getattr(memory, name).ready.eq(rng.random() < 0.6)
            if not at["memory", "b"][0] or "b" in moved:
                go = bool(written) and rng.random() < 0.3
                yield memory.b.valid.eq(go)
                if go:
                    yield memory.b.id.eq(written[0] % 128)
            if not at["memory", "r"][0] or "r" in moved:
                go = bool(reads) and rng.random() < 0.3
                yield memory.r.valid.eq(go)
                if go:
                    yield memory.r.data.eq(reads[0][0])
                    yield memory.r.last.eq(reads[0][1] == 1)
            yield


@pytest.mark.parametrize(("number", "width"), [(0, 512), (2, 128), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((1, 512), (3, 128), (4, 256)))])
def test_holds(number: int, width: int) -> None:
    bench = Bench(number, width)
    bench.run()
    assert bench.held > 3 and bench.dropped > 0 and bench.answered > 300, (bench.held, bench.dropped, bench.answered)
