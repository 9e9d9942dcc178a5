"""Sequences of steps, and the commands that run them."""
