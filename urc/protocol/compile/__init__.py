"""Python source, generated from a driver and compiled at load."""
