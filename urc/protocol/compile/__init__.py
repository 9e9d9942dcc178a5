"""Generate Python source from a driver, and compile it."""
