"""Packages: archive format, sources, dependency resolution and storage."""
