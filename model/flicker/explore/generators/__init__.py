"""Mask generators: which mini-tiles or pixels of a sub-tile a splat is sent to."""
