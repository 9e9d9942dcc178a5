"""Filters of Jinja expressions, by subject."""
