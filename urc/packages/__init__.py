"""Packages: what they are, where they come from, what they need, and where they are kept."""
