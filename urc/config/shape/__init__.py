"""Checks of documents against their schemas."""
