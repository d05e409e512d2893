"""The `flicker` command."""
