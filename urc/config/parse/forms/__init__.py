"""Parsers of the forms of frames, with one module for each form."""
