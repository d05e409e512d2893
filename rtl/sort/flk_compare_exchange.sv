// Compare-exchange cell of a sorting network.
//
// Combinational. The element with the smaller unsigned key leaves at low_*_o, the other at high_*_o;
// with equal keys a_* leaves at low_*_o.
module flk_compare_exchange #(
  parameter int unsigned KeyWidth     = 16,
  parameter int unsigned PayloadWidth = 8
) (
  input  logic [KeyWidth-1:0]     a_key_i,
  input  logic [PayloadWidth-1:0] a_payload_i,
  input  logic [KeyWidth-1:0]     b_key_i,
  input  logic [PayloadWidth-1:0] b_payload_i,
  output logic [KeyWidth-1:0]     low_key_o,
  output logic [PayloadWidth-1:0] low_payload_o,
  output logic [KeyWidth-1:0]     high_key_o,
  output logic [PayloadWidth-1:0] high_payload_o
);

  if (KeyWidth < 1) begin : gen_check_key_width
    $error("flk_compare_exchange: KeyWidth must be at least 1");
  end
  if (PayloadWidth < 1) begin : gen_check_payload_width
    $error("flk_compare_exchange: PayloadWidth must be at least 1");
  end

  logic swap;

  assign swap           = b_key_i < a_key_i;
  assign low_key_o      = swap ? b_key_i : a_key_i;
  assign low_payload_o  = swap ? b_payload_i : a_payload_i;
  assign high_key_o     = swap ? a_key_i : b_key_i;
  assign high_payload_o = swap ? a_payload_i : b_payload_i;

endmodule
