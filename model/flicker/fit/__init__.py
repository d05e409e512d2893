"""Scenes from photographs, and gradients of a picture in all parameters of a scene (docs/guide/fit.md)."""
