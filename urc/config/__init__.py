"""From text to a checked, linked, compiled model."""
