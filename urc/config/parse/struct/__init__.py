"""Layouts of binary frames."""
