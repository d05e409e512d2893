"""cocotb tests of flk_front_throttle: shares of both halves beside its sum."""

from __future__ import annotations

import cocotb
from cocotb.triggers import ReadOnly, RisingEdge
from flicker_tb.bench import Bench, rounds


@cocotb.test()
async def shares(dut):
    """Few bursts while the rendering half runs and its share is not the larger one."""
    bench = Bench(dut)
    rng, edge = bench.rng, RisingEdge(dut.clk_i)
    most_clusters, most_pairs = (1 << int(dut.ClusterBits.value)) - 1, (1 << int(dut.PairBits.value)) - 1
    for name in ("clear", "start", "done", "pairs", "left", "clusters", "cluster"):
        getattr(dut, f"{name}_i").value = 0
    await bench.reset()
    low = high = changes = 0
    for number in range(rounds(40, 200)):
        clusters, pairs = rng.choice([(1, 1), (most_clusters, most_pairs), (1, most_pairs), (most_clusters, 1)] + 4 * [
            (rng.randint(1, min(most_clusters, 300)), rng.randint(1, min(most_pairs, 200)))])
        written, cut, jump = 0, rng.random() < 0.1, rng.choice([1, 1, 3, 40])
        paces = rng.choice([(0.5, 0.5), (0.9, 0.2), (0.2, 0.9), (0.02, 0.5), (0.5, 0.02), (1, 1)])
        at, late, rises = 0, rng.choice([0, 0, 20]), rng.choice([0, 1, 3])  # cycles until the front end begins, until the pairs of the frame are left
        leaves = rng.choice([0, rng.randrange(600)])  # when the last cluster has gone
        dut.clusters_i.value, dut.pairs_i.value = clusters, pairs
        dut.start_i.value = 1
        await edge
        dut.start_i.value = 0
        passed, seen, before = 0, 0, [(0, 0)] * 4  # clusters and pairs of cycles before: registers take them, the step, the sum's two parts
        state = 0
        for cycle in range(600):
            ends = cycle == 599 or (at + 1 == clusters and written == pairs) or (cut and cycle == 40)
            if cycle >= late and rng.random() < paces[0]:
                at = min(at + rng.randint(1, jump), clusters - 1)
            now = 0 if leaves and cycle >= leaves else at
            write = int(cycle > rises and written < pairs and rng.random() < paces[1])
            dut.cluster_i.value, dut.left_i.value = now, 0 if cycle < rises else pairs - written - write
            dut.done_i.value, dut.clear_i.value = int(ends and not cut), int(ends and cut)
            await ReadOnly()
            due = int(before[0][0] * (pairs - pairs // 4) >= before[0][1] * clusters)
            assert int(dut.few_o.value) == due, f"frame {number}, cycle {cycle}: {before[0]} of {clusters} clusters, {pairs} pairs"
            low, high, changes, state = low + 1 - due, high + due, changes + (state != due), due
            await edge
            passed, seen, written = passed + (passed < seen), now, written + write
            before = [*before[1:], (passed, written)]
            if ends:
                break
        dut.cluster_i.value = dut.done_i.value = dut.clear_i.value = dut.left_i.value = 0
        for _ in range(rng.randint(2, 6)):  # what a front end alone does counts for nothing
            await ReadOnly()
            assert not int(dut.few_o.value), f"frame {number}: few bursts of a front end alone"
            await edge
            dut.cluster_i.value = rng.randrange(clusters)
        dut.cluster_i.value = 0
        await edge
    assert low > 100 and high > 100 and changes > 50
