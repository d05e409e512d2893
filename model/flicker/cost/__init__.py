"""What hardware costs: operations, synthesis, area, energy."""
