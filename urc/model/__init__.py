"""Immutable data classes for the content of a document."""
