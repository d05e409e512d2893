"""Bit-true model of the front end: a packed scene and a camera to records and tile lists (docs/reference/front_end.md)."""
