"""Frozen values that hold the content of a document."""
