"""Scenes to a budget: fewer Gaussians, fewer bytes or fewer cycles, with a stated loss (docs/reference/budget.md)."""
