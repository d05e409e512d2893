"""Machines on views: mask generators, rendering stages, configurations; hard inputs; sweeps."""
