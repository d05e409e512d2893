"""FLICKER: golden model, float64 reference renderer and tools of a contribution-aware 3DGS accelerator."""
