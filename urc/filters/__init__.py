"""Filters for Jinja expressions, grouped by subject."""
