"""Generates Python source from a driver and compiles the source."""
