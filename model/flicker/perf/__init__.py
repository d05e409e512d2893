"""Cycle models of the rendering stage."""
