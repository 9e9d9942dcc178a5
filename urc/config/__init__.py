"""Converts YAML documents into a checked, linked and compiled model."""
