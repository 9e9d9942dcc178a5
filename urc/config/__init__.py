"""Converts YAML documents to a checked, linked and compiled model."""
