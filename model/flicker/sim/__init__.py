"""RTL simulation of whole frames: compiled C++ harness around the verilated rendering stage."""
