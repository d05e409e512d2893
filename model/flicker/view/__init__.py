"""The viewer: frames of the engines in a browser (docs/guide/view.md)."""
