"""Sequences of steps, which run as commands."""
