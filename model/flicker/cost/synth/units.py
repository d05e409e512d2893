"""The units and parameter sets that `make synth` reports, and what they are compared with."""

from __future__ import annotations

from dataclasses import dataclass, field

from ... import layout
from ...arithmetic.ff_stages import STAGES
from ...chips import Chip, chips
from ...datapath.units import PIPELINES
from ...params import (
    CHANNELS,
    CORES,
    FAITHFUL,
    FIXED_FRAC_BITS,
    FIXED_INT_BITS,
    LANE_COUNTS,
    MASK_GENERATORS,
    MINITILE,
    PIXELS_PER_VRU,
    SUBTILE_COORD_BITS,
    SUBTILE_PIXELS,
    VRU_COUNTS,
    VRUS_PER_CHANNEL,
    CatMode,
    Form,
    Precision,
    RenderConfig,
)
from ...params import STAGES as RENDERING_STAGES

FORMS = {"conic": 0, "factored": 1}
PRECISIONS = {"fixed": 3, "fp16": 0, "mixed": 1, "fp8": 2}
FEATURE_BITS = layout.bits("feature_elem")
FIFO_DEPTHS = (4, 8, 16, 32, 64, 128)

MEMORY = "flk_sram"
SINGLE = "flk_sram_single"
MEMORIES = {MEMORY: "1 write, 1 read", SINGLE: "1"}  # macros where they are parts of another unit, and what ports they have

# Operators that the pipelines of the front end are put together from.
FF_OPERATORS = [*STAGES, "flk_ff_to_fixed", "flk_ff_from_fixed", "flk_fixed_mul", "flk_phase_mux", "flk_delay_ram"]

# Units that are put together from their synthesised parts instead of being flattened: module -> parts.
COMPOSED: dict[str, list[str]] = {
    "flk_bitonic_sorter": ["flk_compare_exchange", "flk_pipe_reg"],
    "flk_channel": ["flk_fifo", "flk_vru", "flk_stream_arbiter"],
    "flk_ctu": ["flk_prtu", "flk_fifo", "flk_ctu_controller", "flk_mmu", "flk_log_opacity_pipe"],
    "flk_rendering_core": ["flk_fifo_monitor", "flk_channel", "flk_stream_arbiter"],
    "flk_mask_all": ["flk_pipe_reg"],
    "flk_lane_queue": ["flk_fifo"],
    "flk_lane_core": ["flk_splat_setup", "flk_row_mask", "flk_delay", "flk_lane_queue", "flk_lane", "flk_lane_result", "flk_lane_arbiter", "flk_pipe_reg"],
    "flk_lane_stage": ["flk_lane_core", "flk_lane_counters", "flk_stage_control"],
    "flk_render_stage": ["flk_mask_generator", "flk_rendering_core", "flk_perf_counters", "flk_stage_control"],
    **{p.module: list(FF_OPERATORS) for p in PIPELINES},
    "flk_sram_fifo": [MEMORY],
    "flk_delay_ram": [MEMORY],
    "flk_list_writer": [MEMORY, SINGLE],
    "flk_frame_writer": [MEMORY, "flk_pixel_out"],
    "flk_list_reader": [MEMORY, "flk_axi_read"],
    "flk_pair_fifo": ["flk_sram_fifo"],
    "flk_record_cache": [MEMORY, "flk_pair_fifo", "flk_axi_fetch"],
    "flk_record_queue": [MEMORY],
    "flk_delivery": ["flk_record_cache", "flk_record_queue"],
    "flk_entry_buffer": ["flk_pair_fifo"],
    "flk_record_writer": [MEMORY, "flk_sram_fifo", "flk_stream_arbiter"],
    "flk_tile_walker": [MEMORY, "flk_sram_fifo", "flk_splat_band", "flk_fifo"],
    "flk_entry_merge": ["flk_sram_fifo"],
    "flk_sort_memory": [MEMORY],
    "flk_sort_merge": [MEMORY],
    "flk_sort_select": [MEMORY],
    "flk_sorting_unit": ["flk_sort_runs", "flk_sort_merge", "flk_sort_select"],
    "flk_run_merge": [MEMORY, "flk_axi_read"],
    "flk_list_sorter": ["flk_sorting_unit", "flk_run_writer", "flk_run_merge"],
    "flk_axi_fetch": ["flk_axi_read"],
    "flk_cluster_cull": ["flk_cluster_test", "flk_axi_fetch", "flk_sram_fifo", "flk_fifo", "flk_delay_ram"],
    "flk_geometry_fetch": ["flk_cluster_header", "flk_axi_fetch", "flk_sram_fifo", "flk_fifo"],
    "flk_colour_fetch": ["flk_axi_fetch", "flk_sram_fifo"],
    "flk_colour_heads": ["flk_colours_last", "flk_sram_fifo"],
    "flk_colour_rows": ["flk_sram_fifo", "flk_fifo"],
    "flk_colour_keeper": ["flk_sram_fifo"],
    "flk_colour_store": [
        "flk_colour_heads", "flk_colour_rows", "flk_colour_keeper", "flk_axi_fetch", "flk_sram_fifo", "flk_stream_arbiter", "flk_event_counter",
    ],
    "flk_preprocessing_core": [
        MEMORY, "flk_geometry_decode", "flk_projection", "flk_projection_conic", "flk_sram_fifo", "flk_fifo", "flk_colour_basis",
        "flk_colour_group", "flk_colour_constant", "flk_colour_term", "flk_splat_bounds", "flk_tile_walker", "flk_mean_field", "flk_shape_field",
        "flk_opacity_to_fp16", "flk_ff_to_fp16",
    ],
    "flk_preprocessing": [
        "flk_cluster_cull", "flk_geometry_fetch", "flk_colour_fetch", "flk_colour_store", "flk_axi_read_mux", "flk_preprocessing_core", "flk_record_writer",
        "flk_entry_merge", "flk_list_writer",
        "flk_stream_arbiter", "flk_fifo", "flk_sram_fifo", "flk_line_writer", "flk_delay", "flk_event_counters",
    ],
    "flk_line_writer": ["flk_sram_fifo", "flk_axi_write"],
    "flk_axi_read_mux": ["flk_stream_arbiter"],
    "flk_rendering": [
        "flk_tile_walk", "flk_list_reader", "flk_list_sorter", "flk_stream_arbiter", "flk_axi_read_mux", "flk_axi_half", "flk_entry_buffer", "flk_delivery",
        "flk_stage", "flk_frame_writer", "flk_line_writer", "flk_pipe_reg", "flk_event_counters",
    ],
    "flk_splat_input": ["flk_record_to_splat"],
    "flk_stage": ["flk_splat_input", *(stage.module for stage in RENDERING_STAGES.values())],
    "flk_axi_arbiter": ["flk_priority_arbiter", "flk_fifo"],
    "flk_axi_downsizer": [SINGLE],
    "flk_frame_counters": [MEMORY],
    "flk_top": [
        "flk_registers", "flk_frame_control", "flk_frame_counters", "flk_front_throttle", "flk_axi_arbiter", "flk_axi_downsizer", "flk_axi_hold",
        "flk_preprocessing", "flk_rendering",
    ],
    "flk_top_axi": ["flk_top", "flk_reset_sync"],
    # The wrapper has no logic of its own.
    "flk_mask_generator": [generator.module for generator in MASK_GENERATORS.values()],
}


# Operators with registers inside, and the number that the design uses.
PIPES = {"flk_fp_add_pipe": 3, "flk_fp_mul_pipe": 2, "flk_exp_neg_pipe": 2, "flk_log_opacity_pipe": 3}


@dataclass(frozen=True)
class Unit:
    """A module with all its parameters; ``config`` is its name in the tables."""

    top: str
    config: str
    parameters: tuple[tuple[str, int], ...] = field(default=())

    @property
    def name(self) -> str:
        return self.top.removeprefix("flk_")


def unit(top: str, config: str = "default", **parameters: int) -> Unit:
    return Unit(top, config, tuple(sorted(parameters.items())))


def vru_config(form: str, pixels: int) -> str:
    """Name of a VRU in the tables."""
    return form if pixels == PIXELS_PER_VRU else f"{form}, {pixels} pixels"


def channel_config(form: str, vrus: int) -> str:
    """Name of a channel, or of a core of such channels, in the tables."""
    return form if vrus == VRUS_PER_CHANNEL else f"{form}, {vrus} VRU{'s' * (vrus > 1)}"


def ctu_parameters(form: int, precision: int, fifo_depth: int = 0) -> dict[str, int]:
    """All parameters of a CTU."""
    return {"Form": int(form), "Precision": int(precision), "VruCycles": PIXELS_PER_VRU, "CtuFifoDepth": fifo_depth}


def _bits(port: str, record: str, field: str, k: int = 0) -> list[str]:
    """Bits of a field of element k of a port that has records (`layout`)."""
    place = layout.place(record, field)
    return [f"{port}[{layout.bits(record) * k + place.at + bit}]" for bit in range(place.bits)]


def _of_one_identifier(channel: str, k: int = 0) -> list[str]:
    """Bits of element k of `r_i` or `b_i` that say nothing where one identifier answers and no access is exclusive."""
    port, record = f"{channel}_i", f"axi_{channel}"
    return [_bits(port, record, "resp", k)[0], *_bits(port, record, "id", k)]


def open_bits(top: str, parameters: dict[str, int]) -> list[str]:
    """Port bits that are rightly not connected, by the meaning of the unit's parameters."""
    factored = parameters.get("Form", 1) == 1
    keeps = factored and parameters.get("ColourStore", 1) == 1
    width = 1 + parameters.get("ExpBits", 5) + parameters.get("ManBits", 10)
    managers = parameters.get("Managers", 4)
    bits = {
        "flk_log_opacity": ["opacity_i[15]"],  # an opacity is not negative
        "flk_log_opacity_pipe": ["opacity_i[15]"],
        "flk_exp_neg": ["g_o[15]"],  # so is a power
        "flk_exp_neg_pipe": ["g_o[15]"],
        "flk_vru": [f"op_feature_i[{bit}]" for bit in (111, 127, 143)],  # colours are not negative
        # Answers come under the one identifier there is, and no access is exclusive.
        "flk_preprocessing": [
            *(bit for k in range(4) for bit in _of_one_identifier("r", k)), *(bit for k in range(2) for bit in _of_one_identifier("b", k)),
        ] + ([] if keeps else [f"registers_i[{bit}]" for bit in range(329, 423)]),  # of kept colours
        "flk_frame_control": [] if keeps else [f"descriptor_i[{bit}]" for bit in range(185, 220)],  # room and place of kept colours
        "flk_pointer_port": [*_of_one_identifier("r"), *_of_one_identifier("b")],
        "flk_preprocessing_core": ["part_i[268]"],  # of eight clusters the low bits tell
        # FP16 opacities are positive.
        "flk_splat_bounds": ["width_i[12]", "height_i[12]", "opacity_i[15]"],
        "flk_splat_band": [] if parameters.get("Interval", 1) == 2 else ["phase_i[0]"],
        # Zeros fill a record of 32 bytes.
        "flk_record_to_splat": [] if factored else [f"in_record_i[{bit}]" for bit in range(177, 256)],
        # Where a sub-tile lies: of core 0 all but its place in the tile, of the others only which tile of the pair.
        "flk_frame_writer": [
            f"in_data_i[{layout.place('core_pixel', 'subtile').at + bit + k * layout.bits('core_pixel')}]"
            for k in range(CORES) for bit in range(2 * SUBTILE_COORD_BITS) if bit != 1 and (k or bit in (0, SUBTILE_COORD_BITS))
        ],
        "flk_entry_merge": [f"progress_i[{bit}]" for bit in range(12)] if parameters.get("Lanes", 4) == 1 else [],  # one lane is in order
        "flk_list_writer": ["in_bank_i[0]"] if parameters.get("Banks", 1) == 1 else [],
        # Words are addressed; protection means nothing here.
        "flk_registers": [f"s_axil_{channel}{name}[{bit}]" for channel in ("aw", "ar") for name, bits in (("addr", 2), ("prot", 3)) for bit in range(bits)],
        "flk_top_axi": ["m_axi_buser[0]", "m_axi_ruser[0]"],  # answers carry nothing beside them
        # Readiness is always 1 when it matters; identifiers of axi_ax_t are its own.
        "flk_axi_read_mux": [
            *(f"r_ready_i[{k}]" for k in range(managers)), *(bit for k in range(managers) for bit in _bits("ar_i", "axi_ax", "id", k)),
        ],
        # Bits of identifiers that are not in use; no part is narrower than the port. Wires alone where the port is as wide.
        "flk_axi_downsizer": ["clk_i[0]", "rst_ni[0]", "clear_i[0]"] if parameters.get("PortBits", 128) == 512 else ["r_id_i[3]"],
        "flk_axi_half": [f"ar_addr_i[{bit}]" for bit in range(40) if bit != 5],  # one bit says which half
        # Of a magnitude.
        "flk_shape_field": [f"x_i[{8 + parameters.get('ManBits', 11)}]"],
        # The last pixel of 4096 has number 4095.
        "flk_projection": ["width_i[12]", "height_i[12]"],
        "flk_projection_conic": ["width_i[12]", "height_i[12]"],
        "flk_opacity_to_fp16": ["opacity_o[15]"],
        # A record of two quarters lies at the first.
        "flk_record_writer": [f"in_place_i[{9 * lane}]" for lane in range(4)] if parameters.get("Quarters") == 2 else [],
        # Masks are not compared, nor made from another entry's.
        "flk_entry_near": [f"{side}_i[{bit}]" for side in ("older", "newer") for bit in range(4)],
        "flk_line_entry": [f"newer_i[{bit}]" for bit in range(4)],
        "flk_splat_setup": ["record_i[127]"],  # what is spiky the lanes do not ask
        "flk_lane_result": [] if parameters.get("Registered") else ["clk_i[0]", "take_i[0]"],  # combinational
        "flk_row_mask": [f"splat_i[{bit}]" for bit in range(30)],  # colours
        "flk_lane_queue": ["push_subtile_i[0]"] if parameters.get("Subtiles", 1) == 1 else [],  # a core of one sub-tile
        "flk_lane_core": [f"in_elem_i[{153 * way + 151}]" for way in range(parameters.get("InWidth", 1))],  # record_i[127]
        "flk_lane_stage": [f"mode_i[{bit}]" for bit in range(3)],  # there is one
        # Neither mode nor shape of a splat matters without a test.
        "flk_mask_all": [*(f"mode_i[{bit}]" for bit in range(3)), f"in_elem_i[{layout.place('splat_elem', 'splat.spiky').at}]"],
    }.get(top, [])
    # Addresses are multiples of a beat, answers come under the one identifier there is, and no access is exclusive.
    beat = parameters.get("Bytes", parameters.get("Width", 512) // 8).bit_length() - 1
    axi: list[str] | None = {"flk_axi_split": [], "flk_axi_read": ["r_id_i", "r_resp_i"], "flk_axi_write": ["b_id_i", "b_resp_i"]}.get(top)
    if axi is not None:
        bits = [f"in_addr_i[{bit}]" for bit in range(beat)]
        if axi:
            bits += [*(f"{axi[0]}[{bit}]" for bit in range(parameters.get("IdBits", 4))), f"{axi[1]}[0]"]
        if not parameters.get("Tagged", 1):
            bits.append("in_tag_i[0]")
    # What a combinational operator does not use.
    if top in PIPES and parameters.get("Stages", 1) == 0:
        bits = [*bits, "clk_i[0]", "en_i[0]"]
    if factored:  # v is only squared: the sign of l2 does not matter
        quad = 16 if parameters.get("Precision", 1) == 0 else 8
        bits = bits + {
            "flk_prtu": [f"shape_i[{3 * quad - 1}]"], "flk_weight": [f"shape_i[{3 * width - 1}]"], "flk_vru": ["op_feature_i[79]"],
        }.get(top, [])
    return bits


# Parameters of the arithmetic units by format.
FORMATS = {
    "fp16": dict(ExpBits=5, ManBits=10, Fn=0, Saturate=0),
    "e4m3": dict(ExpBits=4, ManBits=3, Fn=1, Saturate=1),
    "e5m2": dict(ExpBits=5, ManBits=2, Fn=0, Saturate=1),
}


def _arithmetic() -> list[Unit]:
    units = []
    for top in ("flk_fp_add", "flk_fp_mul"):
        units += [unit(top, name, **parameters) for name, parameters in FORMATS.items()]
    for name, parameters in FORMATS.items():
        units.append(unit("flk_fp_cmp", name, **{key: parameters[key] for key in ("ExpBits", "ManBits", "Fn")}))
    for source, target in (("fp16", "e4m3"), ("fp16", "e5m2"), ("e4m3", "fp16")):
        src, dst = FORMATS[source], FORMATS[target]
        units.append(
            unit(
                "flk_fp_convert", f"{source} to {target}", SrcExpBits=src["ExpBits"], SrcManBits=src["ManBits"],
                SrcFn=src["Fn"], DstExpBits=dst["ExpBits"], DstManBits=dst["ManBits"], DstFn=dst["Fn"],
                DstSaturate=dst["Saturate"],
            )
        )
    units += [
        unit("flk_fp_to_fixed", "fp16 to 9.8", IntBits=FIXED_INT_BITS, FracBits=FIXED_FRAC_BITS),
        unit("flk_fixed_to_fp", "10.8 to e4m3", MagBits=FIXED_INT_BITS + FIXED_FRAC_BITS + 1, FracBits=FIXED_FRAC_BITS),
    ]
    for base, name in ((1, "2^-E"), (0, "e^-E")):
        units.append(unit("flk_exp_neg", name, Base2=base))
    for base, name in ((1, "log2"), (0, "ln")):
        for fmt in ("fp16", "e4m3"):
            units.append(unit("flk_log_opacity", f"{name} {fmt}", Base2=base, **FORMATS[fmt]))
    units.append(unit("flk_lzc", "14 bit", Width=14))  # of the FP16 adder
    for top, stages in PIPES.items():
        units.append(unit(top, f"fp16, {stages} stages", Stages=stages))
    return units


# Stages of the operators on ff numbers, by mantissa bits: the fewest with which no path is longer than CLOCK_FO4.
FF_MAN_BITS = (11, 15, 19, 23)


def _ff() -> list[Unit]:
    units = [
        unit(top, f"{bits} bit, {count} stages", ManBits=bits, Stages=count)
        for top, stages in STAGES.items() for bits, count in stages.items()
    ]
    for bits in FF_MAN_BITS:
        units += [
            unit("flk_ff_cmp", f"{bits} bit", ManBits=bits),
            unit("flk_ff_from_fixed", f"24.0 to {bits} bit, 2 stages", Bits=24, FracBits=0, ManBits=bits, Stages=2),
            unit("flk_ff_to_fixed", f"{bits} bit to 14.6, 2 stages", Bits=20, FracBits=6, Round=0, ManBits=bits, Stages=2),
            unit("flk_ff_to_fixed", f"{bits} bit to 7.14 nearest, 2 stages", Bits=21, FracBits=14, Round=1, ManBits=bits, Stages=2),
        ]
        if bits > min(FF_MAN_BITS):
            units.append(unit("flk_ff_narrow", f"{bits} to {bits - 4} bit", FromBits=bits, ManBits=bits - 4))
        units += [unit("flk_ff_ldexp", f"{bits} bit", ManBits=bits), unit("flk_ff_from_fp16", f"{bits} bit", ManBits=bits)]
    units.append(unit("flk_ff_to_fp16", f"{FF_MAN_BITS[0]} bit", ManBits=FF_MAN_BITS[0]))
    units.append(unit("flk_fixed_mul", "13 x 14 bit", ABits=13, BBits=14, Drop=12, OutBits=14, Stages=1))
    units.append(unit("flk_phase_mux", "10 bit", Width=10))
    units.append(unit("flk_ff_rom", "recip, 19 bit", Function=0, Group=2))
    units.append(unit("flk_ff_poly", "rsqrt, 19 bit, 3 stages", Function=1, ManBits=19, Stages=3))
    return units


def _cells() -> list[Unit]:
    units = [unit(f"flk_{cell}", f"{FEATURE_BITS} bit", Width=FEATURE_BITS) for cell in ("pipe_reg", "skid_buffer")]
    units.append(unit("flk_delay", f"{FEATURE_BITS} bit x 4", Width=FEATURE_BITS, Depth=4))
    units += [unit("flk_fifo", f"{FEATURE_BITS} x {depth}", Width=FEATURE_BITS, Depth=depth) for depth in FIFO_DEPTHS]
    units += [
        unit("flk_stream_arbiter", "2 x 67 bit", Inputs=2, Width=67),
        unit("flk_stream_arbiter", "4 x 66 bit", Inputs=4, Width=66),
        unit("flk_stream_arbiter", "4 x 92 bit", Inputs=4, Width=92),
        unit("flk_compare_exchange", "32+16 bit", KeyWidth=32, PayloadWidth=16),
        unit("flk_axi_split"),
        unit("flk_axi_read", "512 bit"),
        unit("flk_axi_write", "512 bit"),
        unit("flk_registers"),
        # Memories become flip-flops here: a small writer, for its logic; what the memories of a real one hold is in docs/reference/list_writer.md.
        unit("flk_sram", "64 x 52 bit, flip-flops", Width=52, Depth=64),
        unit("flk_sram_single", "64 x 52 bit, flip-flops", Width=52, Depth=64),
        unit("flk_list_writer", "4 sets, 16 pointers, flip-flops", SetBitsU=1, SetBitsV=1, Pointers=16, Lists=16, CoordBits=3),
        unit("flk_bitonic_sorter", "16 x 32+16 bit", Lanes=16, KeyWidth=32, PayloadWidth=16, StagesPerReg=1),
    ]
    return units


def _stage() -> list[Unit]:
    units = [unit("flk_mmu"), unit("flk_ctu_controller", VruCycles=PIXELS_PER_VRU), unit("flk_perf_counters")]
    units += [unit("flk_fifo_monitor", MaskBits=CHANNELS), unit("flk_fifo_monitor", "masks of pixels", MaskBits=SUBTILE_PIXELS)]
    units += [unit("flk_stage_control"), unit("flk_mask_all", MaskBits=CHANNELS)]
    for pixels in (MINITILE * MINITILE // vrus for vrus in VRU_COUNTS):
        units += [unit("flk_pixel_state", f"{pixels} pixels", Pixels=pixels), unit("flk_pixel_drain", f"{pixels} pixels", Pixels=pixels)]
    for form, f in FORMS.items():
        for fmt, (columns, rows) in (("fp16", (1, 1)), ("fp16", (2, 2)), ("e4m3", (2, 2))):
            size = "1 pixel" if columns == rows == 1 else f"{columns} x {rows}"
            units.append(unit("flk_weight", f"{form} {fmt}, {size}", Form=f, Cols=columns, Rows=rows, **FORMATS[fmt]))
        units.append(unit("flk_blend_pipe", form, Form=f))
        for vrus in (VRUS_PER_CHANNEL, *(count for count in VRU_COUNTS if count != VRUS_PER_CHANNEL)):
            pixels = MINITILE * MINITILE // vrus
            units += [
                unit("flk_vru", vru_config(form, pixels), Form=f, Pixels=pixels),
                unit("flk_channel", channel_config(form, vrus), Form=f, FifoDepth=16, VrusPerChannel=vrus, MiniTile=0),
                unit("flk_rendering_core", channel_config(form, vrus), Form=f, FifoDepth=16, VrusPerChannel=vrus, MaskBits=CHANNELS),
            ]
        for precision, p in PRECISIONS.items():
            config = f"{form} {precision}"
            units += [
                unit("flk_prtu", config, Form=f, Precision=p, Cols=2, Rows=2),
                unit("flk_prtu", f"{config}, 1 pixel", Form=f, Precision=p, Cols=1, Rows=1),
                unit("flk_ctu", config, **ctu_parameters(f, p)),
                unit("flk_render_stage", config, **RenderConfig(Form(f), Precision(p)).rtl_parameters()),
            ]
    units.append(unit("flk_ctu", "faithful", **ctu_parameters(FAITHFUL.form, FAITHFUL.precision, FAITHFUL.ctu_fifo_depth)))
    units.append(unit("flk_render_stage", "faithful", **FAITHFUL.rtl_parameters()))
    for vrus, name in ((2, "no CTU"), (4, "no CTU, 64 VRUs")):
        untested = RenderConfig(cat=CatMode.OFF, mask_generator="all", vrus_per_channel=vrus)
        units.append(unit("flk_render_stage", name, **untested.rtl_parameters()))
    return units


def _front() -> list[Unit]:
    """Pipelines of the front end, in its number formats."""
    slower = [unit(p.module, f"every {n} cycles", Interval=n) for p in PIPELINES for n in p.intervals[1:]]
    return [unit(p.module) for p in PIPELINES] + slower + [
        unit("flk_mean_field"), unit("flk_shape_field"), unit("flk_opacity_to_fp16"),
        unit("flk_coefficient"), unit("flk_event_counter"), unit("flk_event_counters", "20 x 4", Counters=20, Sources=4),
        unit("flk_sram_fifo", "68 x 32", Width=68, Depth=32), unit("flk_pair_fifo", "129 x 64", Width=129, Depth=64), unit("flk_axi_fetch"),
        unit("flk_delay_ram", "60 x 30", Width=60, Depth=30),
        unit("flk_cluster_cull"), unit("flk_geometry_fetch"), unit("flk_colour_fetch"), unit("flk_tile_walker"),
        unit("flk_colour_heads"), unit("flk_colour_rows"), unit("flk_colour_keeper"), unit("flk_colour_store"),
        unit("flk_entry_merge", "queues of 32", Depth=32),
        unit("flk_entry_near"), unit("flk_line_entry"), unit("flk_sort_runs", "16 cells", Cells=16), unit("flk_sort_memory", "512 x 52", Depth=512),
        unit("flk_sort_merge", "runs of 512", Run=512, Lists=8),
        *(unit("flk_sort_select", f"{ways} runs of {2048 // ways}", Run=2048 // ways, Ways=ways) for ways in (2, 8)),
        unit("flk_sorting_unit"), unit("flk_sorting_unit", "2 runs in the last step", Ways=2), unit("flk_run_writer"), unit("flk_run_merge"),
        unit("flk_list_sorter"), unit("flk_list_sorter", "16 runs", MergeLines=32, Runs=16),
        unit("flk_shape_to_fp16"), *(unit("flk_record_to_splat", form, Form=f) for form, f in FORMS.items()),
        unit("flk_splat_input"), unit("flk_pixel_out"), unit("flk_frame_writer"), unit("flk_frame_writer", "32 lanes", Lanes=LANE_COUNTS[0]),
        unit("flk_record_writer"), unit("flk_record_writer", "records of 32 bytes", RecordBits=177, Quarters=2),
        unit("flk_list_writer", "2048 pointers", Pointers=2048), unit("flk_pointer_port"), unit("flk_list_reader"),
        unit("flk_entry_buffer"), unit("flk_record_cache"), unit("flk_record_queue"), unit("flk_delivery"),
        *(unit(top, config, **form) for top in ("flk_preprocessing_core", "flk_preprocessing") for config, form in (("default", {}), ("conic", {"Form": 0}))),
        unit("flk_tile_walk"), unit("flk_axi_read_mux"), unit("flk_line_writer"),
        unit("flk_rendering", "default", **RenderConfig().chip_parameters()),
        unit("flk_rendering", "faithful", **FAITHFUL.chip_parameters()),
        unit("flk_rendering", "32 lanes", **RenderConfig(stage="lanes").chip_parameters()),
    ]


def lane_builds() -> tuple[RenderConfig, ...]:
    """Builds of the lanes: the default, fewer elements a cycle, more lanes; the last with 128 at no more area than the GSCore-like stage."""
    default = RenderConfig(stage="lanes")
    return default, default.with_(in_width=1), default.with_(lanes=64), default.with_(lanes=128, in_width=1, slots=12, fifo_depth=8)


def lane_config(config: RenderConfig) -> str:
    """Name of a core or stage of lanes in the tables."""
    default = RenderConfig(stage="lanes")
    names = [f"{config.lanes} lanes"]
    names += [f"{config.in_width} a cycle"] * (config.in_width != default.in_width)
    names += [f"{config.slots} slots"] * (config.slots != default.slots) + [f"queues of {config.fifo_depth}"] * (config.fifo_depth != default.fifo_depth)
    return ", ".join(names)


def _lanes() -> list[Unit]:
    """Units of the lanes in the log domain."""
    units = [unit("flk_splat_setup"), unit("flk_row_mask"), unit("flk_lane_result"), unit("flk_lane_arbiter"), unit("flk_lane_counters")]
    for config in lane_builds():
        ports, count, pixels = config.rtl_parameters(), config.lanes // config.cores, SUBTILE_PIXELS * config.cores // config.lanes
        if config.in_width == RenderConfig().in_width or config.lanes != LANE_COUNTS[0]:
            units += [
                unit("flk_lane", f"{pixels} pixels", Lanes=count, Lane=0, Slots=config.slots),
                unit("flk_lane_queue", f"{pixels} pixels", Pixels=pixels, Slots=config.slots, Depth=config.fifo_depth),
            ]
        own = {name: value for name, value in ports.items() if name != "Cores"}  # of a core
        units += [unit("flk_lane_core", lane_config(config), **own | {"Lanes": count}), unit("flk_lane_stage", lane_config(config), **ports)]
    return units


def _top() -> list[Unit]:
    """The chip around its two halves."""
    return [
        unit("flk_priority_arbiter", "5 x 55 bit", Inputs=5, Width=55, Patience=16), unit("flk_axi_arbiter"),
        unit("flk_axi_hold"), unit("flk_axi_half"), unit("flk_axi_downsizer", "128 bit"), unit("flk_axi_downsizer", "256 bit", PortBits=256),
        unit("flk_frame_control"), unit("flk_frame_counters"), unit("flk_front_throttle"), unit("flk_reset_sync"), unit("flk_top"),
        *(unit("flk_top", CHIP_ROWS.get(chip.name, chip.name), **chip.parameters) for chip in chips().values() if chip.name != "channels"),
        unit("flk_top_axi"),
    ]


# Rows of chips that have a name of their own; the channels are what flk_top is without parameters.
CHIP_ROWS = {"default": "32 lanes", "channels": "default"}


def chip_row(chip: Chip) -> tuple[str, str]:
    """Unit and configuration of a chip of the table."""
    return "top", CHIP_ROWS.get(chip.name, chip.name)


def all_units() -> list[Unit]:
    return _arithmetic() + _ff() + _cells() + _stage() + _front() + _lanes() + _top()
