"""The way from YAML to a checked, linked and compiled model."""
