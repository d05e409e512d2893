// flk_compare_exchange: both elements leave, each key with its payload, the smaller key low; with
// equal keys nothing is exchanged.
module fv_compare_exchange #(
  parameter int unsigned KeyWidth     = 36,
  parameter int unsigned PayloadWidth = 16
) (
  input logic [    KeyWidth-1:0] a_key_i,
  input logic [PayloadWidth-1:0] a_payload_i,
  input logic [    KeyWidth-1:0] b_key_i,
  input logic [PayloadWidth-1:0] b_payload_i
);

  logic [KeyWidth-1:0] low_key, high_key;
  logic [PayloadWidth-1:0] low_payload, high_payload;
  logic straight, crossed;

  flk_compare_exchange #(
    .KeyWidth    (KeyWidth),
    .PayloadWidth(PayloadWidth)
  ) dut (
    .a_key_i,
    .a_payload_i,
    .b_key_i,
    .b_payload_i,
    .low_key_o     (low_key),
    .low_payload_o (low_payload),
    .high_key_o    (high_key),
    .high_payload_o(high_payload)
  );

  assign straight = {low_key, low_payload} == {a_key_i, a_payload_i}
                 && {high_key, high_payload} == {b_key_i, b_payload_i};
  assign crossed  = {low_key, low_payload} == {b_key_i, b_payload_i}
                 && {high_key, high_payload} == {a_key_i, a_payload_i};

  always_comb begin
    a_order: assert (low_key <= high_key);
    a_kept: assert (straight || crossed);
    a_stable: assert (straight || a_key_i != b_key_i);
    c_straight: cover (straight && !crossed);
    c_crossed: cover (crossed && !straight);
    c_equal: cover (a_key_i == b_key_i && low_payload != high_payload);
  end

endmodule
