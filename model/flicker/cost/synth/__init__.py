"""Area and timing of the hardware, as estimated from a Yosys netlist (docs/reference/synthesis.md)."""
