"""Sequences of steps, and their execution as commands."""
