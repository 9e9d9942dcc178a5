"""Rendering of pages and their parts."""
