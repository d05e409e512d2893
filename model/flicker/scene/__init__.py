"""Scene files, cameras, scenes in memory, pictures and their distance from each other, and the demo scene."""

from .files import Scene, load_scene

__all__ = ["Scene", "load_scene"]
