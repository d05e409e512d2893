"""Pipelines made from the golden model: its functions are traced, scheduled and written as SystemVerilog (docs/reference/datapath.md)."""
