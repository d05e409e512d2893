"""Shared test library: builds and runs cocotb tests, drives, monitors and checks streams.

``runner`` belongs to pytest's process; the rest runs inside the simulator.
"""
