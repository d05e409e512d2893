"""The viewer: frames of the engines in a browser (docs/reference/viewer.md)."""
