"""Every constant of the chip model with its source. What starts with "assumption" was chosen here, not taken from a
publication."""

from __future__ import annotations

from ..scene import memory

# ---- clock and memory interface ----------------------------------------------------------------

CLOCK_HZ = 1_000_000_000
DRAM_BYTES_PER_SECOND = 51_200_000_000
DRAM_CHANNELS = 8
DRAM_WIDTH_BITS = 16
DRAM_RATE = 3_200_000_000
DRAM_BURST_LENGTH = 16
DRAM_BANKS = 8
DRAM_PAGE_BYTES = 2048
DRAM_TRCD = 29
DRAM_TRP = 29
DRAM_TRP_ALL = 34
DRAM_TRAS = 68
DRAM_TRRD = 16
DRAM_TFAW = 64
DRAM_TCCD = 8
DRAM_TCCD_MASKED = 32
DRAM_TRTP = 12
DRAM_TWR = 29
DRAM_TWTR = 16
DRAM_RL = 28
DRAM_WL = 14
DRAM_TDQSCK = 6
DRAM_TREFI = 6246
DRAM_TRFC = 448
DRAM_TRFC_BANK = 224
DRAM_INTERLEAVE_BYTES = 64
DRAM_WINDOW = 32
DRAM_WRITE_PLACES = 64
DRAM_BATCH_BURSTS = 256
DRAM_REQUEST_BURSTS = 16
DRAM_LATENCY_CYCLES = 100

# ---- preprocessing -----------------------------------------------------------------------------

PREPROCESSING_CORES = 4
CLUSTER_TEST_CYCLES = 1
GEOMETRY_CYCLES = 1
SH_COEFFICIENTS_PER_CYCLE = 4
ENTRIES_PER_CYCLE = 1
CLUSTER_SIZE = memory.CHUNK
CLUSTER_HEADER_BYTES = memory.CLUSTER_HEADER_BYTES
GEOMETRY_NUMBERS = 10

# ---- records and lists -------------------------------------------------------------------------

RECORD_BYTES = 32
BOX_BYTES = 12
KEY_BITS = 32
ID_BITS = 24
LINE_BYTES = 32
CHUNK_BYTES = 64
CHUNK_LINK_BITS = 32
POINTER_BYTES = 4
COMBINER_SETS = 256
COMBINER_WAYS = 4
PIXEL_BYTES = 4

# ---- sorting unit ------------------------------------------------------------------------------

SORTING_UNITS = 4
SORT_LANES = 16
SORT_STAGES_PER_REG = 1
MERGE_WAYS = 16
SORT_CAPACITY = 2048
LISTS_IN_FLIGHT = 16
FILTER_ENTRIES_PER_CYCLE = 4
QUEUE_REFERENCES = 256
REFERENCE_BYTES = 2

# ---- feature buffers ---------------------------------------------------------------------------

FEATURE_BUFFER_BYTES = 288 * 1024
RECORD_CACHE_BYTES = 64 * 1024
RECORD_CACHE_WAYS = 4
GEOMETRY_BUFFER_BYTES = 4 * 2 * 1024

_PAPER = "paper, Sec. V-A (hardware set-up) or Table 2a"
_JEDEC = "JEDEC JESD209-4 LPDDR4-3200, 8 Gb a channel, as listed in DRAMSys (JEDEC_8Gb_LPDDR4-3200_16bit), clocks of 0.625 ns"

SOURCES = {
    "CLOCK_HZ": "assumption: 1 GHz, the clock GSCore (ASPLOS 2024) states for 28 nm; the paper gives none",
    "DRAM_BYTES_PER_SECOND": _PAPER,
    "DRAM_CHANNELS": "assumption: 8 channels of 16 bits at 3200 MT/s give the paper's 51.2 GB/s",
    "DRAM_WIDTH_BITS": "JEDEC JESD209-4: x16 channels",
    "DRAM_RATE": "assumption: LPDDR4-3200 (the paper says only LPDDR4)",
    "DRAM_BURST_LENGTH": "JEDEC JESD209-4: BL16, 32 bytes a burst of a x16 channel",
    "DRAM_BANKS": _JEDEC,
    "DRAM_PAGE_BYTES": _JEDEC + ": 1024 columns of 16 bits",
    "DRAM_TRCD": _JEDEC,
    "DRAM_TRP": _JEDEC + " (per bank)",
    "DRAM_TRP_ALL": _JEDEC + " (all banks)",
    "DRAM_TRAS": _JEDEC,
    "DRAM_TRRD": _JEDEC,
    "DRAM_TFAW": _JEDEC,
    "DRAM_TCCD": _JEDEC,
    "DRAM_TCCD_MASKED": "JEDEC JESD209-4: masked write after a write to the same bank, 4 tCCD",
    "DRAM_TRTP": _JEDEC,
    "DRAM_TWR": _JEDEC,
    "DRAM_TWTR": _JEDEC,
    "DRAM_RL": _JEDEC,
    "DRAM_WL": _JEDEC,
    "DRAM_TDQSCK": _JEDEC,
    "DRAM_TREFI": _JEDEC,
    "DRAM_TRFC": _JEDEC + " (all banks, 280 ns)",
    "DRAM_TRFC_BANK": _JEDEC + " (one bank, 140 ns)",
    "DRAM_INTERLEAVE_BYTES": "assumption: 64 bytes of consecutive addresses a channel",
    "DRAM_WINDOW": "assumption: reads a channel's controller sees ahead, to open rows early",
    "DRAM_WRITE_PLACES": "assumption: writes a channel's controller gathers and answers at once, to turn the bus more rarely; as gem5's memory controller",
    "DRAM_BATCH_BURSTS": "assumption: bursts of one purpose before the arbiter turns to the next (32 a channel)",
    "DRAM_REQUEST_BURSTS": "the same where both halves of the chip share the memory: a request for a chunk of a list, 512 bytes",
    "DRAM_LATENCY_CYCLES": "assumption: 100 ns from request to data, controller and interconnect included",
    "PREPROCESSING_CORES": _PAPER,
    "CLUSTER_TEST_CYCLES": "assumption: one cluster a cycle and core, five planes in parallel",
    "GEOMETRY_CYCLES": "assumption: one Gaussian a cycle and core; 0.19 mm2 a core (paper, Table 2a) is room for about 130 FP16 FMAs, "
                       "as many as a projection takes",
    "SH_COEFFICIENTS_PER_CYCLE": "assumption: 4 coefficients of three channels a cycle and core (12 FMAs)",
    "ENTRIES_PER_CYCLE": "assumption: one list entry a cycle and core",
    "CLUSTER_SIZE": "PlayCanvas compressed PLY: 256 Gaussians a chunk; sizes 32 to 1024 are compared in docs/results/chip_model.md",
    "CLUSTER_HEADER_BYTES": "assumption: box of the means (6 float32), largest standard deviation, first Gaussian and count: one burst",
    "GEOMETRY_NUMBERS": "paper, Sec. IV-A: 10 geometric parameters (mean 3, scale 3, quaternion 4)",
    "RECORD_BYTES": "assumption: mean 2 float32, shape 3, colour 3 and opacity in FP16, depth key, spiky bit, padded to one burst",
    "BOX_BYTES": "assumption: depth key and sub-tile box (4 x 12 bits) of a Gaussian, for the second pass of the counting scheme",
    "KEY_BITS": "docs/reference/number_formats.md: float32 bits of the depth; fewer are measured in docs/results/list_schemes.md",
    "ID_BITS": "assumption: up to 16.7 million visible Gaussians a frame",
    "LINE_BYTES": "one DRAM burst",
    "CHUNK_BYTES": "assumption: linked chunks of two bursts",
    "CHUNK_LINK_BITS": "assumption: 28 bits of chunk number, 4 bits of count",
    "POINTER_BYTES": "assumption: fill position or newest chunk of a list",
    "COMBINER_SETS": "assumption: one set per list of a 16 x 16 neighbourhood",
    "COMBINER_WAYS": "assumption",
    "PIXEL_BYTES": "assumption: RGBA, 8 bits a channel, in the frame buffer",
    "SORTING_UNITS": _PAPER,
    "SORT_LANES": "docs/reference/bitonic_sorter.md: 16 lanes, latency 10, one vector a cycle",
    "SORT_STAGES_PER_REG": "docs/reference/bitonic_sorter.md: default",
    "MERGE_WAYS": "assumption: merge tree with 16 inputs, one entry a cycle",
    "SORT_CAPACITY": "assumption: entries a sorting unit holds; longer lists are sorted in depth chunks",
    "LISTS_IN_FLIGHT": "assumption: lists read ahead over the four units, to hide the latency of a chain of chunks",
    "FILTER_ENTRIES_PER_CYCLE": "assumption: entries whose mask is looked at in a cycle",
    "QUEUE_REFERENCES": "assumption: records that may wait for a rendering core; they stay in the record cache, the core's "
                        "queue holds their places",
    "REFERENCE_BYTES": "assumption: place of a record in the record cache",
    "FEATURE_BUFFER_BYTES": _PAPER,
    "RECORD_CACHE_BYTES": "assumption: part of the feature buffers that keeps records for neighbouring tiles",
    "RECORD_CACHE_WAYS": "assumption",
    "GEOMETRY_BUFFER_BYTES": "assumption: two buffers of 1 KiB a preprocessing core for incoming parameters",
}


def constant_table() -> list[tuple[str, int, str]]:
    """(name, value, source) of every constant."""
    return [(name, globals()[name], source) for name, source in SOURCES.items()]
