"""Generation and compilation of Python source from a driver."""
