"""Scenes from photographs, and gradients of a picture in all parameters of a scene (docs/reference/fit.md)."""
