"""Emulated robots, defined by the same profiles as real robots."""
