"""The parameter object of the rendering stage.

Everything that RTL, model, tests and docs must agree on is defined here once: `make generate` (scripts/gen_params.py) writes
`rtl/generated/flk_param_pkg.sv` from the constants and `rtl/generated/flk_mask_generator.sv` from the table of mask generators;
`RenderConfig.rtl_parameters()` gives the module parameters of a build. Records: `flicker.layout`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, IntEnum

from .errors import FlickerError


class Form(IntEnum):
    """How the Gaussian weight E is written, CONIC or FACTORED (docs/reference/number_formats.md)."""

    CONIC = 0
    FACTORED = 1


class Precision(IntEnum):
    """Number formats of the contribution test (paper, Fig. 7c).

    FP16. MIXED: FP16 differences, E4M3 from there on. FP8: coordinates, too, are E4M3. FIXED: fixed-point differences, E4M3 from there on.
    """

    FP16 = 0
    MIXED = 1
    FP8 = 2
    FIXED = 3


class CatMode(IntEnum):
    """Leader pixels of the contribution-aware test (paper, Sec. III-A).

    OFF: every splat goes to all four mini-tiles. DENSE: Uniform-Dense, 4 corners of each mini-tile. SPARSE: Uniform-Sparse, 2 diagonal corners. SMOOTH:
    Smooth-Focused, dense for smooth splats, sparse for spiky ones. SPIKY: Spiky-Focused, the opposite. AUTO: Smooth-Focused, falls to Uniform-Sparse where the
    CTU is the bottleneck.
    """

    OFF = 0
    DENSE = 1
    SPARSE = 2
    SMOOTH = 3
    SPIKY = 4
    AUTO = 5


class Coords(IntEnum):
    """Where the projected mean is rounded to FP16. LOCAL: relative to the sub-tile. ABSOLUTE: in screen coordinates, made local by an FP16 subtraction."""

    LOCAL = 0
    ABSOLUTE = 1


class SortOrder(str, Enum):
    """What splats are sorted by, near to far (docs/decisions/032-depth-keys.md).

    DEPTH: along the camera's axis. DISTANCE: to the camera; stays while it turns on the spot.
    """

    DEPTH = "depth"
    DISTANCE = "distance"


TILE = 16
SUBTILE = 8
MINITILE = 4
CORES = 4
CHANNELS = 4
VRUS_PER_CHANNEL = 2
PIXELS_PER_VRU = MINITILE * MINITILE // VRUS_PER_CHANNEL
SPIKY_AXIS_RATIO = 3.0
SUBTILE_COORD_BITS = 12  # column and row of a sub-tile: pictures up to 32768 pixels wide
COUNTER_BITS = 32

# Fixed-point differences (Precision.FIXED): bits of the mean's magnitude.
FIXED_INT_BITS = 9
FIXED_FRAC_BITS = 8

# Registers of the pipelined operators (= their latency), so that no path is longer than 60 FO4 (docs/reference/synthesis.md).
# A sum is an addition that cannot cancel: both operands are squares or of one sign.
FP16_ADD_STAGES = 3
FP16_SUM_STAGES = 2
FP16_MUL_STAGES = 2
FP8_ADD_STAGES = 2
FP8_SUM_STAGES = 1
FP8_MUL_STAGES = 1
LOG_STAGES = 3
# Registers of the lanes' units.
LANE_SETUP_STAGES = 4
LANE_ROW_MASK_STAGES = 3
EXP_STAGES = {Form.CONIC: 3, Form.FACTORED: 2}


def weight_stages(wide: bool) -> tuple[int, int, int]:
    """Registers of the operators of `flk_weight` (addition, addition that cannot cancel, multiplication): formats of more than 8 bits (`wide`), or up to 8."""
    return (FP16_ADD_STAGES, FP16_SUM_STAGES, FP16_MUL_STAGES) if wide else (FP8_ADD_STAGES, FP8_SUM_STAGES, FP8_MUL_STAGES)


def weight_shape_delay(form: Form, wide: bool) -> int:
    """Cycles after the differences at which `flk_weight` takes the shape numbers: the conic form multiplies the differences first."""
    return weight_stages(wide)[2] if form == Form.CONIC else 0


def weight_latency(form: Form, wide: bool) -> int:
    """Cycles from the differences to the weight (rtl/common/flk_weight.sv)."""
    add, sum_, mul = weight_stages(wide)
    return 2 * mul + 2 * add if form == Form.CONIC else 2 * mul + add + sum_


def prtu_mean_delay(precision: Precision) -> int:
    """Cycles after the coordinates at which a PRTU takes the mean: an FP16 subtraction begins with a register for the coordinates."""
    return int(precision in (Precision.FP16, Precision.MIXED))


def prtu_shape_delay(precision: Precision) -> int:
    """Cycles after the coordinates at which a PRTU takes the splat's shape numbers: its differences are ready."""
    return {
        Precision.FP16: 1 + FP16_ADD_STAGES,
        Precision.MIXED: 1 + FP16_ADD_STAGES + 1,  # conversion
        Precision.FP8: 1 + FP8_ADD_STAGES,
        Precision.FIXED: 3,  # mean to fixed point, subtraction, conversion
    }[precision]


def prtu_latency(form: Form, precision: Precision) -> int:
    """Cycles from a PRTU's coordinates to its answer; the threshold is taken one cycle before the answer."""
    return prtu_shape_delay(precision) + weight_latency(form, precision == Precision.FP16) + 1

ALPHA_MIN = 1.0 / 255.0
ALPHA_MAX = 0.99
TRANSMITTANCE_MIN = 1e-4

# Automatic fall to Uniform-Sparse (docs/reference/ctu.md): widths of the per-sub-tile counts, weight of history.
AUTO_TEST_BITS = 16
AUTO_SENT_BITS = 13
AUTO_DECAY_SHIFT = 2


def vru_stages(form: Form) -> tuple[int, int]:
    """Cycles from a VRU's operation to the blend of transmittance and to that of colour (rtl/render/flk_vru.sv)."""
    add, sum_, mul = FP16_ADD_STAGES, FP16_SUM_STAGES, FP16_MUL_STAGES
    weight = 1 + add + weight_latency(form, True)
    blend = weight + EXP_STAGES[form] + mul + 1 + add + mul
    return blend, blend + mul + sum_


def fp16_bits_up(x: float) -> int:
    """Bits of the smallest FP16 number >= x (x > 0)."""
    bits = fp16_bits_nearest(x)
    return bits + (struct.unpack("<e", struct.pack("<H", bits))[0] < x)


def fp16_bits_nearest(x: float) -> int:
    """Bits of x rounded to FP16."""
    return struct.unpack("<H", struct.pack("<e", x))[0]


FP16_ONE_BITS = fp16_bits_nearest(1.0)
ALPHA_MIN_BITS = fp16_bits_up(ALPHA_MIN)
ALPHA_MAX_BITS = fp16_bits_nearest(ALPHA_MAX)
TRANSMITTANCE_MIN_BITS = fp16_bits_up(TRANSMITTANCE_MIN)

MAX_FIFO_DEPTH = 128
VRU_COUNTS = (1, 2, 4)  # VRUs per channel that the RTL can have
LANE_COUNTS = (32, 64, 128)  # lanes of all of four cores
CORE_COUNTS = (1, 2, 4)  # cores of the stage of lanes
LANES_PER_CORE = (4, 8, 16, 32)
UNIT_COUNTS = (1, 2, 4)  # sorting units, list writers, preprocessing lanes
PREPROC_INTERVALS = (2, 4)  # cycles from a Gaussian of a preprocessing lane to the next
MAX_LANE_ENTRIES = 64  # splats in the store of a core of lanes, entries in a lane's queue


SORT_CELLS = 16  # entries of a sorting unit's first runs


def _power(value: int) -> bool:
    """A power of two."""
    return value > 0 and value & (value - 1) == 0


@dataclass(frozen=True)
class ChipMemories:
    """Sizes of the chip's memories that cost cycles or bytes and no bit of a picture (docs/reference/chip_memory.md).

    sorted_entries: longest list that a sorting unit takes in one reading. list_chunks: in a list reader's memory. sorted_ahead: entries of a sorting unit that
    wait for delivery. pairs: of tiles in the frame writer. survivors: of a preprocessing core that wait for their colours. sort_ways: runs that a sorting
    unit's last step merges, a power of two: the more, the fewer steps with memories of their own. gathered_lines: that the front end writes together.
    merge_lines: of the memory for lists that a sorting unit does not hold, a power of two; half as many runs at most (docs/reference/list_sorter.md).
    record_lines: of 32 bytes that the record cache holds, a power of two: the more, the fewer are read again. queued_records: of each core, between
    delivery and the stage: the more, the further cores with little to do in a tile go ahead of the others.
    """

    sorted_entries: int = 2048
    list_chunks: int = 8
    sorted_ahead: int = 704
    pairs: int = 4
    survivors: int = 128
    sort_ways: int = 8
    gathered_lines: int = 216
    merge_lines: int = 128
    record_lines: int = 1024
    queued_records: int = 128

    def __post_init__(self) -> None:
        rules = {
            "sorted_entries": (_power(self.sorted_entries) and self.sorted_entries >= 64, "a power of two from 64 on"),
            "list_chunks": (self.list_chunks >= 4, "at least 4"),
            "sorted_ahead": (self.sorted_ahead >= 4 and self.sorted_ahead % 2 == 0, "even, at least 4"),
            "pairs": (self.pairs in (2, 4, 8), "2, 4 or 8"),
            "survivors": (_power(self.survivors) and self.survivors >= 8, "a power of two from 8 on"),
            "sort_ways": (_power(self.sort_ways) and 2 <= self.sort_ways <= self.sorted_entries // SORT_CELLS, "a power of two, 2 to sorted_entries / 16"),
            "gathered_lines": (self.gathered_lines >= 8, "at least 8"),
            "merge_lines": (_power(self.merge_lines) and self.merge_lines >= 8, "a power of two from 8 on"),
            "record_lines": (_power(self.record_lines) and 32 <= self.record_lines <= 1 << 16, "a power of two, 32 to 65,536"),
            "queued_records": (self.queued_records >= 8 and self.queued_records % 8 == 0, "a multiple of 8"),
        }
        for name, (legal, text) in rules.items():
            if not legal:
                raise FlickerError(f"memories: {name} must be {text}, not {getattr(self, name)}")
        if self.merge_lines // 2 * -(-self.sorted_entries // 9) > 64 * 228:
            most = 2 * 64 * 228 // -(-self.sorted_entries // 9)
            raise FlickerError(f"memories: merge_lines must be at most {most} with sorted_entries {self.sorted_entries}, not {self.merge_lines}")

    @property
    def sort_stages(self) -> int:
        """Merging steps of a sorting unit by two: doublings of its first runs."""
        return (self.sorted_entries // SORT_CELLS).bit_length() - 1

    @property
    def sort_runs(self) -> int:
        """Runs of a list, at most."""
        return self.merge_lines // 2

    @property
    def longest_list(self) -> int:
        """Entries of the longest list that is sorted; a longer one ends the frame with an error."""
        return self.sort_runs * self.sorted_entries

    def rendering_parameters(self) -> dict[str, int]:
        """Of `flk_rendering` and `flk_top`; none where all sizes are the default ones."""
        values = {
            "SortStages": self.sort_stages, "SortWays": self.sort_ways, "MergeLines": self.merge_lines, "Chunks": self.list_chunks,
            "Entries": self.sorted_ahead, "Pairs": self.pairs, "RecordLines": self.record_lines, "Queue": self.queued_records,
        }
        return values if self != ChipMemories() else {}

    def front_parameters(self) -> dict[str, int]:
        """Of `flk_preprocessing` and `flk_top`, likewise."""
        return {"Waiting": self.survivors, "Gather": self.gathered_lines} if self != ChipMemories() else {}


LINE_BITS = 512  # of what units read and write at once
PORT_WIDTHS = (128, 256, LINE_BITS)  # of the memory port
CHIP_MEMORIES = {
    "default": ChipMemories(),
    "small": ChipMemories(1024, 8, 128, 2, 64, 8, 64, 64, 1024),  # within the paper's 288 KB
    # Fewer bytes a frame: within the default's size, and beyond it.
    "records": ChipMemories(list_chunks=6, sorted_ahead=448, pairs=2, survivors=64, gathered_lines=96, record_lines=2048),
    "large": ChipMemories(pairs=8, record_lines=2048, queued_records=512),
}


@dataclass(frozen=True)
class RenderConfig:
    """One configuration of the rendering stage.

    `cat` is a run-time input of the RTL; the others are elaboration parameters, except `coords`, which concerns the unit that writes the records.
    `ctu_fifo_depth` 0: the CTU's pipeline stands still while its output is blocked; otherwise what is in flight goes on into an output FIFO of that depth,
    as in the paper. `vrus_per_channel`: the VRUs of a channel divide its mini-tile row by row; only the automatic mode's choice, and so only its picture,
    depends on it. mask_generator, stage: keys of MASK_GENERATORS and STAGES. For the stage `lanes`, and no picture depends on them: `cores`, each with 4, 2
    or 1 sub-tiles of a tile; `lanes` of all cores; `in_width` elements that a core takes in a cycle; `slots` splats in its store; `fifo_depth` entries in a
    lane's queue. Of the whole chip: `delivered` records that a core gets in a cycle there, and so takes, whatever `in_width`; `memories`, key of
    CHIP_MEMORIES; `port_bits` of the memory port; `sort_units`, with list readers and buffers of their own; `list_writers`, which share the four banks of
    lists; `preproc_lanes`, preprocessing cores, which take a Gaussian every `preproc_interval` cycles. No bit of records, lists and pictures depends on
    these. `colour_store`: colours can be kept from frame to frame, in factored form alone.
    """

    form: Form = Form.FACTORED
    precision: Precision = Precision.FIXED
    cat: CatMode = CatMode.SMOOTH
    fifo_depth: int = 16
    ctu_fifo_depth: int = 0
    coords: Coords = Coords.LOCAL
    vrus_per_channel: int = VRUS_PER_CHANNEL
    mask_generator: str = "ctu"
    stage: str = "channels"
    lanes: int = LANE_COUNTS[0]
    cores: int = CORES
    in_width: int = 2
    slots: int = 20
    delivered: int = 1
    memories: str = "default"
    port_bits: int = LINE_BITS
    sort_units: int = UNIT_COUNTS[-1]
    list_writers: int = UNIT_COUNTS[-1]
    preproc_lanes: int = UNIT_COUNTS[-1]
    preproc_interval: int = PREPROC_INTERVALS[0]
    colour_store: bool = True

    def __post_init__(self) -> None:
        for field, table in (("mask_generator", MASK_GENERATORS), ("stage", STAGES), ("memories", CHIP_MEMORIES)):
            if getattr(self, field) not in table:
                raise FlickerError(f"configuration: {field} must be one of {', '.join(table)}, not {getattr(self, field)}")
        if not self.generator.tests and self.cat != CatMode.OFF:
            raise FlickerError(f"configuration: cat must be off with mask_generator {self.mask_generator}, which has no test, not {self.cat.name.lower()}")
        if "CtuFifoDepth" not in self.generator.parameters and self.ctu_fifo_depth:
            raise FlickerError(f"configuration: ctu_fifo_depth must be 0 with mask_generator {self.mask_generator}, which has no such FIFO")
        if not 1 <= self.fifo_depth <= MAX_FIFO_DEPTH:
            raise FlickerError(f"configuration: fifo_depth must be 1 to {MAX_FIFO_DEPTH}, not {self.fifo_depth}")
        if not 0 <= self.ctu_fifo_depth <= MAX_FIFO_DEPTH:
            raise FlickerError(f"configuration: ctu_fifo_depth must be 0 to {MAX_FIFO_DEPTH}, not {self.ctu_fifo_depth}")
        if self.vrus_per_channel not in VRU_COUNTS:
            raise FlickerError(f"configuration: vrus_per_channel must be 1, 2 or 4, not {self.vrus_per_channel}")
        if self.cores not in (CORE_COUNTS if self.by_lanes else (CORES,)):
            raise FlickerError(f"configuration: cores must be {'1, 2 or 4' if self.by_lanes else f'{CORES} with stage {self.stage}'}, not {self.cores}")
        if self.lanes not in (counts := [self.cores * own for own in LANES_PER_CORE]):
            raise FlickerError(f"configuration: lanes must be {', '.join(map(str, counts[:-1]))} or {counts[-1]} with cores {self.cores}, not {self.lanes}")
        if self.in_width not in (1, 2):
            raise FlickerError(f"configuration: in_width must be 1 or 2, not {self.in_width}")
        if self.delivered not in ((1, 2) if self.by_lanes else (1,)):
            raise FlickerError(f"configuration: delivered must be {'1 or 2' if self.by_lanes else '1 with stage ' + self.stage}, not {self.delivered}")
        if self.port_bits not in PORT_WIDTHS:
            raise FlickerError(f"configuration: port_bits must be {', '.join(map(str, PORT_WIDTHS[:-1]))} or {PORT_WIDTHS[-1]}, not {self.port_bits}")
        for field in ("sort_units", "list_writers", "preproc_lanes"):
            if (value := getattr(self, field)) not in UNIT_COUNTS:
                raise FlickerError(f"configuration: {field} must be 1, 2 or 4, not {value}")
        if self.preproc_interval not in PREPROC_INTERVALS:
            raise FlickerError(f"configuration: preproc_interval must be 2 or 4, not {self.preproc_interval}")
        for field in ("slots", "fifo_depth"):
            if self.by_lanes and not 2 <= (value := getattr(self, field)) <= MAX_LANE_ENTRIES:
                raise FlickerError(f"configuration: {field} must be 2 to {MAX_LANE_ENTRIES} with stage lanes, not {value}")
        if self.by_lanes and (self.form, self.coords) != (Form.FACTORED, Coords.LOCAL):
            raise FlickerError("configuration: stage lanes takes records of 16 bytes, so form must be factored and coords local")

    @property
    def by_lanes(self) -> bool:
        """The stage takes raw records (`golden.lanes`)."""
        return STAGES[self.stage].element == RECORD_ELEMENT

    @property
    def pixels_per_vru(self) -> int:
        """Pixels of a VRU: the cycles that a splat takes in a channel."""
        return MINITILE * MINITILE // self.vrus_per_channel

    @property
    def generator(self) -> MaskGenerator:
        """What makes the masks."""
        return MASK_GENERATORS[self.mask_generator]

    def rtl_parameters(self) -> dict[str, int]:
        """Module parameters of the rendering stage, those that it has."""
        values = {
            "Form": int(self.form),
            "Precision": int(self.precision),
            "FifoDepth": self.fifo_depth,
            "CtuFifoDepth": self.ctu_fifo_depth,
            "VrusPerChannel": self.vrus_per_channel,
            "MaskGenerator": list(MASK_GENERATORS).index(self.mask_generator),
            "Cores": self.cores,
            "Lanes": self.lanes,
            "InWidth": self.in_width,
            "Slots": self.slots,
            "Depth": self.fifo_depth,
        }
        return {name: values[name] for name in STAGES[self.stage].parameters}

    def chip_parameters(self) -> dict[str, int]:
        """Module parameters of the rendering half and the chip: the stage, what it is built with, what is not the default of the rendering half's own."""
        parameters = self.rtl_parameters()
        if parameters.pop("InWidth", None) and self.delivered != 1:
            parameters["InWidth"] = self.delivered
        units = {"SortUnits": self.sort_units} if self.sort_units != UNIT_COUNTS[-1] else {}
        return {"Stage": list(STAGES).index(self.stage), **parameters, **self.chip_memories.rendering_parameters(), **units}

    def front_parameters(self) -> dict[str, int]:
        """Module parameters of the front end and the chip: what is not the default."""
        units = {"PreprocLanes": self.preproc_lanes, "ListWriters": self.list_writers}
        interval = {"PreprocInterval": self.preproc_interval} if self.preproc_interval != PREPROC_INTERVALS[0] else {}
        store = {} if self.colour_store else {"ColourStore": 0}
        return self.chip_memories.front_parameters() | {name: value for name, value in units.items() if value != UNIT_COUNTS[-1]} | interval | store

    def top_parameters(self) -> dict[str, int]:
        """Of the whole chip, flk_top and what wraps it: `chip_parameters`, `front_parameters`, the port; those that are not the default."""
        port = {"PortBits": self.port_bits} if self.port_bits != LINE_BITS else {}
        return {**self.chip_parameters(), **self.front_parameters(), **port}

    @property
    def chip_memories(self) -> ChipMemories:
        """Sizes of the chip's memories that `memories` names."""
        return CHIP_MEMORIES[self.memories]

    def with_(self, **changes) -> RenderConfig:
        """A copy with some fields changed."""
        return replace(self, **changes)



# ---- plug points (docs/reference/mask_generators.md) -----------------------------------------------------

SUBTILE_PIXELS = SUBTILE * SUBTILE


@dataclass(frozen=True)
class MaskGenerator:
    """A module that gives each splat its mask: behind the ports of `flk_mask_generator`, which instantiates it.

    mask_bits: CHANNELS (a bit for each mini-tile) or SUBTILE_PIXELS. parameters: of the module, each an expression in the parameters of
    `flk_mask_generator` (GENERATOR_PARAMETERS). latency: cycles from acceptance to the output, of a configuration. one_token: a token waits
    until the one before has left the test. tests: it looks at splats; without, its masks are those of CatMode.OFF.
    """

    module: str
    mask_bits: int
    parameters: dict[str, str]
    latency: Callable[[RenderConfig], int]
    one_token: bool
    tests: bool
    note: str


# What a mask generator can be built from, with default values: parameters of `flk_mask_generator`, set by the stage.
GENERATOR_PARAMETERS = {
    "Form": "FORM_FACTORED", "Precision": "PRECISION_FIXED", "VruCycles": "PIXELS_PER_VRU", "CtuFifoDepth": "CTU_FIFO_DEPTH",
}

MASK_GENERATORS: dict[str, MaskGenerator] = {
    "ctu": MaskGenerator(
        "flk_ctu", CHANNELS, {name: name for name in GENERATOR_PARAMETERS}, lambda config: prtu_latency(config.form, config.precision),
        one_token=True, tests=True, note="contribution-aware test (docs/reference/ctu.md)",
    ),
    "all": MaskGenerator(
        "flk_mask_all", CHANNELS, {"MaskBits": str(CHANNELS)}, lambda config: 1,
        one_token=False, tests=False, note="no test: every splat to all four mini-tiles",
    ),
}


@dataclass(frozen=True)
class Stage:
    """A rendering stage: a module with the ports that docs/reference/render_stage.md lists.

    element, pixel: records (flicker.layout) that it takes and gives, on one stream per core. A token of `element` is its bit `eos`, with the
    sub-tile's place in the lowest bits; RECORD_ELEMENT: records as they lie in memory. `pixel` names sub-tile, mini-tile, index and pixel.
    parameters: those of RenderConfig.rtl_parameters() that the module has (STAGE_PARAMETERS). counters: of a core, in the order of their indices.
    lane_order: all pixels of a lane (flk_lane_pkg) before any of the next sub-tile; else all pixels of a mini-tile, which flk_frame_writer
    needs to know.
    """

    module: str
    element: str
    pixel: str
    parameters: tuple[str, ...]
    counters: tuple[str, ...]
    note: str
    lane_order: bool = False


RECORD_ELEMENT = "record_elem"

# What a rendering stage can be built from, with default values: parameters of `flk_stage`, which instantiates the chosen one.
STAGE_PARAMETERS = {
    "Form": "FORM_FACTORED", "Precision": "PRECISION_FIXED", "FifoDepth": "FIFO_DEPTH", "CtuFifoDepth": "CTU_FIFO_DEPTH",
    "VrusPerChannel": "VRUS_PER_CHANNEL", "MaskGenerator": "MASK_GENERATOR_CTU", "Cores": "CORES", "Lanes": "32", "InWidth": "1", "Slots": "LANE_SLOTS",
    "Depth": "LANE_QUEUE_DEPTH",
}

# ---- performance counters (order of the RTL's counter vector) ----------------------------------

CORE_COUNTERS = (
    ("cycles", "cycles since the counters were cleared"),
    ("subtiles", "end-of-sub-tile tokens taken by the CTU"),
    ("gaussians_in", "splats taken by the CTU"),
    ("gaussians_rejected", "splats whose mask came out empty"),
    ("ctu_busy", "cycles in which the CTU started a test or took a token"),
    ("ctu_stalled", "cycles in which the CTU had input but could not take it"),
    ("ctu_idle", "cycles in which the CTU had no input"),
    ("minitiles_tested", "mask bits set by the test"),
    ("minitiles_delivered", "splats written into feature FIFOs"),
    ("minitiles_filtered", "mask bits dropped because the channel was finished"),
)
CHANNEL_COUNTERS = (
    ("fifo_full", "cycles in which the feature FIFO was full"),
    ("vru_busy", "cycles in which the channel issued a pixel to its VRUs"),
    ("minitiles_sent", "splats that met an unfinished mini-tile, in program order"),
    ("minitiles_discarded", "splats taken from the FIFO after the mini-tile was finished, not or not fully issued"),
    ("pixels_finished", "pixels that ended before their list did"),
)
COUNTERS_PER_CORE = len(CORE_COUNTERS) + CHANNELS * len(CHANNEL_COUNTERS)
# Of a core of the lanes (rtl/lanes/flk_lane_counters.sv), behind the same read port. Sums over lanes count every lane in every cycle.
LANE_COUNTERS = (
    ("cycles", "cycles since the counters were cleared"),
    ("subtiles", "end-of-sub-tile tokens taken"),
    ("gaussians_in", "splats taken"),
    ("gaussians_rejected", "splats whose mask came out empty"),
    ("busy", "cycles in which something was taken"),
    ("stalled", "cycles in which there was input that could not be taken"),
    ("idle", "cycles without input"),
    ("dropped", "splats whose pixels were all known to be finished"),
    ("dispatched", "splats and tokens that took a slot of the store"),
    ("no_slot", "cycles in which one of them waited for a slot"),
    ("no_room", "cycles in which one waited for a lane's queue"),
    ("entries", "entries of splats in the lanes' queues"),
    ("visits", "pixels visited"),
    ("skipped", "visits whose alpha is below 1/255"),
    ("blended", "visits that were blended"),
    ("pixels_finished", "pixels that ended before their list did"),
    ("starved", "lanes without an entry, summed over the cycles"),
    ("bank_waits", "lanes whose token waited for the lane's bank, summed over the cycles"),
)
# The read port: address {core, index}, data COUNTER_LATENCY cycles later.
COUNTER_INDEX_BITS = (COUNTERS_PER_CORE - 1).bit_length()
COUNTER_ADDR_BITS = (CORES - 1).bit_length() + COUNTER_INDEX_BITS
COUNTER_LATENCY = 1

# ---- rendering stages -------------------------------------------------------------------------

STAGES: dict[str, Stage] = {
    "channels": Stage(
        "flk_render_stage", "splat_elem", "core_pixel",
        ("Form", "Precision", "FifoDepth", "CtuFifoDepth", "VrusPerChannel", "MaskGenerator"),
        (*(name for name, _ in CORE_COUNTERS), *(f"channel {c} {name}" for c in range(CHANNELS) for name, _ in CHANNEL_COUNTERS)),
        "mask generators and volume rendering units",
    ),
    "lanes": Stage(
        "flk_lane_stage", RECORD_ELEMENT, "core_pixel", ("Cores", "Lanes", "InWidth", "Slots", "Depth"), tuple(name for name, _ in LANE_COUNTERS),
        "lanes in the log domain (docs/reference/lanes.md)", lane_order=True,
    ),
}

# The paper's configuration: conic form in CTU and VRU, Smooth-Focused, E4M3 mixed precision, FIFO depth 16, an output FIFO in
# the CTU for what is in flight at a stall (its depth is ours: enough for one splat per cycle).
FAITHFUL = RenderConfig(form=Form.CONIC, precision=Precision.MIXED, cat=CatMode.SMOOTH, ctu_fifo_depth=16)
# What `flicker render` and `flicker demo` take when nothing else is said: best in cycles times area and in pictures (docs/decisions/010-lanes-by-default.md).
RECOMMENDED = RenderConfig(stage="lanes")
NAMED_CONFIGS = {"faithful": FAITHFUL, "default": RenderConfig()}
