"""Packages: their format, their sources, their needs, and their storage."""
