"""Conversion between raw values and typed values."""
