"""Parsers that convert parts of a document to values of the model, before names are resolved."""
