// The descriptor of a frame as the registers hold it: names of the register map to those of the halves.
//
// Combinational, no gates but those that put the principal point in the middle of the picture where no other is given.
module flk_descriptor
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
  import flk_top_pkg::*;
(
  input  flk_registers_pkg::flk_registers__out_t registers_i,
  output descriptor_t                            descriptor_o
);

  assign descriptor_o.tag          = registers_i.frame.tag.value;
  assign descriptor_o.mode         = registers_i.frame.mode.value;
  assign descriptor_o.rgba         = registers_i.frame.rgba.value;
  assign descriptor_o.background   = {registers_i.background.blue.value,
                                      registers_i.background.green.value,
                                      registers_i.background.red.value};
  assign descriptor_o.clusters     = registers_i.clusters.value.value;
  assign descriptor_o.record_beats = registers_i.record_beats.value.value;
  assign descriptor_o.chunks       = registers_i.chunks.value.value;
  assign descriptor_o.stride       = registers_i.stride.value.value;
  assign descriptor_o.deadline     = registers_i.deadline.cycles.value;

  assign descriptor_o.scene_table  = {registers_i.table_high.value.value,
                                      registers_i.table_low.value.value};
  assign descriptor_o.headers      = {registers_i.headers_high.value.value,
                                      registers_i.headers_low.value.value};
  assign descriptor_o.geometry     = {registers_i.geometry_high.value.value,
                                      registers_i.geometry_low.value.value};
  assign descriptor_o.colours      = {registers_i.colours_high.value.value,
                                      registers_i.colours_low.value.value};
  assign descriptor_o.records      = {registers_i.records_high.value.value,
                                      registers_i.records_low.value.value};
  assign descriptor_o.lists        = {registers_i.lists_high.value.value,
                                      registers_i.lists_low.value.value};
  assign descriptor_o.pointers     = {registers_i.pointers_high.value.value,
                                      registers_i.pointers_low.value.value};
  assign descriptor_o.frame_buffer = {registers_i.frame_buffer_high.value.value,
                                      registers_i.frame_buffer_low.value.value};

  assign descriptor_o.store        = {registers_i.store_high.value.value,
                                      registers_i.store_low.value.value};
  assign descriptor_o.store_clusters = registers_i.store_beats.value.value[28:5];
  assign descriptor_o.generation   = registers_i.generation.value.value;
  assign descriptor_o.tolerance    = registers_i.tolerance.value.value;

  assign descriptor_o.lane.chunked = registers_i.frame.chunked.value;
  assign descriptor_o.lane.box     = registers_i.frame.box.value;
  assign descriptor_o.lane.antialiased = registers_i.frame.antialiased.value;
  assign descriptor_o.lane.by_distance = registers_i.frame.by_distance.value;
  assign descriptor_o.lane.width   = registers_i.size.width.value;
  assign descriptor_o.lane.height  = registers_i.size.height.value;

  for (genvar k = 0; k < 3; k++) begin : gen_vector
    assign descriptor_o.cull.position[k] = registers_i.position[k].value.value;
    assign descriptor_o.lane.row_x[k]    = registers_i.row_x[k].value.value;
    assign descriptor_o.lane.row_x_z[k]  = registers_i.row_x_z[k].value.value;
    assign descriptor_o.lane.row_y[k]    = registers_i.row_y[k].value.value;
    assign descriptor_o.lane.row_y_z[k]  = registers_i.row_y_z[k].value.value;
    for (genvar i = 0; i < 3; i++) begin : gen_view
      assign descriptor_o.lane.view[k][i] = registers_i.view[3*k+i].value.value;
    end
  end
  for (genvar k = 0; k < 5; k++) begin : gen_plane
    assign descriptor_o.cull.offset[k] = registers_i.offset[k].value.value;
    assign descriptor_o.cull.reach[k]  = registers_i.reach[k].value.value;
    for (genvar i = 0; i < 3; i++) begin : gen_normal
      assign descriptor_o.cull.normal[k][i] = registers_i.normal[3*k+i].value.value;
    end
  end
  logic [1:0][12:0] size;

  assign size = {registers_i.size.height.value, registers_i.size.width.value};

  for (genvar k = 0; k < 2; k++) begin : gen_axis
    shape_t opposite;  // of the limit

    assign opposite = {|registers_i.limit[k].value.value[SHAPE_MAN_BITS+7:SHAPE_MAN_BITS],
                       registers_i.limit[k].value.value[SHAPE_MAN_BITS+7:0]};
    assign descriptor_o.lane.focal[k]  = registers_i.focal[k].value.value;
    assign descriptor_o.lane.limit[k]  = registers_i.limit[k].value.value;
    assign descriptor_o.lane.least[k]  = registers_i.frame.off_centre.value
                                         ? registers_i.least[k].value.value : opposite;
    assign descriptor_o.lane.middle[k] = registers_i.frame.off_centre.value
                                         ? registers_i.middle[k].value.value
                                         : 23'({size[k], 6'b0}) - 23'd64;
  end

  logic unused_registers;
  assign unused_registers = ^{registers_i.control, registers_i.interrupt, registers_i.timeout,
                              registers_i.counter_select,
                              registers_i.store_beats.value.value[4:0]};

endmodule
