"""Emulated robots, from the same profile that drives the real one."""
