"""Parsers for the items of binary frames."""
