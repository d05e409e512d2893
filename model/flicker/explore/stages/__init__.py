"""Rendering stages: each draws what the masks let through, and says how long it takes and what it costs."""
