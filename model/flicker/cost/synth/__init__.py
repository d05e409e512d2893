"""Area and timing of the hardware, as estimated from a Yosys netlist (docs/synthesis.md)."""
